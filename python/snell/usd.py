"""USD stages as scenes of Snell, by way of its text format.

Needs the official wheel ``usd-core`` (``pip install 'snell[usd]'``) and NumPy. As a program, ``python3 -m snell.usd IN OUT.snell`` writes the
scene of a stage; the command ``snell`` runs this file whenever it is given a ``.usd``, ``.usda``, ``.usdc`` or ``.usdz``, so it uses nothing
else of the package.

What is read: the composed stage (references, payloads, variants as they are chosen), instances and point instancers, meshes (polygons; those of
subdivision schemes with smooth normals), spheres, cubes, cylinders, cones, capsules and planes, curves as tubes, points as balls, cameras, the
lights of UsdLux, and materials: UsdPreviewSurface, and OpenPBR and standard surface as MaterialX networks. Units become metres, and the up axis
is that of the stage. What is left out is told.
"""

from __future__ import annotations

import base64
import json
import math
import sys
from typing import Any

import numpy as np

__all__ = ["EXTENSIONS", "convert", "load"]

#: Endings of files that this module reads.
EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")

_IDENTITY = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
#: Most balls that stand for points.
_MAX_POINTS = 100_000
#: Sides of the tubes that stand for curves, and pieces of each of their segments.
_SIDES, _PIECES = 6, 6


def load(path: Any, *, variants: dict[str, str] | None = None, time: float | None = None) -> Any:
    """The scene of a USD stage, as `snell.load` gives it for other files.

    Parameters
    ----------
    path : str or PathLike
        A ``.usd``, ``.usda``, ``.usdc`` or ``.usdz`` file.
    variants : dict, optional
        Variants to choose instead of those the file chooses: ``{"/Path/of/prim:set": "name"}``, or ``{"set": "name"}`` wherever there is
        such a set.
    time : float, optional
        Time code at which values that change are read; without it, the default values, or else those of the first sample.
    """
    import os
    import tempfile
    import warnings

    import snell

    path = os.fspath(path)
    text, remarks = convert(path, variants=variants, time=time)
    for remark in remarks:
        warnings.warn(remark, snell.SceneWarning, stacklevel=2)
    with tempfile.TemporaryDirectory() as folder:
        bridge = os.path.join(folder, "stage.snell")
        with open(bridge, "w", encoding="utf-8") as file:
            file.write(text)
        from snell import _snell

        return _snell.load(bridge)


def convert(path: str, *, variants: dict[str, str] | None = None, time: float | None = None) -> tuple[str, list[str]]:
    """The text of a ``.snell`` file for a stage, and remarks on what was left out."""
    try:
        from pxr import Usd
    except ImportError as error:
        raise ImportError("reading USD needs the package usd-core: pip install 'snell[usd]', or pip install usd-core") from error
    try:
        stage = Usd.Stage.Open(path)
    except Exception as error:
        # The first of the errors is the cause; what stands before the colon is where in the library.
        first = next((line.split(" : '", 1)[1] for line in str(error).splitlines() if " : '" in line), str(error))
        raise ValueError(f"{path}: not a USD stage that can be opened: {first.strip().rstrip(chr(39))}") from error
    _choose_variants(stage, variants or {})
    return _Converter(stage, time).text(path)


def _choose_variants(stage: Any, variants: dict[str, str]) -> None:
    for key, name in variants.items():
        prim_path, _, set_name = key.rpartition(":")
        prims = [stage.GetPrimAtPath(prim_path)] if prim_path else list(stage.Traverse())
        found = False
        for prim in prims:
            if prim and set_name in prim.GetVariantSets().GetNames():
                found |= bool(prim.GetVariantSets().GetVariantSet(set_name).SetVariantSelection(name))
        if not found:
            raise ValueError(f"there is no variant set {set_name!r}" + (f" on {prim_path}" if prim_path else ""))


def _numbers(array: Any, kind: Any) -> Any:
    """Many numbers as the format has them: base64 of their little-endian bytes."""
    flat = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<")).reshape(-1)
    return base64.b64encode(flat.tobytes()).decode("ascii")


def _rows(matrix: Any) -> list[list[float]]:
    """A matrix of USD, which has vectors as rows, as three rows of four numbers."""
    m = np.array(matrix, dtype=np.float64).reshape(4, 4).T
    return [[float(x) for x in row] for row in m[:3]]


def _color(factor: Any, texture: int | None = None) -> dict[str, Any]:
    r, g, b = (float(x) for x in factor)
    return {"factor": [r, g, b], "texture": texture, "spectrum": None}


def _scalar(factor: float, texture: tuple[int, int] | None = None) -> dict[str, Any]:
    return {"factor": float(factor), "texture": list(texture) if texture else None}


def _blackbody(kelvin: float) -> np.ndarray:
    """Linear colour of a black body with luminance 1 (UsdLux has the same function)."""
    from pxr import UsdLux

    return np.array(UsdLux.BlackbodyTemperatureAsRgb(float(kelvin)), dtype=np.float64)


