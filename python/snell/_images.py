"""Differences of pictures."""

from __future__ import annotations

import types
from typing import TYPE_CHECKING

from snell._snell import Image, _compare

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Comparison", "compare"]


class Comparison(types.SimpleNamespace):
    """The differences of two pictures: the result of :func:`compare`.

    `mse` is the mean squared error of linear values, and `rel_mse` the mean squared error relative
    to the reference (``(test - reference)**2 / (reference**2 + 0.01)``). `mse_srgb`, `psnr`
    (decibels; None if equal) and `flip` (0 to 1, at 67 pixels per degree) compare sRGB display
    values, and `flip_map` has the FLIP error of each pixel. `max_abs` is the largest difference of
    a linear value, at column and row `max_at`; `max_levels` is the largest difference of an 8-bit
    display value. `different` is the share of pixels that differ by more than `threshold` levels.
    """

    width: int
    height: int
    mse: float
    rel_mse: float
    mse_srgb: float
    psnr: float | None
    flip: float
    flip_map: NDArray[np.float32]
    max_abs: float
    max_at: tuple[int, int]
    max_levels: int
    different: float
    threshold: int
    not_finite_in_reference: int
    not_finite_in_test: int
    tone_mapped: bool
    exposure: float


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
    numbers, flip_map = _compare(reference, test)
    return Comparison(**numbers, flip_map=flip_map)
