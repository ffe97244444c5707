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

from snell._snell import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["RayMeshIntersector"]


def _vectors(value: ArrayLike, name: str) -> NDArray[np.float64]:
    vectors = np.asarray(value, dtype=np.float64)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise ValueError(f"{name}: shape is {vectors.shape}, expected (n, 3)")
    return vectors


class RayMeshIntersector:
    """Casts rays at one mesh, in double precision.

    Hits lie ahead of the origin, at ``t > 0``. Unlike with trimesh's own engines, a ray through an
    edge or vertex of a closed mesh counts each crossing exactly once, because no ray is restarted
    a little behind a hit.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        A mesh, or any object with ``vertices`` and ``faces``. After a change of the mesh, a new
        intersector is needed.
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
        self._scene = Scene()
        self._scene.add_mesh(
            np.asarray(geometry.vertices, dtype=np.float64), np.asarray(geometry.faces)
        )

    def _rays(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        origins, directions = (
            _vectors(ray_origins, "ray_origins"),
            _vectors(ray_directions, "ray_directions"),
        )
        if origins.shape != directions.shape:
            raise ValueError(
                f"ray_origins: shape is {origins.shape}, but that of ray_directions is "
                f"{directions.shape}"
            )
        return origins, directions

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
        rays = self._rays(ray_origins, ray_directions)
        found: Any
        if multiple_hits:
            found = self._scene.list_intersections(rays)
            keep = np.ones(len(found.ray_ids), dtype=bool)
            if max_hits is not None:
                rank = np.arange(len(found.ray_ids)) - found.ray_splits[found.ray_ids]
                keep = rank < max_hits
            index_ray = found.ray_ids[keep]
        else:
            found = self._scene.cast_rays(rays)
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
        found = self._scene.cast_rays(self._rays(ray_origins, ray_directions))
        return np.where(np.isfinite(found.t_hit), found.primitive_ids.astype(np.int64), -1)

    def intersects_any(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **kwargs: Any
    ) -> NDArray[np.bool_]:
        """Whether each ray hits the mesh: an array ``(n,)`` of bool."""
        return self._scene.test_occlusions(self._rays(ray_origins, ray_directions))

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point ``(n, 3)`` is inside the mesh: an array ``(n,)`` of bool. For open
        meshes, a point is inside where the generalised winding number exceeds 0.5.
        """
        return self._scene.occupancy(_vectors(points, "points"))
