"""Work that does not fit into memory raises a MemoryError, and threads are as many as requested."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import snell

linux = pytest.mark.skipif(sys.platform != "linux", reason="limits as on Linux")


def run_within(gigabytes: float, code: str, **environment: str) -> str:
    """Run a program whose address space may grow by this much after it has imported snell."""
    head = f"""
        import resource, snell, numpy as np
        size = 4096 * int(open("/proc/self/statm").read().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (size + int({gigabytes} * 1e9),) * 2)
    """
    program = textwrap.dedent(head) + textwrap.dedent(code)
    known = {
        "env": {**os.environ, **environment},
        "capture_output": True,
        "text": True,
        "timeout": 120,
    }
    done = subprocess.run([sys.executable, "-c", program], check=False, **known)  # type: ignore[call-overload]
    assert done.returncode == 0, done.stderr
    return str(done.stdout)


@linux
def test_a_picture_that_does_not_fit_is_a_memory_error_and_python_goes_on():
    out = run_within(
        0.9,
        """
        scene = snell.load("cornell-box")
        for options in [
            {"size": (3000, 3000)},
            {"size": (9000, 9000)},
            {"size": (2500, 2500), "aovs": "all"},
        ]:
            try:
                snell.render(scene, integrator="flat", spp=1, threads=2, **options)
            except MemoryError as error:
                assert "of at most" in str(error) and "crop" in str(error), error
                print("refused")
        print(snell.render(scene, integrator="flat", spp=1, threads=2, size=(64, 48)).shape)
        """,
    )
    assert out.split("\n")[:4] == ["refused"] * 3 + ["(48, 64, 3)"]


@linux
def test_answers_and_pictures_that_do_not_fit_are_memory_errors():
    out = run_within(
        0.6,
        """
        scene = snell.Scene()
        scene.add_shape("sphere", radius=1)
        rays = np.broadcast_to(np.float32([0, 0, 3, 0, 0, -1]), (40_000_000, 6))
        small = np.zeros((4, 4, 3), np.float32)
        image = snell.Image(np.broadcast_to(np.float32(0.5), (4000, 4000, 3)))
        asked = [
            lambda: scene.cast_rays(rays),
            lambda: scene.test_occlusions(rays),
            lambda: scene.distance(np.zeros((40_000_000, 3), np.float32)),
            lambda: snell.Image(np.broadcast_to(np.float32(0.5), (20_000, 20_000, 3))),
            lambda: [np.array(image), image.to_uint8(), image.save("/tmp/never.exr")],
        ]
        for ask in asked:
            try:
                ask()
            except MemoryError:
                print("refused")
        print(scene.cast_rays(rays[:10]).t_hit[0])
        """,
    )
    assert out.split() == ["refused"] * 5 + ["2.0"]


@linux
def test_one_thread_loads_renders_and_saves_whatever_the_environment_says(tmp_path):
    path = str(tmp_path / "a.exr")
    out = run_within(
        4,
        f"""
        import os, threading, time
        before, most, is_done = len(os.listdir("/proc/self/task")), 0, False
        def watch():
            global most
            while not is_done:
                most = max(most, len(os.listdir("/proc/self/task")))
                time.sleep(0.001)
        watcher = threading.Thread(target=watch)
        watcher.start()
        scene = snell.load("teapot", threads=1)
        image = snell.render(scene, size=(200, 150), spp=2, threads=1)
        image.save({path!r}, threads=1)
        is_done = True
        watcher.join()
        print(most - before - 1)
        """,
        RAYON_NUM_THREADS="300",
    )
    # These are the thread of the pool, the one that renders, and the one that cancels work on
    # request.
    assert int(out) <= 3


def test_the_estimate_is_beside_the_picture_and_not_in_its_file(tmp_path):
    image = snell.render(snell.load("cornell-box"), size=(64, 48), spp=1)
    assert image.metadata["estimated_memory_bytes"] > 64 * 48 * 100
    image.save(tmp_path / "a.exr")
    assert "estimated_memory_bytes" not in snell.Image.open(tmp_path / "a.exr").metadata
    assert np.asarray(image).shape == (48, 64, 3)


@linux
def test_a_file_of_more_objects_than_fit_is_a_memory_error_and_python_goes_on(tmp_path):
    path = tmp_path / "wide.snell"
    ball = '{"surfaces": [{"shape": {"shape": "sphere", "radius": 1}}]}'
    children = ",".join(["1"] * 2_000_000)
    head = '"format": "snell scene", "version": 1, "root": 0'
    path.write_text(f'{{{head}, "nodes": [{{"children": [{children}]}}, {ball}]}}')
    out = run_within(
        1.0,
        f"""
        for use in [snell.load, lambda path: snell.render(path, size=(8, 6), spp=1)]:
            try:
                use({str(path)!r})
            except MemoryError as error:
                print(error)
        print(snell.render("cornell-box", size=(8, 6), spp=1).pixels.shape)
        """,
    )
    *errors, last = out.splitlines()
    assert len(errors) == 2 and all("scene's objects needs" in error for error in errors), out
    assert last.startswith("(6, 8")
