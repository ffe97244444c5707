"""Differences of pictures."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snell._snell import Image, _compare

__all__ = ["Comparison", "compare"]


@dataclasses.dataclass(frozen=True, eq=False)
class Comparison:
    """How far two pictures are apart: what :func:`compare` answers."""

    width: int
    height: int
    mse: float
    """Mean squared error of the linear values."""
    rel_mse: float
    """Mean of ``(test - reference)**2 / (reference**2 + 0.01)``, linear."""
    mse_srgb: float
    """Mean squared error of display values, from 0 to 1."""
    psnr: float | None
    """Peak signal to noise ratio of display values in decibels; None if they are equal."""
    flip: float
    """Mean FLIP error, from 0 to 1, at 67 pixels per degree."""
    max_abs: float
    """Largest difference of a linear value."""
    max_at: tuple[int, int]
    """Column and row of it."""
    max_levels: int
    """Largest difference of an 8-bit display value."""
    different: float
    """Share of the pixels that differ by more than `threshold` levels."""
    threshold: int
    not_finite_in_reference: int
    not_finite_in_test: int
    tone_mapped: bool
    exposure: float
    flip_map: NDArray[np.float32] = dataclasses.field(repr=False)
    """The FLIP error of each pixel."""


def compare(reference: Image | ArrayLike, test: Image | ArrayLike) -> Comparison:
    """Compares two pictures of one size.

    Parameters
    ----------
    reference, test : Image or array (height, width, 3)
        Linear light.

    Examples
    --------
    >>> import numpy as np, snell
    >>> grey = np.full((8, 8, 3), 0.5, dtype=np.float32)
    >>> round(snell.compare(grey, grey * 1.1).mse, 6)
    0.0025
    """
    numbers: dict[str, Any]
    numbers, flip_map = _compare(reference, test)
    return Comparison(**numbers, flip_map=flip_map)
