"""Primvars: values of prims that materials and surfaces read by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Tf, Usd, UsdGeom

from ._context import Context

__all__ = ["State", "first_row", "is_varying", "primvar_rows", "primvar_state"]

#: What a material sees of a primvar: `None` if there is none, its numbers if it is one value for
#: the whole prim, and no numbers if it varies.
State = tuple[float, ...] | None


def primvar_rows(context: Context, prim: Any, name: str) -> tuple[np.ndarray, str] | None:
    """The values of a primvar of a prim or an ancestor as rows, and their interpolation."""
    context.asked.add(name)
    if name in context.overrides:
        return context.overrides[name], "constant"
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    flat = _flattened(primvar, context.time_of(primvar.GetAttr()))
    for other in (Usd.TimeCode.Default(), Usd.TimeCode.EarliestTime()):
        flat = _flattened(primvar, other) if flat is None else flat
    if flat is None and context.value(primvar.GetAttr()) is None:
        return None
    if flat is None:
        context.remark(f"{prim.GetPath()}: the indices of the primvar {name} do not fit its values")
        return None
    rows = np.array(flat)
    if rows.dtype.kind not in "bfiu":
        return None
    rows = rows.astype(np.float64)
    count = len(flat) if primvar.GetTypeName().isArray else 1
    return rows.reshape(count, -1 if rows.size else 1), str(primvar.GetInterpolation())


def _flattened(primvar: Any, time: Any) -> Any:
    """The values of a primvar; `None` if they or their indices are missing."""
    try:
        return primvar.ComputeFlattened(time)
    except Tf.ErrorException:
        return None


def is_varying(found: tuple[np.ndarray, str] | None) -> bool:
    """True for a primvar that is more than one value for the whole prim."""
    return found is not None and found[1] != "constant" and len(found[0]) > 1


def first_row(found: tuple[np.ndarray, str] | None, width: int) -> tuple[float, ...] | None:
    """The first value of a primvar, if it has at least that many columns."""
    if found is None or len(found[0]) == 0 or found[0].shape[1] < width:
        return None
    return tuple(float(x) for x in found[0][0, :width])


def primvar_state(context: Context, prim: Any, name: str) -> State:
    """What a material sees of a primvar."""
    found = primvar_rows(context, prim, name)
    if found is None or len(found[0]) == 0:
        return None
    return () if is_varying(found) else tuple(float(x) for x in found[0][0])
