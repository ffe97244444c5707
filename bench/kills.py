"""Kills renders on their way, goes on with them, and compares the pictures with undisturbed ones.

    python3 bench/kills.py random [--snell target/release/snell] [--kills 200] [--seed 1]
    python3 bench/kills.py calls [--snell target/release/snell]

`random`: half of the kills come at random moments (`kill -9`), the other half at random system
calls of the writer of checkpoints. Each render is killed a few times and then completed, with
another number of threads.

`calls`: not by chance. `strace` lists the system calls by which `snell render --checkpoint` and
`snell work` change their files: checkpoints, results and leases. For each of them the same command
is run again and ended (`SIGKILL`) as it enters that call, so that every state of the folder between
two calls is seen. Then another run completes the picture.
"""

import argparse
import collections
import hashlib
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

RENDER = ["render", "cornell-box", "--size", "64x48", "--spp", "512", "--aov", "depth", "-q"]
CHECKPOINT = ["--checkpoint", "a.snellr", "--checkpoint-interval", "0.05"]
PLAN = ["cornell-box", "--size", "48x32", "--spp", "256", "--noise", "0.04", "-q"]
# The lease is renewed while a task is rendered.
WORK = ["work", "plan", "-q", "-t", "1", "--lease", "0.2s"]

WRITES = ["openat", "write", "fsync", "rename"]
"""The calls at which `random` kills."""

# The calls that change a folder, its files, or how lasting these are.
CHANGES = [
    *("openat", "write", "fsync", "fchmod", "ftruncate", "rename", "renameat2"),
    *("link", "linkat", "unlink", "unlinkat", "mkdir", "mkdirat"),
]

# A line of strace's log at which a call begins.
CALL = re.compile(r"^(?P<thread>\d+) +(?P<name>\w+)\((?P<rest>.*)")


def is_reading(rest: str) -> bool:
    """True if a call opens a file to read it."""
    return "O_RDONLY" in rest and "O_CREAT" not in rest


def sha256(path: pathlib.Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


class Place:
    """A folder in which the command is run."""

    def __init__(self, snell: pathlib.Path) -> None:
        self.snell = str(snell.resolve())
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="kills-"))

    def run(self, *words: str) -> None:
        """Runs the command, which must not fail."""
        done = subprocess.run([self.snell, *words], cwd=self.path, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"snell {' '.join(words)}: {done.stderr}")

    def is_killed(self, strace: list[str], words: list[str]) -> bool:
        """Runs the command under strace; true if it was killed. Any other failure ends this."""
        command = ["strace", "-f", "-qq", "-o", "/dev/null", *strace, self.snell, *words]
        done = subprocess.run(command, cwd=self.path, capture_output=True, text=True)
        if done.returncode not in (0, -9, 137):
            sys.exit(f"snell {' '.join(words)}: {done.stderr}")
        return done.returncode != 0

    def has_lost_all(self) -> bool:
        """True if there are checkpoints, and none of them is whole."""
        names = [name for name in ("a.snellr", "a.snellr.before") if (self.path / name).exists()]
        info = [[self.snell, "info", name] for name in names]
        codes = [subprocess.run(i, cwd=self.path, capture_output=True).returncode for i in info]
        return bool(codes) and 0 not in codes

    def calls(self, words: list[str], touches: str) -> list[tuple[str, int]]:
        """The system calls by which an undisturbed run changes files whose path has this in it:
        their names, and how many calls of the name their thread has made until then.
        """
        log = self.path / "calls.log"
        subprocess.run(
            [
                "strace",
                "-f",
                "-y",
                "-qq",
                "-o",
                str(log),
                "-e",
                f"trace={','.join(CHANGES)}",
                self.snell,
            ]
            + words,
            cwd=self.path,
            check=True,
            capture_output=True,
        )
        counts: collections.Counter[tuple[str, str]] = collections.Counter()
        found = {}
        for line in log.read_text(errors="replace").splitlines():
            call = CALL.match(line)
            if call is None:
                continue
            thread, name = call["thread"], call["name"]
            counts[thread, name] += 1
            if name in CHANGES and touches in call["rest"] and not is_reading(call["rest"]):
                found[name, counts[thread, name]] = None
        return list(found)

    def clean(self, pattern: str) -> None:
        for file in self.path.glob(pattern):
            shutil.rmtree(file) if file.is_dir() else file.unlink()


