"""Writes clouds of points."""

from __future__ import annotations

import os
import pathlib
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from snell._arrays import array_of
from snell._snell import _write_file

# The names of NumPy's types in PLY; the letter and size of PCD are NumPy's own.
_PLY_TYPES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}

# Names that the other arguments write.
_TAKEN = {
    "x": "points",
    "y": "points",
    "z": "points",
    "nx": "normals",
    "ny": "normals",
    "nz": "normals",
    "normal_x": "normals",
    "normal_y": "normals",
    "normal_z": "normals",
    "red": "colors",
    "green": "colors",
    "blue": "colors",
    "alpha": "colors",
    "rgb": "colors",
    "rgba": "colors",
}

Columns = dict[str, np.ndarray]


def save_points(
    path: str | os.PathLike[str],
    points: Any,
    colors: Any = None,
    intensity: Any = None,
    normals: Any = None,
    **columns: Any,
) -> None:
    """Writes a cloud of points as PLY or PCD, in binary (little endian).

    All numbers are written as they are: `float64` points as doubles, `float32` ones as floats,
    integers as integers. (PCL, and the older reader of Open3D, know no doubles in PCD: give them
    `float32`.) The file appears whole or not at all; one that is there stays if the writing fails.

    Parameters
    ----------
    path : str or os.PathLike
        A name that ends in ``.ply`` or ``.pcd``.
    points : array (..., 3)
        Finite positions: of the hits of a scan, those whose `t_hit` is finite. In PCD, a scan of
        the shape ``(h, w, 3)`` keeps its rows, and NaN is a point that is missing.
    colors : array (..., 3) or (..., 4), optional
        Colours: `uint8` is written as it is (sRGB), `uint16` is sRGB too, floats are linear, from
        0 to 1. They become 8 bits for each channel.
    intensity : array (...), optional
        One number for each point.
    normals : array (..., 3), optional
        A normal for each point.
    **columns : array (...)
        Further numbers of each point by name, such as ``ring`` or ``time``.

    Examples
    --------
    >>> import pathlib, tempfile, numpy as np, snell
    >>> points = np.random.default_rng(0).random((100, 3)) + [448262, 5411932, 120]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "scan.ply")
    ...     snell.save_points(path, points, intensity=np.ones(100), ring=np.arange(100))
    ...     cloud = snell.load(path)
    >>> np.abs(cloud.bounds.mean(axis=0) - points.mean(axis=0)).max() < 1
    np.True_
    """
    path = pathlib.Path(os.fspath(path))
    writers: dict[str, Callable[..., tuple[Columns, Callable[..., str]]]] = {
        ".ply": _ply,
        ".pcd": _pcd,
    }
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise ValueError(
            f"path: {path.name} ends in {path.suffix!r}, expected a name that ends in .ply or .pcd"
        )
    places = _numbers(points, "points")
    if places.ndim == 1 and places.size == 0:
        places = places.reshape(0, 3)
    if places.ndim < 2 or places.shape[-1] != 3:
        raise ValueError(f"points: shape is {places.shape}, expected (..., 3)")
    shape = places.shape[:-1]
    is_organized = writer is _pcd and len(shape) == 2
    _check_finite(places, is_organized)
    parts: dict[str, Any] = {"points": _floats(places, "points").reshape(-1, 3)}
    if normals is not None:
        parts["normals"] = _floats(_rows(normals, "normals", shape, (3,)), "normals")
    if colors is not None:
        parts["colors"] = _bytes(_rows(colors, "colors", shape, (3, 4)))
    rest = columns if intensity is None else {"intensity": intensity, **columns}
    parts["rest"] = {name: _column(values, name, shape) for name, values in rest.items()}
    fields, header = writer(**parts)
    records = np.empty(
        places.size // 3,
        [(name, values.dtype.newbyteorder("<")) for name, values in fields.items()],
    )
    for name, values in fields.items():
        records[name] = values
    text = header(records, *(shape if is_organized else (1, len(records))))
    _write_file(path, text.encode(), records.view(np.uint8))


def _ply(points: Any, rest: Columns, normals: Any = None, colors: Any = None) -> Any:
    fields = dict(zip(("x", "y", "z"), points.T, strict=True))
    if normals is not None:
        fields |= zip(("nx", "ny", "nz"), normals.T, strict=True)
    if colors is not None:
        names = ("red", "green", "blue", "alpha")
        fields |= zip(names[: colors.shape[1]], colors.T, strict=True)

    def header(records: np.ndarray, rows: int, width: int) -> str:
        kinds = {name: records.dtype[name] for name in records.dtype.names or ()}
        lines = [f"property {_PLY_TYPES[kind.str[1:]]} {name}\n" for name, kind in kinds.items()]
        count = f"element vertex {rows * width}\n"
        return "ply\nformat binary_little_endian 1.0\n" + count + "".join(lines) + "end_header\n"

    return {**fields, **rest}, header


