"""The program ``python3 -m snell.usd [--confine] IN OUT.snell``. The command ``snell`` runs
this module, too.
"""

from __future__ import annotations

import os
import sys
import tempfile

from . import convert

#: Maximum number of remarks that are written.
_MOST_REMARKS = 10_000


def main(arguments: list[str], name: str | None = None) -> int:
    """Runs the program and returns its exit code: 0 success, 1 failure, 2 wrong usage, 3 if the
    package ``usd-core`` is missing. `name` is the name of the stage in messages.
    """
    confine = arguments[:1] == ["--confine"]
    arguments = arguments[confine:]
    if len(arguments) != 2:
        print(
            "usage: python3 -m snell.usd [--confine] IN OUT.snell (OUT may be - for "
            "standard "
            "output)",
            file=sys.stderr,
        )
        return 2
    try:
        text, remarks = convert(arguments[0], name=name, confine=confine)
    except (ImportError, MemoryError, ValueError) as error:
        problem = (
            f"{name or arguments[0]}: it needs more memory than there is"
            if isinstance(error, MemoryError)
            else error
        )
        _say("error", str(problem))
        return 3 if isinstance(error, ImportError) else 1
    for remark in remarks[:_MOST_REMARKS]:
        _say("warning", remark)
    if len(remarks) > _MOST_REMARKS:
        _say("warning", f"{len(remarks) - _MOST_REMARKS} more remarks of this kind")
    if arguments[1] == "-":
        sys.stdout.write(text)
        return 0
    # Written completely or not at all.
    folder = os.path.dirname(os.path.abspath(arguments[1]))
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", dir=folder, suffix=".tmp", delete=False
    ) as file:
        file.write(text)
    os.chmod(file.name, 0o644)
    os.replace(file.name, arguments[1])
    return 0


def _say(kind: str, text: str) -> None:
    """Writes one line to standard error, even if names in it contain line breaks."""
    print(
        f"{kind}: {' '.join(text.split())}".encode("utf-8", "backslashreplace").decode(),
        file=sys.stderr,
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
