"""What a scene gives of its contents: lists that write through to the scene, objects and meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np

    from snell._snell import Material, Scene

# What to do instead of changing a list that a scene only reports.
_REMEDIES = {
    "materials": "objects bring their materials: add_mesh(…, material=…), update_material(id, …)",
    "children": "add_mesh(…) and its like add objects, and remove(id) removes them",
    "ids": "add_mesh(…) and its like add objects, and remove(id) removes them",
    "warnings": "they are those of the file",
}


class Listed(list):  # type: ignore[type-arg]
    """A list of a scene. Changes of it are changes of the scene, or errors that name the way."""

    def __init__(self, scene: Scene, name: str, items: list[Any]) -> None:
        super().__init__(items)
        self._scene, self._name = scene, name

    def _change(self, method: str, *arguments: Any, **keywords: Any) -> Any:
        name, old = self._name, list(self)
        if list(map(repr, getattr(self._scene, name))) != list(map(repr, old)):
            raise RuntimeError(f"{name}: the scene has others by now; read scene.{name} again")
        new = list(old)
        result = getattr(new, method)(*arguments, **keywords)
        if name in ("cameras", "lights"):
            setattr(self._scene, name, new)
        elif name == "materials" and len(new) == len(old):
            for number, (before, after) in enumerate(zip(old, new, strict=True)):
                if after is not before:
                    self._scene.replace_material(number, after)
        else:
            raise TypeError(f"{name}: this list cannot be changed: {_REMEDIES[name]}")
        list.__init__(self, new)
        return result

    def append(self, item: Any) -> None:
        self._change("append", item)

    def extend(self, items: Any) -> None:
        self._change("extend", items)

    def insert(self, index: Any, item: Any) -> None:
        self._change("insert", index, item)

    def remove(self, item: Any) -> None:
        self._change("remove", item)

    def pop(self, index: Any = -1) -> Any:
        return self._change("pop", index)

    def clear(self) -> None:
        self._change("clear")

    def reverse(self) -> None:
        self._change("reverse")

    def sort(self, **keywords: Any) -> None:
        self._change("sort", **keywords)

    def __setitem__(self, index: Any, item: Any) -> None:
        self._change("__setitem__", index, item)

    def __delitem__(self, index: Any) -> None:
        self._change("__delitem__", index)

    def __iadd__(self, items: Any) -> Listed:  # type: ignore[misc]
        self.extend(items)
        return self

    def __imul__(self, count: Any) -> Listed:  # type: ignore[misc]
        self._change("__imul__", count)
        return self

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return (list, (list(self),))


class Names(dict):  # type: ignore[type-arg]
    """The names of a scene's objects by id. Changes of it are changes of the scene."""

    def __init__(self, scene: Scene, names: dict[int, str]) -> None:
        super().__init__(names)
        self._scene = scene

    def __setitem__(self, id: int, name: str) -> None:
        self._scene.update_name(id, name)
        super().__setitem__(id, name)

    def __delitem__(self, id: int) -> None:
        if id not in self:
            raise KeyError(id)
        self._scene.update_name(id, None)
        super().__delitem__(id)

    def update(self, *others: Any, **keywords: Any) -> None:
        for id, name in dict(*others, **keywords).items():
            self[id] = name

    def __ior__(self, others: Any) -> Names:  # type: ignore[misc]
        self.update(others)
        return self

    def setdefault(self, id: int, name: Any = None) -> Any:
        if id not in self:
            self[id] = name
        return self[id]

    def pop(self, id: int, *default: Any) -> Any:
        if id not in self and default:
            return default[0]
        name = self[id]
        del self[id]
        return name

    def popitem(self) -> tuple[int, str]:
        id = list(self)[-1]
        return id, self.pop(id)

    def clear(self) -> None:
        for id in list(self):
            del self[id]

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return (dict, (dict(self),))


