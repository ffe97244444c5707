"""Files of MaterialX as layers of USD. The package ``usd-core`` is built without the plug-in that
reads them; the prims here have the names and the places that the plug-in gives them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np
from pxr import Ar, Sdf, Tf, Usd, UsdShade

__all__ = ["layer_of"]

#: Maximum number of bytes of a file, of files that include one another, and of prims.
_MOST_BYTES, _MOST_FILES, _MOST_PRIMS = 64 << 20, 100, 100_000
#: Maximum depth of graphs in one another.
_MAX_DEPTH = 32
_TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "integer": Sdf.ValueTypeNames.Int,
    "boolean": Sdf.ValueTypeNames.Bool,
    "color3": Sdf.ValueTypeNames.Color3f,
    "color4": Sdf.ValueTypeNames.Color4f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
    "vector4": Sdf.ValueTypeNames.Float4,
    "filename": Sdf.ValueTypeNames.Asset,
    "surfaceshader": Sdf.ValueTypeNames.Token,
    "displacementshader": Sdf.ValueTypeNames.Token,
    "volumeshader": Sdf.ValueTypeNames.Token,
}
_METRES = {
    "nanometer": 1e-9,
    "micron": 1e-6,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "meter": 1.0,
    "kilometer": 1e3,
    "inch": 0.0254,
    "foot": 0.3048,
    "yard": 0.9144,
    "mile": 1609.344,
}


def layer_of(identifier: str, check: Callable[[str], None]) -> Any:
    """An anonymous layer with the materials of a file; a `ValueError` says why there is none.
    `check` raises an error for a file that may not be opened.
    """
    document = _Document(check)
    document.add(identifier)
    layer = Sdf.Layer.CreateAnonymous("materialx.usda")
    layer.defaultPrim = "MaterialX"
    stage = Usd.Stage.Open(layer)
    stage.DefinePrim("/MaterialX")
    for element in document.roots:
        if element.tag == "surfacematerial":
            _Material(document, stage, element).define()
    return layer


class _Document:
    """The elements of a file and of those that it includes."""

    def __init__(self, check: Callable[[str], None]) -> None:
        self.check = check
        self.files: set[str] = set()
        self.roots: list[Any] = []
        #: For each element, the element around it and the file.
        self.around: dict[Any, Any] = {}
        self.file: dict[Any, str] = {}
        #: The elements below an element by name, or the outermost ones below `None`.
        self.named: dict[Any, dict[str, Any]] = {}
        self.graphs: dict[str, Any] | None = None
        self.prims = 0

    def add(self, identifier: str) -> None:
        """Reads a file and those that it includes."""
        resolved = str(Ar.GetResolver().Resolve(identifier))
        if resolved in self.files:
            return
        self.files.add(resolved)
        if len(self.files) > _MOST_FILES:
            raise ValueError(f"more than {_MOST_FILES} files include one another")
        self.check(resolved or identifier)
        found = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
        if not found:
            raise ValueError("it cannot be opened")
        if found.GetSize() > _MOST_BYTES:
            raise ValueError("it is too large")
        content = bytes(found.GetBuffer()).strip()
        if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
            raise ValueError("it declares entities, which are not read")
        # Files of the world use the prefix of includes without declaring it.
        if b"xmlns:xi" not in content:
            content = content.replace(b"<materialx", b'<materialx xmlns:xi="xi"', 1)
        try:
            root = ElementTree.fromstring(content)
        except ElementTree.ParseError as error:
            raise ValueError(f"it is not XML: {error}") from error
        if root.tag != "materialx":
            raise ValueError("it is not a document of MaterialX")
        for parent in root.iter():
            for child in parent:
                self.around[child] = parent
            self.file[parent] = resolved
        for child in root:
            if child.tag.endswith("}include"):
                self.add(self.anchored(child.get("href", ""), root))
            else:
                self.roots.append(child)

    def anchored(self, name: str, element: Any) -> str:
        """A name of a file as seen from the file of an element."""
        anchor = Ar.ResolvedPath(self.file[element])
        if not re.match(r"/|\.|[A-Za-z][A-Za-z0-9+.-]*:", name):
            # A name without a dot might lie on a search path.
            name = f"./{name}"
        return str(Ar.GetResolver().CreateIdentifier(name, anchor))

    def inherited(self, element: Any, name: str) -> str:
        """An attribute of an element or of the nearest one around it."""
        while element is not None:
            if (value := element.get(name)) is not None:
                return str(value)
            element = self.around.get(element)
        return ""

    def node(self, name: str, graph: Any) -> Any:
        """The element of this name in a graph, or the outermost one if there is no graph."""
        if graph not in self.named:
            elements = self.roots if graph is None else graph
            # The first of a name counts.
            self.named[graph] = {element.get("name", ""): element for element in elements[::-1]}
        return self.named[graph].get(name)

    def graph_of(self, node: Any) -> Any:
        """The graph that a node of a kind of the file's own stands for."""
        if self.graphs is None:
            made = {graph.get("nodedef"): graph for graph in self.roots if graph.tag == "nodegraph"}
            self.graphs = {
                definition.get("node", ""): made[definition.get("name")]
                for definition in self.roots
                if definition.tag == "nodedef" and definition.get("name") in made
            }
        return self.graphs.get(node.tag)


