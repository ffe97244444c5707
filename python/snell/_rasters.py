"""Rasters of heights, and transforms of rasterio and affine. No library is imported."""

from __future__ import annotations

from typing import Any

import numpy as np

from snell._arrays import array_of


def heights_of(z: Any) -> np.ndarray:
    """Heights as an array of ``float32`` or ``float64``, in which NaN stands for masked ones. What
    ``float32`` holds exactly is ``float32``.
    """
    mask = np.ma.getmask(z)
    array = array_of(z.data if isinstance(z, np.ma.MaskedArray) else z, "z")
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind not in "fiu":
        raise TypeError(f"z: dtype is {array.dtype}, expected real numbers")
    is_small = size <= (4 if kind == "f" else 2)
    heights = array.astype(np.float32 if is_small else np.float64, copy=False)
    return heights if mask is np.ma.nomask else np.where(mask, heights.dtype.type(np.nan), heights)


def matrix_of(transform: Any) -> Any:
    """The matrix ``(4, 4)`` or ``(3, 4)`` of a transform of columns, rows and heights: that of an
    ``Affine`` or of a matrix ``(2, 3)`` or ``(3, 3)``, which leave heights alone.
    """
    if all(hasattr(transform, name) for name in "abcdef"):
        names = (("a", "b", "c"), ("d", "e", "f"))
        array = np.array([[getattr(transform, name) for name in row] for row in names], float)
    else:
        array = array_of(transform, "transform")
    if array.shape == (6,):
        raise ValueError(
            "transform: six numbers are in GDAL's order or in affine's; give Affine.from_gdal(*…), "
            "Affine(*…), or the matrix [[a, b, c], [d, e, f]]"
        )
    if array.shape == (3, 3):
        if array[2].tolist() != [0, 0, 1]:
            raise ValueError(f"transform[2] is {array[2].tolist()}, expected [0, 0, 1]")
        array = array[:2]
    if array.shape != (2, 3):
        if array.shape not in ((3, 4), (4, 4)):
            raise ValueError(
                f"transform: shape is {array.shape}, expected an Affine, (2, 3), (3, 3), (3, 4) or "
                "(4, 4)"
            )
        return array
    (a, b, c), (d, e, f) = array.tolist()
    return np.array([[a, b, 0, c], [d, e, 0, f], [0, 0, 1, 0], [0, 0, 0, 1]], np.float64)
