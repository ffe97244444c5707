"""The files of a stage. Only regular files are allowed, and only those in the stage's folder if
the stage is confined. They are checked before USD opens any of them.
"""

from __future__ import annotations

import glob
import os
import re
import stat
from collections.abc import Iterator
from typing import Any

from pxr import Ar, Sdf, Tf

from ._materialx import layer_of
from ._search import search

__all__ = ["Files", "Mended", "StageError", "cause"]

#: Formats of layers that name files only in USD's own ways.
_LAYERS = (".usd", ".usda", ".usdc", ".usdz")
#: The first bytes of pictures: PNG, JPEG, OpenEXR, Radiance, PFM and PNM, BMP, WebP, GIF, TIFF,
#: DDS, KTX2; and the last ones of Targa.
_PICTURES = (
    *(b"\x89PNG", b"\xff\xd8\xff", b"\x76\x2f\x31\x01", b"#?", b"PF", b"Pf", b"BM", b"RIFF"),
    *(b"GIF8", b"II*\0", b"MM\0*", b"DDS ", b"\xabKTX 20\xbb"),
    *(b"P%d" % number for number in range(1, 8)),
)
_TARGA = b"TRUEVISION-XFILE.\0"
_TRUST = "or leave out --confine"


class StageError(ValueError):
    """A fault of a stage: its place, what was found, and a remedy."""


def cause(error: Exception) -> str:
    """The text of the first error that USD reports, without the place in the library that stands
    before its colon.
    """
    lines = str(error).splitlines()
    return (
        next((line.split(" : '", 1)[1] for line in lines if " : '" in line), str(error))
        .strip()
        .rstrip("'")
    )


class Mended:
    """Changes of layers in memory, which last until they are undone: the layers may be shared with
    other stages of this process.
    """

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self._undo: list[Any] = []
        #: Layers that exist only while the changes do.
        self._kept: list[Any] = []

    def rates(self, layers: list[Any]) -> None:
        """Gives the layers whose time codes per second are 0 or no usable number 24 of them, with a
        remark on each. Between layers USD scales times by the ratio of their rates, and with an
        infinite ratio it never finds the samples of an attribute.
        """
        for layer in layers:
            rate = layer.timeCodesPerSecond
            if not 1e-6 < rate < 1e9:
                before = layer.timeCodesPerSecond if layer.HasTimeCodesPerSecond() else None
                self._edit(layer, lambda layer: setattr(layer, "timeCodesPerSecond", 24.0))
                self._undo.append((layer, lambda layer, before=before: _set_rate(layer, before)))
                self.remarks.append(
                    f"{os.path.basename(layer.identifier)}: {rate:g} time codes per second are no "
                    "rate; 24 were used"
                )

    def replaced(self, layer: Any, name: str, other: Any) -> None:
        """Lets a layer name another one in place of a file."""
        self._kept.append(other)
        identifier = other.identifier
        self._edit(layer, lambda layer: layer.UpdateCompositionAssetDependency(name, identifier))
        self._undo.append(
            (layer, lambda layer: layer.UpdateCompositionAssetDependency(identifier, name))
        )

    def undo(self) -> None:
        """Takes all changes back, the last first."""
        while self._undo:
            self._edit(*self._undo.pop())
        self._kept.clear()

    @staticmethod
    def _edit(layer: Any, change: Any) -> None:
        may_edit = layer.permissionToEdit
        layer.SetPermissionToEdit(True)
        change(layer)
        layer.SetPermissionToEdit(may_edit)


def _set_rate(layer: Any, rate: float | None) -> None:
    if rate is None:
        layer.ClearTimeCodesPerSecond()
    else:
        layer.timeCodesPerSecond = rate


