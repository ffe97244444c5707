"""The materials of prims."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade

from ._context import Context, color_form
from ._materials import material

__all__ = ["display_color", "display_material", "is_bound", "material_of"]


def is_bound(prim: Any) -> bool:
    """True if a material is bound to a prim or an ancestor."""
    found, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return bool(found)


def material_of(context: Context, prim: Any) -> int:
    """The number of the bound material, or of one that shows the display colour."""
    found, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    if found:
        return material(context, found.GetPrim(), prim)
    colors = display_color(context, prim)
    if colors is None or len(colors) == 0:
        return display_material(context, (0.18, 0.18, 0.18))
    if len(colors) == 1:
        return display_material(context, colors[0])
    number = context.add_material(
        {"base_color": color_form((1, 1, 1))}, "displayColor", key=("display", "vertices")
    )
    context.vertex_colors[number] = "displayColor"
    return number


def display_material(context: Context, color: Any) -> int:
    """The number of a material of one colour."""
    factor = tuple(float(x) for x in color)
    return context.add_material(
        {"base_color": color_form(factor)}, "displayColor", key=("display", factor)
    )


def display_color(context: Context, prim: Any) -> np.ndarray | None:
    """The display colours of a prim."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
    if not primvar or not primvar.HasValue():
        return None
    value = primvar.ComputeFlattened(context.time)
    value = primvar.ComputeFlattened() if value is None else value
    return None if value is None else np.array(value, dtype=np.float64).reshape(-1, 3)
