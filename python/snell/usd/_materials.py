"""Materials: UsdPreviewSurface, and standard surface and OpenPBR as MaterialX networks; all become
OpenPBR surfaces.
"""

from __future__ import annotations

import math
from typing import Any

from pxr import UsdShade

from ._context import Context, scalar_form
from ._networks import Network, kind_of
from ._primvars import State, primvar_state

__all__ = ["material"]

#: Inputs of surfaces that change nothing here, have a remark of their own, or are written by common
#: programs though no surface has them (`specular` of the preview surface).
_NOT_NEEDED = {"occlusion", "displacement", "opacityMode", "specularColor", "specular"}


def material(context: Context, prim: Any, user: Any, tile: int | None = None) -> int | None:
    """The number of a material as the prim `user` shows it: constant primvars that the material
    reads are those of the prim. `tile` is the tile of its pictures, counted from 0. `None` for a
    material without a surface that is known.
    """
    source = context.source(prim)
    names = context.known.get(("primvars", source))
    if names is not None:
        known = ("material", source, _states(context, user, names), tile)
        if known in context.known:
            return _number(context.known[known])
    given = UsdShade.Material(prim)
    found, others = None, []
    for render_context in ("", "mtlx"):
        shader, _, _ = given.ComputeSurfaceSource(render_context)
        if shader and kind_of(shader) in _READERS:
            found = shader
            break
        if shader:
            others.append(kind_of(shader) or "one of its own code")
    number = None
    names = ()
    if found is None:
        context.remark(
            f"{prim.GetPath()}: no surface of a kind that is known"
            + (f" ({', '.join(dict.fromkeys(others))})" if others else "")
            + "; it is left out"
        )
    else:
        net = Network(context, found, user, tile)
        number = _READERS[kind_of(found)](context, net, prim.GetName())
        context.needs[number] = net.needs
        names = tuple(sorted(net.primvars))
        _tell_what_is_left_out(context, given)
        if missed := sorted(set(net.left_out()) - _NOT_NEEDED):
            context.remark(f"{found.GetPath()}: left out: {', '.join(missed)}")
    context.known["primvars", source] = names
    context.known["material", source, _states(context, user, names), tile] = number
    return number


def _number(known: Any) -> int | None:
    return None if known is None else int(known)


def _states(context: Context, user: Any, names: tuple[str, ...]) -> tuple[State, ...]:
    return tuple(primvar_state(context, user, name) for name in names)


def _tell_what_is_left_out(context: Context, given: Any) -> None:
    for what in ("displacement", "volume"):
        compute = given.ComputeDisplacementSource, given.ComputeVolumeSource
        for render_context in ("", "mtlx"):
            shader, _, _ = compute[what == "volume"](render_context)
            # The usual surface has an output of displacement, which is nothing without its input.
            if shader and not (
                kind_of(shader).endswith("UsdPreviewSurface") and not _is_connected(shader)
            ):
                context.remark(f"{given.GetPath()}: the {what} of the material is left out")
                return


def _is_connected(shader: Any) -> bool:
    given = shader.GetInput("displacement")
    return bool(given) and (given.HasConnectedSource() or bool(given.Get()))


