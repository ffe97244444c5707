"""How fast meshes and scenes are read, beside trimesh and Open3D.

    python bench/reading.py --snell target/release/snell [--folder FOLDER] [--repeat 5] [--json]

Writes files of known size first, the same at every run: a wavy sheet as binary PLY (100 MB), as OBJ
(50 MB) and as pbrt text (20 MB), each with and without what a renderer needs beside positions
(normals, texture coordinates). Then every reader reads every file that it knows in a process of its
own, in turn; what counts is the median time from the call to the mesh in memory (starting the
program does not), and the largest memory of the process less what it took before the call. The
files have been read before, so the disk does not count.

Needs numpy; trimesh and Open3D where they are installed.
"""

import argparse
import importlib.util
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

import numpy as np

MEGABYTE = 1_000_000

# What a process of a peer runs: FILE is read after the imports, and a line of JSON says how long
# that took, how many triangles came, and how much memory the process has needed before and in all.
PEER = """
import json, pathlib, resource, sys, time
def peak():
    # On Linux, what getrusage tells counts what the parent had when it started this process, too.
    status = pathlib.Path("/proc/self/status")
    for line in status.read_text().splitlines() if status.exists() else []:
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
{imports}
path = sys.argv[1]
before = peak()
start = time.perf_counter()
{read}
seconds = time.perf_counter() - start
print(json.dumps(dict(seconds=seconds, triangles=triangles, memory_bytes=peak() - before)))
"""

TRIMESH = PEER.format(
    imports="import trimesh, numpy",
    read="mesh = trimesh.load(path, force='mesh', process=False)\ntriangles = len(mesh.faces)",
)
OPEN3D = PEER.format(
    imports="import open3d as o3d",
    read="mesh = o3d.io.read_triangle_mesh(path)\ntriangles = len(mesh.triangles)",
)
OPEN3D_TENSOR = PEER.format(
    imports="import open3d as o3d",
    read="mesh = o3d.t.io.read_triangle_mesh(path)\ntriangles = len(mesh.triangle.indices)",
)


class Sheet:
    """A sheet of n by n vertices in waves, with normals and texture coordinates."""

    def __init__(self, n: int) -> None:
        x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
        z = 0.05 * np.sin(23 * x) * np.cos(17 * y)
        self.positions = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        slope = np.stack(
            [
                -1.15 * np.cos(23 * x) * np.cos(17 * y),
                0.85 * np.sin(23 * x) * np.sin(17 * y),
                np.ones_like(x),
            ],
            axis=-1,
        )
        self.normals = (slope / np.linalg.norm(slope, axis=-1, keepdims=True)).reshape(-1, 3)
        self.uvs = np.stack([x, y], axis=-1).reshape(-1, 2)
        corner = np.arange(n * n).reshape(n, n)
        a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
        self.faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def sheet_of(size: int, bytes_of_part: float) -> Sheet:
    """A sheet for a file of about this size, if a vertex with its two triangles takes so many
    bytes.
    """
    return Sheet(round((size / bytes_of_part) ** 0.5))


