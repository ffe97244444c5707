"""Values for the texels of a mesh with texture coordinates."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ._snell import Scene, _irradiance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

# The number of rays of one query.
_RAYS = 1 << 20


class Baked:
    """The points of a surface that the texels of its texture show; see :func:`bake`.

    Attributes
    ----------
    points : array (n, 3) of float64
        Where the centres of the texels are in the scene.
    normals : array (n, 3) of float64
        The unit normals there: those of the vertices if the mesh has any, otherwise those of the
        faces.
    faces : array (n,) of int64
        The number of the face of each.
    texels : array (n, 2) of int64
        Row and column of each texel, from the upper left corner of the texture.
    size : tuple
        Width and height of the texture.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        texels: NDArray[np.int64],
        faces: NDArray[np.int64],
        points: NDArray[np.float64],
        normals: NDArray[np.float64],
        sides: NDArray[np.float64],
    ) -> None:
        self._scene, self._sides = scene, sides
        self.size, self.texels, self.faces = size, texels, faces
        self.points, self.normals = points, normals

    def __repr__(self) -> str:
        width, height = self.size
        return f"<snell.Baked: {len(self.points)} of {width} x {height} texels>"

    def ambient_occlusion(
        self, samples: int = 64, *, distance: float = np.inf, mask: int | None = None, seed: int = 0
    ) -> NDArray[np.float32]:
        """The part of the sky that each point sees, weighted by the cosine: an array ``(n,)`` from
        0 to 1.

        Parameters
        ----------
        samples : int
            Rays of each point.
        distance : float
            What is farther away occludes nothing, in units of the scene.
        mask : int, optional
            What occludes; see :meth:`Scene.test_occlusions`.
        seed : int
            Another one turns the rays another way.
        """
        found = np.empty(len(self.points), np.float32)
        bounds = self._scene.bounds
        step = 1e-6 * float(np.linalg.norm(bounds[1] - bounds[0]))
        number = np.arange(samples)
        # A golden spiral over the disk below the hemisphere: directions in proportion to the
        # cosine (Malley's method).
        radius, turn = np.sqrt((number + 0.5) / samples), number * 0.6180339887498949
        turns = np.random.default_rng(seed).random(len(found))
        at_once = max(1, _RAYS // samples)
        for first in range(0, len(found), at_once):
            part = slice(first, first + at_once)
            angle = 2 * np.pi * (turn + turns[part, None])
            x, y = radius * np.cos(angle), radius * np.sin(angle)
            z = np.sqrt(1 - radius**2)
            normal, side = self.normals[part], self._sides[part]
            tangent = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
            tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
            other = np.cross(normal, tangent)
            ways = x[..., None] * tangent[:, None] + y[..., None] * other[:, None]
            ways += z[:, None] * normal[:, None]
            origins = self.points[part] + step * side
            blocked = self._scene.test_occlusions(
                (origins[:, None], ways), t_max=distance, mask=mask
            )
            found[part] = 1 - blocked.mean(axis=1)
        return found

    def irradiance(
        self,
        samples: int = 64,
        *,
        max_depth: int | None = None,
        seed: int = 0,
        threads: int | None = None,
    ) -> NDArray[np.float32]:
        """The light that arrives at each point from all lights of the scene and by all bounces, as
        a path-traced picture has it: an array ``(n, 3)`` of linear RGB, in the units of radiance
        times steradians. A matte surface of the reflectance `r` shines with
        ``r / pi * irradiance``.

        The material of the mesh itself counts only where light bounces off it again. A scene
        without light has that which pictures of it have.

        Parameters
        ----------
        samples : int
            Light paths of each point. The noise falls with the root of their number.
        max_depth : int, optional
            Bounces of light before it arrives, as for :func:`render`; 0 is direct light alone.
        seed : int
            Another one gives other noise.
        threads : int, optional
            Number of threads; all cores if left out.

        Examples
        --------
        >>> import numpy as np, snell
        >>> scene = snell.Scene()
        >>> corners, uvs = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0], [1, 0], [0, 1]]
        >>> floor = scene.add_mesh(corners, [[0, 1, 2]], uvs=uvs)
        >>> _ = scene.add_light(snell.Light("point", position=(0.25, 0.25, 2), intensity=20))
        >>> baked = snell.bake(scene, floor, 8)
        >>> light = baked.irradiance(samples=4)
        >>> distance = np.linalg.norm(baked.points - [0.25, 0.25, 2], axis=1)
        >>> np.allclose(light[:, 0], 20 * 2 / distance**3, rtol=1e-3)
        True
        """
        options: dict[str, Any] = {"spp": samples, "seed": seed, "threads": threads}
        # A point is the first thing that light meets here, and one that a camera sees there.
        options["max_depth"] = None if max_depth is None else max_depth + 1
        texels = [(int(column), int(row)) for row, column in self.texels]
        return _irradiance(self._scene, self.points, self._sides, texels, options)

    def image(
        self, values: ArrayLike, *, margin: int = 2, empty: float = 0.0
    ) -> NDArray[np.float32]:
        """Values of the points as a picture: an array ``(height, width)``, or
        ``(height, width, c)`` for values of shape ``(n, c)``.

        Parameters
        ----------
        values : array (n,) or (n, c)
            A value for each point.
        margin : int
            By how many texels the islands grow, so that filtering finds no seams.
        empty : float
            The value of texels that show nothing.
        """
        values = np.asarray(values, np.float32)
        if len(values) != len(self.points):
            raise ValueError(f"values: there are {len(values)}, expected {len(self.points)}")
        width, height = self.size
        picture = np.full((height, width, *values.shape[1:]), empty, np.float32)
        used = np.zeros((height, width), bool)
        rows, columns = self.texels.T
        picture[rows, columns], used[rows, columns] = values, True
        for _ in range(margin):
            before, was_used = picture.copy(), used.copy()
            for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                to, come = _shifted(height, down), _shifted(height, -down)
                over, start = _shifted(width, right), _shifted(width, -right)
                new = was_used[come, start] & ~used[to, over]
                picture[to, over][new] = before[come, start][new]
                used[to, over] |= new
        return picture


def _shifted(length: int, by: int) -> slice:
    return slice(max(by, 0), length + min(by, 0))


def bake(scene: Scene, id: int, size: int | Sequence[int]) -> Baked:
    """Finds the point of a mesh for each texel of its texture, for ambient occlusion, or for any
    value that is computed from points and normals.

    Parameters
    ----------
    scene : Scene
        The scene, all of which occludes.
    id : int
        A mesh with texture coordinates (``uvs``). Where its coordinates overlap, the face of the
        lowest number counts; coordinates outside of 0 to 1 are left out, with a warning.
    size : int or two ints
        Width and height of the texture in texels.

    Examples
    --------
    >>> import snell
    >>> scene = snell.Scene()
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> uvs = [[0, 1], [1, 1], [1, 0], [0, 0]]
    >>> floor = scene.add_mesh(corners, [[0, 1, 2], [0, 2, 3]], uvs=uvs)
    >>> baked = snell.bake(scene, floor, 4)
    >>> baked.points[0].tolist(), baked.texels[0].tolist()
    ([0.125, 0.875, 0.0], [0, 0])
    >>> baked.image(baked.ambient_occlusion()).min()
    np.float32(1.0)
    """
    width, height = (size, size) if isinstance(size, int) else (int(side) for side in size)
    if width < 1 or height < 1:
        raise ValueError(f"size is {size}, expected whole numbers from 1")
    mesh = scene.mesh(id)
    if mesh.uvs is None or not len(mesh.uvs):
        raise ValueError(f"object {id} has no texture coordinates, expected a mesh with uvs")
    uvs = np.asarray(mesh.uvs, np.float64)
    if uvs.min() < 0 or uvs.max() > 1:
        warnings.warn("uvs outside of 0 to 1 are left out", stacklevel=2)
    flat = Scene()
    flat.add_mesh(np.column_stack([uvs * [width, height], np.zeros(len(uvs))]), mesh.faces)
    rows, columns = np.indices((height, width))
    above = np.stack([columns + 0.5, rows + 0.5, np.ones((height, width))], axis=-1)
    hits = flat.cast_rays((above, [0, 0, -1.0]))
    used = np.isfinite(hits.t_hit)
    faces = hits.primitive_ids[used].astype(np.int64)
    b, c = hits.primitive_uvs[used].astype(np.float64).T
    weights = np.stack([1 - b - c, b, c], axis=-1)[..., None]

    matrix = np.asarray(scene.transform(id), np.float64)
    turn, move = matrix[:3, :3], matrix[:3, 3]
    corners = (np.asarray(mesh.vertices, np.float64) @ turn.T + move)[mesh.faces[faces]]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sides *= np.sign(np.linalg.det(turn))
    sides = _units(sides)
    normals = sides
    if mesh.normals is not None and len(mesh.normals):
        turned = np.asarray(mesh.normals, np.float64) @ np.linalg.inv(turn)
        normals = _units((weights * _units(turned)[mesh.faces[faces]]).sum(axis=1))
        sides = sides * np.where((sides * normals).sum(axis=1, keepdims=True) < 0, -1, 1)
    points = (weights * corners).sum(axis=1)
    return Baked(scene, (width, height), np.argwhere(used), faces, points, normals, sides)


def _units(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1)