class Mesh:
    """A mesh of a scene, in its own coordinates. It unpacks as its `vertices` and `faces`.

    Attributes
    ----------
    vertices : array (n, 3)
        float32 or float64, as they were given.
    faces : array (m, 3) of uint32
    normals : array (n, 3) of float32, or None
    uvs : array (n, 2) of float32, or None
    colors : array (n, 4) of float32, or None
        Linear, with alpha.
    material_ids : array (m,) of uint16, or None
        Index in `materials` for each face; None if all have the first.
    materials : list of Material or None
        The materials that the mesh was given; None is the default grey.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None
    colors: np.ndarray | None
    material_ids: np.ndarray | None
    materials: list[Any]

    def __init__(self, **parts: Any) -> None:
        self.__dict__.update(parts)

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter((self.vertices, self.faces))

    def __len__(self) -> int:
        return 2

    def __getitem__(self, index: Any) -> Any:
        return (self.vertices, self.faces)[index]

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(
            f"{name}: this is a copy of the scene's mesh; the scene's is changed by "
            "update_vertices(id, …) and update_material(id, …)"
        )

    def __repr__(self) -> str:
        parts = ", ".join(name for name, part in self.__dict__.items() if part is not None)
        return f"<snell mesh: {len(self.vertices)} vertices, {len(self.faces)} faces; {parts}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_mesh, (self.__dict__,))


def _mesh(parts: dict[str, Any]) -> Mesh:
    return Mesh(**parts)


class Node:
    """An object of a scene, as it was when :attr:`Scene.children` was read.

    Examples
    --------
    >>> import snell
    >>> scene = snell.Scene()
    >>> ball = scene.add_shape("sphere", radius=1, name="ball")
    >>> node = scene.children[0]
    >>> node.id, node.kind, node.name, node.content["radius"]
    (0, 'shape', 'ball', 1.0)
    """

    _scene: Scene
    _id: int
    _kind: str
    _name: str | None
    _mask: int

    def __init__(self, scene: Scene, id: int, kind: str, name: str | None, mask: int) -> None:
        self.__dict__.update(_scene=scene, _id=id, _kind=kind, _name=name, _mask=mask)

    @property
    def id(self) -> int:
        """The id of the object, in the scene that holds it."""
        return self._id

    @property
    def kind(self) -> str:
        """What it is: ``"mesh"``, ``"shape"``, ``"spheres"``, ``"curves"`` or ``"instance"``."""
        return self._kind

    @property
    def name(self) -> str | None:
        """The name of the object, or None."""
        return self._name

    @property
    def mask(self) -> int:
        """The mask: only rays whose mask shares a bit with it hit the object."""
        return self._mask

    @property
    def transform(self) -> np.ndarray:
        """The map `(4, 4)` to the scene's coordinates, as of :meth:`Scene.transform`."""
        return self._scene.transform(self._id)

    @property
    def motion(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The transforms and times of an object that moves, as of :meth:`Scene.motion`."""
        return self._scene.motion(self._id)

    @property
    def materials(self) -> list[Material | None]:
        """The materials by slot, as a list; None for the default grey."""
        return self._scene._materials(self._id)

    @property
    def content(self) -> Any:
        """What :meth:`Scene.mesh`, `shape`, `spheres`, `curves` or `instance` gives of the id; the
        mesh of a heightfield.
        """
        kind = "mesh" if self._kind == "heightfield" else self._kind
        return getattr(self._scene, kind)(self._id)

    @property
    def children(self) -> list[Node]:
        """The objects of an instance's scene, a list; empty for all else."""
        return self.content.children if self._kind == "instance" else []

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(
            f"{name}: this only tells of the object; update_transform({self._id}, …), update_name, "
            "update_mask and update_material of the scene change it"
        )

    def __repr__(self) -> str:
        name = "" if self._name is None else f" {self._name!r}"
        return f"<snell.Node {self._id}: {self._kind}{name}>"


def walk(scene: Scene) -> Iterator[tuple[tuple[int, ...], Node, np.ndarray]]:
    """Yields all objects of a scene, those in instances too; see :meth:`Scene.walk`."""
    rest: list[tuple[tuple[int, ...], Node, np.ndarray]] = [
        ((), node, node.transform) for node in reversed(scene.children)
    ]
    while rest:
        path, node, placed = rest.pop()
        yield path, node, placed
        within = (*path, node.id)
        rest += [(within, child, placed @ child.transform) for child in reversed(node.children)]