def _preview_surface(context: Context, net: Network, name: str) -> int:
    surface: dict[str, Any] = {
        "base_color": net.color("diffuseColor", (0.18, 0.18, 0.18), may_be_primvar=True),
        "base_metalness": net.scalar("metallic", 0.0),
        "specular_roughness": net.scalar("roughness", 0.5),
        "specular_ior": net.scalar("ior", 1.5),
        "coat_weight": net.scalar("clearcoat", 0.0),
        "coat_roughness": net.scalar("clearcoatRoughness", 0.01),
        "coat_ior": scalar_form(1.5),
        "coat_darkening": scalar_form(0.0),
    }
    if int(net.constant("useSpecularWorkflow", 0)) == 1:
        specular = net.color("specularColor", (0, 0, 0))
        strength = max(specular["factor"])
        # Reflectances that only metals have are treated as metal.
        if (
            strength > 0.25
            and specular["texture"] is None
            and strength > max(surface["base_color"]["factor"])
        ):
            surface["base_color"], surface["base_metalness"] = specular, scalar_form(1.0)
        else:
            root = math.sqrt(min(max(strength, 0.0), 0.9))
            surface["specular_ior"] = (
                scalar_form((1 + root) / (1 - root)) if strength > 0 else scalar_form(1.5)
            )
            surface["specular_weight"] = scalar_form(1.0 if strength > 0 else 0.0)
            surface["specular_color"] = _scaled(specular, 1 / strength if strength > 0 else 0.0)
            surface["base_metalness"] = scalar_form(0.0)
    alpha = net.scalar("opacity", 1.0, may_be_primvar=True)
    threshold = float(net.constant("opacityThreshold", 0.0))
    more: dict[str, Any] = {"alpha": alpha, "normal_map": net.normal_map("normal")}
    if threshold > 0:
        more["alpha_mode"] = {"mask": threshold}
    elif alpha["texture"] is not None or alpha["factor"] < 1 or net.opacity_primvar:
        more["alpha_mode"] = "blend"
    return context.add_material(surface, name, **more, **_emission(net, "emissiveColor", surface))


def _emission(net: Network, name: str, surface: dict[str, Any]) -> dict[str, Any]:
    """The emission of a surface. It may be a primvar that varies if that is the base colour too, or
    the base is black.
    """
    primvar = net.varying(name)
    is_black = not any(surface["base_color"]["factor"]) and net.color_primvar is None
    may_be_primvar = primvar is not None and (primvar == net.color_primvar or is_black)
    return {
        "emission": net.color(name, (0, 0, 0), may_be_primvar=may_be_primvar),
        "emission_takes_vertex_color": may_be_primvar,
    }


def _finish(
    context: Context,
    net: Network,
    name: str,
    surface: dict[str, Any],
    opacity: dict[str, Any],
    emission: dict[str, Any],
    normal: str,
) -> int:
    more: dict[str, Any] = {
        "emission": emission,
        "alpha": opacity,
        "normal_map": net.normal_map(normal),
    }
    if opacity["texture"] is not None or opacity["factor"] < 1 or net.opacity_primvar:
        more["alpha_mode"] = "blend"
    return context.add_material(surface, name, **more)


def _scaled(color: dict[str, Any], factor: float) -> dict[str, Any]:
    return {**color, "factor": [x * factor for x in color["factor"]]}


def _standard_surface(context: Context, net: Network, name: str) -> int:
    surface = {
        "base_weight": net.scalar("base", 1.0),
        "base_color": net.color("base_color", (0.8, 0.8, 0.8), may_be_primvar=True),
        "base_diffuse_roughness": net.scalar("diffuse_roughness", 0.0),
        "base_metalness": net.scalar("metalness", 0.0),
        "specular_weight": net.scalar("specular", 1.0),
        "specular_color": net.color("specular_color", (1, 1, 1)),
        "specular_roughness": net.scalar("specular_roughness", 0.2),
        "specular_ior": net.scalar("specular_IOR", 1.5),
        "specular_roughness_anisotropy": net.scalar("specular_anisotropy", 0.0),
        "transmission_weight": net.scalar("transmission", 0.0),
        "transmission_color": net.color("transmission_color", (1, 1, 1)),
        "transmission_depth": net.scalar("transmission_depth", 0.0),
        "transmission_scatter": net.color("transmission_scatter", (0, 0, 0)),
        "transmission_scatter_anisotropy": net.scalar("transmission_scatter_anisotropy", 0.0),
        "subsurface_weight": net.scalar("subsurface", 0.0),
        "subsurface_color": net.color("subsurface_color", (1, 1, 1)),
        "subsurface_radius": net.scalar("subsurface_scale", 1.0),
        "subsurface_radius_scale": net.color("subsurface_radius", (1, 1, 1)),
        "fuzz_weight": net.scalar("sheen", 0.0),
        "fuzz_color": net.color("sheen_color", (1, 1, 1)),
        "fuzz_roughness": net.scalar("sheen_roughness", 0.3),
        "coat_weight": net.scalar("coat", 0.0),
        "coat_color": net.color("coat_color", (1, 1, 1)),
        "coat_roughness": net.scalar("coat_roughness", 0.1),
        "coat_ior": net.scalar("coat_IOR", 1.5),
        "coat_darkening": scalar_form(0.0),
        "geometry_thin_walled": bool(net.constant("thin_walled", False)),
    }
    thickness = net.scalar("thin_film_thickness", 0.0)
    if thickness["factor"] > 0:
        surface["thin_film_weight"] = scalar_form(1.0)
        # Nanometres to micrometres.
        surface["thin_film_thickness"] = {**thickness, "factor": thickness["factor"] * 1e-3}
        surface["thin_film_ior"] = net.scalar("thin_film_IOR", 1.5)
    emission = _scaled(
        net.color("emission_color", (1, 1, 1)), net.scalar("emission", 0.0)["factor"]
    )
    opacity = net.color("opacity", (1, 1, 1))
    channel = (opacity["texture"], 0) if opacity["texture"] is not None else None
    alpha = scalar_form(sum(opacity["factor"]) / 3, channel)
    return _finish(context, net, name, surface, alpha, emission, "normal")