class Files:
    """The files that the stage at `path` may open; at most `most` layers."""

    def __init__(self, path: str, *, confine: bool, most: int) -> None:
        self.path, self.confine, self.most = path, confine, most
        self.folder = os.path.realpath(os.path.dirname(path) or ".")
        #: Remarks on files that were found under other names than those in the stage.
        self.found: list[str] = []

    def layers(self, mended: Mended) -> list[Any]:
        """Opens the layers of the stage one after the other, and checks the name of each before.
        Files of MaterialX become layers in memory.
        """
        if problem := _not_a_file(self.path):
            raise StageError(f"{problem}; name an ordinary file")
        resolver = Ar.GetResolver()
        root = Sdf.Layer.FindOrOpen(self.path)
        if not root:
            raise StageError("this is not a USD stage that can be opened; check the file")
        found, known, todo = [root], {root.identifier}, [root]
        made: dict[str, Any] = {}
        with Ar.ResolverContextBinder(resolver.CreateDefaultContextForAsset(self.path)):
            while todo:
                layer = todo.pop()
                # A reference to its own layer has no name.
                for name in filter(None, layer.GetCompositionAssetDependencies()):
                    identifier = self._vetted(layer, name)
                    if _is_materialx(identifier):
                        self._read_materialx(layer, name, identifier, mended, made)
                        continue
                    if identifier in known:
                        continue
                    known.add(identifier)
                    if len(known) > self.most:
                        raise StageError(f"it names more than {self.most} layers; split the stage")
                    further = _opened(identifier)
                    if not further and (file := self._searched(layer, name)):
                        further = _opened(file)
                        if further:
                            mended.replaced(layer, name, further)
                            self._tell(name, file)
                    if further:
                        found.append(further)
                        todo.append(further)
                # The rates of clips play no part, and nothing that they name is used.
                for name, place in _clips(layer):
                    self._vetted(layer, name, place)
        return found

    def _read_materialx(
        self, layer: Any, name: str, identifier: str, mended: Mended, made: dict[str, Any]
    ) -> None:
        """Puts a layer in memory in place of a file of MaterialX."""
        identifier = Sdf.Layer.SplitIdentifier(identifier)[0]
        if identifier not in made:
            try:
                made[identifier] = layer_of(
                    identifier, lambda file: self._check_include(file, identifier, layer, name)
                )
            except ValueError as error:
                if isinstance(error, StageError):
                    raise
                made[identifier] = None
                mended.remarks.append(f"{os.path.basename(identifier)} is left out: {error}")
        if made[identifier]:
            mended.replaced(layer, name, made[identifier])

    def _check_include(self, path: str, name: str, layer: Any, place: str) -> None:
        """An error for a file that one of MaterialX includes and that may not be opened."""
        self.check(_file(path), os.path.basename(path), layer, _place(layer, place))
        if problem := _not_a_file(_file(path)):
            raise ValueError(problem)

    def check_opened(self, stage: Any) -> None:
        """An error for a stage that used a layer which was not checked before."""
        for layer in stage.GetUsedLayers(True):
            if not layer.anonymous:
                self.check(
                    _file(layer.realPath or layer.identifier),
                    layer.identifier,
                    stage.GetRootLayer(),
                )

    def check(self, file: str, name: str, layer: Any = None, place: str = "") -> None:
        """An error for a file outside of the folder. `layer` and `place` name the reference."""
        if not self.confine or (
            os.path.commonpath([self.folder, os.path.realpath(file)]) == self.folder
            and not _is_address(file)
        ):
            return
        problem = f'it names the file "{name}", which lies outside of the scene\'s folder'
        place = place or (_place(layer, name) if layer else "")
        raise self._error(layer, place, problem, f"move the file into the folder, {_TRUST}")

    def picture(self, asset: Any, attribute: Any) -> tuple[bytes | None, str]:
        """The content of an image that an attribute names, or the reason why there is none."""
        layer = _layer_of(attribute)
        if not asset.resolvedPath and (file := self._searched(layer, asset.path)):
            self._tell(asset.path, file)
            asset = Sdf.AssetPath(asset.path, str(Ar.GetResolver().Resolve(file)))
        path = asset.resolvedPath or asset.path
        file = self._beside(layer, path)
        self.check(file, asset.path, layer, str(attribute.GetPrim().GetPath()))
        if problem := _not_a_file(file):
            return None, problem
        found = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path)) if asset.resolvedPath else None
        if not found:
            return None, "cannot be opened"
        content = bytes(found.GetBuffer())
        is_known = content.startswith(_PICTURES) or content.endswith(_TARGA)
        if not is_known and content[4:8] != b"ftyp":
            return None, f"starts with {content[:8].hex(' ')}, which is no picture that Snell knows"
        return content, ""

    def tile(self, asset: Any, attribute: Any, number: int) -> Any:
        """The file of a tile of a picture whose name has `<UDIM>` in place of the tile's number;
        `None` if there is none.
        """
        layer = _layer_of(attribute)
        path, name = (
            text.replace("<UDIM>", str(number)) for text in (asset.resolvedPath, asset.path)
        )
        if not path:
            path = Sdf.ComputeAssetPathRelativeToLayer(layer, name) if layer else name
        resolved = str(Ar.GetResolver().Resolve(path))
        if not resolved and (file := self._searched(layer, name)):
            resolved = str(Ar.GetResolver().Resolve(file))
            self._tell(asset.path, file.replace(str(number), "<UDIM>"))
        return Sdf.AssetPath(name, resolved) if resolved else None

    def _searched(self, layer: Any, name: str) -> str | None:
        """The file that a name means which is not that of a file, beside the layer that names it or
        beside the stage; none for names in packages.
        """
        beside = os.path.dirname(_file(layer.realPath)) if layer and layer.realPath else ""
        if not name or Ar.IsPackageRelativePath(name) or "<UDIM>" in name:
            return None
        if os.path.lexists(os.path.join(beside or self.folder, name)):
            return None
        folders = list(dict.fromkeys(filter(None, (beside, self.folder))))
        return search(folders, name, self.folder if self.confine else None)

    def _tell(self, name: str, file: str) -> None:
        """Adds a remark on a file that was found under another name. Backslashes are none."""
        if not file.endswith("/" + name.replace("\\", "/").removeprefix("./")):
            shown = os.path.relpath(os.path.realpath(file), self.folder)
            self.found.append(f"{name!r} was found as {shown!r}")

    def _vetted(self, layer: Any, name: str, place: str = "") -> str:
        """The identifier of a layer that another layer names. Raises an error unless the layer is a
        file that may be opened.
        """
        if self.confine and Sdf.VariableExpression.IsExpression(name):
            problem = (
                f"it names a file by the expression {name}, which may lead out of the scene's "
                "folder"
            )
            raise self._error(
                layer, place or _place(layer, name), problem, f"write the name itself, {_TRUST}"
            )
        plain, arguments = Sdf.Layer.SplitIdentifier(name)
        anchored = Sdf.ComputeAssetPathRelativeToLayer(layer, plain)
        path = str(Ar.GetResolver().Resolve(anchored)) or anchored
        file = self._beside(layer, path)
        for match in _numbered(file):
            self.check(match, name, layer, place)
            if problem := _not_a_file(match):
                raise self._error(
                    layer,
                    place or _place(layer, name),
                    f'it names "{name}": {problem}',
                    "name an ordinary file",
                )
        kind = os.path.splitext(path.rstrip("]"))[1].lower()
        if self.confine and kind not in (*_LAYERS, ".mtlx") and os.path.exists(file):
            problem = (
                f'it names the layer "{name}", of a kind that may read files outside of the '
                "scene's folder"
            )
            raise self._error(
                layer, place or _place(layer, name), problem, f"convert it to USD, {_TRUST}"
            )
        return str(Sdf.Layer.CreateIdentifier(anchored, arguments))

    def _beside(self, layer: Any, path: str) -> str:
        """The file that a path leads into. A name that USD did not find is relative to the layer
        that names it.
        """
        folder = os.path.dirname(_file(layer.realPath)) if layer else self.folder
        file = _file(path)
        return file if _is_address(file) else os.path.join(folder, file)

    def _error(self, layer: Any, place: str, problem: str, remedy: str) -> StageError:
        other = _file(layer.realPath) if layer else ""
        where = f"at {place}: " if place else ""
        if other and os.path.realpath(other) != os.path.realpath(self.path):
            where = f"{os.path.relpath(os.path.realpath(other), self.folder)}: {where}"
        return StageError(f"{where}{problem}; {remedy}")


