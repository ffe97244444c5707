"""Shading networks: the values of surface inputs through the nodes that they are connected to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade

from ._context import Context, color_form, scalar_form

__all__ = ["Network", "constant_primvar", "kind_of"]

#: Maximum length of a chain of nodes.
_MAX_DEPTH = 32
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "outr": 0, "outg": 1, "outb": 2, "outa": 3}
_WRAPS = {
    "repeat": "repeat",
    "periodic": "repeat",
    "mirror": "mirror",
    "clamp": "clamp",
    "black": "black",
    "constant": "black",
}
_PICTURES = (
    "ND_image_",
    "ND_tiledimage_",
    "ND_UsdUVTexture",
    "ND_gltf_image",
    "ND_gltf_colorimage",
)
_PRIMVARS = ("UsdPrimvarReader", "ND_geompropvalue", "ND_UsdPrimvarReader")


def kind_of(shader: Any) -> str:
    """The identifier of a node."""
    identifier = shader.GetIdAttr().Get() if shader.GetIdAttr() else None
    return str(identifier or "")


@dataclass
class _Picture:
    """An image and its use."""

    image: int
    space: str
    wrap: list[str]
    scale: np.ndarray
    bias: np.ndarray
    #: The map from the texture coordinates of the mesh to those of the image.
    st: np.ndarray


@dataclass
class _Source:
    """The value of an input: a constant, an image times a constant, or a primvar."""

    value: Any = None
    picture: _Picture | None = None
    channel: int = 0
    primvar: str | None = None


def constant_primvar(context: Context, prim: Any, name: str) -> float | None:
    """The number that a constant primvar of a prim or an ancestor is; `None` if there is none."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue() or primvar.GetInterpolation() != "constant":
        return None
    value = np.array(context.value(primvar.GetAttr())).reshape(-1)
    return float(value[0]) if len(value) and value.dtype.kind in "bfiu" else None


