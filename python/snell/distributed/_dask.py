"""Tasks on Dask distributed."""

from __future__ import annotations

import queue
import time
import uuid
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from snell.distributed._engine import FETCHED, FIELDS, MAX_DEATHS, explain, give_up, load
from snell.distributed._worker import Job, Place, perform, train

# Processes of a cluster that is started for a render; each holds the scene.
_PROCESSES = 4

# Seconds for which the number of threads is taken to be the same.
_STEADY = 2.0


class Dask:
    """An engine on the workers of a Dask scheduler. Without a client it starts workers on this
    machine, which end with it.
    """

    def __init__(self, client: Any, scene: bytes) -> None:
        self._distributed = load("distributed", "dask")
        self._dask = load("dask", "dask")
        self._owned: list[Any] = []
        self._client = self._connect(client)
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._running: dict[str, tuple[Any, Job, bytes, int]] = {}
        self._handles: dict[str, str] = {}
        self._threads = (0.0, 1)
        self._fields: dict[str, Any] = {}
        # Unlike scattered data, the result of a task is made again if all workers that have it die.
        with self._dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 PB"}):
            self._scene = self._client.submit(_given, scene, key=f"snell-scene-{uuid.uuid4().hex}")

    def _connect(self, client: Any) -> Any:
        if isinstance(client, self._distributed.Client):
            return client
        if client is None:
            client = self._start()
        connected = self._distributed.Client(client, set_as_default=False)
        self._owned.insert(0, connected)
        return connected

    def _start(self) -> Any:
        cores = max(1, load("dask.system", "dask").CPU_COUNT)
        processes = min(cores, _PROCESSES)
        with self._dask.config.set({"distributed.scheduler.allowed-failures": MAX_DEATHS}):
            cluster = self._distributed.LocalCluster(
                n_workers=processes,
                threads_per_worker=cores // processes,
                memory_limit=None,
                dashboard_address=":0",
                scheduler_kwargs={"dashboard": False},
                silence_logs=50,
            )
        self._owned.append(cluster)
        return cluster

    def threads(self) -> int:
        asked, threads = self._threads
        if time.monotonic() - asked > _STEADY:
            threads = max(1, sum(self._client.nthreads().values()))
            self._threads = (time.monotonic(), threads)
        return threads

    def submit(self, job: Job, task: bytes) -> Hashable:
        handle = uuid.uuid4().hex
        self._send(handle, job, task, 0)
        return handle

    def _send(self, handle: str, job: Job, task: bytes, deaths: int) -> None:
        key = f"snell-{job.name[:8]}-{handle}-{deaths}"
        field = self._field(job) if job.is_guided else None
        future = self._client.submit(_perform, self._scene, field, job, task, key=key)
        self._running[handle] = (future, job, task, deaths)
        self._handles[key] = handle
        future.add_done_callback(self._done.put)

    def _field(self, job: Job) -> Any:
        if job.name not in self._fields:
            for old in list(self._fields)[: 1 - FIELDS]:
                del self._fields[old]
            key = f"snell-field-{uuid.uuid4().hex}"
            self._fields[job.name] = self._client.submit(_train, self._scene, job, key=key)
        return self._fields[job.name]

    def wait(self, seconds: float) -> Sequence[tuple[Hashable, bytes]]:
        done: list[Any] = []
        try:
            while len(done) < FETCHED:
                done.append(self._done.get(timeout=0 if done else seconds))
        except queue.Empty:
            pass
        fetched = self._fetch(done)
        return [result for future in done for result in self._take(future, fetched)]

    def _fetch(self, done: Sequence[Any]) -> dict[str, bytes | None]:
        """The results that can be had, all at once."""
        futures = [f for f in done if f.key in self._handles and f.status == "finished"]
        try:
            return dict(zip((f.key for f in futures), self._client.gather(futures), strict=True))
        except Exception:
            # Which of them fails, and why, shows when they are taken one by one.
            return {}

    def _take(
        self, future: Any, fetched: Mapping[str, bytes | None]
    ) -> list[tuple[Hashable, bytes]]:
        handle = self._handles.pop(future.key, None)
        if handle is None or handle not in self._running:
            return []
        _, job, task, deaths = self._running.pop(handle)
        killed: tuple[type[BaseException], ...] = (
            self._distributed.KilledWorker,
            self._distributed.client.CancelledError,
            self._distributed.client.FutureCancelledError,
        )
        try:
            key = future.key
            result = fetched[key] if key in fetched else future.result()
        except killed as error:
            if self._client.status not in ("running", "connecting"):
                raise
            if deaths >= MAX_DEATHS:
                raise give_up(deaths) from error
            result = None
            self._fields.pop(job.name, None)
        except Exception as error:
            raise explain(error) from error
        finally:
            future.release()
        if result is None:
            self._send(handle, job, task, deaths + 1)
            return []
        return [(handle, result)]

    def cancel(self) -> None:
        futures = [future for future, *_ in self._running.values()]
        futures += self._fields.values()
        self._running.clear()
        self._handles.clear()
        self._fields.clear()
        if futures and self._client.status == "running":
            self._client.cancel(futures, force=True)

    def close(self) -> None:
        self.cancel()
        self._scene.release()
        for owned in self._owned:
            owned.close()


def _given(scene: bytes) -> bytes:
    return scene


def _train(scene: bytes, job: Job) -> bytes | None:
    return train(job, _place(scene))


def _perform(scene: bytes, field: bytes | None, job: Job, task: bytes) -> bytes | None:
    return perform(job, task, _place(scene), lambda: field)


def _place(scene: bytes) -> Place:
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def is_wanted() -> bool:
        state = worker.state.tasks.get(key)
        return state is not None and state.state != "cancelled"

    return Place(lambda: scene, worker.state.nthreads, str(worker.name), is_wanted)
