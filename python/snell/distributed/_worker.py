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


def perform(
    job: Job,
    scene: Callable[[], bytes],
    task: bytes,
    *,
    threads: int,
    worker: str,
    is_wanted: Callable[[], bool] | None = None,
) -> bytes | None:
    """Performs a task and returns its result; None if it was no longer wanted.

    Parameters
    ----------
    scene : callable
        Returns the scene, as `_pack_scene` has given it. It is called if the process does not know
        the scene yet.
    threads : int
        Number of threads.
    worker : str
        The name of the worker, for messages.
    """
    if job.version != __version__:
        raise RuntimeError(
            f"the worker {worker} has Snell {__version__}, and this program has {job.version}; "
            "their pictures may differ: install the same version"
        )
    with _lock:

        def load() -> Scene:
            return _unpack_scene(scene(), threads)

        def plan() -> _Worker:
            options: dict[str, Any] = pickle.loads(job.options)
            of_worker = {**options, "threads": threads}
            return _Worker(_kept(_scenes, job.scene, load), of_worker, job.name)

        return _kept(_workers, job.name, plan).perform(task, worker, is_wanted)


def _kept(cache: OrderedDict[str, _T], name: str, make: Callable[[], _T]) -> _T:
    """The thing of this name, which is made if it is not there; the oldest ones are dropped."""
    if name not in cache:
        while len(cache) >= _KEPT:
            cache.popitem(last=False)
        cache[name] = make()
    cache.move_to_end(name)
    return cache[name]
