"""Hands out the tasks of pictures and merges their results."""

from __future__ import annotations

import hashlib
import pickle
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any

from snell._snell import Scene, __version__, _Film
from snell.distributed._engine import Engine
from snell.distributed._worker import Job

# Samples of a task, of all its pixels together: a second or so of one thread.
_SAMPLES = 1 << 20

# The least number of tasks of a round for each thread, if there are as many tiles.
_TASKS_OF_THREAD = 8

# Seconds between two looks at what is to be done besides rendering.
_LOOK = 0.1


class Frame:
    """A picture and its tasks."""

    def __init__(self, scene: Scene, scene_name: str, options: Mapping[str, Any]) -> None:
        of_workers = pickle.dumps({**options, "threads": None})
        name = hashlib.sha256(f"{__version__} {scene_name} ".encode() + of_workers).hexdigest()
        self.job = Job(name, scene_name, of_workers, __version__)
        self.film = _Film(scene, dict(options), name)
        self.waiting: deque[bytes] = deque()
        self.running = 0
        self.is_done = False
        self._tasks = 1

    def plan(self, threads: int) -> None:
        """Finds the tasks of the next round."""
        self.waiting.extend(self.film.tasks(threads * _TASKS_OF_THREAD, _SAMPLES))
        self._tasks = max(1, len(self.waiting))
        self.is_done = not self.waiting

    def add(self, result: bytes, threads: int) -> None:
        """Adds a result; after the last of a round, the next round begins."""
        self.running -= 1
        self.film.add(result)
        if not self.waiting and self.running == 0:
            self.film.end_round()
            self.plan(threads)

    def progress(self) -> tuple[float, int]:
        """The finished share, from 0 to 1, and the number of rays."""
        converged, rays = self.film.progress
        if self.is_done:
            return 1.0, rays
        if self.film.has_rounds:
            return converged, rays
        return 1.0 - (len(self.waiting) + self.running) / self._tasks, rays


def run(
    engine: Engine, frames: Iterator[Frame], is_cancelled: Callable[[], bool]
) -> Iterator[Frame]:
    """Renders pictures. Yields the first one that is not done every 100 ms or so, and each one when
    it is done, in order.
    """
    is_last = False
    opened: deque[Frame] = deque()
    running: dict[Hashable, Frame] = {}
    try:
        while not is_cancelled():
            threads = engine.threads()
            # A worker finds its next task waiting, and few results are anywhere at a time.
            while len(running) < 2 * threads + 4:
                frame = next((frame for frame in opened if frame.waiting), None)
                if frame is None:
                    # Films take memory: at most two pictures are open.
                    frame = next(frames, None) if len(opened) < 2 and not is_last else None
                    is_last = is_last or (frame is None and len(opened) < 2)
                    if frame is None:
                        break
                    frame.plan(threads)
                    opened.append(frame)
                    continue
                running[engine.submit(frame.job, frame.waiting.popleft())] = frame
                frame.running += 1
            if running:
                for handle, result in engine.wait(_LOOK):
                    running.pop(handle).add(result, threads)
            while opened and opened[0].is_done:
                yield opened.popleft()
            if opened:
                yield opened[0]
            elif is_last:
                return
    finally:
        engine.cancel()
