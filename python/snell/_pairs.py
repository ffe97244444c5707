"""Two scenes: how far apart they are, whether they collide, and when they will."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _snell
from ._snell import INVALID_ID, Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# Points of bodies that are asked about at once.
_POINTS = 1 << 22


@dataclass(frozen=True, eq=False)
class ClosestPair:
    """The nearest points of two scenes; see :func:`closest_pair`. For `n` poses, each attribute is
    an array with `n` as its first dimension.

    Attributes
    ----------
    distance : float, or array (n,)
        The distance of the surfaces: 0 if and only if they meet, and infinite if nothing is within
        `max_distance` or a scene is empty.
    points : array (2, 3) or (n, 2, 3)
        A point of `a` and a point of `b`, in world coordinates. They are the same if the surfaces
        meet, and NaN if nothing was found.
    geometry_ids : array (2,) or (n, 2) of uint32
        The object that each point is on: its id in the scene that holds it, or `INVALID_ID`.
    primitive_ids : array (2,) or (n, 2) of uint32
        The triangle of the mesh, or the face of the box.
    instance_ids : array (2,) or (n, 2) of uint32
        The outermost instance that the object is in, or `INVALID_ID`.
    instance_paths : array (2, depth) or (n, 2, depth) of uint32
        The ids of all instances around the object, the outermost first, as in :class:`Hits`.
    names : array (2,) or (n, 2) of str
        The names of the objects, after those of the instances around them, as in :class:`Hits`.
    """

    distance: Any
    points: NDArray[np.float64]
    geometry_ids: NDArray[np.uint32]
    primitive_ids: NDArray[np.uint32]
    instance_ids: NDArray[np.uint32]
    instance_paths: NDArray[np.uint32]
    names: NDArray[np.str_]

    @property
    def is_found(self) -> Any:
        """Whether there is a pair within the largest distance: a bool, or an array ``(n,)``."""
        found = self.geometry_ids[..., 0] != INVALID_ID
        return found if found.ndim else bool(found)

    def __repr__(self) -> str:
        if np.ndim(self.distance):
            return f"<snell.ClosestPair: {len(self.distance)} poses>"
        return f"<snell.ClosestPair: distance {self.distance:g}>"


def closest_pair(
    a: Scene,
    b: Scene,
    *,
    transform_a: ArrayLike | None = None,
    transform_b: ArrayLike | None = None,
    max_distance: float | None = None,
    threads: int | None = None,
) -> ClosestPair:
    """The nearest points of the surfaces of two scenes, and their distance.

    The distance is that of the triangles, edge to edge and corner to face, in double precision. Its
    error is below 1e-13 of the size of both scenes and the space between them, wherever they are;
    whether they meet is decided exactly. Scenes may hold meshes, heightfields without holes, boxes,
    rectangles, triangles and instances of scenes of these; other shapes, spheres and curves are
    refused. Things that move are where they are at their first key; see :meth:`Scene.at`.

    The trees of meshes are built by the first query and kept. They do not depend on transforms:
    move a scene with `transform_a` or `transform_b`, or its parts with
    :meth:`Scene.update_transform`.

    Parameters
    ----------
    a, b : Scene
        The two scenes. They may be the same one.
    transform_a, transform_b : array (4, 4) or (n, 4, 4), optional
        Where each scene is: maps to the world that rotate, move, mirror or scale uniformly. For `n`
        poses the answer has `n` rows; they are spread over all cores.
    max_distance : float, optional
        Pairs that are farther apart are not looked for, which is faster.
    threads : int, optional
        As for :meth:`Scene.cast_rays`.

    Examples
    --------
    >>> import numpy as np, snell
    >>> table, cup = snell.Scene(), snell.Scene()
    >>> top = table.add_shape("box", min=[-1, -1, -0.1], max=[1, 1, 0])
    >>> body = cup.add_shape("box", min=[-0.05, -0.05, 0], max=[0.05, 0.05, 0.1])
    >>> poses = np.tile(np.eye(4), (3, 1, 1))
    >>> poses[:, 2, 3] = [0.5, 0.25, 0]
    >>> snell.closest_pair(cup, table, transform_a=poses).distance.tolist()
    [0.5, 0.25, 0.0]
    """
    distance, points, geometries, primitives, instances, paths, names = _snell._closest_pair(
        a, b, transform_a, transform_b, max_distance, threads
    )
    alone = distance if distance.ndim else float(distance)
    return ClosestPair(alone, points, geometries, primitives, instances, paths, names)


def collides(
    a: Scene,
    b: Scene,
    *,
    transform_a: ArrayLike | None = None,
    transform_b: ArrayLike | None = None,
    solid: bool = False,
    threads: int | None = None,
) -> Any:
    """Whether two scenes collide: a bool, or an array ``(n,)`` for `n` poses.

    Scenes collide if their surfaces meet, as in FCL and ``trimesh.collision``; touching is meeting.
    A body that is wholly inside another one, without touching it, then collides only with
    ``solid=True``. Whether triangles meet is decided exactly (for their corners as rounded after a
    transform is applied).

    Parameters
    ----------
    a, b, transform_a, transform_b, threads
        As for :func:`closest_pair`.
    solid : bool
        Whether bodies also collide if one is inside the other. What is inside is the rule of
        :meth:`Scene.occupancy`.

    Examples
    --------
    >>> import snell
    >>> room, ball = snell.Scene(), snell.Scene()
    >>> walls = room.add_shape("box", min=[0, 0, 0], max=[5, 4, 3])
    >>> small = ball.add_shape("box", min=[1, 1, 1], max=[2, 2, 2])
    >>> snell.collides(room, ball), snell.collides(room, ball, solid=True)
    (False, True)
    """
    found = _snell._collides(a, b, transform_a, transform_b, threads)
    if solid:
        flat = np.atleast_1d(found)
        sides = [(a, transform_a, "a"), (b, transform_b, "b")]
        for inner, outer in (sides, sides[::-1]):
            _add_contained(flat, inner, outer, threads)
        found = flat if found.ndim else flat[0]
    return found if np.ndim(found) else bool(found)


def _add_contained(
    found: NDArray[np.bool_],
    inner: tuple[Scene, ArrayLike | None, str],
    outer: tuple[Scene, ArrayLike | None, str],
    threads: int | None,
) -> None:
    """Marks the poses at which a body of one scene is inside the other: where surfaces do not meet,
    one point of each body tells.
    """
    points = _snell._body_points(inner[0], inner[2])
    if not len(points):
        return
    asked = np.flatnonzero(~found)
    step = max(1, _POINTS // len(points))
    for first in range(0, len(asked), step):
        part = asked[first : first + step]
        placed = np.linalg.inv(_rows(outer[1], part)) @ _rows(inner[1], part)
        moved = points @ placed[..., :3, :3].swapaxes(-1, -2) + placed[..., None, :3, 3]
        inside = outer[0].occupancy(moved, threads=threads).any(axis=-1)
        found[part] = inside


def _rows(transform: ArrayLike | None, part: NDArray[np.int64]) -> NDArray[np.float64]:
    """The matrices ``(1 or m, 4, 4)`` of some poses."""
    given = np.eye(4) if transform is None else np.asarray(transform, np.float64)
    matrix = np.broadcast_to(np.eye(4), (*given.shape[:-2], 4, 4)).copy()
    matrix[..., : given.shape[-2], :] = given
    return matrix[part] if matrix.ndim == 3 else matrix[None]


def time_of_impact(
    a: Scene,
    b: Scene,
    motion: ArrayLike,
    *,
    transform_b: ArrayLike | None = None,
    tolerance: float | None = None,
    threads: int | None = None,
) -> Any:
    """The first moment, from 0 to 1, at which a scene that moves meets the surface of another:
    a float, or an array ``(n,)`` for `n` motions. Infinite if they do not meet.

    From the first pose to the second, the origin of the coordinates of `a` moves on a straight line
    at constant speed, while `a` turns round it at a constant rate by the shortest way (slerp). No
    contact is missed, however thin things are or fast they move: before the answer the surfaces
    certainly do not meet, and at that moment they are no farther apart than the tolerance. So a
    scene that passes by within the tolerance may count as meeting.

    Parameters
    ----------
    a, b : Scene
        The scene that moves, and the one that rests; see :func:`closest_pair` for what they may
        hold.
    motion : array (2, 4, 4) or (n, 2, 4, 4)
        The first pose and the second: rotations and translations. A mirroring or uniform scale must
        be the same in both.
    transform_b : array (4, 4), optional
        Where `b` is.
    tolerance : float, optional
        The distance that counts as contact: a millionth of the diagonal of a box around `a` if
        left out. A smaller one takes more time.
    threads : int, optional
        As for :meth:`Scene.cast_rays`.

    Examples
    --------
    >>> import numpy as np, snell
    >>> door, wall = snell.Scene(), snell.Scene()
    >>> leaf = door.add_shape("box", min=[0, -0.001, 0], max=[1, 0.001, 2])
    >>> pillar = wall.add_shape("box", min=[0.5, 0.5, 0], max=[1, 1, 2])
    >>> quarter = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    >>> t = snell.time_of_impact(door, wall, [np.eye(4), quarter])
    >>> round(t * 90)  # Degrees.
    30
    """
    found = _snell._time_of_impact(a, b, motion, transform_b, tolerance, threads)
    return found if np.ndim(found) else float(found)
