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
