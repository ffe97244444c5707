"""Parts of the answers of queries."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def numbers_of(whole: Any, key: Any) -> np.ndarray:
    """The numbers of the answers that an index selects, counted over the raveled leading shape."""
    numbers = np.arange(math.prod(whole.shape)).reshape(whole.shape)
    try:
        numbers = np.asarray(numbers[key])
    except IndexError as error:
        raise IndexError(
            f"{type(whole).__name__} of shape {whole.shape}: {error}; an index is a name, such as "
            "'t_hit', or what selects from an array of this shape"
        ) from None
    if not hasattr(whole, "ray_splits"):
        return numbers
    numbers = np.atleast_1d(numbers)
    if numbers.ndim > 1 or (np.diff(numbers) < 0).any():
        raise IndexError("the hits of a list keep their order: give a mask, a slice or a number")
    return numbers


def part_of(whole: Any, name: str, numbers: np.ndarray) -> np.ndarray:
    """The array of this name for the answers with these numbers."""
    array = getattr(whole, name)
    if name == "ray_splits":
        counts = np.bincount(whole.ray_ids[numbers], minlength=len(array) - 1)
        return np.concatenate([[0], np.cumsum(counts)])
    count, inner = math.prod(whole.shape), array.shape[len(whole.shape) :]
    return np.asarray(array.reshape(count, *inner)[numbers])
