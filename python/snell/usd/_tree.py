"""The tree of a stage as nodes; instances are created once."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from pxr import Gf, Tf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade, UsdSkel

from ._bindings import bound_materials
from ._cameras import camera
from ._context import Context, rows
from ._curves import curves
from ._files import StageError, cause
from ._lights import light, mesh_light
from ._meshes import mesh
from ._primvars import is_varying, primvar_rows
from ._shapes import points, shape

__all__ = ["document"]

_T = TypeVar("_T")
#: Maximum number of different values of a primvar that the instances of one prim have.
_MOST_VALUES = 1000


def document(context: Context, name: str) -> str:
    """The text of a `.snell` file for a stage."""
    _pose(context)
    context.nodes[0]["transform"] = rows(context.world)
    root = context.motion.add_joint("stage", None, 0, rows(context.world))
    context.nodes[0]["children"] = _children(
        context, context.stage.GetPseudoRoot(), context.world, root
    )
    settings = _settings(context)
    form = {
        "format": "snell scene",
        "version": 1,
        "name": context.stage.GetRootLayer().GetDisplayName() or name,
        "settings": settings,
        "environment": context.environment,
        "cameras": context.cameras,
        "lights": context.lights,
        "materials": context.materials,
        "textures": context.textures,
        "images": context.images,
        "root": 0,
        "nodes": context.nodes,
        "meshes": context.meshes,
        "curves": context.curves,
        **context.motion.form(),
    }
    try:
        return json.dumps(form, allow_nan=False)
    except ValueError as error:
        raise StageError(
            "a number of what moves or of the sky is infinite or none at all; write them as the "
            "schema says"
        ) from error


def _settings(context: Context) -> dict[str, Any]:
    """The scene's settings: the up axis, and from the stage's render settings the size of the
    picture and the camera, which becomes the first.
    """
    settings: dict[str, Any] = {
        "up": [0.0, 0.0, 1.0] if UsdGeom.GetStageUpAxis(context.stage) == "Z" else [0.0, 1.0, 0.0]
    }
    asked = UsdRender.Settings.GetStageRenderSettings(context.stage)
    if asked:
        _follow_render_settings(context, asked, settings)
    if context.exposures and context.exposures[0] != 1:
        settings["imaging_ratio"] = context.exposures[0]
    if len(set(context.exposures)) > 1:
        context.remark("the exposures of the cameras differ; that of the first counts for all")
    return settings


def _follow_render_settings(context: Context, asked: Any, settings: dict[str, Any]) -> None:
    """Takes the size of the picture and the first camera from the stage's render settings."""
    size = (
        context.value(asked.GetResolutionAttr())
        if asked.GetResolutionAttr().HasAuthoredValue()
        else None
    )
    if size is not None and min(size) > 0:
        settings["size"] = [int(x) for x in size]
    for path in asked.GetCameraRel().GetForwardedTargets()[:1]:
        if (number := context.known.get(("camera", str(path)))) is not None:
            context.cameras.insert(0, context.cameras.pop(number))
            context.exposures.insert(0, context.exposures.pop(number))
            place = lambda i: 0 if i == number else i + (i < number)  # noqa: E731
            context.motion.cameras = [
                (place(camera), joint) for camera, joint in context.motion.cameras
            ]


def _pose(context: Context) -> None:
    """Skins and blend shapes as points of meshes, in a layer that is not part of the file."""
    stage = context.stage
    roots = [
        prim for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsA(UsdSkel.Root)
    ]
    if not roots:
        return
    stage.SetEditTarget(stage.GetSessionLayer())
    interval = _samples_around(context)
    for root in roots:
        if root.IsInstanceProxy():
            context.remark(f"{root.GetPath()}: skins of instances are shown in their rest pose")
        else:
            UsdSkel.BakeSkinning(Usd.PrimRange(root), interval)


def _samples_around(context: Context) -> Any:
    """The interval of time codes whose poses are needed at the time of this reading."""
    time = context.time.GetValue() if context.time.IsNumeric() else 0.0
    found = [time]
    for prim in context.stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdSkel.Animation):
            for attribute in prim.GetAttributes():
                found += attribute.GetBracketingTimeSamples(time)
    return Gf.Interval(min(found), max(found))


