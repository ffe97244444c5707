"""Clouds of points in files."""

from __future__ import annotations

import numpy as np
import pytest

import snell


def cloud(rng, count: int = 200) -> np.ndarray:
    """Points in metres of a map, where float32 has steps of half a metre."""
    return rng.random((count, 3)) * 9 + [448262, 5411932, 120]


def read_ply(path) -> np.ndarray:
    """The vertices of a binary PLY, by its header."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    count = int(lines[2].removeprefix("element vertex "))
    types = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2"}
    types |= {"int": "<i4", "uint": "<u4", "float": "<f4", "double": "<f8"}
    fields = [line.split()[1:] for line in lines[3:-1]]
    kind = np.dtype([(name, types[kind]) for kind, name in fields])
    assert len(data) == end + count * kind.itemsize
    return np.frombuffer(data, kind, offset=end)


def read_pcd(path) -> tuple[np.ndarray, dict[str, list[str]]]:
    data = path.read_bytes()
    end = data.index(b"DATA binary\n") + len(b"DATA binary\n")
    header = {line.split()[0]: line.split()[1:] for line in data[:end].decode().splitlines()}
    kinds = zip(header["FIELDS"], header["TYPE"], header["SIZE"], strict=True)
    kind = np.dtype([(name, "<" + letter.lower() + size) for name, letter, size in kinds])
    found = np.frombuffer(data, kind, offset=end)
    assert len(found) == int(header["POINTS"][0])
    return found, header


def test_ply_has_the_very_numbers(rng, tmp_path):
    points, path = cloud(rng), tmp_path / "scan.ply"
    columns = {
        "ring": rng.integers(0, 64, 200).astype(np.uint16),
        "time": rng.random(200) + 1.7e9,
        "label": rng.integers(-5, 5, 200),
        "large": rng.integers(2**40, 2**41, 200),
        "is_ground": rng.random(200) < 0.5,
        "power": rng.random(200).astype(np.float16),
    }
    intensity = rng.random(200).astype(np.float32)
    colors = rng.integers(0, 256, (200, 4)).astype(np.uint8)
    normals = rng.normal(size=(200, 3)).astype(np.float32)
    snell.save_points(path, points, colors, intensity, normals, **columns)
    found = read_ply(path)
    for i, name in enumerate("xyz"):
        assert (found[name] == points[:, i]).all() and found[name].dtype == np.float64
        assert (found["n" + name] == normals[:, i]).all()
    for i, name in enumerate(("red", "green", "blue", "alpha")):
        assert (found[name] == colors[:, i]).all()
    assert (found["intensity"] == intensity).all()
    for name, values in columns.items():
        assert (found[name] == values).all(), name
    kinds = {name: found.dtype[name].str for name in columns}
    assert kinds == {
        "ring": "<u2",
        "time": "<f8",
        "label": "<i4",
        "large": "<f8",
        "is_ground": "|u1",
        "power": "<f4",
    }
    snell.save_points(path, points.astype(np.float32))
    assert read_ply(path).dtype.names == ("x", "y", "z") and read_ply(path)["x"].dtype == np.float32


def test_pcd_keeps_rows_and_what_is_missing(rng, tmp_path):
    points, path = cloud(rng, 60).reshape(5, 12, 3), tmp_path / "scan.pcd"
    points[2, 3] = np.nan
    colors = rng.integers(0, 256, (5, 12, 3)).astype(np.uint8)
    snell.save_points(path, points, colors, ring=np.arange(60, dtype=np.int8).reshape(5, 12))
    found, header = read_pcd(path)
    assert header["WIDTH"] == ["12"] and header["HEIGHT"] == ["5"]
    assert header["FIELDS"] == ["x", "y", "z", "rgb", "ring"]
    assert header["TYPE"] == ["F", "F", "F", "F", "I"] and header["SIZE"] == [
        "8",
        "8",
        "8",
        "4",
        "1",
    ]
    assert np.array_equal(found["y"], points[..., 1].ravel(), equal_nan=True)
    bits = found["rgb"].view(np.uint32)
    channels = np.stack([bits >> 16 & 255, bits >> 8 & 255, bits & 255], axis=-1)
    assert (channels == colors.reshape(-1, 3)).all()
    snell.save_points(path, points[:2].reshape(-1, 3), normals=np.ones((24, 3)))
    assert read_pcd(path)[1]["FIELDS"][3:] == ["normal_x", "normal_y", "normal_z"]


def test_floats_are_linear_light(tmp_path):
    light = [[0, 0.5, 1], [0.0031308, 0.2140411, 0.003]]
    snell.save_points(tmp_path / "a.ply", np.zeros((2, 3)), light)
    found = read_ply(tmp_path / "a.ply")
    assert found["green"].tolist() == [188, 127] and found["red"].tolist() == [0, 10]
    wide = np.array([[0, 257, 65535], [1, 128, 129]], np.uint16)
    snell.save_points(tmp_path / "a.ply", np.zeros((2, 3)), wide)
    found = read_ply(tmp_path / "a.ply")
    assert found["blue"].tolist() == [255, 1] and found["green"].tolist() == [1, 0]


def test_a_failed_write_destroys_nothing(rng, tmp_path, monkeypatch):
    path = tmp_path / "scan.ply"
    snell.save_points(path, cloud(rng))
    before = path.read_bytes()
    bad = cloud(rng)
    bad[7, 1] = np.inf
    for arguments, message in [
        ((bad,), r"points\[7, 1\] is inf"),
        ((cloud(rng)[:, :2],), r"points: shape is \(200, 2\), expected \(..., 3\)"),
        ((cloud(rng), np.ones((3, 3))), r"colors: shape is \(3, 3\)"),
        ((cloud(rng), np.full((200, 3), 255.0)), "linear light from 0 to 1"),
        ((cloud(rng), None, np.ones(3)), r"intensity: shape is \(3,\), expected \(200,\)"),
        ((np.full((2, 3), np.nan),), "leave out what is missed"),
    ]:
        with pytest.raises(ValueError, match=message):
            snell.save_points(path, *arguments)
    points = cloud(rng)
    with pytest.raises(TypeError, match="x: this column is written from points"):
        snell.save_points(path, points, x=np.ones(200))
    with pytest.raises(TypeError, match="dtype is <U1"):
        snell.save_points(path, points, ring=np.full(200, "a"))
    with pytest.raises(ValueError, match="name for a column"):
        snell.save_points(path, points, **{"a b": np.ones(200)})
    with pytest.raises(ValueError, match="not hold"):
        snell.save_points(path, points, stamp=np.full(200, 2**60 + 1))
    with pytest.raises(ValueError, match=r"expected a name that ends in \.ply or \.pcd"):
        snell.save_points(tmp_path / "scan.xyz", points)
    with pytest.raises(OSError, match="missing"):
        snell.save_points(tmp_path / "missing" / "scan.ply", points)
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["scan.ply"]


def test_an_empty_cloud_is_a_file(tmp_path):
    for name in ("a.ply", "a.pcd"):
        snell.save_points(tmp_path / name, np.empty((0, 3)), intensity=[])
    assert len(read_ply(tmp_path / "a.ply")) == 0
    assert len(read_pcd(tmp_path / "a.pcd")[0]) == 0


def test_snell_draws_them(rng, tmp_path):
    points = cloud(rng, 500)
    snell.save_points(
        tmp_path / "a.ply", points, colors=rng.random((500, 3)), intensity=points[:, 0]
    )
    loaded = snell.load(tmp_path / "a.ply")
    low, high = loaded.bounds
    assert (low <= points.min(axis=0)).all() and (high >= points.max(axis=0)).all()
    assert (high - low < np.ptp(points, axis=0) + 5).all()


def test_open3d_reads_them(rng, tmp_path):
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    points = cloud(rng)
    colors = rng.integers(0, 256, (200, 3)).astype(np.uint8)
    normals = rng.normal(size=(200, 3)).astype(np.float32)
    intensity = np.arange(200, dtype=np.float32)
    # Its older reader knows no doubles in PCD.
    for name, given in [("a.ply", points), ("a.pcd", points.astype(np.float32))]:
        snell.save_points(tmp_path / name, given, colors, intensity, normals)
        read = o3d.io.read_point_cloud(str(tmp_path / name))
        assert (np.asarray(read.points) == given).all(), name
        assert np.allclose(np.asarray(read.colors) * 255, colors), name
        assert np.allclose(np.asarray(read.normals), normals), name
    for name in ("a.ply", "a.pcd"):
        snell.save_points(tmp_path / name, points, colors, intensity, normals)
        tensor = o3d.t.io.read_point_cloud(str(tmp_path / name))
        assert (tensor.point.positions.numpy() == points).all(), name
        assert (tensor.point.intensity.numpy().ravel() == intensity).all(), name


def test_trimesh_reads_them(rng, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    points, colors = cloud(rng), rng.integers(0, 256, (200, 4)).astype(np.uint8)
    snell.save_points(tmp_path / "a.ply", points, colors, ring=np.arange(200))
    read = trimesh.load(tmp_path / "a.ply")
    assert (read.vertices == points).all() and (read.colors == colors).all()


def lzf(data: bytes) -> bytes:
    """LZF of literals, and of a reference where 3 bytes or more repeat what is 4 bytes before."""
    out, at, literal = bytearray(), 0, bytearray()

    def flush() -> None:
        for start in range(0, len(literal), 32):
            piece = literal[start : start + 32]
            out.append(len(piece) - 1)
            out.extend(piece)
        literal.clear()

    while at < len(data):
        length = 0
        while at >= 4 and at + length < len(data) and length < 264:
            if data[at + length] != data[at + length - 4]:
                break
            length += 1
        if length >= 3:
            flush()
            code = length - 2
            out.append((min(code, 7) << 5) | 0)
            if code >= 7:
                out.append(code - 7)
            out.append(3)
            at += length
        else:
            literal.append(data[at])
            at += 1
    flush()
    return bytes(out)


HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z rgb intensity ring normal_x normal_y normal_z _
SIZE 4 4 4 4 8 2 4 4 4 1
TYPE F F F F F U F F F U
COUNT 1 1 1 1 1 1 1 1 1 3
WIDTH 6
HEIGHT {rows}
VIEWPOINT 0 0 0 1 0 0 0
POINTS {count}
DATA {data}
"""