class _Material:
    """A material and copies of all nodes that it needs, so that it can be referenced alone."""

    def __init__(self, document: _Document, stage: Any, element: Any) -> None:
        self.document, self.stage, self.element = document, stage, element
        self.path = Sdf.Path("/MaterialX/Materials").AppendChild(_valid(element.get("name", "")))
        self.made: dict[Any, Any] = {}

    def define(self) -> None:
        material = UsdShade.Material.Define(self.stage, self.path)
        outputs = {
            "surfaceshader": material.CreateSurfaceOutput,
            "displacementshader": material.CreateDisplacementOutput,
            "volumeshader": material.CreateVolumeOutput,
        }
        for given in self.element:
            create = outputs.get(given.get("name", ""))
            source = self._source(given, self.path, None, 0) if create else None
            if create and source:
                create("mtlx").ConnectToSource(source)

    def _source(self, given: Any, scope: Sdf.Path, graph: Any, depth: int) -> Any:
        """The output that an input or an output of a graph is connected to; `None` if it is not."""
        output = given.get("output", "out")
        if name := given.get("nodegraph"):
            found = self.document.node(name, None)
            if found is None or found.tag != "nodegraph":
                return None
            return self._graph(found, None, self.path, output, depth + 1)
        if name := given.get("nodename"):
            node = self.document.node(name, graph)
            return None if node is None else self._node(node, scope, graph, output, depth + 1)
        return None

    def _node(self, node: Any, scope: Sdf.Path, graph: Any, output: str, depth: int) -> Any:
        own = self.document.graph_of(node)
        if own is not None:
            return self._graph(own, node, scope, output, depth, graph)
        path = scope.AppendChild(_valid(node.get("name", "")))
        if path not in self.made:
            self._count(depth)
            shader = self.made[path] = UsdShade.Shader.Define(self.stage, path)
            shader.CreateIdAttr(f"ND_{node.tag}_{node.get('type', '')}")
            self._inputs(shader, node, scope, graph, depth)
        kind = _TYPES.get(node.get("type", ""), Sdf.ValueTypeNames.Token)
        return self.made[path].CreateOutput(output, kind)

    def _graph(
        self, graph: Any, node: Any, scope: Sdf.Path, output: str, depth: int, around: Any = None
    ) -> Any:
        """An output of a graph, or of a node that stands for a graph."""
        path = scope.AppendChild(_valid((graph if node is None else node).get("name", "")))
        if path not in self.made:
            self._count(depth)
            made = self.made[path] = UsdShade.NodeGraph.Define(self.stage, path)
            self._inputs(made, graph if node is None else node, scope, around, depth)
        outputs = [given for given in graph if given.tag == "output"]
        given = next((given for given in outputs if given.get("name") == output), None)
        if given is None and len(outputs) == 1:
            given = outputs[0]
        if given is None:
            return None
        kind = _TYPES.get(given.get("type", ""), Sdf.ValueTypeNames.Token)
        result = self.made[path].CreateOutput(_valid(given.get("name", "")), kind)
        if not result.HasConnectedSource():
            source = self._source(given, path, graph, depth + 1)
            if source:
                result.ConnectToSource(source)
        return result

    def _inputs(self, prim: Any, node: Any, scope: Sdf.Path, graph: Any, depth: int) -> None:
        for given in node:
            if given.tag not in ("input", "parameter"):
                continue
            kind = _TYPES.get(given.get("type", ""), Sdf.ValueTypeNames.String)
            made = prim.CreateInput(_valid(given.get("name", "")), kind)
            source = self._source(given, scope, graph, depth)
            if source:
                made.ConnectToSource(source)
            elif name := given.get("interfacename"):
                outer = self.made.get(scope)
                if outer:
                    made.ConnectToSource(outer.CreateInput(_valid(name), kind))
            elif given.get("value") is not None:
                made.Set(self._value(given, kind))
            if given.get("type") == "filename" and node.get("type", "").startswith("color"):
                space = self.document.inherited(given, "colorspace")
                if space:
                    made.GetAttr().SetColorSpace(space)

    def _value(self, given: Any, kind: Any) -> Any:
        text, name = given.get("value", ""), given.get("type", "")
        if name == "filename":
            prefix = self.document.inherited(given, "fileprefix")
            whole = text if text.startswith("/") else prefix + text
            anchored = self.document.anchored(whole, given)
            if prefix and not Ar.GetResolver().Resolve(anchored):
                # Some files repeat the prefix in their names.
                anchored = self.document.anchored(text, given)
            return Sdf.AssetPath(anchored)
        if name == "boolean":
            return text.strip().lower() == "true"
        if name == "integer":
            return int(text)
        if kind not in _TYPES.values() or kind == Sdf.ValueTypeNames.Token:
            return text
        numbers = np.array([float(word) for word in re.split(r"[,\s]+", text.strip())])
        if name.startswith("color") and "srgb" in self.document.inherited(given, "colorspace"):
            low = numbers[:3] <= 0.04045
            numbers[:3] = np.where(low, numbers[:3] / 12.92, ((numbers[:3] + 0.055) / 1.055) ** 2.4)
        if given.get("name", "").startswith("realworld"):
            numbers = numbers * _METRES.get(given.get("unit", ""), 1.0)
        return float(numbers[0]) if name == "float" else kind.type.pythonClass(*numbers.tolist())

    def _count(self, depth: int) -> None:
        self.document.prims += 1
        if self.document.prims > _MOST_PRIMS or depth > _MAX_DEPTH:
            raise ValueError("its graphs are too large or too deep")


def _valid(name: str) -> str:
    return str(Tf.MakeValidIdentifier(name)) if name else "_"