_OPEN_PBR_COLORS = {
    "base_color": (0.8, 0.8, 0.8),
    "specular_color": (1, 1, 1),
    "transmission_color": (1, 1, 1),
    "transmission_scatter": (0, 0, 0),
    "subsurface_color": (0.8, 0.8, 0.8),
    "subsurface_radius_scale": (1, 0.5, 0.25),
    "coat_color": (1, 1, 1),
    "fuzz_color": (1, 1, 1),
}
_OPEN_PBR_SCALARS = {
    "base_weight": 1.0,
    "base_diffuse_roughness": 0.0,
    "base_metalness": 0.0,
    "specular_weight": 1.0,
    "specular_roughness": 0.3,
    "specular_roughness_anisotropy": 0.0,
    "specular_ior": 1.5,
    "transmission_weight": 0.0,
    "transmission_depth": 0.0,
    "transmission_scatter_anisotropy": 0.0,
    "transmission_dispersion_scale": 0.0,
    "transmission_dispersion_abbe_number": 20.0,
    "subsurface_weight": 0.0,
    "subsurface_radius": 1.0,
    "subsurface_scatter_anisotropy": 0.0,
    "coat_weight": 0.0,
    "coat_roughness": 0.0,
    "coat_roughness_anisotropy": 0.0,
    "coat_ior": 1.6,
    "coat_darkening": 1.0,
    "fuzz_weight": 0.0,
    "fuzz_roughness": 0.5,
    "thin_film_weight": 0.0,
    "thin_film_thickness": 0.5,
    "thin_film_ior": 1.4,
}


def _open_pbr(context: Context, net: Network, name: str) -> int:
    surface: dict[str, Any] = {
        key: net.color(key, default, may_be_primvar=key == "base_color")
        for key, default in _OPEN_PBR_COLORS.items()
    }
    surface.update({key: net.scalar(key, default) for key, default in _OPEN_PBR_SCALARS.items()})
    surface["geometry_thin_walled"] = bool(net.constant("geometry_thin_walled", False))
    emission = _scaled(
        net.color("emission_color", (1, 1, 1)), net.scalar("emission_luminance", 0.0)["factor"]
    )
    return _finish(
        context,
        net,
        name,
        surface,
        net.scalar("geometry_opacity", 1.0),
        emission,
        "geometry_normal",
    )


_READERS = {
    "UsdPreviewSurface": _preview_surface,
    "ND_UsdPreviewSurface_surfaceshader": _preview_surface,
    "ND_standard_surface_surfaceshader": _standard_surface,
    "ND_open_pbr_surface_surfaceshader": _open_pbr,
}
