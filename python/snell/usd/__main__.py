"""``python3 -m snell.usd IN OUT.snell``, and what the command ``snell`` runs."""

from __future__ import annotations

import os
import sys
import tempfile

from . import convert


def main(arguments: list[str]) -> int:
    """Exit code 0 done, 1 failed, 2 wrong usage, 3 without the package ``usd-core``."""
    if len(arguments) != 2:
        print("usage: python3 -m snell.usd IN OUT.snell (OUT may be - for standard output)", file=sys.stderr)
        return 2
    try:
        text, remarks = convert(arguments[0])
    except (ImportError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 3 if isinstance(error, ImportError) else 1
    for remark in remarks:
        print(f"warning: {remark}", file=sys.stderr)
    if arguments[1] == "-":
        sys.stdout.write(text)
        return 0
    # Whole or not at all.
    folder = os.path.dirname(os.path.abspath(arguments[1]))
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=folder, suffix=".tmp", delete=False) as file:
        file.write(text)
    os.chmod(file.name, 0o644)
    os.replace(file.name, arguments[1])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
