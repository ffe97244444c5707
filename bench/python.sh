#!/usr/bin/env bash
# All that is measured of the Python package: bench/python.sh BUNNY.obj FOLDER. Needs Python 3.10 or
# later, a Rust compiler, and a quiet machine.
set -euo pipefail
bunny=$(realpath "$1") folder=$2
mkdir -p "$folder"
folder=$(realpath "$folder")
here=$(realpath "$(dirname "$0")")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/fresh"
fresh="$work/fresh/bin/python"

{
    seconds=$({ time -p "$fresh" -m pip install --quiet "$here/.."; } 2>&1 |
        awk '/real/ { print $2 }')
    echo "installation: $seconds s"
    "$fresh" -m pip wheel --quiet --no-deps --wheel-dir "$work" "$here/.."
    echo "wheel: $(stat -c %s "$work"/snell-*.whl) bytes"
    cd "$work"
    "$fresh" "$here/python_start.py"
} | tee "$folder/python-start.txt"

"$fresh" -m pip install --quiet open3d trimesh embreex rtree scipy mitsuba
"$fresh" "$here/python_throughput.py" "$bunny" --json | tee "$folder/python-throughput.jsonl"
"$fresh" "$here/python_agreement.py" --json | tee "$folder/python-agreement.jsonl"
"$fresh" "$here/python_soak.py" | tee "$folder/python-soak.txt"
