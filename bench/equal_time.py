"""What one way of rendering gains over another in the same time.

    python bench/equal_time.py night-town --ways "--light-sampler bvh" \
        "--light-sampler power" "--light-sampler uniform"

Renders the scene in each of the ways with the same samples, and compares with a picture of many
samples in the first way. Errors fall in proportion to the samples, so the gain in the same time is
the ratio of the products of error and processor time (all threads together, without reading and
building). The ways take turns --repeat times, with other random numbers each time; medians count.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import tempfile
from pathlib import Path


def processor_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Scene:
    def __init__(self, snell: str, scene: str, options: list[str], folder: Path) -> None:
        self.snell, self.scene, self.options, self.folder = snell, scene, options, folder

    def render(self, way: list[str], spp: int, seed: int, name: str) -> float:
        """Processor time, and the picture in the folder."""
        before = processor_seconds()
        out = str(self.folder / name)
        command = [
            self.snell,
            "render",
            self.scene,
            *self.options,
            *way,
            "--spp",
            str(spp),
            "--seed",
            str(seed),
            "-q",
            "-o",
            out,
        ]
        subprocess.run(command, check=True)
        return processor_seconds() - before

    def error(self, name: str) -> float:
        command = [
            self.snell,
            "compare",
            str(self.folder / "reference.exr"),
            str(self.folder / name),
            "--json",
        ]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        return float(json.loads(done.stdout)["rel_mse"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene")
    parser.add_argument(
        "--ways", nargs="+", required=True, help="options of `snell render`, each way in quotes"
    )
    parser.add_argument("--options", default="--size 320x200", help="options of all ways")
    parser.add_argument("--snell", default="snell", help="the command")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument(
        "--many",
        type=int,
        default=4096,
        help="samples of the picture that errors are measured against",
    )
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene(options.snell, options.scene, options.options.split(), Path(folder))
        ways = [way.split() for way in options.ways]
        scene.render(ways[0], options.many, 12345, "reference.exr")
        found: list[list[tuple[float, float]]] = [[] for _ in ways]
        for seed in range(options.repeat):
            for way, of_way in zip(ways, found, strict=True):
                start = scene.render(way, 1, seed, "start.exr")
                seconds = scene.render(way, options.spp, seed, "test.exr") - start
                of_way.append((scene.error("test.exr"), max(seconds, 1e-3)))
    print(
        f"{options.scene}, {options.spp} samples\n{'way':40} {'rel. MSE':>10} {'seconds':>8} "
        f"{'the first gains':>16}"
    )
    for way, of_way in zip(options.ways, found, strict=True):
        error, seconds = (statistics.median(column) for column in zip(*of_way, strict=True))
        gain = statistics.median(
            e * s / (e0 * s0) for (e, s), (e0, s0) in zip(of_way, found[0], strict=True)
        )
        print(f"{way:40} {error:10.5f} {seconds:8.2f} {gain:16.2f}")


if __name__ == "__main__":
    main()