class _Converter:
    def __init__(self, stage: Any, time: float | None) -> None:
        from pxr import Usd, UsdGeom, UsdShade

        self.stage = stage
        self.time = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
        if time is None and stage.HasAuthoredTimeCodeRange():
            # What has samples only has no default value.
            self.time = Usd.TimeCode(stage.GetStartTimeCode())
        self.xforms = UsdGeom.XformCache(self.time)
        self.remarks: dict[str, int] = {}
        self.nodes: list[dict[str, Any]] = [{"name": "stage"}]
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.textures: list[dict[str, Any]] = []
        self.images: list[dict[str, Any]] = []
        self.lights: list[dict[str, Any]] = []
        self.cameras: list[dict[str, Any]] = []
        self.environment: Any = None
        self.known: dict[Any, Any] = {}
        self.UsdGeom, self.UsdShade = UsdGeom, UsdShade
        scale = UsdGeom.GetStageMetersPerUnit(stage)
        self.scale = float(scale) if scale > 0 and math.isfinite(scale) else 1.0
        self.world = np.diag([self.scale, self.scale, self.scale, 1.0])

    def remark(self, text: str) -> None:
        self.remarks[text] = self.remarks.get(text, 0) + 1

    def value(self, attribute: Any, default: Any = None) -> Any:
        if not attribute:
            return default
        value = attribute.Get(self.time)
        if value is None:
            value = attribute.Get()
        return default if value is None else value

    def text(self, path: str) -> tuple[str, list[str]]:
        self.nodes[0]["transform"] = _rows(self.world.T)
        self.nodes[0]["children"] = self.children(self.stage.GetPseudoRoot(), self.world)
        up = [0.0, 0.0, 1.0] if self.UsdGeom.GetStageUpAxis(self.stage) == "Z" else [0.0, 1.0, 0.0]
        document = {
            "format": "snell scene",
            "version": 1,
            "name": self.stage.GetRootLayer().GetDisplayName() or path,
            "settings": {"up": up},
            "environment": self.environment,
            "cameras": self.cameras,
            "lights": self.lights,
            "materials": self.materials,
            "textures": self.textures,
            "images": self.images,
            "root": 0,
            "nodes": self.nodes,
            "meshes": self.meshes,
        }
        remarks = [text if count == 1 else f"{text} ({count} times)" for text, count in self.remarks.items()]
        return json.dumps(document), remarks

    # The tree.

    def children(self, prim: Any, world: np.ndarray) -> list[int]:
        from pxr import Usd

        found = []
        for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
            if (node := self.node(child, world)) is not None:
                found.append(node)
        return found

    def node(self, prim: Any, parent: np.ndarray) -> int | None:
        geom = self.UsdGeom
        imageable = geom.Imageable(prim)
        if imageable:
            if self.value(imageable.GetVisibilityAttr()) == "invisible":
                return None
            if imageable.ComputePurpose() in (geom.Tokens.proxy, geom.Tokens.guide):
                return None
        local = np.eye(4)
        if geom.Xformable(prim):
            matrix, resets = self.xforms.GetLocalTransformation(prim)
            local = np.array(matrix, dtype=np.float64).reshape(4, 4).T
            if resets:
                local = np.linalg.pinv(parent) @ self.world @ local
        world = parent @ local
        node: dict[str, Any] = {"name": prim.GetName()}
        if not np.array_equal(local, np.eye(4)):
            node["transform"] = _rows(local.T)
        number = len(self.nodes)
        self.nodes.append(node)
        surfaces, below = self.content(prim, world)
        if surfaces:
            node["surfaces"] = surfaces
        if not prim.IsA(geom.PointInstancer):
            below += self.shared_children(prim, world)
        if below:
            node["children"] = below
        return number

    def shared_children(self, prim: Any, world: np.ndarray) -> list[int]:
        """What is below; that of an instance is made once for all of its kind."""
        if not prim.IsInstance():
            return self.children(prim, world)
        key = ("prototype", str(prim.GetPrototype().GetPath()))
        # Lights and cameras stand in the world, so they are made for every instance.
        if key not in self.known:
            lights, cameras = len(self.lights), len(self.cameras)
            below = self.children(prim, world)
            if (lights, cameras) != (len(self.lights), len(self.cameras)):
                return below
            self.known[key] = below
        return list(self.known[key])

    def content(self, prim: Any, world: np.ndarray) -> tuple[list[Any], list[int]]:
        """Surfaces of a prim itself, and further nodes."""
        geom = self.UsdGeom
        if prim.IsA(geom.Mesh):
            return self.mesh(prim), []
        if prim.IsA(geom.PointInstancer):
            return [], self.point_instancer(prim, world)
        if prim.IsA(geom.BasisCurves):
            return self.curves(prim), []
        if prim.IsA(geom.Points):
            return [], self.points(prim)
        if prim.IsA(geom.Camera):
            self.camera(prim, world)
            return [], []
        if prim.IsA(geom.Gprim):
            return [], self.shape(prim)
        from pxr import UsdLux

        if prim.HasAPI(UsdLux.LightAPI):
            return [], self.light(prim, world)
        return [], []

    # Surfaces.

    def material_of(self, prim: Any) -> int | None:
        material, _ = self.UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        return self.material(material.GetPrim()) if material else self.display_material(prim)

    def is_double_sided(self, prim: Any) -> bool:
        return bool(self.value(self.UsdGeom.Gprim(prim).GetDoubleSidedAttr(), False))

    def display_material(self, prim: Any) -> int:
        """Grey, or the constant display colour; other display colours are vertex colours."""
        color = self.UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        value = color.ComputeFlattened(self.time) if color and color.HasValue() else None
        factor = (0.18, 0.18, 0.18)
        if value is not None and len(value) > 0:
            factor = tuple(value[0]) if len(value) == 1 else (1.0, 1.0, 1.0)
        return self.add_material({"base_color": _color(factor)}, "displayColor", key=("display", factor))

    def add_material(self, surface: dict[str, Any], name: str, key: Any = None, **more: Any) -> int:
        if key is not None and key in self.known:
            return self.known[key]
        material = {
            "name": name,
            "kind": {"material": "open-pbr", **surface},
            "emission": _color((0, 0, 0)),
            "emits_on_both_sides": True,
            "illuminates": True,
            "alpha_mode": "opaque",
            "alpha": _scalar(1),
            "double_sided": True,
            "normal_map": None,
            **more,
        }
        self.materials.append(material)
        if key is not None:
            self.known[key] = len(self.materials) - 1
        return len(self.materials) - 1

    def source(self, prim: Any) -> Any:
        """The prim that stands for all instances of one."""
        return prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim

    def mesh(self, prim: Any) -> list[Any]:
        key = ("mesh", str(self.source(prim).GetPath()))
        if key not in self.known:
            self.known[key] = self.make_mesh(prim)
        made = self.known[key]
        if made is None:
            return []
        number, subsets = made
        materials = [self.material_of(prim)]
        materials += [self.material_of(self.stage.GetPrimAtPath(prim.GetPath().AppendChild(name))) for name in subsets]
        return [{"mesh": number, "materials": materials}]

    def make_mesh(self, prim: Any) -> tuple[int, list[str]] | None:
        mesh = self.UsdGeom.Mesh(prim)
        points = np.array(self.value(mesh.GetPointsAttr(), []), dtype=np.float32).reshape(-1, 3)
        counts = np.array(self.value(mesh.GetFaceVertexCountsAttr(), []), dtype=np.int64)
        indices = np.array(self.value(mesh.GetFaceVertexIndicesAttr(), []), dtype=np.int64)
        if len(points) == 0 or len(counts) == 0:
            self.remark(f"{prim.GetPath()}: a mesh without points or faces is left out")
            return None
        if counts.min() < 0 or counts.sum() != len(indices) or indices.min(initial=0) < 0 or indices.max(initial=0) >= len(points):
            self.remark(f"{prim.GetPath()}: a mesh whose faces and points do not fit together is left out")
            return None
        corners, faces = _triangulated(points, counts, indices, np.array(self.value(mesh.GetHoleIndicesAttr(), []), dtype=np.int64))
        if self.value(mesh.GetOrientationAttr()) == "leftHanded":
            corners = corners[:, ::-1]
        scheme = self.value(mesh.GetSubdivisionSchemeAttr())
        attributes = {"normals": self.normals(prim, mesh, points, counts, indices, corners, faces, scheme)}
        attributes["uvs"] = self.primvar(prim, ("st", "UVMap", "st0", "map1", "uv"), 2, counts, indices, corners, faces, len(points))
        attributes["colors"] = self.colors(prim, counts, indices, corners, faces, len(points))
        subsets, slots = [], np.zeros(len(faces), dtype=np.uint16)
        for subset in self.UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            members = np.array(self.value(subset.GetIndicesAttr(), []), dtype=np.int64)
            subsets.append(subset.GetPrim().GetName())
            slots[np.isin(faces, members)] = len(subsets)
        return self.add_mesh(points, indices[corners], attributes, slots if subsets else None), subsets

    def add_mesh(self, points: np.ndarray, triangles: np.ndarray, attributes: dict[str, Any], slots: Any = None) -> int:
        """Stores a mesh. Attributes are ("vertex", one for each point) or ("corner", one for each corner of each triangle)."""
        attributes = {name: value for name, value in attributes.items() if value is not None}
        if any(where == "corner" for where, _ in attributes.values()):
            flat = triangles.reshape(-1)
            parts = [flat.astype(np.float64)[:, None]]
            for name, (where, values) in attributes.items():
                values = values[flat] if where == "vertex" else values.reshape(len(flat), -1)
                attributes[name] = ("vertex", values)
                parts.append(values.astype(np.float64))
            # Corners that are alike in everything are one vertex.
            _, first, inverse = np.unique(np.concatenate(parts, axis=1), axis=0, return_index=True, return_inverse=True)
            points, triangles = points[flat[first]], inverse.reshape(-1, 3)
            attributes = {name: ("vertex", values[first]) for name, (_, values) in attributes.items()}
        form = {"positions": _numbers(points, np.float32), "indices": _numbers(triangles, np.uint32)}
        form.update({name: _numbers(values, np.float32) for name, (_, values) in attributes.items()})
        if slots is not None:
            form["material_slots"] = _numbers(slots, np.uint16)
        self.meshes.append(form)
        return len(self.meshes) - 1

    def interpolated(self, values: np.ndarray, interpolation: str, indices: Any, corners: Any, faces: Any, count: int) -> Any:
        if interpolation in ("vertex", "varying") and len(values) == count:
            return ("vertex", values)
        if interpolation == "faceVarying" and len(values) == len(indices):
            return ("corner", values[corners.reshape(-1)])
        if interpolation == "uniform" and len(values) > faces.max(initial=-1):
            return ("corner", np.repeat(values[faces], 3, axis=0))
        if interpolation == "constant" and len(values) == 1:
            return ("vertex", np.repeat(values, count, axis=0))
        return None

    def primvar(self, prim: Any, names: tuple[str, ...], width: int, counts: Any, indices: Any, corners: Any, faces: Any, count: int) -> Any:
        primvars = self.UsdGeom.PrimvarsAPI(prim)
        for name in names:
            primvar = primvars.FindPrimvarWithInheritance(name)
            if primvar and primvar.HasValue():
                flat = primvar.ComputeFlattened(self.time)
                flat = primvar.ComputeFlattened() if flat is None else flat
                values = np.array(flat, dtype=np.float32).reshape(-1, width)
                found = self.interpolated(values, primvar.GetInterpolation(), indices, corners, faces, count)
                if found is None:
                    self.remark(f"{prim.GetPath()}: the primvar {name} does not fit the mesh and is left out")
                return found
        return None

    def colors(self, prim: Any, counts: Any, indices: Any, corners: Any, faces: Any, count: int) -> Any:
        material, _ = self.UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        primvar = self.UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        if material or not primvar or not primvar.HasValue() or primvar.GetInterpolation() == "constant":
            return None
        found = self.primvar(prim, ("displayColor",), 3, counts, indices, corners, faces, count)
        if found is None:
            return None
        where, values = found
        return (where, np.concatenate([values, np.ones((len(values), 1), dtype=np.float32)], axis=1))

    def normals(self, prim: Any, mesh: Any, points: Any, counts: Any, indices: Any, corners: Any, faces: Any, scheme: str) -> Any:
        if scheme in (None, "none"):
            found = self.primvar(prim, ("normals",), 3, counts, indices, corners, faces, len(points))
            values = self.value(mesh.GetNormalsAttr())
            if found is None and values is not None and len(values) > 0:
                values = np.array(values, dtype=np.float32).reshape(-1, 3)
                found = self.interpolated(values, mesh.GetNormalsInterpolation(), indices, corners, faces, len(points))
            return found
        self.remark(f"{prim.GetPath()}: the mesh is not subdivided; its polygons are shown with smooth normals")
        triangles = points[indices[corners]].astype(np.float64)
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals = np.zeros((len(points), 3))
        for k in range(3):
            np.add.at(normals, indices[corners[:, k]], cross)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return ("vertex", np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0]))

    def placed_shape(self, shape: dict[str, Any], material: int | None, transform: Any = None) -> int:
        node: dict[str, Any] = {"name": shape["shape"], "surfaces": [{"shape": shape, "materials": [material]}]}
        if transform is not None:
            node["transform"] = [[float(x) for x in row] for row in np.asarray(transform)[:3]]
        self.nodes.append(node)
        return len(self.nodes) - 1

    def shape(self, prim: Any) -> list[int]:
        geom, kind = self.UsdGeom, prim.GetTypeName()
        get = lambda name, default: float(self.value(prim.GetAttribute(name), default))  # noqa: E731
        axis = str(self.value(prim.GetAttribute("axis"), "Z"))
        if kind == "Sphere":
            return [self.placed_shape({"shape": "sphere", "radius": get("radius", 1)}, self.material_of(prim))]
        if kind == "Cube":
            half = get("size", 2) / 2
            return [self.placed_shape({"shape": "box", "min": [-half] * 3, "max": [half] * 3}, self.material_of(prim))]
        if kind in ("Cylinder", "Cone"):
            shape = {"shape": kind.lower(), "radius": get("radius", 1), "height": get("height", 2)}
            return [self.placed_shape(shape, self.material_of(prim), _from_y(axis))]
        if kind == "Capsule":
            radius, height, material = get("radius", 0.5), get("height", 1), self.material_of(prim)
            ends = []
            for side in (0.5, -0.5):
                move = np.eye(4)
                move[1, 3] = side * height
                ends.append(self.placed_shape({"shape": "sphere", "radius": radius}, material, _from_y(axis) @ move))
            return [self.placed_shape({"shape": "cylinder", "radius": radius, "height": height, "caps": False}, material, _from_y(axis)), *ends]
        if kind == "Plane":
            # Its normal is the axis; ours is z.
            shape = {"shape": "rectangle", "half_size": [get("width", 2) / 2, get("length", 2) / 2]}
            return [self.placed_shape(shape, self.material_of(prim), _from_z(axis))]
        if prim.IsA(geom.Boundable):
            self.remark(f"{prim.GetPath()}: {kind} is not supported and was left out")
        return []

    def points(self, prim: Any) -> list[int]:
        points = self.UsdGeom.Points(prim)
        positions = np.array(self.value(points.GetPointsAttr(), []), dtype=np.float64).reshape(-1, 3)
        widths = np.array(self.value(points.GetWidthsAttr(), [1.0]), dtype=np.float64).reshape(-1)
        if len(positions) > _MAX_POINTS:
            self.remark(f"{prim.GetPath()}: {len(positions)} points, of which the first {_MAX_POINTS} are shown")
            positions = positions[:_MAX_POINTS]
        widths = widths if len(widths) >= len(positions) else np.resize(widths if len(widths) else [1.0], len(positions))
        ball = self.placed_shape({"shape": "sphere", "radius": 0.5}, self.material_of(prim))
        found = []
        for position, width in zip(positions, widths):
            rows = [[float(width) if i == j else 0.0 for j in range(3)] + [float(position[i])] for i in range(3)]
            self.nodes.append({"transform": rows, "children": [ball]})
            found.append(len(self.nodes) - 1)
        return found

    def curves(self, prim: Any) -> list[Any]:
        curves = self.UsdGeom.BasisCurves(prim)
        points = np.array(self.value(curves.GetPointsAttr(), []), dtype=np.float64).reshape(-1, 3)
        counts = [int(n) for n in self.value(curves.GetCurveVertexCountsAttr(), [])]
        widths = np.array(self.value(curves.GetWidthsAttr(), [1.0]), dtype=np.float64).reshape(-1)
        kind = "linear" if self.value(curves.GetTypeAttr()) == "linear" else str(self.value(curves.GetBasisAttr(), "bezier"))
        periodic = self.value(curves.GetWrapAttr()) == "periodic"
        pinned = self.value(curves.GetWrapAttr()) == "pinned"
        vertices, normals, triangles, start = [], [], [], 0
        base = 0
        for number, count in enumerate(counts):
            control = points[start : start + count]
            if len(widths) == len(points):
                width = widths[start : start + count]
            else:
                width = np.full(max(count, 1), widths[min(number, len(widths) - 1)] if len(widths) else 1.0)
            start += count
            line = _sampled(np.concatenate([control, width[: len(control), None]], axis=1), kind, periodic, pinned)
            if len(line) < 2:
                continue
            tube = _tube(line[:, :3], line[:, 3] / 2)
            vertices.append(tube[0])
            normals.append(tube[1])
            triangles.append(tube[2] + base)
            base += len(tube[0])
        if not vertices:
            return []
        attributes = {"normals": ("vertex", np.concatenate(normals))}
        number = self.add_mesh(np.concatenate(vertices), np.concatenate(triangles), attributes)
        return [{"mesh": number, "materials": [self.material_of(prim)]}]

    def point_instancer(self, prim: Any, world: np.ndarray) -> list[int]:
        instancer = self.UsdGeom.PointInstancer(prim)
        prototypes = []
        for path in instancer.GetPrototypesRel().GetForwardedTargets():
            target = self.stage.GetPrimAtPath(path)
            prototypes.append(self.node(target, world) if target else None)
        indices = self.value(instancer.GetProtoIndicesAttr(), [])
        transforms = instancer.ComputeInstanceTransformsAtTime(self.time, self.time, instancer.ExcludeProtoXform)
        if len(transforms) == 0 and len(indices) > 0:
            self.remark(f"{prim.GetPath()}: the instances could not be placed and are left out")
        # Masked instances are left out of the transforms, but not of the indices.
        mask = instancer.ComputeMaskAtTime(self.time)
        if len(mask) == len(indices):
            indices = [index for index, keep in zip(indices, mask) if keep]
        found = []
        for index, matrix in zip(indices, transforms):
            if 0 <= index < len(prototypes) and prototypes[index] is not None:
                self.nodes.append({"transform": _rows(matrix), "children": [prototypes[index]]})
                found.append(len(self.nodes) - 1)
        return found

    # Cameras and lights.

    def camera(self, prim: Any, world: np.ndarray) -> None:
        camera = self.UsdGeom.Camera(prim)
        get = lambda attribute, default: float(self.value(attribute, default))  # noqa: E731
        width, height = get(camera.GetHorizontalApertureAttr(), 20.955), get(camera.GetVerticalApertureAttr(), 15.2908)
        focal = get(camera.GetFocalLengthAttr(), 50)
        unit = lambda v: [float(x) for x in v / max(np.linalg.norm(v), 1e-300)]  # noqa: E731
        towards = -world[:3, 2] / max(np.linalg.norm(world[:3, 2]), 1e-300)
        up = world[:3, 1] - towards * towards.dot(world[:3, 1])
        if get(camera.GetHorizontalApertureOffsetAttr(), 0) or get(camera.GetVerticalApertureOffsetAttr(), 0):
            self.remark(f"{prim.GetPath()}: the offset of the aperture is left out")
        if str(self.value(camera.GetProjectionAttr())) == "orthographic":
            # Apertures are tenths of units.
            projection = {"projection": "orthographic", "half_size": [None, height * 0.05 * self.scale]}
        else:
            projection = {"projection": "perspective", "tan_half_fov": [None, height / (2 * focal)]}
        stop, focus = get(camera.GetFStopAttr(), 0), get(camera.GetFocusDistanceAttr(), 0)
        lens = focal * 0.1 * self.scale / (2 * stop) if stop > 0 and focus > 0 else 0.0
        self.cameras.append(
            {
                "name": prim.GetName(),
                "eye": [float(x) for x in world[:3, 3]],
                "towards": unit(towards),
                "up": unit(up),
                "projection": projection,
                "aperture_radius": lens,
                "focus_distance": focus * self.scale if focus > 0 else 1.0,
                "resolution": None,
            }
        )

    def light(self, prim: Any, world: np.ndarray) -> list[int]:
        from pxr import UsdLux

        light, kind = UsdLux.LightAPI(prim), prim.GetTypeName()
        get = lambda name, default: self.value(prim.GetAttribute(name), default)  # noqa: E731
        strength = float(self.value(light.GetIntensityAttr(), 1.0)) * 2.0 ** float(self.value(light.GetExposureAttr(), 0.0))
        color = np.array(self.value(light.GetColorAttr(), (1, 1, 1)), dtype=np.float64) * strength
        if self.value(light.GetEnableColorTemperatureAttr(), False):
            color = color * _blackbody(self.value(light.GetColorTemperatureAttr(), 6500.0))
        normalize = bool(self.value(light.GetNormalizeAttr(), False))
        scale = [float(np.linalg.norm(world[:3, i])) / self.scale for i in range(3)]
        if kind.startswith("DomeLight"):
            self.dome(prim, world, color)
            return []
        if kind == "DistantLight":
            angle = math.radians(float(get("inputs:angle", 0.53)))
            solid = math.pi * math.sin(min(angle, math.pi) / 2) ** 2
            irradiance = color if normalize or solid <= 0 else color * solid
            direction = -world[:3, 2] / max(np.linalg.norm(world[:3, 2]), 1e-300)
            self.lights.append(
                {"light": "directional", "direction": [float(x) for x in direction], "irradiance": [float(x) for x in irradiance]}
            )
            return []
        cone = self.value(prim.GetAttribute("inputs:shaping:cone:angle"), None)
        shape, transform, area = None, None, 1.0
        if kind == "SphereLight":
            radius = float(get("inputs:radius", 0.5))
            # What is a point in the file has the brightness of a ball of radius 1.
            is_point = bool(get("treatAsPoint", False)) or radius <= 0
            area = 4 * math.pi * (radius * scale[0]) ** 2
            if is_point or cone is not None:
                size = 1.0 if is_point and normalize else max(radius * scale[0] * self.scale, 1e-12)
                intensity = color * (math.pi * size**2 / (area * self.scale**2 if normalize and not is_point else 1.0))
                self.point_light(prim, world, intensity, cone)
                return []
            shape = {"shape": "sphere", "radius": radius}
        elif kind == "RectLight":
            width, height = float(get("inputs:width", 1)), float(get("inputs:height", 1))
            area = width * scale[0] * height * scale[1]
            # It shines along -z.
            shape, transform = {"shape": "rectangle", "half_size": [width / 2, height / 2]}, np.diag([-1.0, 1.0, -1.0, 1.0])
            if get("inputs:texture:file", None):
                self.remark(f"{prim.GetPath()}: the texture of the light is left out")
        elif kind == "DiskLight":
            radius = float(get("inputs:radius", 0.5))
            area = math.pi * radius**2 * scale[0] * scale[1]
            shape, transform = {"shape": "disk", "radius": radius}, np.diag([-1.0, 1.0, -1.0, 1.0])
        elif kind == "CylinderLight":
            radius, length = float(get("inputs:radius", 0.5)), float(get("inputs:length", 1))
            area = 2 * math.pi * radius * length * scale[0] * scale[1]
            shape, transform = {"shape": "cylinder", "radius": radius, "height": length, "caps": False}, _from_y("X")
        else:
            self.remark(f"{prim.GetPath()}: {kind} is not supported and was left out")
            return []
        if cone is not None and cone < 90:
            self.remark(f"{prim.GetPath()}: the cone of a light with an area is left out")
        radiance = color / (area * self.scale**2) if normalize and area > 0 else color
        material = self.add_material({}, prim.GetName(), kind={"material": "black"}, emission=_color(radiance), emits_on_both_sides=False)
        return [self.placed_shape(shape, material, transform)]

    def point_light(self, prim: Any, world: np.ndarray, intensity: np.ndarray, cone: float | None) -> None:
        form: dict[str, Any] = {"light": "point", "position": [float(x) for x in world[:3, 3]], "intensity": [float(x) for x in intensity]}
        if cone is not None and cone < 180:
            soft = float(self.value(prim.GetAttribute("inputs:shaping:cone:softness"), 0.0))
            outer = math.radians(float(cone))
            direction = -world[:3, 2] / max(np.linalg.norm(world[:3, 2]), 1e-300)
            form["light"] = "spot"
            form["direction"] = [float(x) for x in direction]
            form["falloff"] = {"falloff": "smooth", "inner": outer * max(0.0, 1.0 - soft), "outer": outer}
        self.lights.append(form)

    def dome(self, prim: Any, world: np.ndarray, color: np.ndarray) -> None:
        if self.environment is not None:
            self.remark(f"{prim.GetPath()}: a second dome light is left out")
            return
        attribute = prim.GetAttribute("inputs:texture:file")
        asset = self.value(attribute)
        if not asset or not asset.path:
            self.environment = {"constant": [float(x) for x in color]}
            return
        encoded = self.encoded(asset, attribute)
        if encoded is None:
            self.environment = {"constant": [float(x) for x in color]}
            return
        # The middle of the picture is +z, and what is right of it -x (OpenEXR); ours are -z and +x.
        turn = np.diag([-1.0, 1.0, -1.0])
        pole = str(self.value(prim.GetAttribute("poleAxis"), "Y"))
        if pole == "Z" or (pole == "scene" and self.UsdGeom.GetStageUpAxis(self.stage) == "Z"):
            # The same, stood up: y becomes z.
            turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]) @ turn
        axes = world[:3, :3] / np.maximum(np.linalg.norm(world[:3, :3], axis=0), 1e-300)
        m = axes @ turn
        rows = [[float(x) for x in row] + [0.0] for row in m]
        self.environment = {"image": {"image": encoded, "scale": [float(x) for x in color], "world_from_environment": rows}}

    # Materials.

    def encoded(self, asset: Any, attribute: Any = None) -> dict[str, Any] | None:
        """A picture as the file has it."""
        from pxr import Ar

        path = asset.resolvedPath or asset.path
        found = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path)) if path else None
        if not found:
            self.remark(f"the picture {asset.path!r} cannot be opened; a magenta checkerboard stands in for this texture")
            return None
        return {"encoded": base64.b64encode(bytes(found.GetBuffer())).decode("ascii")}

    def image(self, asset: Any) -> int:
        key = ("image", asset.resolvedPath or asset.path)
        if key not in self.known:
            encoded = self.encoded(asset)
            if encoded is None:
                checker = [255, 0, 255, 0, 0, 0, 0, 0, 0, 255, 0, 255]
                encoded = {"width": 2, "height": 2, "channels": 3, "encoding": "srgb", "pixels": {"u8": checker}}
            self.images.append(encoded)
            self.known[key] = len(self.images) - 1
        return self.known[key]

    def material(self, prim: Any) -> int:
        key = ("material", str(self.source(prim).GetPath()))
        if key in self.known:
            return self.known[key]
        material = self.UsdShade.Material(prim)
        surface = None
        for context in ("", "mtlx"):
            shader, _, _ = material.ComputeSurfaceSource(context)
            if shader and _READERS.get(_shader_kind(shader)):
                surface = shader
                break
        if surface is None:
            self.remark(f"{prim.GetPath()}: no surface of a kind that is known; a grey one was used instead")
            number = self.add_material({"base_color": _color((0.18, 0.18, 0.18))}, prim.GetName())
        else:
            number = _READERS[_shader_kind(surface)](self, surface, prim.GetName())
        self.known[key] = number
        return number