def records(rng, count: int) -> np.ndarray:
    fields = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("intensity", "<f8")]
    fields += [("ring", "<u2"), ("normal_x", "<f4"), ("normal_y", "<f4"), ("normal_z", "<f4")]
    made = np.zeros(count, [*fields, ("_", "u1", 3)])
    for name in ("x", "y", "z", "normal_x", "normal_y", "normal_z"):
        made[name] = rng.normal(size=count)
    made["rgb"] = rng.integers(0, 1 << 24, count)
    made["intensity"] = rng.random(count)
    made["ring"] = np.arange(count) // 4
    return made


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("rows", [1, 4])
def test_pcd_of_other_programs_is_read(rng, tmp_path, data, rows):
    count = 6 * rows
    made = records(rng, count)
    if data == "ascii":
        lines = [
            " ".join(
                str(value)
                for name in made.dtype.names
                for value in np.atleast_1d(
                    row[name].view("f4") if name == "rgb" else row[name]
                ).tolist()
            )
            for row in made
        ]
        body = "\n".join(lines).encode()
    elif data == "binary":
        body = made.tobytes()
    else:
        columns = b"".join(np.ascontiguousarray(made[name]).tobytes() for name in made.dtype.names)
        packed = lzf(columns)
        body = np.array([len(packed), len(columns)], "<u4").tobytes() + packed
    path = tmp_path / "scan.pcd"
    path.write_bytes(HEADER.format(rows=rows, count=count, data=data).encode() + body)
    cloud = snell.load_points(path)
    shape = (rows, 6) if rows > 1 else (6,)
    assert cloud.points.shape == (*shape, 3) and cloud.points.dtype == np.float32
    assert len(cloud) == shape[0] and list(cloud.columns) == ["ring"]
    for axis, name in enumerate("xyz"):
        assert (cloud.points[..., axis].ravel() == made[name]).all()
        assert (cloud.normals[..., axis].ravel() == made[f"normal_{name}"]).all()
    assert (cloud.intensity.ravel() == made["intensity"]).all()
    assert cloud.columns["ring"].dtype == np.uint16
    assert (cloud.columns["ring"].ravel() == made["ring"]).all()
    for channel, shift in enumerate((16, 8, 0)):
        assert (cloud.colors[..., channel].ravel() == made["rgb"] >> shift & 255).all()
    # The same file as balls.
    scene = snell.load(path)
    assert any("points are drawn as balls" in warning for warning in scene.warnings)
    hits = scene.cast_rays((cloud.points.reshape(-1, 3) + [0, 0, 9], [0, 0, -1]))
    assert hits.is_hit.all()
    linear = snell.Texture(cloud.colors.reshape(1, -1, 3))
    assert linear is not None and (hits.albedo <= 1).all()


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_what_is_saved_is_loaded(rng, tmp_path, suffix, kind):
    points = (rng.normal(size=(50, 3)) + [448262, 5411932, 120]).astype(kind)
    given = {
        "colors": rng.integers(0, 256, (50, 3), dtype=np.uint8),
        "intensity": rng.random(50),
        "normals": rng.normal(size=(50, 3)).astype(np.float32),
    }
    columns = {"ring": np.arange(50, dtype=np.uint16), "time": rng.random(50)}
    path = tmp_path / f"scan{suffix}"
    snell.save_points(path, points, **given, **columns)
    cloud = snell.load_points(path)
    assert cloud.points.dtype == kind and (cloud.points == points).all()
    for name, values in given.items():
        found = getattr(cloud, name)
        assert found.dtype == values.dtype and (found == values).all(), name
    for name, values in columns.items():
        assert cloud.columns[name].dtype == values.dtype and (cloud.columns[name] == values).all()
    kept = {name: getattr(cloud, name) for name in given}
    snell.save_points(tmp_path / f"again{suffix}", cloud.points, **kept, **cloud.columns)
    assert (tmp_path / f"again{suffix}").read_bytes() == path.read_bytes()
    alpha = rng.integers(1, 256, (50, 4), dtype=np.uint8)
    snell.save_points(path, points, colors=alpha)
    assert (snell.load_points(path).colors == alpha).all()
    grid = points[:48].reshape(6, 8, 3)
    snell.save_points(path, grid)
    assert snell.load_points(path).points.shape == (grid.shape if suffix == ".pcd" else (48, 3))


