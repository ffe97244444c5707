"""Renders of many processes on Dask and Ray: workers are killed, tasks are doubled and come in a
random order, and the bits are compared with those of one process; the efficiency from one to two
workers; the overhead of a task.

    python bench/many_workers.py kill dask
    python bench/many_workers.py kill ray
    python bench/many_workers.py speed dask
"""

from __future__ import annotations

import hashlib
import logging
import os
import random
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import snell
import snell.distributed
from snell._snell import _Film
from snell.distributed import _frames

WORKERS = 4
SIZE = (160, 120)


class Shuffled:
    """A film that hands out its tasks in a random order, and a tenth of them twice."""

    tasks_given = 0

    def __init__(self, *arguments: Any) -> None:
        self.film = _Film(*arguments)

    def tasks(self, *arguments: Any) -> list[bytes]:
        tasks = self.film.tasks(*arguments)
        tasks += random.sample(tasks, (len(tasks) + 9) // 10)
        random.shuffle(tasks)
        Shuffled.tasks_given += len(tasks)
        return tasks

    def __getattr__(self, name: str) -> Any:
        return getattr(self.film, name)


def digest(image: snell.Image) -> str:
    """The SHA-256 of all layers and of the variance."""
    found = hashlib.sha256(np.asarray(image).tobytes())
    found.update(image.variance.tobytes())
    for name in sorted(image.aovs):
        found.update(name.encode() + image.aovs[name].tobytes())
    return found.hexdigest()


def foggy() -> snell.Scene:
    scene = snell.load("cornell-box")
    scene.medium = snell.Medium("homogeneous", sigma_a=0.0002, sigma_s=0.002, emission=0, g=0.3)
    return scene


def moving() -> snell.Scene:
    scene = snell.load("cornell-box")
    turn = np.tile(np.eye(4), (2, 1, 1))
    turn[0, :3, 3] = 150, 150, 200
    turn[1, :3, 3] = 400, 350, 200
    scene.add_shape("sphere", turn, times=(0, 1), radius=80)
    return scene


GROUPS = {"ceiling": "lamp", "rest": ["environment"]}

# Scene, common keywords, and those of each picture.
KINDS: dict[str, tuple[Callable[[], snell.Scene], dict[str, Any], list[dict[str, Any]]]] = {
    "path": (lambda: snell.load("cornell-box"), {"spp": 256}, [{}]),
    "noise": (lambda: snell.load("cornell-box"), {"noise": 0.1, "spp": 1024}, [{}]),
    "guiding": (lambda: snell.load("cornell-box"), {"guiding": 3, "spp": 128}, [{}]),
    "fog": (foggy, {"spp": 96, "max_depth": 16}, [{}]),
    "all layers, Cryptomatte": (foggy, {"aovs": "all", "light_groups": GROUPS, "spp": 48}, [{}]),
    "8 frames": (moving, {"spp": 32}, [{"shutter": (i / 8, (i + 0.5) / 8)} for i in range(8)]),
}


@contextmanager
def dask_cluster(workers: int) -> Iterator[tuple[Any, Callable[[], list[int]]]]:
    import distributed

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=":0",
            scheduler_kwargs={"dashboard": False},
            silence_logs=60,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client, lambda: list(client.run(os.getpid, on_error="ignore").values())


@contextmanager
def ray_cluster(workers: int) -> Iterator[tuple[Any, Callable[[], list[int]]]]:
    import psutil
    import ray

    ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, logging_level="error")

    def pids() -> list[int]:
        found = psutil.process_iter(["cmdline"])
        return [p.pid for p in found if "ray::_perform" in " ".join(p.info["cmdline"] or [])]

    yield None, pids
    ray.shutdown()


CLUSTERS = {"dask": dask_cluster, "ray": ray_cluster}