def _is_materialx(identifier: str) -> bool:
    """True for a file of MaterialX, unless USD itself reads it."""
    path = Sdf.Layer.SplitIdentifier(identifier)[0].rstrip("]")
    return path.lower().endswith(".mtlx") and not Sdf.FileFormat.FindByExtension("mtlx")


def _layer_of(attribute: Any) -> Any:
    """The layer that gives an attribute its value."""
    return next(
        (
            spec.layer
            for spec in attribute.GetPropertyStack()
            if spec.HasDefaultValue() or spec.HasInfo("timeSamples")
        ),
        None,
    )


def _opened(identifier: str) -> Any:
    """Opens a layer; None if it is missing or broken, which USD reports again when it composes the
    stage.
    """
    try:
        return Sdf.Layer.FindOrOpen(identifier)
    except Tf.ErrorException:
        return None


def _file(path: str) -> str:
    """The file that a path leads into, such as `a.usdz` for `a.usdz[b.usda]`."""
    return (
        str(Ar.SplitPackageRelativePathOuter(path)[0]) if Ar.IsPackageRelativePath(path) else path
    )


def _is_address(name: str) -> bool:
    """True for `file:///…`, `https://…` and similar."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", name) is not None


def _not_a_file(path: str) -> str:
    """The reason why a path leads to no file but to something that would be read for ever, such as
    a pipe; empty for regular files, folders, and paths that lead to nothing.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return ""
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return ""
    kind = "pipe" if stat.S_ISFIFO(mode) else "socket" if stat.S_ISSOCK(mode) else "device"
    return f"this is a {kind}, not a file"