def test_ply_of_meshes_and_of_text_is_read(tmp_path):
    path = tmp_path / "mesh.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n"
        "element vertex 3\nproperty int x\nproperty int y\nproperty int z\n"
        "property list uchar int near\nproperty float scalar_Intensity\nend_header\n"
        "3 0 1 2\n0 0 0 2 5 6 0.5\n1 0 0 0 1\n0 1 0 1 9 -3\n"
    )
    cloud = snell.load_points(path)
    assert cloud.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert cloud.points.dtype == np.float64 and cloud.intensity.tolist() == [0.5, 1, -3]
    assert repr(cloud) == "<snell.PointCloud: 3 points, intensity>"


def test_files_that_are_no_clouds_are_refused(tmp_path):
    path = tmp_path / "scan.xyz"
    with pytest.raises(FileNotFoundError):
        snell.load_points(path)
    path.write_text("1 2 3\n")
    with pytest.raises(ValueError, match="neither a PLY nor a PCD file"):
        snell.load_points(path)
    path.write_text("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n")
    with pytest.raises(ValueError, match="no x, y and z"):
        snell.load_points(path)
    path.write_bytes(HEADER.format(rows=1, count=6, data="binary").encode() + bytes(7))
    with pytest.raises(ValueError, match=r"scan\.xyz.*7 bytes of points, expected 246"):
        snell.load_points(path)
