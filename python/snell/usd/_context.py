"""The data that is collected while a stage is read: the parts of a document in Snell's text format,
and remarks on what could not be read.
"""

from __future__ import annotations

import base64
import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from ._files import Files
from ._motion import Motion

__all__ = ["Context", "Needs", "color_form", "direction", "numbers", "rows", "scalar_form"]


def numbers(array: Any, kind: Any) -> str:
    """Many numbers in the syntax of the format: base64 of their little-endian bytes."""
    flat = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<")).reshape(-1)
    return base64.b64encode(flat.tobytes()).decode("ascii")


def rows(matrix: Any) -> list[list[float]]:
    """A transform for column vectors as three rows of four numbers."""
    return [[float(x) for x in row] for row in np.asarray(matrix)[:3]]


def direction(vector: np.ndarray) -> list[float]:
    """A vector of length 1; 0 stays 0."""
    return [float(x) for x in vector / max(float(np.linalg.norm(vector)), 1e-300)]


def color_form(factor: Any, texture: int | None = None) -> dict[str, Any]:
    """A colour of a material: a factor, and the texture it multiplies."""
    r, g, b = (float(x) for x in factor)
    return {"factor": [r, g, b], "texture": texture, "spectrum": None}


def scalar_form(factor: float, texture: tuple[int, int] | None = None) -> dict[str, Any]:
    """A number of a material: a factor, and the texture and channel it multiplies."""
    return {"factor": float(factor), "texture": list(texture) if texture else None}