def _numbered(file: str) -> list[str]:
    """The files that the name of a sequence, such as `clip.###.usd`, stands for. Any other name
    stands for itself.
    """
    if "#" not in file:
        return [file]
    return [file, *glob.glob(re.sub("#+", "*", glob.escape(file)))]


def _prims(layer: Any) -> Iterator[Any]:
    """The prims of a layer, including those of all variants."""
    paths: list[Any] = []
    layer.Traverse(
        Sdf.Path.absoluteRootPath,
        lambda path: (
            paths.append(path) if path.IsPrimPath() or path.IsPrimVariantSelectionPath() else None
        ),
    )
    return (prim for path in paths if (prim := layer.GetPrimAtPath(path)))


def _place(layer: Any, name: str) -> str:
    """The prim by which a layer names another one; empty for its sublayers."""
    if name in layer.subLayerPaths:
        return ""
    for prim in _prims(layer):
        for arcs in (prim.referenceList, prim.payloadList):
            if any(arc.assetPath == name for arc in arcs.GetAddedOrExplicitItems()):
                return str(prim.path)
    return ""


def _clips(layer: Any) -> Iterator[tuple[str, str]]:
    """The files of the value clips of a layer, and the prims that name them."""
    for prim in _prims(layer):
        clips = prim.GetInfo("clips") if prim.HasInfo("clips") else {}
        for values in clips.values():
            names = [
                values.get("manifestAssetPath"),
                values.get("templateAssetPath"),
                *(values.get("assetPaths") or []),
            ]
            for name in filter(None, (getattr(name, "path", name) for name in names)):
                yield str(name), str(prim.path)
