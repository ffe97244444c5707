"""A ray engine for trimesh: exact, on all cores.

:class:`RayMeshIntersector` has the methods, arguments, shapes and meanings of ``mesh.ray`` of
trimesh. Where trimesh's two engines differ in the order of arguments, that of the Embree engine
holds.

Examples
--------
>>> from types import SimpleNamespace
>>> import numpy as np
>>> import snell.trimesh
>>> mesh = SimpleNamespace(vertices=np.eye(3), faces=np.array([[0, 1, 2]]))  # or a trimesh.Trimesh
>>> ray = snell.trimesh.RayMeshIntersector(mesh)
>>> ray.intersects_any([[0, 0, 0]], [[1, 1, 1]])
array([ True])
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from snell._arrays import array_of
from snell._snell import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["RayMeshIntersector"]


# How far behind its origin a ray still hits, relative to the size of the coordinates: a point that
# was computed on a surface is on it but for roundings of this size.
_AT_ORIGIN = 1e-12


def _vectors(value: ArrayLike, name: str) -> NDArray[np.float64]:
    vectors = array_of(value, name).astype(np.float64, copy=False)
    if vectors.shape == (0,):
        return vectors.reshape(0, 3)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise ValueError(f"{name}: shape is {vectors.shape}, expected (n, 3)")
    return vectors


class RayMeshIntersector:
    """Casts rays at one mesh, in double precision.

    The mesh is read when it is first asked about, and again after it has changed.

    Hits lie ahead of the origin or at it: the surface on which a ray starts counts, as with
    trimesh's own engines. Unlike with these, a ray through an edge or vertex of a closed mesh
    counts each crossing exactly once, because no ray is restarted a little behind a hit.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        A mesh, or any object with ``vertices`` and ``faces``.
    **kwargs
        Options of other engines, such as ``scale_to_box``; they are ignored.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> import snell.trimesh
    >>> mesh = SimpleNamespace(vertices=np.eye(3), faces=np.array([[0, 1, 2]]))
    >>> ray = snell.trimesh.RayMeshIntersector(mesh)
    >>> origins, directions = [[0, 0, 0], [9, 9, 9]], [[3, 3, 3], [1, 0, 0]]
    >>> locations, index_ray, index_tri = ray.intersects_location(origins, directions)
    >>> locations.round(3).tolist(), index_ray.tolist(), index_tri.tolist()
    ([[0.333, 0.333, 0.333]], [0], [0])
    """

    def __init__(self, geometry: Any, **kwargs: Any) -> None:
        self.mesh = geometry
        self._read: _Read | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"mesh": self.mesh}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["mesh"])  # type: ignore[misc]

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh)

    def __deepcopy__(self, memo: Any) -> RayMeshIntersector:
        # As in trimesh: a copied mesh makes an intersector of its own.
        return RayMeshIntersector(self.mesh)

    @property
    def _scene(self) -> Scene:
        """The scene of the mesh as it is now."""
        read = self._read
        if read is None or not read.is_of(self.mesh):
            self._read = read = _Read(self.mesh)
        return read.scene

    def _rays(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]:
        """The rays, and the parameter at which each starts."""
        origins, directions = (
            _vectors(ray_origins, "ray_origins"),
            _vectors(ray_directions, "ray_directions"),
        )
        if origins.shape != directions.shape:
            raise ValueError(
                f"ray_origins: shape is {origins.shape}, but that of ray_directions is "
                f"{directions.shape}"
            )
        size = np.abs(origins).max(axis=1, initial=0)
        bounds = self._scene.bounds
        if np.isfinite(bounds).all():
            size = np.maximum(size, np.abs(bounds).max())
        length = np.sqrt((directions**2).sum(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            behind = np.nan_to_num(-_AT_ORIGIN * size / length, nan=0.0, neginf=0.0)
        return (origins, directions), behind

    def intersects_location(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        **kwargs: Any,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Finds the hits of rays on the mesh.

        Parameters
        ----------
        ray_origins, ray_directions : array (n, 3)
            Directions have any length.
        multiple_hits : bool
            All hits of each ray, not only the first.

        Returns
        -------
        locations : (h, 3) float64
        index_ray : (h,) int64
        index_tri : (h,) int64
            Sorted by ray, then along the ray.
        """
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
        **kwargs: Any,
    ) -> Any:
        """Finds the triangles that rays hit.

        Parameters
        ----------
        ray_origins, ray_directions : array (n, 3)
        multiple_hits : bool
            All hits of each ray, not only the first.
        max_hits : int, optional
            Maximum number of hits per ray, the first ones; no limit if left out.
        return_locations : bool

        Returns
        -------
        index_tri : (h,) int64
        index_ray : (h,) int64
        locations : (h, 3) float64
            Only with ``return_locations``.
        """
        rays, t_min = self._rays(ray_origins, ray_directions)
        found: Any
        if multiple_hits:
            found = self._scene.list_intersections(rays, t_min=t_min)
            keep = np.ones(len(found.ray_ids), dtype=bool)
            if max_hits is not None:
                rank = np.arange(len(found.ray_ids)) - found.ray_splits[found.ray_ids]
                keep = rank < max_hits
            index_ray = found.ray_ids[keep]
        else:
            found = self._scene.cast_rays(rays, t_min=t_min)
            keep = np.isfinite(found.t_hit)
            index_ray = np.flatnonzero(keep)
        index_tri = found.primitive_ids[keep].astype(np.int64)
        if return_locations:
            return index_tri, index_ray, found.points[keep]
        return index_tri, index_ray

    def intersects_first(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **kwargs: Any
    ) -> NDArray[np.int64]:
        """The first triangle that each ray hits, -1 for a miss: an array ``(n,)`` of int64."""
        rays, t_min = self._rays(ray_origins, ray_directions)
        found = self._scene.cast_rays(rays, t_min=t_min)
        return np.where(np.isfinite(found.t_hit), found.primitive_ids.astype(np.int64), -1)

    def intersects_any(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **kwargs: Any
    ) -> NDArray[np.bool_]:
        """Whether each ray hits the mesh: an array ``(n,)`` of bool."""
        rays, t_min = self._rays(ray_origins, ray_directions)
        return self._scene.test_occlusions(rays, t_min=t_min)

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point ``(n, 3)`` is inside the mesh: an array ``(n,)`` of bool. For open
        meshes, a point is inside where the generalised winding number exceeds 0.5.
        """
        return self._scene.occupancy(_vectors(points, "points"))


class _Read:
    """A mesh as it was read: its scene, and what shows that the mesh has changed since."""

    def __init__(self, mesh: Any) -> None:
        self.hash = _hash(mesh)
        vertices, faces = _arrays(mesh)
        # A mesh without a hash of its contents is compared with what was read.
        self.arrays = None if self.hash is not None else (vertices.copy(), faces.copy())
        self.scene = Scene()
        self.scene.add_mesh(vertices, faces)

    def is_of(self, mesh: Any) -> bool:
        """True if the mesh is as it was read."""
        if self.arrays is None:
            return self.hash == _hash(mesh)
        return all(np.array_equal(a, b) for a, b in zip(self.arrays, _arrays(mesh), strict=True))


def _arrays(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    faces = array_of(mesh.faces, "faces")
    return (
        array_of(mesh.vertices, "vertices").astype(np.float64, copy=False),
        faces if faces.size else np.empty((0, 3), dtype=np.int64),
    )


def _hash(mesh: Any) -> int | None:
    """The hash of a mesh's contents; None if its hash is that of the object or there is none."""
    own: Any = type(mesh).__hash__
    return None if own in (None, object.__hash__) else hash(mesh)