class Network:
    """The inputs of a surface, as the prim `user` shows it."""

    def __init__(self, context: Context, shader: Any, user: Any) -> None:
        self.context, self.shader, self.user = context, shader, user
        #: What the outputs of nodes are; nothing while a node is being looked at.
        self.sources: dict[str, _Source] = {}
        #: The primvars that are asked for as constants of the prim.
        self.constants: set[str] = set()
        #: The primvar that is the colour of the base, for the vertices of meshes.
        self.primvar: str | None = None

    def constant(self, name: str, default: Any) -> Any:
        """The constant of an input; an image is ignored."""
        value = self._read(name).value
        return default if value is None else value

    def color(self, name: str, default: Any, *, may_be_primvar: bool = False) -> dict[str, Any]:
        """The colour of an input: a constant, an image times a constant, or (if `may_be_primvar`)
        the colours of vertices.
        """
        source = self._read(name)
        if source.primvar and may_be_primvar:
            self.primvar = source.primvar
            return color_form((1, 1, 1))
        if source.primvar:
            self.context.remark(
                f"{self.shader.GetPath()}: the primvar {source.primvar} as {name} is left out"
            )
        if source.picture is None:
            return color_form(_three(default if source.value is None else source.value))
        picture = source.picture
        if np.any(picture.bias[:3]):
            self.context.remark(
                f"{self.shader.GetPath()}: the bias of the texture of {name} is left out"
            )
        factor = np.resize(picture.scale, 3) * (
            1.0 if source.value is None else _three(source.value)
        )
        return color_form(factor, self._placed(picture, True))

    def scalar(self, name: str, default: float) -> dict[str, Any]:
        """The number of an input: a constant, or an image times a constant."""
        source = self._read(name)
        if source.primvar:
            self.context.remark(
                f"{self.shader.GetPath()}: the primvar {source.primvar} as {name} is left out"
            )
        value = (
            None
            if source.value is None
            else float(np.array(source.value, dtype=np.float64).reshape(-1)[0])
        )
        if source.picture is None:
            return scalar_form(default if value is None else value)
        scale = source.picture.scale
        factor = float(scale[min(source.channel, len(scale) - 1)]) * (
            1.0 if value is None else value
        )
        return scalar_form(factor, (self._placed(source.picture, False), source.channel))

    def normal_map(self, name: str) -> dict[str, Any] | None:
        """The image of an input, as normals in tangent space; None if there is no image."""
        picture = self._read(name).picture
        if picture is None:
            return None
        # Directions are not colours, whatever the file declares.
        picture.space = "raw"
        return {"texture": self._placed(picture, False), "scale": 1.0}

    def _read(self, name: str) -> _Source:
        given = self.shader.GetInput(name)
        return self._resolve(given) if given else _Source()

    def _resolve(self, given: Any, depth: int = 0) -> _Source:
        attributes = given.GetValueProducingAttributes() if depth < _MAX_DEPTH else []
        if not attributes:
            return _Source(given.Get())
        attribute = attributes[0]
        if not UsdShade.Output.IsOutput(attribute):
            return _Source(self.context.value(attribute))
        # A node may be named many times, by itself too.
        key = str(attribute.GetPath())
        if key not in self.sources:
            self.sources[key] = _Source()
            prim = UsdShade.Shader(attribute.GetPrim())
            self.sources[key] = self._node(prim, attribute.GetName(), depth + 1)
        return self.sources[key]

    def _node(self, shader: Any, output: str, depth: int) -> _Source:
        kind = kind_of(shader)
        channel = _CHANNELS.get(output.split(":")[-1], 0)
        if kind == "UsdUVTexture" or kind.startswith(_PICTURES):
            return _Source(None, self._texture(shader, kind), channel)
        if kind.startswith(_PRIMVARS):
            return self._primvar(shader, kind)
        if kind.startswith("ND_constant"):
            return _Source(shader.GetInput("value").Get() if shader.GetInput("value") else None)
        if kind.startswith("ND_multiply"):
            product = self._product(
                [
                    self._resolve(shader.GetInput(name), depth)
                    for name in ("in1", "in2")
                    if shader.GetInput(name)
                ]
            )
            if product is not None:
                return product
        if kind.startswith("ND_mix"):
            mixed = self._mixed(shader, depth)
            if mixed is not None:
                return mixed
        if kind.startswith("ND_extract"):
            source = self._resolve(shader.GetInput("in"), depth)
            index = int(self._value_of(shader, "index", 0))
            value = (
                source.value[index]
                if source.value is not None and source.picture is None
                else source.value
            )
            return _Source(value, source.picture, index)
        for name in ("in", "in1", "input", "base", "fg"):
            if shader.GetInput(name):
                if not kind.startswith(
                    ("ND_normalmap", "ND_convert", "ND_swizzle", "ND_dot", "ND_separate")
                ):
                    self.context.remark(f"{shader.GetPath()}: a node of kind {kind} is passed by")
                source = self._resolve(shader.GetInput(name), depth)
                source.channel = channel if kind.startswith("ND_separate") else source.channel
                return source
        self.context.remark(
            f"{shader.GetPath()}: a node of kind {kind} is not supported and was left out"
        )
        return _Source()

    def _primvar(self, shader: Any, kind: str) -> _Source:
        name = self._value_of(shader, "varname", self._value_of(shader, "geomprop", None))
        if name and ("float3" in kind or "vector" in kind or "color3" in kind):
            return _Source(primvar=str(name))
        if name:
            self.constants.add(str(name))
            value = constant_primvar(self.context, self.user, str(name))
            if value is not None:
                return _Source(value)
        self.context.remark(f"{shader.GetPath()}: a primvar as input of a surface is left out")
        given = shader.GetInput("fallback") or shader.GetInput("default")
        return _Source(given.Get() if given else None)

    def _mixed(self, shader: Any, depth: int) -> _Source | None:
        """The mixture of a foreground and a background by a constant share. None if it is more than
        a constant times an image.
        """
        share = self._value_of(shader, "mix", 0.0)
        if isinstance(share, str):
            return None
        sides: list[_Source] = []
        for name, weight in (("fg", share), ("bg", 1 - np.asarray(share))):
            given = shader.GetInput(name)
            source = self._resolve(given, depth) if given else _Source(0.0)
            if source.picture is None and source.value is None:
                return None
            side = self._product([source, _Source(weight)])
            if side is None:
                return None
            sides.append(side)
        if not self._is_constant(shader.GetInput("mix"), depth):
            return None
        lit = [side for side in sides if side.picture is not None or np.any(side.value)]
        if len(lit) == 1:
            return lit[0]
        if any(side.picture is not None for side in lit):
            return None
        return _Source(np.sum([np.asarray(side.value) for side in sides], axis=0))

    def _is_constant(self, given: Any, depth: int) -> bool:
        source = self._resolve(given, depth) if given else _Source()
        return source.picture is None and not source.primvar

    @staticmethod
    def _product(sides: list[_Source]) -> _Source | None:
        """The product of some sources: a constant and at most one image. None if two sources are
        images, or one is a primvar.
        """
        pictures = [side for side in sides if side.picture is not None]
        if len(pictures) > 1 or any(side.primvar for side in sides):
            return None
        factor = None
        for value in (side.value for side in sides if side.value is not None):
            factor = value if factor is None else np.asarray(factor) * np.asarray(value)
        return (
            _Source(factor, pictures[0].picture, pictures[0].channel)
            if pictures
            else _Source(factor)
        )

    def _value_of(self, shader: Any, name: str, default: Any) -> Any:
        given = shader.GetInput(name)
        value = self._resolve(given).value if given else None
        return default if value is None else value

    def _texture(self, shader: Any, kind: str) -> _Picture | None:
        file = shader.GetInput("file")
        asset = self._resolve(file).value if file else None
        if asset is None or not getattr(asset, "path", ""):
            self.context.remark(f"{shader.GetPath()}: a texture without a file is left out")
            return None
        space = str(self._value_of(shader, "sourceColorSpace", "auto"))
        authored = file.GetAttr().GetColorSpace() if file.GetAttr().HasColorSpace() else ""
        if space == "auto" and authored:
            space = "sRGB" if "srgb" in authored.lower() else "raw"
        names = (
            ("wrapS", "wrapT")
            if shader.GetInput("wrapS") or shader.GetInput("wrapT")
            else ("uaddressmode", "vaddressmode")
        )
        wraps = [
            _WRAPS.get(str(self._value_of(shader, name, "repeat")), "repeat") for name in names
        ]
        scale = np.array(self._value_of(shader, "scale", (1, 1, 1, 1)), dtype=np.float64).reshape(
            -1
        )
        bias = np.array(self._value_of(shader, "bias", (0, 0, 0, 0)), dtype=np.float64).reshape(-1)
        st = np.eye(3)
        if (given := shader.GetInput("st") or shader.GetInput("texcoord")) and not kind.startswith(
            "ND_gltf"
        ):
            st = self._placement(given)
        if tiling := shader.GetInput("uvtiling"):
            st = (
                np.diag([*np.array(self._resolve(tiling).value or (1, 1), dtype=np.float64), 1.0])
                @ st
            )
        return _Picture(
            self.context.image(asset, (file.GetValueProducingAttributes() or [file.GetAttr()])[0]),
            space,
            wraps,
            scale,
            bias,
            st,
        )

    def _placement(self, given: Any, depth: int = 0) -> np.ndarray:
        """The map from the texture coordinates of the mesh to those of the image."""
        attributes = given.GetValueProducingAttributes() if depth < _MAX_DEPTH else []
        if not attributes or not UsdShade.Output.IsOutput(attributes[0]):
            return np.eye(3)
        shader = UsdShade.Shader(attributes[0].GetPrim())
        if kind_of(shader) not in ("UsdTransform2d", "ND_UsdTransform2d", "ND_place2d_vector2"):
            return np.eye(3)
        name = "in" if shader.GetInput("in") else "texcoord"
        before = (
            self._placement(shader.GetInput(name), depth + 1)
            if shader.GetInput(name)
            else np.eye(3)
        )
        angle = math.radians(
            float(self._value_of(shader, "rotation", self._value_of(shader, "rotate", 0.0)))
        )
        sx, sy = (float(x) for x in self._value_of(shader, "scale", (1, 1)))
        tx, ty = (
            float(x)
            for x in self._value_of(shader, "translation", self._value_of(shader, "offset", (0, 0)))
        )
        turn = np.array(
            [
                [math.cos(angle), -math.sin(angle), tx],
                [math.sin(angle), math.cos(angle), ty],
                [0, 0, 1],
            ]
        )
        return turn @ np.diag([sx, sy, 1.0]) @ before

    def _placed(self, picture: _Picture, is_color: bool) -> int:
        """The number of a texture of the scene; its v grows downwards."""
        is_srgb = is_color if picture.space == "auto" else picture.space.lower().startswith("srgb")
        flip = np.array([[1.0, 0, 0], [0, -1.0, 1.0], [0, 0, 1.0]])
        return self.context.texture(
            picture.image, is_srgb=is_srgb, wrap=picture.wrap, uv_transform=flip @ picture.st
        )


def _three(value: Any) -> np.ndarray:
    return np.resize(np.array(value, dtype=np.float64).reshape(-1), 3)
