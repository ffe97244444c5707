"""How long the Python package takes to begin: its import over NumPy's, and the first picture from
the start of the process; and how soon Ctrl-C ends a call.

    python bench/python_start.py [--repeat 15]
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time

IMPORT = (
    "import time, numpy; start = time.perf_counter(); import snell; print(time.perf_counter() - "
    "start)"
)
PICTURE = 'import snell; snell.render("cornell-box", spp=1, size=(320, 240)).save("first.png")'
INTERRUPT = """
import os, signal, threading, time, numpy as np, snell
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = snell.load("cornell-box")
snell.render(scene, spp=1, size=(8, 8))
rays = np.random.default_rng(0).normal(size=(20_000_000, 6)).astype(np.float32)
points = np.ascontiguousarray(rays[:, :3])
work = {
    "render": lambda: snell.render(scene, spp=100_000, size=(640, 480)),
    "cast_rays": lambda: scene.cast_rays(rays),
    "list_intersections": lambda: scene.list_intersections(rays),
    "signed_distance": lambda: scene.signed_distance(points),
    "occupancy": lambda: scene.occupancy(points),
}
for name, call in work.items():
    pressed = []
    def press():
        pressed.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)
    timer = threading.Timer(0.3, press)
    timer.start()
    try:
        call()
        print(name, "ended before")
        timer.join()
    except KeyboardInterrupt:
        print(name, round(time.perf_counter() - pressed[0], 3))
"""


def run(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=15)
    repeat = parser.parse_args().repeat
    imports = [float(run(IMPORT)) for _ in range(repeat)]
    print(
        f"import over NumPy's: {1e3 * statistics.median(imports):.1f} ms (least "
        f"{1e3 * min(imports):.1f})"
    )
    pictures = []
    for _ in range(repeat):
        start = time.perf_counter()
        run(PICTURE)
        pictures.append(time.perf_counter() - start)
    print(
        f"first picture from the start of the process: {1e3 * statistics.median(pictures):.0f} ms "
        f"(least {1e3 * min(pictures):.0f})"
    )
    print("seconds from Ctrl-C to KeyboardInterrupt:")
    print(run(INTERRUPT), end="")


if __name__ == "__main__":
    main()
