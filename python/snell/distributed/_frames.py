"""Hands out the tasks of pictures and merges their results."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any, NamedTuple

from snell._snell import Scene, __version__, _Film
from snell.distributed._engine import Engine
from snell.distributed._worker import Job

# Samples of a task, of all its pixels together: a second or so of one thread.
_SAMPLES = 1 << 20

# With more threads than these, tasks are longer, because one program hands all of them out.
_THREADS = 64

# The least number of tasks of a round for each thread, if there are as many tiles.
_TASKS_OF_THREAD = 8

# A task is handed out again when threads are idle and it has taken longer than the slowest one so
# far by this factor, and by these seconds.
_LATE = 2.0
_PATIENCE = 5.0

# Seconds between two looks at what is to be done besides rendering.
_LOOK = 0.1


class Frame:
    """A picture and its tasks."""

    def __init__(self, scene: Scene, scene_name: str, options: Mapping[str, Any]) -> None:
        of_workers = pickle.dumps({**options, "threads": None})
        name = hashlib.sha256(f"{__version__} {scene_name} ".encode() + of_workers).hexdigest()
        self.film = _Film(scene, dict(options), name)
        self.job = Job(name, scene_name, of_workers, __version__, self.film.is_guided)
        self.waiting: deque[bytes] = deque()
        """The tasks of the round that were not handed out yet."""
        self.left: set[bytes] = set()
        """The tasks of the round whose results are not in the film."""
        self.is_done = False
        self._tasks = 1

    def plan(self, threads: int) -> None:
        """Finds the tasks of the next round."""
        samples = _SAMPLES * max(1, threads // _THREADS)
        self.waiting = deque(self.film.tasks(threads * _TASKS_OF_THREAD, samples))
        self.left = set(self.waiting)
        self._tasks = max(1, len(self.left))
        self.is_done = not self.left

    def add(self, task: bytes, result: bytes, threads: int) -> None:
        """Adds the result of a task; after the last of a round, the next round begins."""
        if self.is_done:
            return
        self.film.add(result)
        if task in self.left:
            self.left.remove(task)
            if not self.left:
                self.film.end_round()
                self.plan(threads)

    def progress(self) -> tuple[float, int]:
        """The finished share, from 0 to 1, and the number of rays."""
        converged, rays = self.film.progress
        if self.is_done:
            return 1.0, rays
        if self.film.has_rounds:
            return converged, rays
        return 1.0 - len(self.left) / self._tasks, rays


def run(
    engine: Engine, frames: Iterator[Frame], is_cancelled: Callable[[], bool]
) -> Iterator[Frame]:
    """Renders pictures. Yields the first one that is not done every 100 ms or so, and each one when
    it is done, in order.
    """
    is_last = False
    opened: deque[Frame] = deque()
    running: dict[Hashable, _Sent] = {}
    slowest = 0.0
    try:
        while not is_cancelled():
            threads = engine.threads()
            # A worker finds its next task waiting, and few results are anywhere at a time.
            while len(running) < 2 * threads + 4:
                frame = next((frame for frame in opened if frame.waiting), None)
                if frame is not None:
                    sent = _Sent(frame, frame.waiting.popleft(), time.monotonic())
                elif len(opened) < 2 and not is_last:
                    # Films take memory: at most two pictures are open.
                    frame = next(frames, None)
                    is_last = frame is None
                    if frame is not None:
                        frame.plan(threads)
                        opened.append(frame)
                    continue
                elif (late := _late(running, threads, slowest)) is not None:
                    sent = late
                else:
                    break
                running[engine.submit(sent.frame.job, sent.task)] = sent
            for handle, result in engine.wait(_LOOK) if running else ():
                sent = running.pop(handle)
                slowest = max(slowest, time.monotonic() - sent.moment)
                sent.frame.add(sent.task, result, threads)
            while opened and opened[0].is_done:
                yield opened.popleft()
            if opened:
                yield opened[0]
            elif is_last:
                return
    finally:
        engine.cancel()


class _Sent(NamedTuple):
    """A task that was handed out at a moment."""

    frame: Frame
    task: bytes
    moment: float


def _late(running: Mapping[Hashable, _Sent], threads: int, slowest: float) -> _Sent | None:
    """A task to be handed out again while threads are idle: its worker may hang or be slow."""
    now = time.monotonic()
    if len(running) >= threads or slowest == 0:
        return None
    counts = Counter(sent.task for sent in running.values())
    for frame, task, moment in running.values():
        is_late = now - moment > _LATE * slowest + _PATIENCE
        if is_late and counts[task] == 1 and task in frame.left:
            return _Sent(frame, task, now)
    return None
