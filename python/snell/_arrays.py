"""Arrays and tensors of any library as NumPy arrays. No library is imported."""

from __future__ import annotations

from typing import Any

import numpy as np

# The kinds of devices of DLPack whose memory NumPy can read.
_IN_MAIN_MEMORY = (1, 3, 11, 13)


def array_of(value: Any, name: str) -> np.ndarray:
    """An argument as an array: NumPy's own, tensors in main memory (``numpy()``), what has
    ``__array__``, ``__array_interface__`` or DLPack, and nested sequences. Errors begin with the
    name of the argument.
    """
    if isinstance(value, np.ndarray):
        if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
            masked = int(np.ma.getmaskarray(value).sum())
            raise ValueError(
                f"{name}: {masked} of {value.size} numbers are masked, and a mask does not count "
                "here; leave their rows out, or give filled(…)"
            )
        return np.asarray(value)
    _check_tensor(value, name)
    try:
        if callable(getattr(value, "numpy", None)):
            return np.asarray(value.numpy())
        is_known = hasattr(value, "__array__") or hasattr(value, "__array_interface__")
        if hasattr(value, "__dlpack__") and not is_known:
            return np.from_dlpack(value)
        made = np.asarray(value)
    except Exception as error:
        raise TypeError(f"{name}: this does not convert to an array") from error
    if made.dtype == object and made.ndim == 0:
        raise TypeError(f"{name} is {_described(value)}, expected an array of numbers")
    return made


def _check_tensor(value: Any, name: str) -> None:
    """Refuses tensors that NumPy cannot read, and says what to give instead."""
    if getattr(value, "requires_grad", False) is True:
        raise TypeError(
            f"{name}: the tensor has a gradient, which no query carries; give {name}.detach()"
        )
    if not _is_in_main_memory(value):
        where = getattr(value, "device", "another device")
        raise TypeError(
            f"{name}: the tensor is on {where}, expected one in main memory; give {name}.cpu()"
        )


def _is_in_main_memory(value: Any) -> bool:
    if getattr(value, "is_cuda", False) is True:
        return False
    device = getattr(value, "__dlpack_device__", None)
    if not callable(device):
        return True
    kind = device()[0]
    return int(getattr(kind, "value", kind)) in _IN_MAIN_MEMORY


def _described(value: Any) -> str:
    kind = type(value)
    module = kind.__module__.partition(".")[0]
    return kind.__name__ if module == "builtins" else f"a {module}.{kind.__name__}"
