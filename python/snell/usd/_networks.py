"""Shading networks: the values of surface inputs through the nodes that they are connected to."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pxr import UsdShade

from ._context import Context, Needs, color_form, scalar_form
from ._primvars import State, primvar_state

__all__ = ["Network", "kind_of"]

#: Maximum length of a chain of nodes.
_MAX_DEPTH = 32
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "outr": 0, "outg": 1, "outb": 2, "outa": 3}
_CHANNELS |= {"x": 0, "y": 1, "z": 2, "w": 3, "outx": 0, "outy": 1, "outz": 2, "outw": 3}
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
_PRIMVARS = ("UsdPrimvarReader", "ND_geompropvalue", "ND_UsdPrimvarReader", "ND_geomcolor")
#: Nodes whose value is that of their first input.
_PASSED = ("ND_normalmap", "ND_convert", "ND_dot_")


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
    uv_set: int


@dataclass
class _Source:
    """The value of an input: a constant, or a constant times an image, a computed texture, or a
    primvar that varies.
    """

    value: Any = None
    picture: _Picture | None = None
    #: The number of a texture of the scene.
    pattern: int | None = None
    channel: int = 0
    primvar: str | None = None

    @property
    def is_constant(self) -> bool:
        return self.picture is None and self.pattern is None and self.primvar is None


class Network:
    """The inputs of a surface, as the prim `user` shows it."""

    def __init__(self, context: Context, shader: Any, user: Any, tile: int | None = None) -> None:
        self.context, self.shader, self.user, self.tile = context, shader, user, tile
        #: What the outputs of nodes are; nothing while a node is being looked at.
        self.sources: dict[str, _Source] = {}
        #: The inputs that were asked for.
        self.read: set[str] = set()
        #: What the primvars that are read are on the prim, by name.
        self.primvars: dict[str, State] = {}
        #: The primvars that are the colour of the base and the opacity, for the vertices of meshes.
        self.color_primvar: str | None = None
        self.opacity_primvar: str | None = None
        #: The sets of texture coordinates that are read, by name.
        self.coordinates: dict[str, int] = {}
        self.tiles: tuple[int, tuple[tuple[float, ...], ...]] | None = None

    @property
    def needs(self) -> Needs:
        """What the surface reads from the meshes that it is on."""
        return Needs(
            self.color_primvar,
            self.opacity_primvar,
            tuple(sorted(self.coordinates.items())),
            self.tiles,
        )

    def constant(self, name: str, default: Any) -> Any:
        """The constant of an input; an image is ignored."""
        value = self._read(name).value
        return default if value is None else value

    def varying(self, name: str) -> str | None:
        """The primvar that an input is, if it varies."""
        return self._read(name).primvar

    def color(self, name: str, default: Any, *, may_be_primvar: bool = False) -> dict[str, Any]:
        """The colour of an input: a constant, a texture times a constant, or (if `may_be_primvar`)
        the colours of vertices times a constant.
        """
        source = self._read(name)
        if source.primvar and may_be_primvar:
            self.color_primvar = source.primvar
            return color_form(_three(1.0 if source.value is None else source.value))
        if source.primvar:
            self._leave_out(source.primvar, name)
            return color_form(_three(default))
        if source.is_constant and source.value is None:
            return color_form(_three(default))
        return self._color(source, is_color=True)

    def scalar(self, name: str, default: float, *, may_be_primvar: bool = False) -> dict[str, Any]:
        """The number of an input: a constant, a texture times a constant, or (if `may_be_primvar`)
        the opacity of vertices times a constant.
        """
        source = self._read(name)
        value = None if source.value is None else float(_numbers(source.value)[0])
        if source.primvar and may_be_primvar:
            self.opacity_primvar = source.primvar
            return scalar_form(1.0 if value is None else value)
        if source.primvar:
            self._leave_out(source.primvar, name)
            return scalar_form(default)
        if source.is_constant:
            return scalar_form(default if value is None else value)
        factor = 1.0 if value is None else value
        if source.picture is None:
            assert source.pattern is not None
            return scalar_form(factor, (source.pattern, min(source.channel, 2)))
        picture, channel = source.picture, source.channel
        if channel < len(picture.bias) and picture.bias[channel] != 0:
            if channel < 3:
                pattern = self._color(replace(source, value=None), is_color=False)["texture"]
                return scalar_form(factor, (pattern, channel))
            self.context.remark(
                f"{self.shader.GetPath()}: the bias of the alpha of the texture of {name} is left "
                "out"
            )
        factor *= float(picture.scale[min(channel, len(picture.scale) - 1)])
        return scalar_form(factor, (self._placed(picture, False), channel))

    def normal_map(self, name: str) -> dict[str, Any] | None:
        """The texture of an input, as normals in tangent space; `None` if there is none."""
        source = self._read(name)
        scale = 1.0 if source.value is None else float(_numbers(source.value)[0])
        if source.pattern is not None:
            return {"texture": source.pattern, "scale": scale}
        picture = source.picture
        if picture is None:
            if source.primvar:
                self._leave_out(source.primvar, name)
            return None
        # Directions are not colours, whatever the file declares.
        picture = replace(picture, space="raw")
        scale3, bias = np.resize(picture.scale, 3), np.resize(picture.bias, 3)
        is_usual = np.allclose(scale3, 2) and np.allclose(bias, -1)
        if is_usual or (np.allclose(scale3, 1) and np.allclose(bias, 0)):
            return {"texture": self._placed(picture, False), "scale": scale}
        # The picture times the scale plus the bias is the normal, which is stored as (n + 1) / 2.
        plain = replace(picture, scale=np.ones(4), bias=np.zeros(4))
        stored = self._affine(_Source(picture=plain), scale3 / 2, (bias + 1) / 2, is_color=False)
        return {"texture": stored.pattern, "scale": scale}

    def _leave_out(self, primvar: str, name: str) -> None:
        self.context.remark(
            f"{self.shader.GetPath()}: the primvar {primvar} as {name} varies and is left out"
        )

    def _color(self, source: _Source, *, is_color: bool) -> dict[str, Any]:
        """A source as a colour: a factor, and the texture that it multiplies."""
        factor = _three(1.0 if source.value is None else source.value)
        if source.pattern is not None:
            return color_form(factor, source.pattern)
        if source.picture is None:
            return color_form(_three(0.0 if source.value is None else source.value))
        picture = source.picture
        scale, bias = np.resize(picture.scale, 3), np.resize(picture.bias, 3)
        placed = self._placed(picture, is_color)
        if not np.any(bias):
            return color_form(scale * factor, placed)
        mixed = self.context.pattern(
            "mix",
            first=color_form(bias),
            second=color_form(bias + scale),
            amount=color_form((1, 1, 1), placed),
        )
        return color_form(factor, mixed)

    def left_out(self) -> list[str]:
        """The inputs of the surface that have a value but were not asked for."""
        return [
            name
            for given in self.shader.GetInputs()
            if (name := given.GetBaseName()) not in self.read
            and (given.HasConnectedSource() or _is_set(given.Get()))
        ]

    def _read(self, name: str) -> _Source:
        self.read.add(name)
        given = self.shader.GetInput(name)
        return self._resolve(given) if given else _Source()

    def _resolve(self, given: Any, depth: int = 0) -> _Source:
        attributes = given.GetValueProducingAttributes() if depth < _MAX_DEPTH else []
        if not attributes:
            return _Source(self.context.value(given.GetAttr()))
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
            picture = self._texture(shader, kind)
            return (
                _Source(None, picture, channel=channel)
                if picture
                else self._fallback(shader, output, channel)
            )
        if kind.startswith(_PRIMVARS):
            return self._primvar(shader, kind, depth, channel)
        if kind.startswith("ND_texcoord"):
            index = int(self._value_of(shader, "index", 0))
            return self._coordinates(f"st{index}" if index else None, channel)
        if kind.startswith("ND_constant"):
            return self._input(shader, "value", depth)
        computed = self._computed(shader, kind, depth)
        if computed is not None:
            return computed
        if kind.startswith("ND_extract"):
            index = int(self._value_of(shader, "index", 0))
            return _channel_of(self._input(shader, "in", depth), index)
        if "separate" in kind:
            return _channel_of(self._input(shader, "in", depth), channel)
        if kind.startswith("ND_swizzle"):
            return self._swizzled(shader, depth)
        for name in ("in", "in1", "input", "base", "fg"):
            if shader.GetInput(name):
                if not kind.startswith(_PASSED):
                    self.context.remark(f"{shader.GetPath()}: a node of kind {kind} is passed by")
                source = self._input(shader, name, depth)
                if kind.startswith("ND_normalmap") and source.picture is not None:
                    return replace(source, value=self._value_of(shader, "scale", 1.0))
                return source
        self.context.remark(
            f"{shader.GetPath()}: a node of kind {kind} is not supported and was left out"
        )
        return _Source()

    def _swizzled(self, shader: Any, depth: int) -> _Source:
        """An input with its channels in another order."""
        source = self._input(shader, "in", depth)
        names = str(self._value_of(shader, "channels", ""))
        places = [_CHANNELS.get(name, 0) for name in names]
        if source.is_constant and source.value is not None and places:
            values = _numbers(source.value)
            chosen = [
                float(name) if name in "01" else values[min(place, len(values) - 1)]
                for name, place in zip(names, places, strict=True)
            ]
            return _Source(chosen if len(chosen) > 1 else chosen[0])
        if len(places) == 1:
            return replace(source, channel=places[0])
        if places != list(range(len(places))):
            self.context.remark(f"{shader.GetPath()}: the order {names} of channels is left out")
        return source

    def _input(self, shader: Any, name: str, depth: int, default: Any = None) -> _Source:
        given = shader.GetInput(name)
        source = self._resolve(given, depth) if given else _Source()
        return _Source(default) if source.is_constant and source.value is None else source

    def _computed(self, shader: Any, kind: str, depth: int) -> _Source | None:
        """The value of a node that computes; `None` if it is not of a kind that is known, or its
        inputs are.
        """
        operation = kind.split("_")[1] if kind.startswith("ND_") and kind.count("_") > 1 else ""
        is_color = "color" in kind
        get = lambda name, default=0.0: self._input(shader, name, depth, default)  # noqa: E731
        if operation == "multiply":
            return self._product(get("in1"), get("in2", 1.0), is_color)
        if operation == "divide":
            below = get("in2", 1.0)
            if not below.is_constant or not np.all(_numbers(below.value)):
                return None
            return self._product(get("in1"), _Source(1 / _numbers(below.value)), is_color)
        if operation in ("add", "subtract"):
            return self._sum(get("in1"), get("in2"), operation == "subtract", is_color)
        if operation == "invert":
            return self._sum(get("amount", 1.0), get("in"), True, is_color)
        if operation == "mix":
            return self._mixed(get("fg"), get("bg"), get("mix"), is_color)
        if operation == "contrast":
            amount, pivot = get("amount", 1.0), get("pivot", 0.5)
            if not (amount.is_constant and pivot.is_constant):
                return None
            by, at = np.broadcast_arrays(_three(amount.value), _three(pivot.value))
            return self._affine(get("in"), by, at - by * at, is_color=is_color)
        if operation == "remap":
            ends = [
                get(name, default)
                for name, default in (("inlow", 0), ("inhigh", 1), ("outlow", 0), ("outhigh", 1))
            ]
            if not all(end.is_constant for end in ends):
                return None
            low, high, first, last = (_three(end.value) for end in ends)
            by = (last - first) / np.where(high == low, 1.0, high - low)
            return self._affine(get("in"), by, first - by * low, is_color=is_color)
        if operation == "power":
            return self._power(get("in1"), get("in2", 1.0), is_color)
        if operation == "clamp":
            return self._clamped(get("in"), get("low"), get("high", 1.0), is_color)
        if operation in ("combine2", "combine3", "combine4"):
            parts = [get(f"in{i}") for i in range(1, int(operation[-1]) + 1)]
            if all(part.is_constant for part in parts):
                return _Source(np.concatenate([_numbers(part.value)[:1] for part in parts]))
        return None

    def _product(self, a: _Source, b: _Source, is_color: bool) -> _Source | None:
        """The product of two sources; `None` if one is a primvar and the other varies too."""
        if not _is_numeric(a, b):
            return None
        if a.is_constant:
            a, b = b, a
        if b.is_constant:
            return replace(a, value=b.value if a.value is None else _times(a.value, b.value))
        if a.primvar or b.primvar:
            return None
        forms = [self._color(side, is_color=is_color) for side in (a, b)]
        return _Source(
            pattern=self.context.pattern("scale", texture=forms[0], scale=forms[1]),
            channel=a.channel,
        )

    def _sum(self, a: _Source, b: _Source, is_difference: bool, is_color: bool) -> _Source | None:
        """The sum or the difference of two sources; `None` if one is a primvar."""
        if not _is_numeric(a, b) or a.primvar or b.primvar:
            return None
        sign = -1.0 if is_difference else 1.0
        if a.is_constant and b.is_constant:
            return _Source(_numbers(a.value) + sign * _fit(_numbers(b.value), a.value))
        if b.is_constant:
            return self._affine(a, _three(1.0), sign * _three(b.value), is_color=is_color)
        if a.is_constant:
            return self._affine(b, _three(sign), _three(a.value), is_color=is_color)
        # Half of either is a mixture; a mixture by -1 is twice the first without the second.
        first, second = (self._color(side, is_color=is_color) for side in (a, b))
        if is_difference:
            first = {**first, "factor": [x / 2 for x in first["factor"]]}
        mixed = self.context.pattern(
            "mix",
            first=first,
            second=second,
            amount=color_form((-1, -1, -1) if is_difference else (0.5, 0.5, 0.5)),
        )
        return _Source(None if is_difference else 2.0, pattern=mixed, channel=a.channel)

    def _affine(
        self, source: _Source, scale: np.ndarray, bias: np.ndarray, *, is_color: bool
    ) -> _Source:
        """A source times a scale, plus a bias."""
        if source.is_constant or source.primvar:
            value = _numbers(0.0 if source.value is None else source.value)
            if source.primvar:
                self._leave_out(source.primvar, "a summand")
            return _Source(value * _fit(scale, value) + _fit(bias, value))
        mixed = self.context.pattern(
            "mix",
            first=color_form(bias),
            second=color_form(bias + scale),
            amount=self._color(source, is_color=is_color),
        )
        return _Source(pattern=mixed, channel=source.channel)

    def _mixed(self, fg: _Source, bg: _Source, share: _Source, is_color: bool) -> _Source | None:
        """The mixture of a foreground and a background; `None` if one is a primvar."""
        if not _is_numeric(fg, bg, share):
            return None
        if share.is_constant:
            weight = _numbers(share.value)
            sides = [self._product(fg, _Source(weight), is_color)]
            sides.append(self._product(bg, _Source(1 - weight), is_color))
            lit = [
                side
                for side in sides
                if side is None or not (side.value is not None and not np.any(side.value))
            ]
            if len(lit) == 1:
                return lit[0]
            if not lit or all(side is not None and side.is_constant for side in sides):
                values = [_numbers(side.value) for side in sides if side is not None]
                return _Source(values[0] + _fit(values[1], values[0]))
        if fg.primvar or bg.primvar or share.primvar:
            return None
        mixed = self.context.pattern(
            "mix",
            first=self._color(bg, is_color=is_color),
            second=self._color(fg, is_color=is_color),
            amount=self._color(share, is_color=False),
        )
        return _Source(pattern=mixed, channel=max(fg.channel, bg.channel))

    def _power(self, base: _Source, exponent: _Source, is_color: bool) -> _Source | None:
        """A source to a constant power, which is one number if the source is a texture."""
        if not exponent.is_constant or base.primvar or not _is_numeric(base, exponent):
            return None
        power = _numbers(exponent.value)
        if base.is_constant:
            return _Source(np.maximum(_numbers(base.value), 0) ** _fit(power, base.value))
        if np.ptp(power) > 0 or power[0] <= 0:
            return None
        form = self._color(base, is_color=is_color)
        pattern = self.context.pattern("power", base=form, exponent=float(power[0]))
        return _Source(pattern=pattern, channel=base.channel)

    def _clamped(
        self, source: _Source, low: _Source, high: _Source, is_color: bool
    ) -> _Source | None:
        """A source between constants, which are 0 and 1 if the source is a texture."""
        if not (low.is_constant and high.is_constant) or not _is_numeric(source, low, high):
            return None
        least, most = _numbers(low.value), _numbers(high.value)
        if source.is_constant:
            value = _numbers(source.value)
            return _Source(np.clip(value, _fit(least, value), _fit(most, value)))
        if np.any(least) or np.any(most != 1) or source.primvar:
            return None
        ramp = self.context.pattern(
            "ramp",
            amount=self._color(source, is_color=is_color),
            colors=[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]],
        )
        return _Source(pattern=ramp, channel=source.channel)

    def _coordinates(self, name: str | None, channel: int) -> _Source:
        """Texture coordinates as red and green."""
        uv_set = self.context.uv_set(name, self.coordinates) if name else 0
        pattern = self.context.pattern(
            "bilerp",
            **{f"v{s}{t}": color_form((s, t, 0)) for s in (0, 1) for t in (0, 1)},
            mapping={"uv": {"uv_set": uv_set, "uv_transform": [[1, 0, 0], [0, 1, 0]]}},
        )
        return _Source(pattern=pattern, channel=channel)

    def _primvar(self, shader: Any, kind: str, depth: int, channel: int) -> _Source:
        name = self._value_of(shader, "varname", self._value_of(shader, "geomprop", None))
        if kind.startswith("ND_geomcolor"):
            name = "displayColor"
        given = shader.GetInput("fallback") or shader.GetInput("default")
        fallback = self._resolve(given, depth) if given else _Source()
        if not name:
            return fallback
        name = str(name)
        if name not in self.primvars:
            self.primvars[name] = primvar_state(self.context, self.user, name)
        state = self.primvars[name]
        if state == () and kind.endswith(("vector2", "float2")):
            return self._coordinates(name, channel)
        if state == ():
            return _Source(primvar=name)
        if state is not None:
            return _Source(state if len(state) > 1 else state[0])
        self.context.remark(
            f"{shader.GetPath()}: some prims have no primvar {name}; the fallback is used"
        )
        return fallback

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
        scale = _numbers(self._value_of(shader, "scale", (1, 1, 1, 1)))
        bias = _numbers(self._value_of(shader, "bias", (0, 0, 0, 0)))
        st, name = np.eye(3), None
        if (given := shader.GetInput("st") or shader.GetInput("texcoord")) and not kind.startswith(
            "ND_gltf"
        ):
            st, name = self._placement(given)
        uv_set = self.context.uv_set(name, self.coordinates) if name else 0
        two = lambda name, default: np.resize(  # noqa: E731
            _numbers(self._value_of(shader, name, default)), 2
        )
        if kind.startswith("ND_tiledimage"):
            size = two("realworldimagesize", 1.0)
            by = two("realworldtilesize", 1.0) / np.where(size == 0, 1, size)
            st = _scaled(by) @ _moved(-two("uvoffset", 0.0)) @ _scaled(two("uvtiling", 1.0)) @ st
        attribute = (file.GetValueProducingAttributes() or [file.GetAttr()])[0]
        if "<UDIM>" in asset.path:
            self.tiles = (uv_set, tuple(tuple(float(x) for x in row) for row in st[:2]))
            tile = self._tile(asset, attribute)
            if tile is None:
                return None
            number, asset = tile
            st, wraps = _moved([-(number % 10), -(number // 10)]) @ st, ["clamp", "clamp"]
        return _Picture(self.context.image(asset, attribute), space, wraps, scale, bias, st, uv_set)

    def _fallback(self, shader: Any, output: str, channel: int) -> _Source:
        """What the output of a picture is where there is none: the fallback of the file, black for
        a tile that is missing, and else the default of the surface.
        """
        given = shader.GetInput("fallback") or shader.GetInput("default")
        value = self._resolve(given).value if given else None
        if value is None and self.tiles is not None and self.tile is not None:
            value = (0.0, 0.0, 0.0, 1.0)
        if value is None:
            return _Source()
        numbers = _numbers(value)
        is_one = output.split(":")[-1] in _CHANNELS
        return _Source(numbers[min(channel, len(numbers) - 1)] if is_one else numbers[:3])

    def _tile(self, asset: Any, attribute: Any) -> tuple[int, Any] | None:
        """The number of a tile, counted from 0, and its picture."""
        numbers = range(100) if self.tile is None else [self.tile]
        for number in numbers:
            found = self.context.files.tile(asset, attribute, 1001 + number)
            if found is not None:
                return number, found
        if self.tile is None:
            self.context.remark(
                f"{attribute.GetPrim().GetPath()}: the picture {asset.path!r}: no tile of it "
                "exists; the texture is left out"
            )
        return None

    def _placement(self, given: Any, depth: int = 0) -> tuple[np.ndarray, str | None]:
        """The map from the texture coordinates of the mesh to those of the image, and the name of
        those of the mesh, if it is known.
        """
        attributes = given.GetValueProducingAttributes() if depth < _MAX_DEPTH else []
        if not attributes or not UsdShade.Output.IsOutput(attributes[0]):
            return np.eye(3), None
        shader = UsdShade.Shader(attributes[0].GetPrim())
        kind = kind_of(shader)
        if kind.startswith(_PRIMVARS):
            name = self._value_of(shader, "varname", self._value_of(shader, "geomprop", None))
            return np.eye(3), str(name) if name else None
        if kind.startswith("ND_texcoord"):
            index = int(self._value_of(shader, "index", 0))
            return np.eye(3), f"st{index}" if index else None
        before: tuple[np.ndarray, str | None] = np.eye(3), None
        for name in ("in", "texcoord", "in1"):
            if shader.GetInput(name):
                before = self._placement(shader.GetInput(name), depth + 1)
                break
        two = lambda name, default: np.resize(  # noqa: E731
            _numbers(self._value_of(shader, name, default)), 2
        )
        if kind in ("UsdTransform2d", "ND_UsdTransform2d"):
            angle = math.radians(float(self._value_of(shader, "rotation", 0.0)))
            own = _moved(two("translation", 0.0)) @ _turned(angle)
            own = own @ _scaled(two("scale", 1.0))
        elif kind.startswith("ND_place2d"):
            # The inverse of scaling, turning and moving the picture around its pivot.
            angle = math.radians(float(self._value_of(shader, "rotate", 0.0)))
            pivot, scale = two("pivot", 0.0), two("scale", 1.0)
            shrink = _scaled(1 / np.where(scale == 0, 1, scale))
            own = _moved(-two("offset", 0.0))
            if int(self._value_of(shader, "operationorder", 0)) == 0:
                own = own @ _turned(-angle) @ shrink
            else:
                own = shrink @ _turned(-angle) @ own
            own = _moved(pivot) @ own @ _moved(-pivot)
        elif kind.startswith("ND_multiply"):
            own = _scaled(two("in2", 1.0))
        elif kind.startswith("ND_divide"):
            by = two("in2", 1.0)
            own = _scaled(1 / np.where(by == 0, 1, by))
        elif kind.startswith("ND_add"):
            own = _moved(two("in2", 0.0))
        elif kind.startswith("ND_subtract"):
            own = _moved(-two("in2", 0.0))
        elif kind.startswith("ND_rotate2d"):
            own = _turned(-math.radians(float(self._value_of(shader, "amount", 0.0))))
        else:
            own = np.eye(3)
            if not kind.startswith(("ND_convert", "ND_dot_")):
                self.context.remark(
                    f"{shader.GetPath()}: a node of kind {kind} in texture coordinates is passed by"
                )
        return own @ before[0], before[1]

    def _placed(self, picture: _Picture, is_color: bool) -> int:
        """The number of a texture of the scene; its v grows downwards."""
        is_srgb = is_color if picture.space == "auto" else picture.space.lower().startswith("srgb")
        flip = np.array([[1.0, 0, 0], [0, -1.0, 1.0], [0, 0, 1.0]])
        return self.context.texture(
            picture.image,
            is_srgb=is_srgb,
            wrap=picture.wrap,
            uv_transform=flip @ picture.st,
            uv_set=picture.uv_set,
        )


def _numbers(value: Any) -> np.ndarray:
    """A number or several ones as a row."""
    return np.array(value, dtype=np.float64).reshape(-1)


def _three(value: Any) -> np.ndarray:
    return np.resize(_numbers(value), 3)


def _fit(values: np.ndarray, other: Any) -> np.ndarray:
    """Numbers as many as `other` has, such as those of a colour without its alpha."""
    return np.resize(values, len(_numbers(other)))


def _times(a: Any, b: Any) -> np.ndarray:
    """The product of numbers; one number multiplies all, and else as many count as both have."""
    a, b = _numbers(a), _numbers(b)
    if 1 not in (len(a), len(b)):
        size = min(len(a), len(b))
        a, b = a[:size], b[:size]
    return np.asarray(a * b)


def _channel_of(source: _Source, index: int) -> _Source:
    """One number of a source."""
    if not source.is_constant:
        return replace(source, channel=index)
    if source.value is None:
        return source
    values = _numbers(source.value)
    return _Source(values[min(index, len(values) - 1)])


def _is_numeric(*sources: _Source) -> bool:
    """True unless a constant is a text or a file."""
    for source in sources:
        if source.is_constant and source.value is None:
            return False
        if source.value is not None and np.array(source.value).dtype.kind not in "bfiu":
            return False
    return True


def _is_set(value: Any) -> bool:
    """True for a value that is not 0."""
    if value is None or isinstance(value, str):
        return bool(value)
    array = np.array(value)
    return array.dtype.kind in "bfiu" and bool(np.any(array))


def _moved(by: Any) -> np.ndarray:
    return np.array([[1.0, 0, by[0]], [0, 1.0, by[1]], [0, 0, 1.0]])


def _scaled(by: Any) -> np.ndarray:
    return np.diag([by[0], by[1], 1.0])


def _turned(angle: float) -> np.ndarray:
    sin, cos = math.sin(angle), math.cos(angle)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
