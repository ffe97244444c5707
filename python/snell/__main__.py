"""The command ``snell``, also by ``python -m snell``."""

from __future__ import annotations

import signal
import sys


def main() -> int:
    """Runs the command with the arguments of this process, and returns its exit code."""
    # The command watches for Ctrl-C itself. Python's own handler would run after it, and raise.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    from snell._snell import _run_command

    return _run_command(["snell", *sys.argv[1:]], sys.executable or None)


if __name__ == "__main__":
    raise SystemExit(main())
