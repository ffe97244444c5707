"""Kills a render on its way again and again, and compares its picture with an undisturbed one.

    python3 bench/kills.py [--snell target/release/snell] [--kills 200] [--seed 1]

Half of the kills come at random moments (`kill -9`). The other half come at a system call of the
writer of checkpoints: `strace` ends the process at the n-th call of one kind, for each kind that
the writer makes, so that every state of the folder between two calls is seen. Each render that was
killed is gone on with, with another number of threads, until it is complete.
"""

import argparse
import hashlib
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

CALLS = ["openat", "write", "fsync", "rename"]
RENDER = ["render", "cornell-box", "--size", "64x48", "--spp", "512", "--aov", "depth", "-q"]


def sha256(path: pathlib.Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--snell", default="target/release/snell")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    snell = str(pathlib.Path(options.snell).resolve())
    chance = random.Random(options.seed)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="kills-"))
    start = time.monotonic()
    subprocess.run([snell, *RENDER, "-t", "2", "-o", "whole.exr"], cwd=folder, check=True)
    alone = time.monotonic() - start
    whole = sha256(folder / "whole.exr")
    saving = ["--checkpoint", "a.snellr", "--checkpoint-interval", "0.05", "--resume"]
    kills = {"at random": 0, **{f"at {call}": 0 for call in CALLS}}
    pictures = wrong = damaged = 0

    def command(threads: int) -> list[str]:
        return [snell, *RENDER, *saving, "-t", str(threads), "-o", "a.exr"]

    while sum(kills.values()) < options.kills:
        for file in folder.glob("a.*"):
            file.unlink()
        # Several kills of each render, then it may end.
        for _ in range(chance.randint(2, 6)):
            words = command(chance.randint(1, 2))
            by_call = chance.random() < 0.5 and shutil.which("strace") is not None
            if by_call:
                call = chance.choice(CALLS)
                # Only calls that concern the checkpoint's files and its folder count.
                names = ["a.snellr.new", "a.snellr", "a.snellr.before", "."]
                path = [word for name in names for word in ("-P", name)]
                number = chance.randint(1, 6)
                inject = f"inject={call}:signal=KILL:when={number}"
                strace = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={call}"]
                words = [*strace, *path, "-e", inject, *words]
                done = subprocess.run(words, cwd=folder, capture_output=True)
                if done.returncode in (-9, 137):
                    kills[f"at {call}"] += 1
                elif done.returncode != 0:
                    print(done.stderr.decode(), file=sys.stderr)
                    return 1
            else:
                process = subprocess.Popen(words, cwd=folder, stderr=subprocess.PIPE)
                time.sleep(chance.uniform(0.02, alone))
                process.kill()
                if process.wait() == -9:
                    kills["at random"] += 1
            # At every moment one of both names leads to a whole file, once there was one.
            names = [name for name in ("a.snellr", "a.snellr.before") if (folder / name).exists()]
            told = [
                subprocess.run([snell, "info", name], cwd=folder, capture_output=True).returncode
                for name in names
            ]
            if names and 0 not in told:
                damaged += 1
        last = subprocess.run(command(chance.randint(1, 2)), cwd=folder, capture_output=True)
        if last.returncode != 0:
            print(last.stderr.decode(), file=sys.stderr)
            return 1
        pictures += 1
        wrong += sha256(folder / "a.exr") != whole
        print(f"{sum(kills.values())} kills", file=sys.stderr, flush=True)
    shutil.rmtree(folder)
    print(f"a render alone takes {alone:.2f} s; load {os.getloadavg()[0]:.1f}")
    print(", ".join(f"{count} {kind}" for kind, count in kills.items()))
    print(f"{pictures} pictures after {sum(kills.values())} kills, {wrong} with other bytes")
    print(f"{damaged} times no checkpoint was whole")
    return int(wrong > 0 or damaged > 0)


if __name__ == "__main__":
    sys.exit(main())