def _from_y(axis: str) -> np.ndarray:
    """Turns shapes that stand around y to another axis."""
    columns = {"X": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "Y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "Z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]]}
    m = np.eye(4)
    m[:3, :3] = np.array(columns.get(axis, columns["Z"]), dtype=np.float64).T
    return m


def _from_z(axis: str) -> np.ndarray:
    """Turns a rectangle with the normal z to another axis."""
    columns = {"X": [[0, 0, -1], [0, 1, 0], [1, 0, 0]], "Y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "Z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
    m = np.eye(4)
    m[:3, :3] = np.array(columns.get(axis, columns["Z"]), dtype=np.float64).T
    return m


def _triangulated(points: np.ndarray, counts: np.ndarray, indices: np.ndarray, holes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the corners of triangles in the list of corners of faces, and the face of each triangle."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    keep = np.ones(len(counts), dtype=bool)
    keep[holes[(holes >= 0) & (holes < len(counts))]] = False
    parts: list[np.ndarray] = []
    owners: list[np.ndarray] = []
    for size in np.unique(counts[keep]):
        faces = np.nonzero(keep & (counts == size))[0]
        if size < 3:
            continue
        first = starts[faces]
        if size == 3:
            parts.append(first[:, None] + np.arange(3))
            owners.append(faces)
        elif size == 4:
            # Along the diagonal that keeps both triangles on one side of the face, for faces that are not convex.
            p = points[indices[first[:, None] + np.arange(4)]].astype(np.float64)
            a = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
            b = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])
            other = np.einsum("ij,ij->i", a, b) < 0
            one = np.where(other[:, None], [0, 1, 3], [0, 1, 2])
            two = np.where(other[:, None], [1, 2, 3], [0, 2, 3])
            parts.append(np.stack([first[:, None] + one, first[:, None] + two], axis=1).reshape(-1, 3))
            owners.append(np.repeat(faces, 2))
        else:
            for face, start in zip(faces, first):
                cut = _ears(points[indices[start : start + size]].astype(np.float64))
                parts.append(start + cut)
                owners.append(np.full(len(cut), face))
    if not parts:
        return np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64)
    corners, owner = np.concatenate(parts), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return corners[order], owner[order]


