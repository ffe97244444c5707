"""Lights of UsdLux."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdLux

from ._context import Context, color_form, direction, rows
from ._meshes import mesh, triangles_of
from ._shapes import from_y

__all__ = ["light", "mesh_light"]

#: Rectangles and disks of USD emit along -z, and those of Snell along z.
_TURNED = np.diag([-1.0, 1.0, -1.0, 1.0])


def light(context: Context, prim: Any, world: np.ndarray) -> list[int]:
    """Adds a light. A light with an area becomes a node, whose number is returned."""
    kind = str(prim.GetPrimTypeInfo().GetSchemaTypeName())
    color, is_normalized = _color(context, prim), _is_normalized(context, prim)
    if _is_of_blender(prim):
        color, is_normalized = _as_blender(context, prim, kind, color, is_normalized)
    _tell_what_is_left_out(context, prim)
    if kind.startswith("DomeLight"):
        _dome(context, prim, world, color)
        return []
    if kind == "DistantLight":
        _distant(context, prim, world, color, is_normalized)
        return []
    cone = context.value(_attribute(prim, "shaping:cone:angle"), None)
    if kind == "SphereLight" and (
        _radius(context, prim) <= 0
        or context.value(prim.GetAttribute("treatAsPoint"), False)
        or cone is not None
    ):
        _point(context, prim, world, color, is_normalized, cone)
        return []
    found = _area_light(
        context, prim, kind, [float(np.linalg.norm(world[:3, i])) / context.scale for i in range(3)]
    )
    if found is None:
        context.remark(f"{prim.GetPath()}: {kind} is not supported and was left out")
        return []
    shape, transform, area = found
    if cone is not None and cone < 90:
        context.remark(f"{prim.GetPath()}: the cone of a light with an area is left out")
    if float(context.value(_attribute(prim, "shaping:focus"), 0.0)) != 0.0:
        context.remark(f"{prim.GetPath()}: the focus of a light with an area is left out")
    radiance = color / area if is_normalized and area > 0 else color
    emission = color_form(radiance, _picture(context, prim))
    material = context.add_material(
        {},
        prim.GetName(),
        kind={"material": "black"},
        emission=emission,
        emits_on_both_sides=False,
        double_sided=False,
    )
    return [context.add_shape(shape, material, transform)]


def mesh_light(context: Context, prim: Any, world: np.ndarray) -> list[Any]:
    """The surfaces of a mesh that is a light. Its material emits the light, tinted by the emission
    that the material has itself.
    """
    radiance = _color(context, prim)
    if _is_normalized(context, prim):
        corners = triangles_of(context, prim) @ world[:3, :3].T / context.scale
        area = (
            np.linalg.norm(
                np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
            ).sum()
            / 2
        )
        radiance = radiance / area if area > 0 else radiance
    surfaces = mesh(context, prim)
    for surface in surfaces:
        lit = []
        for number in surface["materials"]:
            before = context.materials[number]
            glow = before["emission"]
            emission = (
                {**glow, "factor": [float(x) for x in radiance * glow["factor"]]}
                if any(glow["factor"])
                else color_form(radiance)
            )
            context.materials.append({**before, "emission": emission, "emits_on_both_sides": False})
            lit.append(len(context.materials) - 1)
        surface["materials"] = lit
    return surfaces


def _color(context: Context, prim: Any) -> np.ndarray:
    """The colour of a light times its intensity, exposure and colour temperature."""
    given = lambda name, default: context.value(_attribute(prim, name), default)  # noqa: E731
    strength = float(given("intensity", 1.0)) * 2.0 ** float(given("exposure", 0.0))
    color = np.array(given("color", (1, 1, 1)), dtype=np.float64) * strength
    if given("enableColorTemperature", False):
        kelvin = float(given("colorTemperature", 6500.0))
        # The colour of a black body, scaled to luminance 1.
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin), dtype=np.float64)
    return color


def _is_normalized(context: Context, prim: Any) -> bool:
    return bool(context.value(_attribute(prim, "normalize"), False))


def _attribute(prim: Any, name: str) -> Any:
    """An input of a light. Before version 21.02 of USD its name had no prefix."""
    given, old = prim.GetAttribute(f"inputs:{name}"), prim.GetAttribute(name)
    is_given = bool(given) and given.HasAuthoredValue()
    return old if not is_given and old and old.HasAuthoredValue() else given


def _is_of_blender(prim: Any) -> bool:
    """True for a light in a layer that Blender wrote."""
    layers = [spec.layer for spec in prim.GetPrimStack()]
    return bool(layers) and str(layers[-1].documentation).startswith("Blender v")


def _as_blender(
    context: Context, prim: Any, kind: str, color: np.ndarray, is_normalized: bool
) -> tuple[np.ndarray, bool]:
    """The colour of a light with the power that it has in Blender, and whether it is to be divided
    by the area, from `usd_writer_light.cc` there.
    """
    if kind == "DistantLight":
        if is_normalized:
            context.remark("a sun of Blender: its file has a quarter of the power, which is undone")
            return color * 4, True
        context.remark("a sun of Blender 3 or older: its intensity is taken as W/m²")
        return color, True
    if kind in ("SphereLight", "RectLight", "DiskLight") and not is_normalized:
        # Blender 3 wrote a hundredth of the power in watts, and later ones write normalized lights.
        context.remark("a light of Blender 3 or older: its intensity is taken as 100 W")
        return color * (100 / math.pi), True
    return color, is_normalized


def _radius(context: Context, prim: Any) -> float:
    return float(context.value(_attribute(prim, "radius"), 0.5))


def _tell_what_is_left_out(context: Context, prim: Any) -> None:
    for name in ("diffuse", "specular"):
        if float(context.value(_attribute(prim, name), 1.0)) != 1.0:
            context.remark(
                f"{prim.GetPath()}: the factor of a light for {name} surfaces is left out"
            )
    if context.value(_attribute(prim, "shaping:ies:file")):
        context.remark(f"{prim.GetPath()}: the IES profile of the light is left out")
    if context.value(_attribute(prim, "shadow:enable"), True) is False:
        context.remark(f"{prim.GetPath()}: the light casts shadows, which the file switches off")
    given = UsdLux.LightAPI(prim)
    for what, collection in (
        ("light", given.GetLightLinkCollectionAPI()),
        ("shadow", given.GetShadowLinkCollectionAPI()),
    ):
        if _selects(context, collection):
            context.remark(
                f"{prim.GetPath()}: the {what} linking is left out; the light counts for everything"
            )
    if prim.HasRelationship("light:filters") and prim.GetRelationship("light:filters").GetTargets():
        context.remark(f"{prim.GetPath()}: the filters of the light are left out")


def _selects(context: Context, collection: Any) -> bool:
    """True for a collection other than all prims."""
    return (
        context.value(collection.GetIncludeRootAttr(), True) is False
        or len(collection.GetIncludesRel().GetTargets()) > 0
        or len(collection.GetExcludesRel().GetTargets()) > 0
    )


def _distant(
    context: Context, prim: Any, world: np.ndarray, color: np.ndarray, is_normalized: bool
) -> None:
    angle = math.radians(float(context.value(_attribute(prim, "angle"), 0.53)))
    solid = math.pi * math.sin(min(angle, math.pi) / 2) ** 2
    irradiance = color if is_normalized or solid <= 0 else color * solid
    form = {
        "light": "directional",
        "direction": direction(-world[:3, 2]),
        "irradiance": [float(x) for x in irradiance],
    }
    context.lights.append(form)


def _area_light(
    context: Context, prim: Any, kind: str, scale: list[float]
) -> tuple[dict[str, Any], Any, float] | None:
    """The shape of a light, its rotation, and its area in the world, in units of the stage."""
    get = lambda name: float(context.value(_attribute(prim, name), 1.0))  # noqa: E731
    radius = _radius(context, prim)
    if kind == "SphereLight":
        return {"shape": "sphere", "radius": radius}, None, 4 * math.pi * (radius * scale[0]) ** 2
    if kind == "RectLight":
        width, height = get("width"), get("height")
        return (
            {"shape": "rectangle", "half_size": [width / 2, height / 2]},
            _TURNED,
            width * scale[0] * height * scale[1],
        )
    if kind == "DiskLight":
        return (
            {"shape": "disk", "radius": radius},
            _TURNED,
            math.pi * radius**2 * scale[0] * scale[1],
        )
    if kind == "CylinderLight":
        length = get("length")
        shape = {"shape": "cylinder", "radius": radius, "height": length, "caps": False}
        return shape, from_y("X"), 2 * math.pi * radius * length * scale[0] * scale[1]
    return None


def _picture(context: Context, prim: Any) -> int | None:
    """The texture of a rectangular light: its first row is at +y, and it is upright as seen from
    the emitting side.
    """
    file = _attribute(prim, "texture:file")
    asset = context.value(file)
    if prim.GetTypeName() != "RectLight" or not asset or not asset.path:
        return None
    return context.texture(
        context.image(asset, file), is_srgb=True, wrap=["clamp", "clamp"], uv_transform=np.eye(3)
    )


def _point(
    context: Context,
    prim: Any,
    world: np.ndarray,
    color: np.ndarray,
    is_normalized: bool,
    cone: float | None,
) -> None:
    """Adds a point or spot light in place of a sphere light. Its intensity is the radiance times
    the area of the visible disk.
    """
    radius = _radius(context, prim) * float(np.linalg.norm(world[:3, 0]))
    if is_normalized:
        # The radiance is the colour divided by the area of the sphere (in units of the stage),
        # which is four times that of the visible disk.
        intensity = color * context.scale**2 / 4
    else:
        intensity = color * math.pi * radius**2
        if radius <= 0:
            context.remark(
                f"{prim.GetPath()}: a light without a radius that is not normalized is dark"
            )
    form: dict[str, Any] = {
        "light": "point",
        "position": [float(x) for x in world[:3, 3]],
        "intensity": [float(x) for x in intensity],
    }
    focus = float(context.value(_attribute(prim, "shaping:focus"), 0.0))
    soft = float(context.value(_attribute(prim, "shaping:cone:softness"), 0.0))
    if focus > 0:
        outer = math.radians(min(float(cone if cone is not None else 90), 90))
        form["light"] = "spot"
        form["direction"] = direction(-world[:3, 2])
        form["falloff"] = {"falloff": "power", "cutoff": outer, "exponent": focus}
        if soft > 0:
            context.remark(f"{prim.GetPath()}: the soft edge of a light with a focus is left out")
    elif cone is not None and cone < 180:
        outer = math.radians(float(cone))
        form["light"] = "spot"
        form["direction"] = direction(-world[:3, 2])
        form["falloff"] = {
            "falloff": "smooth",
            "inner": outer * min(max(0.0, 1.0 - soft), 1.0),
            "outer": outer,
        }
    context.lights.append(form)


def _dome(context: Context, prim: Any, world: np.ndarray, color: np.ndarray) -> None:
    file = _attribute(prim, "texture:file")
    asset = context.value(file)
    layout = str(context.value(_attribute(prim, "texture:format"), "automatic"))
    if layout not in ("automatic", "latlong"):
        context.remark(
            f"{prim.GetPath()}: the layout {layout} of the picture of a dome is not supported; it "
            "is taken for latlong"
        )
    instead = "the light has the same colour everywhere"
    picture = context.picture(asset, file, instead) if asset and asset.path else None
    before = context.environment or {"constant": [0.0, 0.0, 0.0]}
    if picture is None and "constant" in before:
        context.environment = {"constant": [float(x) for x in color + before["constant"]]}
        return
    if picture is None or "image" in before or any(before["constant"]):
        context.remark(f"{prim.GetPath()}: of several dome lights, one with a picture is shown")
    if picture is None or "image" in before:
        return
    # The middle of the image is +z, and right of it is -x (OpenEXR); Snell has -z and +x.
    turn = np.diag([-1.0, 1.0, -1.0])
    pole = str(context.value(prim.GetAttribute("poleAxis"), "Y"))
    if pole == "Z" or (pole == "scene" and UsdGeom.GetStageUpAxis(context.stage) == "Z"):
        # The pole is z, so the picture is rotated from y up to z up.
        turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]) @ turn
    axes = world[:3, :3] / np.maximum(np.linalg.norm(world[:3, :3], axis=0), 1e-300)
    place = np.eye(4)
    place[:3, :3] = axes @ turn
    context.environment = {
        "image": {
            "image": picture,
            "scale": [float(x) for x in color],
            "world_from_environment": rows(place),
        }
    }