def _pcd(points: Any, rest: Columns, normals: Any = None, colors: Any = None) -> Any:
    fields = dict(zip(("x", "y", "z"), points.T, strict=True))
    if normals is not None:
        fields |= zip(("normal_x", "normal_y", "normal_z"), normals.T, strict=True)
    if colors is not None:
        # A number of 32 bits, from the highest byte: (alpha,) red, green, blue. As in PCL, `rgb`
        # is declared a float with these bits, and `rgba` an integer.
        wide = colors.astype(np.uint32)
        bits = wide[:, 0] << 16 | wide[:, 1] << 8 | wide[:, 2]
        if colors.shape[1] == 4:
            fields["rgba"] = bits | wide[:, 3] << 24
        else:
            fields["rgb"] = bits.view(np.float32)

    def header(records: np.ndarray, rows: int, width: int) -> str:
        kinds = [records.dtype[name] for name in records.dtype.names or ()]
        lines = {
            "VERSION": "0.7",
            "FIELDS": " ".join(records.dtype.names or ()),
            "SIZE": " ".join(str(kind.itemsize) for kind in kinds),
            "TYPE": " ".join(kind.kind.upper() for kind in kinds),
            "COUNT": " ".join("1" for _ in kinds),
            "WIDTH": width,
            "HEIGHT": rows,
            "VIEWPOINT": "0 0 0 1 0 0 0",
            "POINTS": rows * width,
            "DATA": "binary",
        }
        return "".join(f"{key} {value}\n" for key, value in lines.items())

    return {**fields, **rest}, header


def _numbers(value: Any, name: str) -> np.ndarray:
    array = array_of(value, name)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name}: dtype is {array.dtype}, expected numbers")
    return array


def _rows(value: Any, name: str, shape: tuple[int, ...], widths: tuple[int, ...]) -> np.ndarray:
    """An array of rows, one for each point."""
    array = _numbers(value, name)
    if array.shape[:-1] != shape or array.shape[-1:] not in [(width,) for width in widths]:
        expected = " or ".join(str((*shape, width)) for width in widths)
        raise ValueError(f"{name}: shape is {array.shape}, expected {expected}")
    return array.reshape(-1, array.shape[-1])


def _floats(array: np.ndarray, name: str) -> np.ndarray:
    """Numbers as floats: of 4 or 8 bytes as they are, all others in double precision."""
    if array.dtype.kind == "f" and array.dtype.itemsize in (4, 8):
        return array
    made = array.astype(np.float64)
    if not (made.astype(array.dtype) == array).all():
        raise ValueError(f"{name}: {array.dtype} has digits that float64 does not hold")
    return made


def _bytes(colors: np.ndarray) -> np.ndarray:
    """Colours as 8-bit sRGB."""
    kind = colors.dtype
    if kind == np.uint8:
        return colors
    if kind == np.uint16:
        return ((colors.astype(np.uint32) + 128) // 257).astype(np.uint8)
    if kind.kind != "f":
        raise TypeError(f"colors: dtype is {kind}, expected uint8, uint16 or floats")
    if not (np.isfinite(colors).all() and (colors >= 0).all() and (colors <= 1).all()):
        raise ValueError("colors: floats are linear light from 0 to 1; give sRGB bytes as uint8")
    light = colors.astype(np.float64)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    curve[:, 3:] = light[:, 3:]
    shown: np.ndarray = np.round(curve * 255).astype(np.uint8)
    return shown


def _column(value: Any, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """One number for each point, in a type that both formats have."""
    if name in _TAKEN:
        raise TypeError(f"{name}: this column is written from {_TAKEN[name]}; give another name")
    if not re.fullmatch(r"[!-~]+", name):
        raise ValueError(f"{name!r} is not a name for a column: letters and digits without spaces")
    array = _numbers(value, name)
    if array.shape != shape:
        raise ValueError(f"{name}: shape is {array.shape}, expected {shape}, one for each point")
    array = array.ravel()
    kind = array.dtype
    if kind.kind == "b":
        return array.astype(np.uint8)
    if kind.kind == "f":
        return _floats(array.astype(np.float32) if kind.itemsize == 2 else array, name)
    if kind.itemsize < 8:
        return array
    # PLY has no integers of 64 bits, and few programs read those of PCD.
    low, high = (int(array.min()), int(array.max())) if len(array) else (0, 0)
    for narrow in (np.int32, np.uint32):
        limits = np.iinfo(narrow)
        if limits.min <= low and high <= limits.max:
            return array.astype(narrow)
    return _floats(array, name)


def _check_finite(points: np.ndarray, may_be_missing: bool) -> None:
    finite = np.isfinite(points)
    if may_be_missing:
        finite |= np.isnan(points)
    if finite.all():
        return
    place = ", ".join(str(index) for index in np.argwhere(~finite)[0])
    remedy = "leave out what is missed: points[np.isfinite(t_hit)]"
    value = points[tuple(np.argwhere(~finite)[0])]
    raise ValueError(f"points[{place}] is {value}, expected a finite number; {remedy}")