def _ears(p: np.ndarray) -> np.ndarray:
    """Triangles of a polygon, by cutting ears."""
    following = np.roll(p, -1, axis=0)
    normal = np.cross(p, following).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(p, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * [-1.0, 1.0]
    area = lambda a, b, c: (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])  # noqa: E731
    rest, found = list(range(len(p))), []
    while len(rest) > 3:
        for i in range(len(rest)):
            a, b, c = rest[i - 1], rest[i], rest[(i + 1) % len(rest)]
            if area(flat[a], flat[b], flat[c]) <= 0:
                continue
            inside = lambda q: all(area(*s, q) >= 0 for s in ((flat[a], flat[b]), (flat[b], flat[c]), (flat[c], flat[a])))  # noqa: B023, E731
            if not any(inside(flat[q]) for q in rest if q not in (a, b, c)):
                break
        else:
            i, a, b, c = 1, rest[0], rest[1], rest[2]
        found.append([a, b, c])
        rest.pop(i)
    return np.array([*found, rest])


_BASES = {
    "bezier": np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 3, 0, 0], [1, 0, 0, 0]], dtype=np.float64),
    "bspline": np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 0, 3, 0], [1, 4, 1, 0]], dtype=np.float64) / 6,
    "catmullRom": np.array([[-1, 3, -3, 1], [2, -5, 4, -1], [-1, 0, 1, 0], [0, 2, 0, 0]], dtype=np.float64) / 2,
}