def kill(engine: str, *kinds: str) -> None:
    """Kills a worker at a random moment of each picture."""
    random.seed(56)
    _frames._Film = Shuffled  # type: ignore[misc]
    _frames._SAMPLES = 1 << 15
    with CLUSTERS[engine](WORKERS) as (client, pids):
        for kind in kinds or KINDS:
            scene, common, frames = KINDS[kind]
            options = {"size": SIZE, **common}
            alone = [digest(snell.render(scene(), progress=False, **options, **f)) for f in frames]
            killed, moment = 0, random.uniform(0.05, 0.8)
            last = 0.0

            def tell(share: float, rays: int) -> None:
                nonlocal killed, moment, last
                if share < last:  # The next picture.
                    moment = random.uniform(0.05, 0.8)
                last = share
                if share > moment and (running := pids()):
                    os.kill(random.choice(running), signal.SIGKILL)
                    killed, moment = killed + 1, 2.0

            Shuffled.tasks_given, start = 0, time.perf_counter()
            images = snell.distributed.render_frames(
                scene(), frames, client, engine=engine, progress=tell, **options
            )
            found = [digest(image) for image in images]
            seconds = time.perf_counter() - start
            print(
                f"{engine}, {kind}: {sum(a == b for a, b in zip(alone, found, strict=True))} of "
                f"{len(alone)} pictures with the same SHA-256 ({found[0][:12]}...), "
                f"{killed} kills among {WORKERS} workers, {Shuffled.tasks_given} tasks, "
                f"{seconds:.1f} s, load {os.getloadavg()[0]:.1f}",
                flush=True,
            )
            assert found == alone


def processor_seconds() -> tuple[float, float]:
    """Processor time of this process (with Dask's scheduler), and of all that it has started."""
    import psutil

    others = 0.0
    for process in psutil.Process().children(recursive=True):
        times = process.cpu_times()
        others += times.user + times.system
    return time.process_time(), others


def timed(work: Callable[[], object]) -> tuple[float, float, float]:
    """Seconds, and processor seconds of this process and of others."""
    start, before = time.perf_counter(), processor_seconds()
    work()
    after = processor_seconds()
    return time.perf_counter() - start, after[0] - before[0], after[1] - before[1]


def speed(engine: str) -> None:
    """Times a render with one and with two workers of one thread, and one of many small tasks."""
    options: dict[str, Any] = {"size": (320, 240), "spp": 48, "progress": False}

    def shared(client: Any, **settings: Any) -> object:
        return snell.distributed.render("cornell-box", client, engine=engine, **settings)

    taken: dict[int, list[float]] = {0: [], 1: [], 2: []}
    for _ in range(3):
        alone = timed(lambda: snell.render("cornell-box", threads=1, **options))
        taken[0].append(alone[0])
        print(f"snell.render, 1 thread: {alone[0]:.2f} s, CPU {alone[1]:.2f} s")
        for workers in (1, 2):
            with CLUSTERS[engine](workers) as (client, _):
                # The first one loads what is needed and compiles the scene.
                shared(client, **{**options, "spp": 1})
                shared(client, **{**options, "spp": 1})
                wall, own, others = timed(lambda client=client: shared(client, **options))
                taken[workers].append(wall)
                print(
                    f"{engine}, {workers} workers: {wall:.2f} s, CPU {own:.2f} s here and "
                    f"{others:.2f} s in other processes, load {os.getloadavg()[0]:.1f}",
                    flush=True,
                )
    best = {workers: min(seconds) for workers, seconds in taken.items()}
    print(f"{engine}: 1 worker {best[1] / best[0]:.2f} times as long as snell.render")
    print(f"{engine}: efficiency from 1 to 2 workers {best[1] / best[2] / 2:.1%}")
    with CLUSTERS[engine](1) as (client, _):
        overhead(client, engine)


def overhead(client: Any, engine: str) -> None:
    """The time for each of 1200 tasks of one tile and one sample a pixel."""
    small: dict[str, Any] = {"size": (640, 480), "spp": 1, "integrator": "flat", "progress": False}
    _frames._SAMPLES = 1

    def render() -> object:
        return snell.distributed.render("cornell-box", client, engine=engine, **small)

    render()
    wall, own, others = timed(render)
    alone = timed(lambda: snell.render("cornell-box", threads=1, **small))[0]
    print(
        f"{engine}, a task: {(wall - alone) / 1.2:.2f} ms, CPU {own / 1.2:.2f} ms here and "
        f"{others / 1.2:.2f} ms in other processes, load {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    {"kill": kill, "speed": speed}[sys.argv[1]](*sys.argv[2:])
