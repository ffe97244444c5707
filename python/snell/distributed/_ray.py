"""Tasks on Ray."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from typing import Any

from snell.distributed._engine import FETCHED, MAX_DEATHS, explain, give_up, load
from snell.distributed._worker import Job, perform


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
        self._perform = self._ray.remote(num_cpus=1, max_retries=-1)(_perform)
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
        # In a list the scene stays a reference: only a process that needs it fetches it.
        reference = self._perform.remote([self._scene], tuple(job), task)
        self._running[reference] = (handle, job, task, deaths)

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
        except errors.RayTaskError as error:
            raise explain(error.cause) from error
        if result is None:
            self._send(handle, job, task, deaths + 1)
            return []
        return [(handle, result)]

    def cancel(self) -> None:
        for reference in self._running:
            self._ray.cancel(reference)
        self._running.clear()

    def close(self) -> None:
        self.cancel()
        del self._scene
        if self._is_owned:
            self._ray.shutdown()


def _perform(scene: list[Any], job: tuple[str, str, bytes, str], task: bytes) -> bytes | None:
    import ray

    def fetch() -> bytes:
        packed: bytes = ray.get(scene[0])
        return packed

    worker = f"{ray.util.get_node_ip_address()}, process {os.getpid()}"
    return perform(Job(*job), fetch, task, threads=1, worker=worker)