def write_ply(path: pathlib.Path, size: int, full: bool) -> None:
    sheet = sheet_of(size, 50 if full else 38)
    names = ["x", "y", "z"] + (["nx", "ny", "nz"] if full else [])
    vertices = np.concatenate([sheet.positions, sheet.normals], axis=1) if full else sheet.positions
    faces = np.empty(len(sheet.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, sheet.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
        "",
    ]
    with path.open("wb") as file:
        file.write("\n".join(header).encode())
        file.write(vertices.astype("<f4").tobytes())
        file.write(faces.tobytes())


def write_rows(file, form: str, rows: np.ndarray) -> None:
    """Writes each row in a form."""
    step = 10_000
    for start in range(0, len(rows), step):
        part = rows[start : start + step]
        file.write(form * len(part) % tuple(part.ravel().tolist()))


def write_obj(path: pathlib.Path, size: int, full: bool) -> None:
    sheet = sheet_of(size, 185 if full else 73)
    with path.open("w") as file:
        write_rows(file, "v %.6f %.6f %.6f\n", sheet.positions)
        if not full:
            write_rows(file, "f %d %d %d\n", sheet.faces + 1)
            return
        write_rows(file, "vt %.6f %.6f\n", sheet.uvs)
        write_rows(file, "vn %.5f %.5f %.5f\n", sheet.normals)
        write_rows(file, "f %d/%d/%d %d/%d/%d %d/%d/%d\n", np.repeat(sheet.faces + 1, 3, axis=1))


def write_pbrt(path: pathlib.Path, size: int, full: bool) -> None:
    sheet = sheet_of(size, 112 if full else 69)
    with path.open("w") as file:
        file.write('WorldBegin\nShape "trianglemesh"\n"point3 P" [\n')
        write_rows(file, "%.6f %.6f %.6f\n", sheet.positions)
        if full:
            file.write(']\n"normal N" [\n')
            write_rows(file, "%.5f %.5f %.5f\n", sheet.normals)
            file.write(']\n"point2 uv" [\n')
            write_rows(file, "%.6f %.6f\n", sheet.uvs)
        file.write(']\n"integer indices" [\n')
        write_rows(file, "%d %d %d\n", sheet.faces)
        file.write("]\n")


FILES = {
    "positions.ply": (write_ply, 100 * MEGABYTE, False),
    "normals.ply": (write_ply, 100 * MEGABYTE, True),
    "positions.obj": (write_obj, 50 * MEGABYTE, False),
    "normals-uvs.obj": (write_obj, 50 * MEGABYTE, True),
    "positions.pbrt": (write_pbrt, 20 * MEGABYTE, False),
    "normals-uvs.pbrt": (write_pbrt, 20 * MEGABYTE, True),
    # What the peers read instead of pbrt's text: the same triangles in the text that they know.
    "as-the-pbrt.obj": (write_obj, 20 * MEGABYTE, False),
}


def readers(snell: pathlib.Path) -> dict[str, list[str]]:
    """How each reader is called, but for the file."""
    command = [str(snell), "bench", "read", "--repeat", "1", "--json"]
    found = {"Snell": [*command, "--as-written"], "Snell, with shading normals": command}
    peers = {
        "trimesh": [("trimesh", TRIMESH)],
        "open3d": [("Open3D", OPEN3D), ("Open3D, tensors", OPEN3D_TENSOR)],
    }
    for package, programs in peers.items():
        if importlib.util.find_spec(package):
            found |= {name: [sys.executable, "-c", program] for name, program in programs}
    return found


def measure(folder: pathlib.Path, snell: pathlib.Path, repeat: int):
    """A row for each file and reader."""
    for name, (write, size, full) in FILES.items():
        path = folder / name
        if not path.exists():
            write(path, size, full)
        path.read_bytes()
        ways = {
            n: c
            for n, c in readers(snell).items()
            if n.startswith("Snell") or path.suffix != ".pbrt"
        }
        runs = {reader: [] for reader in ways}
        # In turn, so that whatever else the machine does troubles all.
        for _ in range(repeat):
            for reader, command in ways.items():
                done = subprocess.run([*command, str(path)], capture_output=True, text=True)
                if done.returncode != 0:
                    sys.exit(f"{reader}: {name}: {done.stderr.strip()}")
                runs[reader].append(json.loads(done.stdout.strip().splitlines()[-1]))
        peers = [
            statistics.median(r["seconds"] for r in rows)
            for n, rows in runs.items()
            if not n.startswith("Snell")
        ]
        for reader, rows in runs.items():
            seconds = statistics.median(row["seconds"] for row in rows)
            memory = statistics.median(row["memory_bytes"] for row in rows)
            bytes_read = path.stat().st_size
            yield {
                "file": name,
                "bytes": bytes_read,
                "triangles": rows[0]["triangles"],
                "reader": reader,
                "repeat": repeat,
                "seconds": round(seconds, 4),
                "mb_per_second": round(bytes_read / MEGABYTE / seconds, 1),
                "mtriangles_per_second": round(rows[0]["triangles"] / MEGABYTE / seconds, 2),
                "memory_of_file": round(memory / bytes_read, 2),
                "times_the_fastest_peer": round(min(peers) / seconds, 2) if peers else None,
            }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--snell", required=True, type=pathlib.Path)
    parser.add_argument(
        "--folder", type=pathlib.Path, help="where the files are kept; default: none are kept"
    )
    parser.add_argument("--repeat", default=5, type=int)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not options.json:
            print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
            print(
                f"{'file':18} {'reader':28} {'seconds':>8} {'MB/s':>8} {'Mtri/s':>7} "
                f"{'memory':>7} "
                f"{'times':>6}"
            )
        for row in measure(folder, options.snell.resolve(), options.repeat):
            if options.json:
                print(json.dumps(row), flush=True)
                continue
            times = row["times_the_fastest_peer"] or float("nan")
            print(
                f"{row['file']:18} {row['reader']:28} {row['seconds']:8.3f} "
                f"{row['mb_per_second']:8.1f} "
                f"{row['mtriangles_per_second']:7.2f} {row['memory_of_file']:6.2f}x {times:6.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