def _sampled(control: np.ndarray, kind: str, periodic: bool, pinned: bool) -> np.ndarray:
    """Points of a curve, each with its width in the last column."""
    if kind == "linear" or kind not in _BASES or len(control) < 4:
        return np.concatenate([control, control[:1]]) if periodic and len(control) > 2 else control
    step = 3 if kind == "bezier" else 1
    if periodic:
        control = np.concatenate([control, control[: 4 - step]])
    elif pinned and kind != "bezier":
        control = np.concatenate([2 * control[:1] - control[1:2], control, 2 * control[-1:] - control[-2:-1]])
    t = np.linspace(0, 1, _PIECES, endpoint=False)
    powers = np.stack([t**3, t**2, t, np.ones_like(t)], axis=1) @ _BASES[kind]
    pieces = [powers @ control[i : i + 4] for i in range(0, len(control) - 3, step)]
    last = np.ones((1, 4)) @ _BASES[kind] @ control[(len(control) - 4) // step * step :][:4]
    return np.concatenate([*pieces, last])


def _tube(line: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and triangles around a line; frames are carried along without twist."""
    tangents = np.gradient(line, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-300)
    x = np.cross(tangents[0], [1.0, 0, 0] if abs(tangents[0, 0]) < 0.9 else [0, 1.0, 0])
    angles = np.arange(_SIDES) * (2 * math.pi / _SIDES)
    normals = np.zeros((len(line), _SIDES, 3))
    for i, tangent in enumerate(tangents):
        x = x - tangent * tangent.dot(x)
        x = x / max(np.linalg.norm(x), 1e-300)
        normals[i] = np.outer(np.cos(angles), x) + np.outer(np.sin(angles), np.cross(tangent, x))
    vertices = line[:, None] + normals * radii[:, None, None]
    a = (np.arange(len(line) - 1)[:, None] * _SIDES + np.arange(_SIDES)).reshape(-1)
    b = (np.arange(len(line) - 1)[:, None] * _SIDES + (np.arange(_SIDES) + 1) % _SIDES).reshape(-1)
    triangles = np.concatenate([np.stack([a, b, b + _SIDES], axis=1), np.stack([a, b + _SIDES, a + _SIDES], axis=1)])
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), triangles


# Shading networks.


def _shader_kind(shader: Any) -> str:
    identifier = shader.GetIdAttr().Get() if shader.GetIdAttr() else None
    return str(identifier or "")


class _Network:
    """Inputs of a surface: a value, or a texture found behind the connection."""

    def __init__(self, converter: _Converter, shader: Any) -> None:
        self.converter, self.shader = converter, shader

    def constant(self, name: str, default: Any) -> Any:
        value, _, _ = self.read(name)
        return default if value is None else value

    def read(self, name: str) -> tuple[Any, Any, int]:
        """A value, the picture that it is multiplied by, and the channel of the picture."""
        given = self.shader.GetInput(name)
        return self.resolve(given) if given else (None, None, 0)

    def resolve(self, given: Any, depth: int = 0) -> tuple[Any, Any, int]:
        attributes = given.GetValueProducingAttributes() if depth < 32 else []
        if not attributes:
            return given.Get(), None, 0
        attribute = attributes[0]
        from pxr import UsdShade

        if not UsdShade.Output.IsOutput(attribute):
            return self.converter.value(attribute), None, 0
        return self.node(UsdShade.Shader(attribute.GetPrim()), attribute.GetName(), depth + 1)

    def node(self, shader: Any, output: str, depth: int) -> tuple[Any, Any, int]:
        kind = _shader_kind(shader)
        channel = {"r": 0, "g": 1, "b": 2, "a": 3, "outr": 0, "outg": 1, "outb": 2, "outa": 3}.get(output.split(":")[-1], 0)
        if kind == "UsdUVTexture" or kind.startswith(("ND_image_", "ND_tiledimage_", "ND_UsdUVTexture", "ND_gltf_image", "ND_gltf_colorimage")):
            return None, self.texture(shader, kind), channel
        if kind.startswith("UsdPrimvarReader") or kind.startswith("ND_geompropvalue"):
            self.converter.remark(f"{shader.GetPath()}: a primvar as input of a surface is left out")
            given = shader.GetInput("fallback") or shader.GetInput("default")
            return (given.Get() if given else None), None, 0
        if kind.startswith("ND_constant"):
            return shader.GetInput("value").Get() if shader.GetInput("value") else None, None, 0
        if kind.startswith("ND_multiply"):
            sides = [self.resolve(shader.GetInput(name), depth) for name in ("in1", "in2") if shader.GetInput(name)]
            values = [value for value, texture, _ in sides if texture is None and value is not None]
            pictures = [side for side in sides if side[1] is not None]
            if len(pictures) <= 1:
                factor = values[0] if values else None
                for value in values[1:]:
                    factor = np.asarray(factor) * np.asarray(value)
                return (factor, *(pictures[0][1:] if pictures else (None, 0)))
        if kind.startswith("ND_extract"):
            value, picture, _ = self.resolve(shader.GetInput("in"), depth)
            index = int(self.value_of(shader, "index", 0))
            return (value[index] if value is not None and picture is None else value), picture, index
        for name in ("in", "in1", "input", "base", "fg"):
            if shader.GetInput(name):
                if not kind.startswith(("ND_normalmap", "ND_convert", "ND_swizzle", "ND_dot", "ND_separate")):
                    self.converter.remark(f"{shader.GetPath()}: a node of kind {kind} is passed by")
                value, picture, inner = self.resolve(shader.GetInput(name), depth)
                return value, picture, channel if kind.startswith("ND_separate") else inner
        self.converter.remark(f"{shader.GetPath()}: a node of kind {kind} is not supported and was left out")
        return None, None, 0

    def value_of(self, shader: Any, name: str, default: Any) -> Any:
        given = shader.GetInput(name)
        value = self.resolve(given)[0] if given else None
        return default if value is None else value

    def texture(self, shader: Any, kind: str) -> dict[str, Any] | None:
        file = shader.GetInput("file")
        asset = self.resolve(file)[0] if file else None
        if asset is None or not getattr(asset, "path", ""):
            self.converter.remark(f"{shader.GetPath()}: a texture without a file is left out")
            return None
        space = str(self.value_of(shader, "sourceColorSpace", "auto"))
        authored = file.GetAttr().GetColorSpace() if file.GetAttr().HasColorSpace() else ""
        if space == "auto" and authored:
            space = "sRGB" if "srgb" in authored.lower() else "raw"
        wrap = {"repeat": "repeat", "periodic": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "black", "constant": "black"}
        names = ("wrapS", "wrapT") if shader.GetInput("wrapS") or shader.GetInput("wrapT") else ("uaddressmode", "vaddressmode")
        default = "repeat"
        wraps = [wrap.get(str(self.value_of(shader, name, default)), "repeat") for name in names]
        scale = np.array(self.value_of(shader, "scale", (1, 1, 1, 1)), dtype=np.float64).reshape(-1)
        bias = np.array(self.value_of(shader, "bias", (0, 0, 0, 0)), dtype=np.float64).reshape(-1)
        st = np.eye(3)
        if (given := shader.GetInput("st") or shader.GetInput("texcoord")) and not kind.startswith("ND_gltf"):
            st = self.placement(given)
        if tiling := shader.GetInput("uvtiling"):
            st = np.diag([*np.array(self.resolve(tiling)[0] or (1, 1), dtype=np.float64), 1.0]) @ st
        return {"image": self.converter.image(asset), "space": space, "wrap": wraps, "scale": scale, "bias": bias, "st": st}

    def placement(self, given: Any) -> np.ndarray:
        """The map of texture coordinates before the picture."""
        from pxr import UsdShade

        attributes = given.GetValueProducingAttributes()
        if not attributes or not UsdShade.Output.IsOutput(attributes[0]):
            return np.eye(3)
        shader = UsdShade.Shader(attributes[0].GetPrim())
        if _shader_kind(shader) not in ("UsdTransform2d", "ND_UsdTransform2d", "ND_place2d_vector2"):
            return np.eye(3)
        name = "in" if shader.GetInput("in") else "texcoord"
        before = self.placement(shader.GetInput(name)) if shader.GetInput(name) else np.eye(3)
        angle = math.radians(float(self.value_of(shader, "rotation", self.value_of(shader, "rotate", 0.0))))
        sx, sy = (float(x) for x in self.value_of(shader, "scale", (1, 1)))
        tx, ty = (float(x) for x in self.value_of(shader, "translation", self.value_of(shader, "offset", (0, 0))))
        turn = np.array([[math.cos(angle), -math.sin(angle), tx], [math.sin(angle), math.cos(angle), ty], [0, 0, 1]])
        return turn @ np.diag([sx, sy, 1.0]) @ before

    def place(self, picture: dict[str, Any], is_color: bool) -> int:
        """The number of a texture of the scene; its v grows downwards."""
        space = picture["space"]
        srgb = is_color if space == "auto" else space.lower().startswith("srgb")
        flip = np.array([[1.0, 0, 0], [0, -1.0, 1.0], [0, 0, 1.0]])
        rows = (flip @ picture["st"])[:2]
        texture = {
            "image": picture["image"],
            "encoding": "srgb" if srgb else "linear",
            "wrap": picture["wrap"],
            "filtering": "trilinear",
            "uv_set": 0,
            "uv_transform": [[float(x) for x in row] for row in rows],
        }
        textures = self.converter.textures
        if texture in textures:
            return textures.index(texture)
        textures.append(texture)
        return len(textures) - 1

    def color(self, name: str, default: Any) -> dict[str, Any]:
        value, picture, _ = self.read(name)
        if picture is None:
            value = default if value is None else value
            return _color(np.resize(np.array(value, dtype=np.float64).reshape(-1), 3))
        if np.any(picture["bias"][:3]):
            self.converter.remark(f"{self.shader.GetPath()}: the bias of the texture of {name} is left out")
        factor = np.resize(picture["scale"], 3) * (1.0 if value is None else np.resize(np.array(value, dtype=np.float64).reshape(-1), 3))
        return _color(factor, self.place(picture, True))

    def scalar(self, name: str, default: float) -> dict[str, Any]:
        value, picture, channel = self.read(name)
        if picture is None:
            value = default if value is None else value
            return _scalar(float(np.array(value, dtype=np.float64).reshape(-1)[0]))
        scale = picture["scale"]
        factor = float(scale[min(channel, len(scale) - 1)]) * (1.0 if value is None else float(np.array(value).reshape(-1)[0]))
        return _scalar(factor, (self.place(picture, False), channel))

    def normal_map(self, name: str) -> dict[str, Any] | None:
        _, picture, _ = self.read(name)
        if picture is None:
            return None
        # Whatever the file says, directions are no colours.
        return {"texture": self.place({**picture, "space": "raw"}, False), "scale": 1.0}


def _preview_surface(converter: _Converter, shader: Any, name: str) -> int:
    net = _Network(converter, shader)
    surface: dict[str, Any] = {
        "base_color": net.color("diffuseColor", (0.18, 0.18, 0.18)),
        "base_metalness": net.scalar("metallic", 0.0),
        "specular_roughness": net.scalar("roughness", 0.5),
        "specular_ior": net.scalar("ior", 1.5),
        "coat_weight": net.scalar("clearcoat", 0.0),
        "coat_roughness": net.scalar("clearcoatRoughness", 0.01),
        "coat_ior": _scalar(1.5),
        "coat_darkening": _scalar(0.0),
    }
    if int(net.constant("useSpecularWorkflow", 0)) == 1:
        specular = net.color("specularColor", (0, 0, 0))
        strength = max(specular["factor"])
        # Reflectances that only metals have make a metal.
        if strength > 0.25 and specular["texture"] is None and strength > max(surface["base_color"]["factor"]):
            surface["base_color"], surface["base_metalness"] = specular, _scalar(1.0)
        else:
            root = math.sqrt(min(max(strength, 0.0), 0.9))
            surface["specular_ior"] = _scalar((1 + root) / (1 - root)) if strength > 0 else _scalar(1.5)
            surface["specular_weight"] = _scalar(1.0 if strength > 0 else 0.0)
            surface["base_metalness"] = _scalar(0.0)
    alpha, threshold = net.scalar("opacity", 1.0), float(net.constant("opacityThreshold", 0.0))
    more: dict[str, Any] = {"alpha": alpha, "normal_map": net.normal_map("normal")}
    if threshold > 0:
        more["alpha_mode"] = {"mask": threshold}
    elif alpha["texture"] is not None or alpha["factor"] < 1:
        more["alpha_mode"] = "blend"
    if shader.GetInput("displacement") and shader.GetInput("displacement").HasConnectedSource():
        converter.remark(f"{shader.GetPath()}: displacement is left out")
    return converter.add_material(surface, name, emission=net.color("emissiveColor", (0, 0, 0)), **more)


def _finish(converter: _Converter, net: _Network, name: str, surface: dict[str, Any], opacity: dict[str, Any], emission: dict[str, Any], normal: str) -> int:
    more: dict[str, Any] = {"emission": emission, "alpha": opacity, "normal_map": net.normal_map(normal)}
    if opacity["texture"] is not None or opacity["factor"] < 1:
        more["alpha_mode"] = "blend"
    return converter.add_material(surface, name, **more)


def _scaled(color: dict[str, Any], factor: float) -> dict[str, Any]:
    return {**color, "factor": [x * factor for x in color["factor"]]}


def _standard_surface(converter: _Converter, shader: Any, name: str) -> int:
    net = _Network(converter, shader)
    surface = {
        "base_weight": net.scalar("base", 1.0),
        "base_color": net.color("base_color", (0.8, 0.8, 0.8)),
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
        "coat_darkening": _scalar(0.0),
        "geometry_thin_walled": bool(net.constant("thin_walled", False)),
    }
    thickness = net.scalar("thin_film_thickness", 0.0)
    if thickness["factor"] > 0:
        surface["thin_film_weight"] = _scalar(1.0)
        # Nanometres to micrometres.
        surface["thin_film_thickness"] = {**thickness, "factor": thickness["factor"] * 1e-3}
        surface["thin_film_ior"] = net.scalar("thin_film_IOR", 1.5)
    emission = _scaled(net.color("emission_color", (1, 1, 1)), net.scalar("emission", 0.0)["factor"])
    opacity = net.color("opacity", (1, 1, 1))
    channel = (opacity["texture"], 0) if opacity["texture"] is not None else None
    alpha = _scalar(sum(opacity["factor"]) / 3, channel)
    return _finish(converter, net, name, surface, alpha, emission, "normal")


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


def _open_pbr(converter: _Converter, shader: Any, name: str) -> int:
    net = _Network(converter, shader)
    surface: dict[str, Any] = {key: net.color(key, default) for key, default in _OPEN_PBR_COLORS.items()}
    surface.update({key: net.scalar(key, default) for key, default in _OPEN_PBR_SCALARS.items()})
    surface["geometry_thin_walled"] = bool(net.constant("geometry_thin_walled", False))
    emission = _scaled(net.color("emission_color", (1, 1, 1)), net.scalar("emission_luminance", 0.0)["factor"])
    return _finish(converter, net, name, surface, net.scalar("geometry_opacity", 1.0), emission, "geometry_normal")


_READERS = {
    "UsdPreviewSurface": _preview_surface,
    "ND_UsdPreviewSurface_surfaceshader": _preview_surface,
    "ND_standard_surface_surfaceshader": _standard_surface,
    "ND_open_pbr_surface_surfaceshader": _open_pbr,
}


def _main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python3 -m snell.usd IN OUT.snell (OUT may be - for standard output)", file=sys.stderr)
        return 2
    try:
        text, remarks = convert(arguments[0])
    except (ImportError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 3 if isinstance(error, ImportError) else 1
    for remark in remarks:
        print(f"warning: {remark}", file=sys.stderr)
    if arguments[1] == "-":
        sys.stdout.write(text)
        return 0
    import os
    import tempfile

    # Whole or not at all.
    folder = os.path.dirname(os.path.abspath(arguments[1]))
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=folder, suffix=".tmp", delete=False) as file:
        file.write(text)
    os.chmod(file.name, 0o644)
    os.replace(file.name, arguments[1])
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
