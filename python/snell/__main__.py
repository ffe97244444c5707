"""``python -m snell``: runs the command ``snell``, with the same arguments."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys


def command() -> str | None:
    """The path of the command: that of the variable ``SNELL``, beside this Python, or on the
    path.
    """
    own = os.environ.get("SNELL")
    beside = os.path.join(os.path.dirname(sys.executable), "snell")
    return shutil.which(own) if own else shutil.which(beside) or shutil.which("snell")


def main(arguments: list[str]) -> int:
    """Runs the command and returns its exit code; 127 if it is not installed."""
    path = command()
    if path is None:
        wanted = os.environ.get("SNELL")
        where = f"{wanted} (the variable SNELL) is not a program" if wanted else "it is not on PATH"
        print(
            f"snell: the command is not part of the Python package, and {where}. Install it with "
            "`cargo install --path crates/cli` in Snell's sources, or set SNELL to its path",
            file=sys.stderr,
        )
        return 127
    if os.name == "posix":
        sys.stdout.flush()
        os.execv(path, [path, *arguments])
    return subprocess.call([path, *arguments])


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
