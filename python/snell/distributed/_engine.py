"""What a render needs of an engine: something that performs tasks on other processes."""

from __future__ import annotations

import importlib
from collections.abc import Hashable, Sequence
from typing import Any, Protocol

from snell.distributed._worker import Job

# So often may workers die over a task. More deaths than these are the fault of the task.
MAX_DEATHS = 100

# Guiding fields that are kept, one for each picture that is open.
FIELDS = 2

# Results that are fetched at a time, so that few of them are in memory.
FETCHED = 8


class Engine(Protocol):
    """An engine for one scene."""

    def threads(self) -> int:
        """The number of threads of all workers, at least 1."""

    def submit(self, job: Job, task: bytes) -> Hashable:
        """Hands out a task and returns its handle. Before the first task of a guided render, a
        worker trains the field for all.
        """

    def wait(self, seconds: float) -> Sequence[tuple[Hashable, bytes]]:
        """Waits at most so long and returns some handles with their results."""

    def cancel(self) -> None:
        """Forgets all tasks that were handed out and are not done."""

    def close(self) -> None:
        """Ends what was started for the render."""


def load(module: str, extra: str) -> Any:
    """Imports a package that only an extra of Snell installs."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] != module:
            raise
        raise ModuleNotFoundError(
            f"snell.distributed needs the package {module!r} here: pip install 'snell[{extra}]'",
            name=error.name,
        ) from None


def give_up(deaths: int) -> RuntimeError:
    """The error of a task over which too many workers have died."""
    return RuntimeError(
        f"{deaths} workers have died over one task of the render; the scene may be too large for "
        "the memory of a worker: give each worker more memory, or start fewer on each machine"
    )


def explain(error: BaseException) -> BaseException:
    """The error of a task, with a remedy if the worker lacks Snell."""
    if "No module named 'snell'" in str(error):
        return RuntimeError(
            "a worker cannot import Snell: install the version of this program where workers run"
        )
    return error
