"""What checkpoints and folders cost, on a quiet machine.

    python3 bench/efficiency.py checkpoints [--snell target/release/snell] [--minutes 5] [--pairs 3]
    python3 bench/efficiency.py folder [--snell target/release/snell]

`checkpoints`: pairs of the same render with and without a checkpoint every 30 seconds, in turn.
`folder`: a plan with one and with two workers of one thread each, and what a task costs besides
rendering. `many_workers.py speed dask` and `many_workers.py speed ray` measure the same there.
"""

import argparse
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

SCENE = ["cornell-box", "--size", "1280x720"]


class Place:
    """A folder in which the command is timed."""

    def __init__(self, snell: pathlib.Path) -> None:
        self.snell = str(snell.resolve())
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="efficiency-"))

    def time(self, *words: str, workers: int = 1) -> float:
        """Runs the command as often at the same time, and returns the seconds."""
        command = [self.snell, *words, "-q"]
        start = time.perf_counter()
        started = [subprocess.Popen(command, cwd=self.path) for _ in range(workers)]
        if any(process.wait() != 0 for process in started):
            sys.exit(f"{' '.join(command)} has failed")
        return time.perf_counter() - start


def checkpoints(place: Place, minutes: float, pairs: int) -> None:
    few = place.time("render", *SCENE, "--spp", "16", "-o", "a.exr")
    spp = max(16, round(16 * minutes * 60 / few))
    render = ["render", *SCENE, "--spp", str(spp)]
    costs = []
    for pair in range(pairs):
        for file in place.path.glob("a.*"):
            file.unlink()
        runs = {
            "plain": lambda: place.time(*render, "-o", "plain.exr"),
            "kept": lambda: place.time(*render, "--checkpoint", "a.snellr", "-o", "a.exr"),
        }
        # The machine may become slower or faster: the order changes from pair to pair.
        order = sorted(runs, reverse=pair % 2 == 0)
        taken = {name: runs[name]() for name in order}
        costs.append(taken["kept"] / taken["plain"] - 1)
        size = (place.path / "a.snellr").stat().st_size
        print(
            f"plain {taken['plain']:.1f} s, with checkpoints {taken['kept']:.1f} s: "
            f"{costs[-1]:+.2%}; {size / 1e6:.0f} MB; load {os.getloadavg()[0]:.1f}",
            flush=True,
        )
        assert (place.path / "a.exr").read_bytes() == (place.path / "plain.exr").read_bytes()
    print(f"checkpoints cost {statistics.median(costs):+.2%} (median of {pairs} pairs)")


def folder(place: Place) -> None:
    def worked(workers: int, *options: str) -> float:
        shutil.rmtree(place.path / "plan", ignore_errors=True)
        place.time("plan", *options, "-o", "plan")
        return place.time("work", "plan", "-t", "1", workers=workers)

    usual = [*SCENE, "--spp", "64"]
    alone, best = [], {1: [], 2: []}
    for _ in range(3):
        alone.append(place.time("render", *usual, "-t", "1", "-o", "a.exr"))
        for workers, seconds in best.items():
            seconds.append(worked(workers, *usual))
        print(
            f"render -t 1: {alone[-1]:.1f} s, 1 worker {best[1][-1]:.1f} s, 2 workers "
            f"{best[2][-1]:.1f} s, load {os.getloadavg()[0]:.1f}",
            flush=True,
        )
    print(f"1 worker {min(best[1]) / min(alone):.3f} times as long as snell render -t 1")
    print(f"efficiency from 1 to 2 workers {min(best[1]) / min(best[2]) / 2:.1%}")
    small = [*SCENE, "--spp", "1", "-i", "flat"]
    tasks = 80 * 45
    few, many = (worked(1, *small, "--tiles-per-task", str(n)) for n in (tasks, 1))
    print(f"a task costs {1000 * (many - few) / (tasks - 1):.2f} ms besides rendering")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["checkpoints", "folder"])
    parser.add_argument("--snell", type=pathlib.Path, default="target/release/snell")
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--pairs", type=int, default=3)
    options = parser.parse_args()
    place = Place(options.snell)
    try:
        if options.what == "checkpoints":
            checkpoints(place, options.minutes, options.pairs)
        else:
            folder(place)
    finally:
        shutil.rmtree(place.path)


if __name__ == "__main__":
    main()
