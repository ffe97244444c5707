"""Threads, processes, Ctrl-C and imports."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest
from conftest import sphere_mesh

import snell


def scene_and_rays(count: int = 20_000) -> tuple[snell.Scene, np.ndarray]:
    scene = snell.Scene()
    scene.add_mesh(*sphere_mesh(60, 120))
    rays = np.random.default_rng(3).normal(size=(count, 6))
    return scene, rays


def ask(scene: snell.Scene, rays: np.ndarray) -> float:
    t = scene.cast_rays(rays).t_hit
    few = (
        scene.list_intersections(rays[:10]).t_hit.sum()
        + scene.distance(rays[0, :3])
        + scene.bounds.sum()
    )
    return float(t[np.isfinite(t)].sum() + scene.occupancy(rays[:500, :3]).sum() + few)


def answer_to(queue, scene, rays) -> None:
    queue.put(ask(scene, rays))


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_children_answer_as_their_parents_do(method):
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system cannot {method}")
    scene, rays = scene_and_rays()
    expected = ask(scene, rays)
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    children = [context.Process(target=answer_to, args=(queue, scene, rays)) for _ in range(2)]
    [child.start() for child in children]
    assert [queue.get(timeout=60) for _ in children] == [expected] * 2
    [child.join(60) for child in children]
    assert [child.exitcode for child in children] == [0, 0]


def test_many_threads_ask_one_scene_while_it_changes():
    scene, rays = scene_and_rays(3000)
    ball = scene.add_shape("sphere", radius=0.1)
    allowed = set()
    for x in range(4):
        scene.update_transform(ball, [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]])
        allowed.add(scene.cast_rays(rays).t_hit.tobytes())
    found, stop, errors = set(), threading.Event(), []

    def read() -> None:
        try:
            while not stop.is_set():
                found.add(scene.cast_rays(rays).t_hit.tobytes())
                scene.signed_distance(rays[:100, :3])
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=read) for _ in range(6)]
    [thread.start() for thread in threads]
    for i in range(60):
        scene.update_transform(ball, [[1, 0, 0, i % 4], [0, 1, 0, 0], [0, 0, 1, 0]])
        time.sleep(0.005)
    stop.set()
    [thread.join() for thread in threads]
    assert not errors and found and found <= allowed


def test_other_threads_of_python_run_meanwhile():
    scene, rays = scene_and_rays(300_000)
    scene.commit(np.float64)
    ticks, stop = [], threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    scene.count_intersections(rays, threads=1)
    end = time.perf_counter()
    stop.set()
    thread.join()
    during = [t for t in ticks if start < t < end]
    assert len(during) > (end - start) * 50


@pytest.mark.skipif(os.name == "nt", reason="signals are those of Unix")
@pytest.mark.parametrize("threads", [1, None])
def test_ctrl_c_interrupts_soon_and_all_works_afterwards(threads):
    scene, rays = scene_and_rays(1000)
    rays = np.broadcast_to(rays, (20_000, 1000, 6)).reshape(-1, 6).astype(np.float32)
    scene.commit()
    timer = threading.Timer(0.2, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            scene.count_intersections(rays, threads=threads)
    late = time.perf_counter()
    timer.join()
    assert scene.cast_rays(rays[:1000]).t_hit.shape == (1000,)
    assert time.perf_counter() - late < 1


@pytest.mark.skipif(os.name == "nt", reason="signals are those of Unix")
def test_a_build_is_not_waited_for_after_ctrl_c():
    scene = snell.Scene()
    vertices, faces = sphere_mesh(1000, 1000)
    scene.add_mesh(vertices, faces)
    sent = []

    def interrupt() -> None:
        sent.append(time.perf_counter())
        signal.raise_signal(signal.SIGINT)

    timer = threading.Timer(0.05, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        scene.commit(np.float64)
        time.sleep(5)  # for a machine that builds two million triangles in no time
    assert time.perf_counter() - sent[0] < 0.5
    assert scene.test_occlusions([0, 0, 0, 0, 0, 1])


def test_importing_needs_numpy_only():
    code = """
        import sys, numpy
        before = set(sys.modules)
        import snell
        new = set(sys.modules) - before
        more = {name.split(".")[0] for name in new} - {"snell", *sys.stdlib_module_names}
        print(sorted(more))
    """
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "[]"