def _children(context: Context, prim: Any, world: np.ndarray, joint: int) -> list[int]:
    # Prototypes may lie in classes, or below prims that nothing defines.
    predicate = Usd.PrimIsActive & Usd.PrimIsLoaded
    if prim.IsPseudoRoot() or prim.IsDefined():
        predicate &= Usd.PrimIsDefined
    if not prim.IsAbstract():
        predicate &= ~Usd.PrimIsAbstract
    below = prim.GetFilteredChildren(Usd.TraverseInstanceProxies(predicate))
    found = [_node(context, child, world, joint) for child in below]
    return [number for number in found if number is not None]


def _node(context: Context, prim: Any, parent: np.ndarray, joint: int) -> int | None:
    """The node of a prim and of everything below it. Values of a type other than the schema's are
    errors with the prim's path.
    """
    try:
        return _node_of(context, prim, parent, joint)
    except StageError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise StageError(
            f"at {prim.GetPath()}: its values cannot be used: {error}; write them as the schema "
            "says"
        ) from error


def _node_of(context: Context, prim: Any, parent: np.ndarray, joint: int) -> int | None:
    imageable = UsdGeom.Imageable(prim)
    if imageable:
        if context.value(imageable.GetVisibilityAttr()) == "invisible":
            return None
        if imageable.ComputePurpose() in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide):
            return None
    _tell_of_draw_modes(context, prim)
    local, resets = np.eye(4), False
    if UsdGeom.Xformable(prim):
        matrix, resets = context.xforms.GetLocalTransformation(prim)
        if context.time.IsDefault() and _has_samples_only(context, prim):
            matrix = UsdGeom.Xformable(prim).GetLocalTransformation(Usd.TimeCode.EarliestTime())
        # USD has row vectors.
        local = np.array(matrix, dtype=np.float64).reshape(4, 4).T
        if resets:
            local = np.linalg.pinv(parent) @ context.world @ local
    world = parent @ local
    node: dict[str, Any] = {"name": prim.GetName()}
    if not np.array_equal(local, np.eye(4)):
        node["transform"] = rows(local)
    before = _sizes(context)
    number = context.add_node(node)
    joint = context.motion.add_joint(prim.GetName(), joint, number, rows(local))
    if not resets:
        context.motion.follow(
            prim, joint, lambda matrix: rows(np.array(matrix, dtype=np.float64).reshape(4, 4).T)
        )
    cameras, lights = len(context.cameras), len(context.lights)
    surfaces, below = _usable_content(context, prim, world, joint)
    context.motion.cameras += [(i, joint) for i in range(cameras, len(context.cameras))]
    context.motion.lights += [(i, joint) for i in range(lights, len(context.lights))]
    _check_finite(context, before)
    if surfaces:
        node["surfaces"] = surfaces
    if not prim.IsA(UsdGeom.PointInstancer):
        below += _shared_children(context, prim, world, joint)
    if below:
        node["children"] = below
    return number


def _has_samples_only(context: Context, prim: Any) -> bool:
    """True for a transform that has values at some times, and no default."""
    return any(
        context.time_of(operation.GetAttr()) != context.time
        for operation in UsdGeom.Xformable(prim).GetOrderedXformOps()
        if operation.GetAttr()
    )


def _tell_of_draw_modes(context: Context, prim: Any) -> None:
    """A remark on a model that is to be drawn as cards, or as its bounds."""
    if not prim.IsModel():
        return
    model = UsdGeom.ModelAPI(prim)
    mode = str(context.value(model.GetModelDrawModeAttr(), "inherited"))
    if mode not in ("inherited", "default"):
        context.remark(f"{prim.GetPath()}: the draw mode {mode} is left out; the model is shown")


def _sizes(context: Context) -> list[tuple[list[Any], int]]:
    return [
        (part, len(part))
        for part in (context.nodes, context.materials, context.lights, context.cameras)
    ]


def _check_finite(context: Context, before: list[tuple[list[Any], int]]) -> None:
    """Raises an error if an added number is not finite, because no file can hold it."""
    try:
        json.dumps(
            [part[size:] for part, size in before]
            + [context.environment and context.environment.get("constant")],
            allow_nan=False,
        )
    except ValueError as error:
        raise ValueError("a number is infinite or none at all") from error


