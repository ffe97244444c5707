"""Reads clouds of points."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ._snell import _load_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NORMALS = [("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z")]
_CHANNELS = ("red", "green", "blue", "alpha")


@dataclass(frozen=True, eq=False)
class PointCloud:
    """The points of a file; see :func:`load_points`. All arrays have the leading shape of `points`:
    ``(n,)``, or ``(h, w)`` for a scan that kept its rows.

    Attributes
    ----------
    points : array (..., 3) of float32 or float64
        The positions. In a scan with rows, NaN is a point that is missing.
    colors : array (..., 3) or (..., 4), or None
        sRGB of `uint8` or `uint16`; floats are linear.
    intensity : array (...), or None
        The numbers that the file calls intensity.
    normals : array (..., 3), or None
        The normals.
    columns : dict of arrays
        All other numbers of the points, by their names in the file.
    """

    points: NDArray[Any]
    colors: NDArray[Any] | None
    intensity: NDArray[Any] | None
    normals: NDArray[Any] | None
    columns: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        shape = " x ".join(str(size) for size in self.points.shape[:-1])
        named = {"colors": self.colors, "intensity": self.intensity, "normals": self.normals}
        parts = [name for name, array in named.items() if array is not None]
        parts += list(self.columns)
        return f"<snell.PointCloud: {shape} points{''.join(f', {part}' for part in parts)}>"


def load_points(path: str | os.PathLike[str]) -> PointCloud:
    """Reads a cloud of points from PLY or PCD, with all its numbers; the inverse of
    :func:`save_points`.

    PCD may be text, binary or compressed; PLY is text or binary, and of a mesh the vertices are
    read. Types stay as they are in the file. :func:`load` reads the same files as things that rays
    can hit.

    Parameters
    ----------
    path : str or os.PathLike
        The file; its content decides which format it is.

    Examples
    --------
    >>> import pathlib, tempfile, numpy as np, snell
    >>> points = np.random.default_rng(0).random((100, 3))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "scan.pcd")
    ...     snell.save_points(path, points, intensity=np.arange(100), ring=np.arange(100) % 16)
    ...     cloud = snell.load_points(path)
    >>> cloud
    <snell.PointCloud: 100 points, intensity, ring>
    >>> (cloud.points == points).all()
    np.True_
    """
    listed, (rows, width) = _load_points(os.fspath(path))
    shape = (rows, width) if rows > 1 else (width,)
    columns = {name: array.reshape(shape + array.shape[1:]) for name, array in listed}
    points = _stacked(columns, ("x", "y", "z"))
    if points is None:
        raise ValueError(f"{os.fspath(path)}: the points have no x, y and z")
    if points.dtype.kind != "f":
        points = points.astype(np.float64)
    normals = None
    for names in _NORMALS:
        normals = _stacked(columns, names) if normals is None else normals
    colors = _stacked(columns, _CHANNELS)
    if colors is None:
        colors = _stacked(columns, _CHANNELS[:3])
    if colors is None:
        colors = _packed(columns)
    intensity = None
    for name in list(columns):
        # CloudCompare writes "scalar_Intensity".
        if intensity is None and name.lower().removeprefix("scalar_") == "intensity":
            intensity = columns.pop(name)
    return PointCloud(points, colors, intensity, normals, columns)


def _stacked(columns: dict[str, NDArray[Any]], names: tuple[str, ...]) -> NDArray[Any] | None:
    """Takes some columns, if all are there, as one array."""
    if not all(name in columns for name in names):
        return None
    return np.stack([columns.pop(name) for name in names], axis=-1)


def _packed(columns: dict[str, NDArray[Any]]) -> NDArray[np.uint8] | None:
    """Takes the colours of a PCD file: 32 bits, of which the lowest are blue."""
    for name, channels in (("rgba", (16, 8, 0, 24)), ("rgb", (16, 8, 0))):
        if name in columns and columns[name].dtype.itemsize == 4:
            bits = np.ascontiguousarray(columns.pop(name)).view(np.uint32)
            return np.stack([(bits >> shift).astype(np.uint8) for shift in channels], axis=-1)
    return None