def at_random(snell: pathlib.Path, kills: int, seed: int) -> bool:
    chance = random.Random(seed)
    place = Place(snell)
    start = time.monotonic()
    place.run(*RENDER, "-t", "2", "-o", "whole.exr")
    alone = time.monotonic() - start
    whole = sha256(place.path / "whole.exr")
    counts = {"at random": 0, **{f"at {call}": 0 for call in WRITES}}
    pictures = wrong = damaged = 0

    def command() -> list[str]:
        threads = str(chance.randint(1, 2))
        return [*RENDER, *CHECKPOINT, "--resume", "-t", threads, "-o", "a.exr"]

    while sum(counts.values()) < kills:
        place.clean("a.*")
        # Several kills of each render, then it may end.
        for _ in range(chance.randint(2, 6)):
            if chance.random() < 0.5:
                call = chance.choice(WRITES)
                # Only calls that concern the checkpoint's files and its folder count.
                names = ["a.snellr.new", "a.snellr", "a.snellr.before", "."]
                paths = [word for name in names for word in ("-P", name)]
                inject = f"inject={call}:signal=KILL:when={chance.randint(1, 6)}"
                strace = ["-e", f"trace={call}", *paths, "-e", inject]
                counts[f"at {call}"] += place.is_killed(strace, command())
            else:
                process = subprocess.Popen(
                    [place.snell, *command()], cwd=place.path, stderr=subprocess.DEVNULL
                )
                time.sleep(chance.uniform(0.02, alone))
                process.kill()
                counts["at random"] += process.wait() == -9
            damaged += place.has_lost_all()
        place.run(*command())
        pictures += 1
        wrong += sha256(place.path / "a.exr") != whole
        print(f"{sum(counts.values())} kills", file=sys.stderr, flush=True)
    shutil.rmtree(place.path)
    print(f"a render alone takes {alone:.2f} s; load {os.getloadavg()[0]:.1f}")
    print(", ".join(f"{count} {kind}" for kind, count in counts.items()))
    print(f"{pictures} pictures after {sum(counts.values())} kills, {wrong} with other bytes")
    print(f"{damaged} times no checkpoint was whole")
    return wrong + damaged == 0


def at_each_call(snell: pathlib.Path) -> bool:
    place = Place(snell)

    def renew() -> None:
        place.clean("a.*")

    def resume() -> None:
        place.run(*RENDER, *CHECKPOINT, "--resume", "-t", "1", "-o", "a.exr")

    place.run(*RENDER, "-o", "whole.exr")
    render = [*RENDER, *CHECKPOINT, "-t", "2", "-o", "a.exr"]
    is_right = kill_at_each(place, "render --checkpoint", render, "a.snellr", renew, resume)

    def replan() -> None:
        place.clean("plan")
        shutil.copytree(place.path / "fresh", place.path / "plan")

    def work_on() -> None:
        place.run(*WORK)
        place.run("merge", "plan", "-q", "-o", "a.exr")

    place.run("render", *PLAN, "-o", "whole.exr")
    place.run("plan", *PLAN, "--tiles-per-task", "3", "-o", "fresh")
    is_right &= kill_at_each(place, "work", WORK, "plan/frames", replan, work_on)
    shutil.rmtree(place.path)
    return is_right


def kill_at_each(
    place: Place,
    what: str,
    words: list[str],
    touches: str,
    renew: Callable[[], None],
    complete: Callable[[], None],
) -> bool:
    """Kills a command at each of its calls that changes files with this in their path. `renew`
    makes its folder as it was, and `complete` does what was left undone.
    """
    whole = sha256(place.path / "whole.exr")
    renew()
    calls = place.calls(words, touches)
    kills: collections.Counter[str] = collections.Counter()
    wrong = damaged = 0
    for done, (name, number) in enumerate(calls):
        renew()
        inject = ["-e", f"trace={name}", "-e", f"inject={name}:signal=KILL:when={number}"]
        # A later run may make fewer calls, because checkpoints are written by the clock.
        kills[name] += place.is_killed(inject, words)
        damaged += place.has_lost_all()
        complete()
        wrong += sha256(place.path / "a.exr") != whole
        print(f"{what}: {done + 1} of {len(calls)} calls", file=sys.stderr, flush=True)
    print(f"{what}: {len(calls)} calls, {sum(kills.values())} kills", end=": ")
    print(", ".join(f"{count} at {name}" for name, count in kills.items()))
    print(f"{what}: {wrong} pictures with other bytes, {damaged} times no checkpoint was whole")
    return wrong + damaged == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mode", choices=["random", "calls"])
    parser.add_argument("--snell", type=pathlib.Path, default="target/release/snell")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.mode == "random":
        is_right = at_random(options.snell, options.kills, options.seed)
    else:
        is_right = at_each_call(options.snell)
    return int(not is_right)


if __name__ == "__main__":
    sys.exit(main())