def _shared_children(context: Context, prim: Any, world: np.ndarray, joint: int) -> list[int]:
    """The nodes below a prim. The nodes of a prototype are created once for all instances."""
    if not prim.IsInstance():
        return _children(context, prim, world, joint)
    key = ("prototype", str(prim.GetPrototype().GetPath()), _inherited(context, prim))
    if key not in context.known:
        before = _placed_in_the_world(context)
        below, asked = _with_names(context, lambda: _children(context, prim, world, joint))
        if before != _placed_in_the_world(context):
            return below
        context.known[key] = below, asked
    below, asked = context.known[key]
    context.asked |= asked
    return list(below)


def _with_names(context: Context, make: Callable[[], _T]) -> tuple[_T, set[str]]:
    """What a function makes, and the names of the primvars that it looks for."""
    before, context.asked = context.asked, set()
    made, asked = make(), context.asked
    context.asked = before | asked
    return made, asked


def _inherited(context: Context, prim: Any) -> tuple[Any, ...]:
    """What the inside of an instance takes from the instance and from above it: the material, the
    purpose, and primvars.
    """
    primvars = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
    above = prim
    while above and not above.IsPseudoRoot():
        if _has_collections(above):
            # Such a binding names the parts inside by their paths, which differ by instance.
            return (str(prim.GetPath()),)
        above = above.GetParent()
    values = [
        (str(primvar.GetPrimvarName()), str(context.value(primvar.GetAttr())))
        for primvar in primvars
        if primvar.GetInterpolation() == "constant"
    ]
    materials = tuple(
        (
            str(material.GetPath()),
            str(UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(binding)),
        )
        for material, binding in bound_materials(prim)
    )
    purpose = str(UsdGeom.Imageable(prim).ComputePurpose()) if UsdGeom.Imageable(prim) else ""
    return (materials, purpose, tuple(sorted(values)), _overrides(context))


def _has_collections(prim: Any) -> bool:
    """True if a prim binds materials to collections."""
    return any(
        UsdShade.MaterialBindingAPI(prim).GetCollectionBindingRels(purpose)
        for purpose in (
            UsdShade.Tokens.allPurpose,
            UsdShade.Tokens.full,
            UsdShade.Tokens.preview,
        )
    )


def _placed_in_the_world(context: Context) -> tuple[int, int, bool]:
    """The numbers of lights and cameras so far, and whether the scene still lacks an environment.
    All of these are in world space, so they are created for every instance.
    """
    return len(context.lights), len(context.cameras), context.environment is None


def _usable_content(
    context: Context, prim: Any, world: np.ndarray, joint: int
) -> tuple[list[Any], list[int]]:
    """What a prim shows. A prim with values of another type than the schema's shows nothing."""
    try:
        return _content(context, prim, world, joint)
    except StageError:
        raise
    except Tf.ErrorException as error:
        problem = cause(error)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        problem = str(error)
    context.remark(
        f"at {prim.GetPath()}: its values cannot be used: {problem}; it is left out; write them as "
        "the schema says"
    )
    return [], []


def _content(
    context: Context, prim: Any, world: np.ndarray, joint: int
) -> tuple[list[Any], list[int]]:
    """The surfaces of a prim itself, and further nodes that it needs."""
    is_light = prim.HasAPI(UsdLux.LightAPI)
    if prim.IsA(UsdGeom.Mesh):
        return mesh_light(context, prim, world) if is_light else mesh(context, prim), []
    if prim.IsA(UsdGeom.TetMesh) or prim.IsA(UsdGeom.NurbsPatch):
        return mesh(context, prim), []
    if prim.IsA(UsdGeom.Cube) and _varies(context, prim):
        return mesh(context, prim), []
    if prim.IsA(UsdGeom.PointInstancer):
        return [], _point_instancer(context, prim, world, joint)
    if prim.IsA(UsdGeom.Curves):
        return curves(context, prim), []
    if prim.IsA(UsdGeom.Points):
        return [], points(context, prim)
    if prim.IsA(UsdGeom.Camera):
        camera(context, prim, world)
        return [], []
    if prim.IsA(UsdGeom.Gprim):
        if _varies(context, prim):
            context.remark(
                f"{prim.GetPath()}: its colour or opacity varies; the first value is shown"
            )
        return [], shape(context, prim)
    return [], light(context, prim, world) if is_light else []


