"""Tasks on Ray."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from typing import Any

from snell.distributed._engine import FETCHED, FIELDS, MAX_DEATHS, explain, give_up, load
from snell.distributed._worker import Job, Place, perform, train


class Ray:
    """An engine on a Ray cluster: the one that the program is connected to, that of an address, or
    else one on this machine that ends with the render.
    """

    def __init__(self, address: str | None, scene: bytes) -> None:
        self._ray = load("ray", "ray")
        self._is_owned = not self._ray.is_initialized()
        if self._is_owned:
            self._ray.init(address=address, log_to_driver=False, logging_level="error")
        elif address is not None:
            raise ValueError(
                f"client is {address!r}, but the program is connected to a Ray cluster already; "
                "leave client out, or call ray.shutdown() first"
            )
        # A task is done again if its worker dies, however often.
        options = {"num_cpus": 1, "max_retries": -1}
        self._perform = self._ray.remote(**options)(_perform)
        self._train = self._ray.remote(num_returns=2, **options)(_train)
        self._fields: dict[str, tuple[Any, Any]] = {}
        self._scene = self._ray.put(scene)
        self._running: dict[Any, tuple[Any, Job, bytes, int]] = {}
        self._next = 0

    def threads(self) -> int:
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def submit(self, job: Job, task: bytes) -> Hashable:
        self._next += 1
        self._send(self._next, job, task, 0)
        return self._next

    def _send(self, handle: int, job: Job, task: bytes, deaths: int) -> None:
        # In a list these stay references: only a process that needs them fetches them.
        field, is_trained = self._field(job) if job.is_guided else (None, True)
        reference = self._perform.remote([self._scene, field], is_trained, tuple(job), task)
        self._running[reference] = (handle, job, task, deaths)

    def _field(self, job: Job) -> tuple[Any, Any]:
        if job.name not in self._fields:
            for old in list(self._fields)[: 1 - FIELDS]:
                del self._fields[old]
            self._fields[job.name] = self._train.remote([self._scene], tuple(job))
        return self._fields[job.name]

    def wait(self, seconds: float) -> Sequence[tuple[Hashable, bytes]]:
        waiting = list(self._running)
        if not waiting:
            return []
        ready, _ = self._ray.wait(waiting, num_returns=1, timeout=seconds)
        if ready:
            count = min(FETCHED, len(waiting))
            ready, _ = self._ray.wait(waiting, num_returns=count, timeout=0)
        return [result for reference in ready for result in self._take(reference)]

    def _take(self, reference: Any) -> list[tuple[int, bytes]]:
        handle, job, task, deaths = self._running.pop(reference)
        errors = self._ray.exceptions
        lost: tuple[type[BaseException], ...] = (
            errors.WorkerCrashedError,
            errors.NodeDiedError,
            errors.ObjectLostError,
            errors.OutOfMemoryError,
            errors.LocalRayletDiedError,
        )
        try:
            result: bytes | None = self._ray.get(reference)
        except lost as error:
            if deaths >= MAX_DEATHS:
                raise give_up(deaths) from error
            result = None
            self._fields.pop(job.name, None)
        except errors.RayTaskError as error:
            raise explain(error.cause) from error
        if result is None:
            self._send(handle, job, task, deaths + 1)
            return []
        return [(handle, result)]

    def cancel(self) -> None:
        for reference in [*self._running, *(done for _, done in self._fields.values())]:
            self._ray.cancel(reference)
        self._running.clear()
        self._fields.clear()

    def close(self) -> None:
        self.cancel()
        del self._scene
        if self._is_owned:
            self._ray.shutdown()


_Fields = tuple[str, str, bytes, str, bool]


def _train(references: list[Any], job: _Fields) -> tuple[bytes | None, bool]:
    return train(Job(*job), _place(references[0])), True


def _perform(references: list[Any], _: bool, job: _Fields, task: bytes) -> bytes | None:
    import ray

    scene, field = references
    learn = None if field is None else lambda: ray.get(field)
    return perform(Job(*job), task, _place(scene), learn)


def _place(scene: Any) -> Place:
    import ray

    def fetch() -> bytes:
        packed: bytes = ray.get(scene)
        return packed

    return Place(fetch, 1, f"{ray.util.get_node_ip_address()}, process {os.getpid()}")
