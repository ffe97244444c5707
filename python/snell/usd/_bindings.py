"""The materials of prims."""

from __future__ import annotations

from typing import Any

from pxr import UsdShade

from ._context import Context, Needs, color_form, scalar_form
from ._materials import material
from ._primvars import first_row, is_varying, primvar_rows

__all__ = ["bound_materials", "display_material", "material_of"]

#: The colour of surfaces that have none.
_GREY = (0.18, 0.18, 0.18)


def bound_materials(prim: Any) -> list[tuple[Any, Any]]:
    """The materials that are bound to a prim or an ancestor, and their bindings: that for final
    pictures, and that for previews if it is another one.
    """
    found: list[tuple[Any, Any]] = []
    for purpose in (UsdShade.Tokens.full, UsdShade.Tokens.preview):
        material, binding = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)
        if material and all(material.GetPath() != other.GetPath() for other, _ in found):
            found.append((material, binding))
    return found


def material_of(
    context: Context, prim: Any, *, tile: int | None = None, is_mesh: bool = False
) -> int:
    """The number of the bound material, or of one that shows the display colour. `tile` selects
    the picture of a set that is named by tiles. Colours that vary are those of the first value,
    unless `is_mesh`.
    """
    for found, _ in bound_materials(prim):
        number = material(context, found.GetPrim(), prim, tile)
        if number is not None:
            return number
    color = primvar_rows(context, prim, "displayColor")
    opacity = primvar_rows(context, prim, "displayOpacity")
    varies = is_mesh and is_varying(color), is_mesh and is_varying(opacity)
    factor = None if varies[0] else first_row(color, 3)
    alpha = None if varies[1] else first_row(opacity, 1)
    return display_material(
        context,
        (1.0, 1.0, 1.0) if varies[0] else factor or _GREY,
        alpha[0] if alpha else 1.0,
        varies,
    )


def display_material(
    context: Context, color: Any, alpha: float, varies: tuple[bool, bool] = (False, False)
) -> int:
    """The number of a material of one colour and opacity. `varies` says which of them is
    multiplied by that of the vertices.
    """
    factor, alpha = tuple(float(x) for x in color), min(max(float(alpha), 0.0), 1.0)
    number = context.add_material(
        {"base_color": color_form(factor)},
        "displayColor",
        key=("display", factor, alpha, varies),
        alpha=scalar_form(alpha),
        alpha_mode="blend" if alpha < 1 or varies[1] else "opaque",
    )
    if any(varies):
        context.needs[number] = Needs(
            "displayColor" if varies[0] else None, "displayOpacity" if varies[1] else None
        )
    return number
