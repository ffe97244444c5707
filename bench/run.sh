#!/usr/bin/env bash
# All benchmarks: bench/run.sh EMBREE-WHEEL BUNNY.obj FOLDER. Snell must be built (cargo build
# --release).
set -euo pipefail
peer="embree=$(realpath "$1")" bunny=$(realpath "$2") folder=$3
mkdir -p "$folder"
folder=$(realpath "$folder")
here=$(realpath "$(dirname "$0")")
snell="$here/../target/release/snell"
cores=$(nproc)
scenes=("$bunny" "$bunny:subdivide=2" "$bunny:copies=145" "$bunny:instances=145" terrain room)

{
    date -u +%FT%TZ
    "$snell" --version
    git -C "$here" rev-parse HEAD
    rustc --version
    uname -sr
    lscpu | grep -E "^(Model name|CPU\(s\)|Thread|L1d|L2|L3|Flags)" |
        sed -E 's/(Flags: +).*(avx2).*/\1... \2/'
    free -h | head -2
} > "$folder/machine.txt"

"$snell" bench rays "${scenes[@]}" --calls batch,one --threads "1,$cores" --peer "$peer" --json \
    > "$folder/rays.jsonl"
"$snell" bench build "${scenes[@]}" --quality fast,medium,high --threads "1,$cores" --peer "$peer" \
    --json > "$folder/build.jsonl"
"$snell" bench render cornell-box "$bunny" room --json > "$folder/render.jsonl"

rays=$(mktemp -d)
trap 'rm -rf "$rays"' EXIT
"$snell" bench rays "$bunny" "$bunny:subdivide=2" room --repeat 1 --threads 1 --dump-rays "$rays" \
    > /dev/null
(
    cd "$here/peers"
    RUSTFLAGS="-C target-cpu=native" cargo run --release --quiet -- "$rays"/* \
        --threads "1,$cores"
) > "$folder/crates.jsonl"
if python3 -c "import open3d" 2> /dev/null; then
    python3 "$here/open3d_rays.py" "$rays"/* --threads "1,$cores" > "$folder/open3d.jsonl"
fi
