"""Shows the progress of a render or a query: by tqdm or rich if the program has imported one of
them, else as a line of text.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

Report = Callable[[float, int], object]

# Seconds of rendering before anything is shown.
_PATIENCE = 1.0


class _Bar:
    """A display of the finished share of a render or a query. It opens after a delay, so short
    ones show none.
    """

    def __init__(self) -> None:
        self._start = time.perf_counter()
        self._is_open = False

    def __call__(self, share: float, rays: int) -> None:
        seconds = time.perf_counter() - self._start
        if not self._is_open:
            if seconds < _PATIENCE:
                return
            self._is_open = True
            self.open()
        self.show(share, f"{rays / seconds / 1e6:.1f} Mrays/s")

    def open(self) -> None:
        pass

    def show(self, share: float, rate: str) -> None:
        raise NotImplementedError

    def close(self) -> None:
        pass


class _Tqdm(_Bar):
    def open(self) -> None:
        tqdm = importlib.import_module("tqdm.auto").tqdm
        self._bar: Any = tqdm(
            total=100,
            unit="%",
            bar_format="{l_bar}{bar}| {elapsed}<{remaining}{postfix}",
            leave=False,
        )

    def show(self, share: float, rate: str) -> None:
        self._bar.set_postfix_str(rate, refresh=False)
        self._bar.update(100 * share - self._bar.n)

    def close(self) -> None:
        if self._is_open:
            self._bar.close()


class _Rich(_Bar):
    def open(self) -> None:
        self._progress: Any = importlib.import_module("rich.progress").Progress(transient=True)
        self._task = self._progress.add_task("", total=1.0)
        self._progress.start()

    def show(self, share: float, rate: str) -> None:
        self._progress.update(self._task, completed=share, description=rate)

    def close(self) -> None:
        if self._is_open:
            self._progress.stop()


class _Line(_Bar):
    """A line of text that is overwritten."""

    def show(self, share: float, rate: str) -> None:
        print(f"\r{share:4.0%}  {rate}  ", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        if self._is_open:
            print("\r" + " " * 40 + "\r", end="", file=sys.stderr, flush=True)


def _bar() -> _Bar | None:
    if "tqdm" in sys.modules:
        return _Tqdm()
    if "rich" in sys.modules:
        return _Rich()
    return _Line() if sys.stderr is not None and sys.stderr.isatty() else None


class _QueryBar:
    """A display that is told the number of answered rays and that of all."""

    def __init__(self, bar: _Bar) -> None:
        self._bar = bar

    def __call__(self, done: int, total: int) -> None:
        self._bar(done / max(total, 1), done)

    def close(self) -> None:
        self._bar.close()


def query_bar() -> _QueryBar | None:
    """A display for a query; None if there is nowhere to show it."""
    bar = _bar()
    return None if bar is None else _QueryBar(bar)


@contextlib.contextmanager
def reporter(progress: bool | Report | None) -> Iterator[Report | None]:
    """Yields the function that receives the progress of a render; None if nothing does."""
    if progress is not None and not isinstance(progress, bool):
        if not callable(progress):
            raise TypeError(
                f"progress is {progress!r}, expected True, False or a function of (share, rays)"
            )
        yield progress
        return
    bar = _bar() if progress else None
    try:
        yield bar
    finally:
        if bar is not None:
            bar.close()
