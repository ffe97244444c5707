"""Plans of a million tasks and ten thousand workers: the time to plan, to claim a task, to wait, to
merge a 4K picture; files, bytes and memory.

    python3 bench/large_plans.py [--snell target/release/snell] [--tasks 1000000]

Workers run against folders that are filled as if others had worked there: with empty results, and
with the leases of ten thousand names. Tasks take no time to render, so that what is measured is the
folder. The merged picture is of real results.
"""

import argparse
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable

SIZE = (3840, 2160)
TILES = (SIZE[0] // 16) * (SIZE[1] // 16)
SCENE = ["cornell-box", "--size", "3840x2160", "--spp", "1", "-i", "flat", "-q"]
WORKERS = 10_000

# Seconds for which workers run.
RUN = 8.0


class Plans:
    """Plans in a temporary folder."""

    def __init__(self, snell: pathlib.Path) -> None:
        self.snell = str(snell.resolve())
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="plans-"))

    def run(self, *words: str) -> float:
        """Runs the command to its end and returns the seconds."""
        start = time.perf_counter()
        done = subprocess.run([self.snell, *words], cwd=self.path, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"snell {' '.join(words)}: {done.stderr}")
        return time.perf_counter() - start

    def fill(self, plan: str, frame: int, tasks: Iterable[int], leases: Iterable[int]) -> None:
        """Makes results and leases of these tasks of one tile each."""
        folder = self.path / plan / "frames" / f"{frame:05}" / "0000000"
        folder.mkdir(parents=True, exist_ok=True)
        for task in tasks:
            os.mknod(folder / f"{task:05}-0000000.result")
        for number, task in enumerate(leases):
            lease = f'{{"worker": "node-{number % WORKERS}", "beat": "{0:020}"}}\n'
            (folder / f"{task:05}-0000000.lease").write_text(lease)

    def work(self, plan: str, workers: int) -> None:
        """Runs workers for some seconds. Prints how long the first took to its first task, and how
        long it took for each beside rendering it.
        """
        command = [self.snell, "work", plan, "-t", "1"]
        before = self.results(plan)
        others = [
            subprocess.Popen([*command, "-q"], cwd=self.path, stderr=subprocess.DEVNULL)
            for _ in range(workers - 1)
        ]
        start = time.perf_counter()
        first = subprocess.Popen(command, cwd=self.path, stderr=subprocess.PIPE, text=True)
        assert first.stderr is not None
        moments, rendering = [], 0.0
        for line in first.stderr:
            moments.append(time.perf_counter())
            if taken := re.search(r": ([\d.]+) (ms|s)$", line.strip()):
                rendering += float(taken[1]) * (0.001 if taken[2] == "ms" else 1.0)
            if moments[-1] - moments[0] > RUN:
                break
        elapsed = time.perf_counter() - start
        for worker in [first, *others]:
            worker.kill()
            worker.wait()
        after = self.results(plan)
        if len(moments) < 2:
            print(f"  {workers} workers: no task in {elapsed:.0f} s")
            return
        each = (moments[-1] - moments[0]) / (len(moments) - 1) - rendering / len(moments)
        print(
            f"  {workers} workers: first task after {moments[0] - start:.2f} s, then "
            f"{1000 * each:.2f} ms for each besides rendering; {(after - before) / elapsed:.0f} "
            "tasks/s of all",
            flush=True,
        )

    def results(self, plan: str) -> int:
        """The number of results in the pictures of a plan that are not finished."""
        frames = [f for f in self.path.glob(f"{plan}/frames/*") if not (f / "finished").exists()]
        rounds = [round for frame in frames for round in frame.iterdir() if round.is_dir()]
        return sum(name.endswith(".result") for round in rounds for name in os.listdir(round))

    def files(self, plan: str) -> tuple[int, int]:
        """The number of files of a plan, and their bytes."""
        found = [f.stat().st_size for f in (self.path / plan).rglob("*") if f.is_file()]
        return len(found), sum(found)


