"""What happens on a worker: the scene is compiled once, and then tasks are performed."""

from __future__ import annotations

import pickle
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from snell._snell import Scene, __version__, _unpack_scene, _Worker

# Scenes and renders that a process keeps: those of two pictures, because the tasks of a picture
# begin before the last ones of the picture before are done.
_KEPT = 2

_scenes: OrderedDict[str, Scene] = OrderedDict()
_workers: OrderedDict[str, _Worker] = OrderedDict()

# A process performs one task at a time, with all of its threads.
_lock = threading.Lock()

_T = TypeVar("_T")


class Job(NamedTuple):
    """A picture, as workers know it."""

    name: str
    """The hash of all that follows."""
    scene: str
    """The hash of the scene."""
    options: bytes
    """The pickled keywords of the render."""
    version: str
    """The version of Snell."""
    is_guided: bool = False
    """True if workers need a guiding field."""


class Place(NamedTuple):
    """The process that performs a task, and where it finds the scene."""

    scene: Callable[[], bytes]
    """Returns the scene, as `_pack_scene` has given it. It is called if the process does not know
    the scene yet.
    """
    threads: int
    """Number of threads."""
    worker: str
    """The name of the worker, for messages."""
    is_wanted: Callable[[], bool] | None = None
    """Returns False when the work need not go on."""


def train(job: Job, place: Place) -> bytes | None:
    """Trains a guiding field for all workers; None if it was no longer wanted."""
    with _lock:
        return _worker_of(job, place).train(place.is_wanted)


def perform(
    job: Job, task: bytes, place: Place, field: Callable[[], bytes | None] | None = None
) -> bytes | None:
    """Performs a task and returns its result; None if it was no longer wanted. `field` returns what
    :func:`train` has returned.
    """
    with _lock:
        is_new = job.name not in _workers
        worker = _worker_of(job, place)
        learnt = field() if is_new and field is not None else None
        if learnt is not None:
            worker.learn(learnt)
        return worker.perform(task, place.worker, place.is_wanted)


def _worker_of(job: Job, place: Place) -> _Worker:
    if job.version != __version__:
        raise RuntimeError(
            f"the worker {place.worker} has Snell {__version__}, and this program has "
            f"{job.version}; their pictures may differ: install the same version"
        )

    def load() -> Scene:
        return _unpack_scene(place.scene(), place.threads)

    def plan() -> _Worker:
        options: dict[str, Any] = pickle.loads(job.options)
        of_worker = {**options, "threads": place.threads}
        return _Worker(_kept(_scenes, job.scene, load), of_worker, job.name)

    return _kept(_workers, job.name, plan)


def _kept(cache: OrderedDict[str, _T], name: str, make: Callable[[], _T]) -> _T:
    """The thing of this name, which is made if it is not there; the oldest ones are dropped."""
    if name not in cache:
        while len(cache) >= _KEPT:
            cache.popitem(last=False)
        cache[name] = make()
    cache.move_to_end(name)
    return cache[name]