def _varies(context: Context, prim: Any) -> bool:
    """True if the colour or the opacity of a shape is not the same everywhere."""
    return any(
        is_varying(primvar_rows(context, prim, name)) for name in ("displayColor", "displayOpacity")
    )


def _point_instancer(context: Context, prim: Any, world: np.ndarray, joint: int) -> list[int]:
    instancer = UsdGeom.PointInstancer(prim)
    targets = [
        context.stage.GetPrimAtPath(path)
        for path in instancer.GetPrototypesRel().GetForwardedTargets()
    ]
    indices = context.value(instancer.GetProtoIndicesAttr(), [])
    transforms = instancer.ComputeInstanceTransformsAtTime(
        context.time, context.time, instancer.ExcludeProtoXform
    )
    if len(transforms) == 0 and len(indices) > 0:
        context.remark(f"{prim.GetPath()}: the instances could not be placed and are left out")
    # Masked instances are left out of the transforms, but not of the indices.
    mask = instancer.ComputeMaskAtTime(context.time)
    numbers = list(range(len(indices)))
    if len(mask) == len(indices):
        numbers = [number for number in numbers if mask[number]]
    values = _values_of_instances(context, prim, len(indices))
    names: dict[int, list[str]] = {}
    made: dict[Any, int | None] = {}
    found = []
    for number, matrix in zip(numbers, transforms, strict=False):
        index = indices[number]
        if not 0 <= index < len(targets) or not targets[index]:
            continue
        make = functools.partial(_prototype, context, targets[index], world, joint)
        if index not in names:
            made[index,], asked = _with_names(context, make)
            names[index] = [
                name
                for name in sorted(asked & set(values))
                if _has_few_values(context, prim, name, values[name])
            ]
        own = {name: values[name][number : number + 1] for name in names[index]}
        key = (index, *(value.tobytes() for value in own.values()))
        if key not in made:
            before, context.overrides = context.overrides, {**context.overrides, **own}
            made[key] = make()
            context.overrides = before
        if (prototype := made[key]) is not None:
            place = np.array(matrix, dtype=np.float64).reshape(4, 4).T
            found.append(context.add_node({"transform": rows(place), "children": [prototype]}))
    return found


def _prototype(context: Context, prim: Any, world: np.ndarray, joint: int) -> int | None:
    """The node of a prototype of a point instancer. It is made once for all instancers that show it
    with the same primvars of their instances.
    """
    path = str(prim.GetPath())
    key = lambda asked: ("instanced", path, _overrides(context, asked))  # noqa: E731
    asked = context.known.get(("asked", path))
    if asked is not None and key(asked) in context.known:
        context.asked |= asked
        known: int | None = context.known[key(asked)]
        return known
    before = _placed_in_the_world(context)
    node, asked = _with_names(context, lambda: _node(context, prim, world, joint))
    if before == _placed_in_the_world(context):
        context.known["asked", path] = asked
        context.known[key(asked)] = node
    return node


def _overrides(context: Context, names: set[str] | None = None) -> tuple[tuple[str, bytes], ...]:
    """The values of one instance that take the place of primvars, all or those of these names."""
    return tuple(
        sorted(
            (name, rows.tobytes())
            for name, rows in context.overrides.items()
            if names is None or name in names
        )
    )


def _values_of_instances(context: Context, prim: Any, count: int) -> dict[str, np.ndarray]:
    """The primvars of a point instancer that have a value for each instance. They count instead of
    those of the prototypes.
    """
    found = {}
    for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithValues():
        if primvar.GetInterpolation() != "constant":
            name = str(primvar.GetPrimvarName())
            given = primvar_rows(context, prim, name)
            if given is not None and len(given[0]) >= count:
                found[name] = given[0]
    return found


def _has_few_values(context: Context, prim: Any, name: str, rows: np.ndarray) -> bool:
    """True unless a primvar of instances has so many values that each would be a prototype."""
    if len(np.unique(rows, axis=0)) <= _MOST_VALUES:
        return True
    context.remark(
        f"{prim.GetPath()}: the primvar {name} has more than {_MOST_VALUES} values for instances "
        "and is left out"
    )
    return False