def peak_megabytes() -> float:
    """The peak memory of the largest process so far."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def claims(plans: Plans, tasks: int) -> None:
    frames = -(-tasks // TILES)
    turn = ["--turntable", str(frames), "--tiles-per-task", "1"]
    seconds = plans.run("plan", *SCENE, *turn, "-o", "plan")
    count, size = plans.files("plan")
    print(f"a plan of {frames * TILES} tasks: {seconds:.2f} s, {count} files, {size / 1e6:.1f} MB")
    many = str(-(-tasks // 254))
    seconds = plans.run("plan", *SCENE, "--turntable", many, "-o", "many")
    print(f"a plan of {many} pictures, 254 tasks each: {seconds:.2f} s")
    for workers in (1, 10):
        plans.work("plan", workers)
    shutil.rmtree(plans.path / "plan" / "frames")
    # All pictures but the last are open, with leases that leave nothing free.
    each = WORKERS // frames
    for frame in range(frames - 1):
        plans.fill("plan", frame, range(TILES - each), range(TILES - each, TILES))
    last = plans.path / "plan" / "frames" / f"{frames - 1:05}"
    for share in (0.5, 0.99):
        shutil.rmtree(last, ignore_errors=True)
        done = int(share * TILES)
        plans.fill("plan", frames - 1, range(done), range(done, done + TILES // 200))
        print(f"{WORKERS} workers have taken all but one picture, and {share:.0%} of that one")
        for workers in (1, 10):
            plans.work("plan", workers)
    shutil.rmtree(last)
    plans.fill("plan", frames - 1, range(TILES - each), range(TILES - each, TILES))
    wait(plans)
    seconds = plans.run("plan", "status", "plan")
    print(f"plan status: {seconds:.2f} s; the largest process took {peak_megabytes():.0f} MB")


def wait(plans: Plans) -> None:
    """Counts the calls that concern files of a worker that finds nothing free."""
    log = plans.path / "calls"
    command = ["strace", "-f", "-c", "-e", "trace=%file", "-o", str(log), plans.snell]
    start = time.perf_counter()
    worker = subprocess.Popen([*command, "work", "plan", "-t", "1", "-q"], cwd=plans.path)
    time.sleep(2 * RUN)
    worker.send_signal(15)
    worker.wait()
    elapsed = time.perf_counter() - start
    total = next(line for line in log.read_text().splitlines() if line.endswith("total"))
    calls = int(total.split()[3])
    print(f"a worker that waits: {calls / elapsed:.0f} calls a second that concern files")


def merge(plans: Plans) -> None:
    for tiles in (1, 127):
        plan = f"picture-{tiles}"
        plans.run("plan", *SCENE, "--tiles-per-task", str(tiles), "-o", plan)
        work = plans.run("work", plan, "-q")
        count, size = plans.files(plan)
        seconds = plans.run("merge", plan, "-q", "-o", f"{plan}.exr")
        print(
            f"a 4K picture in tasks of {tiles} tiles: {work:.0f} s to render, {count} files, "
            f"{size / 1e6:.0f} MB, merged in {seconds:.1f} s"
        )
    alone = plans.run("render", *SCENE, "-o", "whole.exr")
    pictures = [plans.path / name for name in ("whole.exr", "picture-1.exr", "picture-127.exr")]
    assert len({path.read_bytes() for path in pictures}) == 1
    print(f"rendered by one process: {alone:.1f} s; all three files have the same bytes")
    print(f"the largest process took {peak_megabytes():.0f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--snell", type=pathlib.Path, default="target/release/snell")
    parser.add_argument("--tasks", type=int, default=1_000_000)
    options = parser.parse_args()
    plans = Plans(options.snell)
    try:
        claims(plans, options.tasks)
        merge(plans)
    finally:
        shutil.rmtree(plans.path)
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