def _distinct(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first of each of the rows that differ, and for each row the number of that one. Numbers
    made from the rows are sorted many times faster than the rows.
    """
    # Minus 0 becomes 0.
    bits = (np.ascontiguousarray(table) + 0.0).view(np.uint64)
    factors = np.random.default_rng(1).integers(1, 1 << 63, bits.shape[1], dtype=np.uint64) | 1
    mixed = (bits ^ (bits >> np.uint64(29))) * factors
    keys = (mixed ^ (mixed >> np.uint64(32))).sum(axis=1, dtype=np.uint64)
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    if not np.array_equal(bits[first][inverse.reshape(-1)], bits):
        _, first, inverse = np.unique(bits, axis=0, return_index=True, return_inverse=True)
    return first, inverse.reshape(-1)


@dataclass(frozen=True)
class Needs:
    """What a material reads from the surfaces that it is on."""

    #: The primvars that multiply its base colour and its opacity.
    color: str | None = None
    opacity: str | None = None
    #: Names of texture coordinates, and the number of the set of each.
    coordinates: tuple[tuple[str, int], ...] = ()
    #: The set of texture coordinates that selects the tile of its pictures, and the rows of their
    #: map to those of the tiles.
    tiles: tuple[int, tuple[tuple[float, ...], ...]] | None = None


class Context:
    """A stage at one time, and the document that is made from it."""

    def __init__(self, stage: Any, time: float | None, files: Files) -> None:
        self.stage, self.files = stage, files
        self.time = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
        if time is None and stage.HasAuthoredTimeCodeRange():
            # An attribute with time samples only has no default value.
            self.time = Usd.TimeCode(stage.GetStartTimeCode())
        self.xforms = UsdGeom.XformCache(self.time)
        self.remarks: dict[str, int] = {}
        self.nodes: list[dict[str, Any]] = [{"name": "stage"}]
        self.meshes: list[dict[str, Any]] = []
        self.curves: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.textures: list[dict[str, Any]] = []
        self.images: list[dict[str, Any]] = []
        self.lights: list[dict[str, Any]] = []
        self.cameras: list[dict[str, Any]] = []
        #: The factor of each camera on the light.
        self.exposures: list[float] = []
        self.environment: Any = None
        self.motion = Motion(stage)
        #: Objects already created, by a key that identifies them.
        self.known: dict[Any, Any] = {}
        #: The number of corners that subdivided meshes may still have.
        self.corners_left = 20_000_000
        #: What materials read from surfaces, by the number of the material.
        self.needs: dict[int, Needs] = {}
        #: Values that take the place of primvars, such as those of one instance.
        self.overrides: dict[str, np.ndarray] = {}
        #: The names of the primvars that were looked for.
        self.asked: set[str] = set()
        #: The sets of texture coordinates, by name.
        self.uv_sets: dict[str, int] = {}
        # Old exporters write a number of another type, which USD's own function does not take.
        written = stage.HasAuthoredMetadata("metersPerUnit")
        scale = stage.GetMetadata("metersPerUnit") if written else 0.01
        #: Metres per unit of the stage.
        self.scale = float(scale) if scale and scale > 0 and math.isfinite(scale) else 1.0
        self.world = np.diag([self.scale, self.scale, self.scale, 1.0])

    def remark(self, text: str) -> None:
        """Adds a remark about what is left out, unless an equal remark is there."""
        self.remarks[text] = self.remarks.get(text, 0) + 1

    def value(self, attribute: Any, default: Any = None) -> Any:
        """The value of an attribute at the time of this reading."""
        if not attribute:
            return default
        value = attribute.Get(self.time_of(attribute))
        value = attribute.Get() if value is None else value
        return default if value is None else value

    def time_of(self, attribute: Any) -> Any:
        """The time of this reading, or the earliest one for an attribute that has values at some
        times but no default.
        """
        if not self.time.IsDefault() or attribute.GetNumTimeSamples() == 0:
            return self.time
        source = attribute.GetResolveInfo(self.time).GetSource()
        is_set = source not in (Usd.ResolveInfoSourceNone, Usd.ResolveInfoSourceFallback)
        return self.time if is_set else Usd.TimeCode.EarliestTime()

    def array(self, attribute: Any, width: int, default: Any = ()) -> np.ndarray:
        """The value of an attribute as rows of numbers."""
        found = np.array(self.value(attribute, default), dtype=np.float64)
        if found.size and width > 1 and found.shape[-1:] != (width,):
            name = attribute.GetName()
            raise ValueError(f"{name} has rows of other than {width} numbers")
        return found.reshape(-1, width)

    def source(self, prim: Any) -> str:
        """The path of the prim that all instances of a prototype share."""
        return str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())

    def add_node(self, node: dict[str, Any]) -> int:
        """Stores a node and returns its number."""
        self.nodes.append(node)
        return len(self.nodes) - 1

    def add_shape(self, shape: dict[str, Any], material: int | None, transform: Any = None) -> int:
        """A node with one shape."""
        node: dict[str, Any] = {
            "name": shape["shape"],
            "surfaces": [{"shape": shape, "materials": [material]}],
        }
        if transform is not None:
            node["transform"] = rows(transform)
        return self.add_node(node)

    def add_mesh(
        self,
        points: np.ndarray,
        triangles: np.ndarray,
        attributes: dict[str, Any],
        slots: Any = None,
    ) -> int:
        """Stores a mesh. Attributes are ("vertex", one for each point) or ("corner", one for each
        corner of each triangle).
        """
        attributes = {name: value for name, value in attributes.items() if value is not None}
        if any(where == "corner" for where, _ in attributes.values()):
            flat = triangles.reshape(-1)
            parts = [flat.astype(np.float64)[:, None]]
            for name, (where, values) in attributes.items():
                values = values[flat] if where == "vertex" else values.reshape(len(flat), -1)
                attributes[name] = ("vertex", values)
                parts.append(values.astype(np.float64))
            # Corners with equal attributes are one vertex.
            first, inverse = _distinct(np.concatenate(parts, axis=1))
            points, triangles = points[flat[first]], inverse.reshape(-1, 3)
            attributes = {
                name: ("vertex", values[first]) for name, (_, values) in attributes.items()
            }
        form = {"positions": numbers(points, np.float32), "indices": numbers(triangles, np.uint32)}
        form.update({name: numbers(values, np.float32) for name, (_, values) in attributes.items()})
        if slots is not None:
            form["material_slots"] = numbers(slots, np.uint16)
        self.meshes.append(form)
        return len(self.meshes) - 1

    def add_material(self, surface: dict[str, Any], name: str, key: Any = None, **more: Any) -> int:
        """Stores a material and returns its number. It is an OpenPBR material unless `more` says
        otherwise. Materials with the same `key` are stored once.
        """
        if key is not None and key in self.known:
            return int(self.known[key])
        material = {
            "name": name,
            "kind": {"material": "open-pbr", **surface},
            "emission": color_form((0, 0, 0)),
            "emits_on_both_sides": True,
            "illuminates": True,
            "alpha_mode": "opaque",
            "alpha": scalar_form(1),
            "double_sided": True,
            "normal_map": None,
            **more,
        }
        self.materials.append(material)
        if key is not None:
            self.known[key] = len(self.materials) - 1
        return len(self.materials) - 1

    def picture(
        self,
        asset: Any,
        attribute: Any,
        instead: str = "a magenta checkerboard stands in for this texture",
    ) -> dict[str, Any] | None:
        """The content of the image file that `attribute` names. Without it, a remark says what is
        shown instead.
        """
        content, problem = self.files.picture(asset, attribute)
        if content is None:
            self.remark(
                f"{attribute.GetPrim().GetPath()}: the picture {asset.path!r}: {problem}; {instead}"
            )
            return None
        return {"encoded": base64.b64encode(content).decode("ascii")}

    def image(self, asset: Any, attribute: Any) -> int:
        """The number of an image for textures."""
        key = ("image", asset.resolvedPath or asset.path)
        if key not in self.known:
            picture = self.picture(asset, attribute)
            if picture is None:
                checker = [255, 0, 255, 0, 0, 0, 0, 0, 0, 255, 0, 255]
                picture = {
                    "width": 2,
                    "height": 2,
                    "channels": 3,
                    "encoding": "srgb",
                    "pixels": {"u8": checker},
                }
            self.images.append(picture)
            self.known[key] = len(self.images) - 1
        return int(self.known[key])

    def texture(
        self,
        image: int,
        *,
        is_srgb: bool,
        wrap: list[str],
        uv_transform: np.ndarray,
        uv_set: int = 0,
    ) -> int:
        """The number of a texture; equal ones share it."""
        texture = {
            "image": image,
            "encoding": "srgb" if is_srgb else "linear",
            "wrap": wrap,
            "filtering": "trilinear",
            "uv_set": uv_set,
            "uv_transform": [[float(x) for x in row] for row in uv_transform[:2]],
        }
        return self._stored(texture)

    def pattern(self, kind: str, **parameters: Any) -> int:
        """The number of a texture that is computed from others; equal ones share it."""
        return self._stored({"pattern": kind, **parameters})

    def _stored(self, texture: dict[str, Any]) -> int:
        key = ("texture", json.dumps(texture))
        if key not in self.known:
            self.textures.append(texture)
            self.known[key] = len(self.textures) - 1
        return int(self.known[key])

    def uv_set(self, name: str, used: dict[str, int]) -> int:
        """The number of the set of texture coordinates of this name, of a material that uses these
        already. Surfaces have two sets, and names share them.
        """
        if name not in self.uv_sets:
            self.uv_sets[name] = 1 if 0 in used.values() and 1 not in used.values() else 0
        number = self.uv_sets[name]
        if any(other != name and taken == number for other, taken in used.items()):
            self.remark(
                f"the texture coordinates {name} are left out: a material has more than two sets, "
                "or one that other materials share"
            )
        used[name] = number
        return number
