"""Open3D's ray casting on NumPy arrays: no tensors, no 400 MB, exact at edges.

:class:`RaycastingScene` has the methods, arguments, keys and meanings of
``open3d.t.geometry.RaycastingScene``.

Examples
--------
>>> import numpy as np
>>> import snell.open3d
>>> scene = snell.open3d.RaycastingScene()
>>> id = scene.add_triangles(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.uint32))
>>> scene.cast_rays(np.array([[0, 0, 0, 1, 1, 1]], dtype=np.float32))["t_hit"].round(3)
array([0.333], dtype=float32)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from snell._cameras import create_rays_pinhole
from snell._snell import INVALID_ID, Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["RaycastingScene"]


def _single(value: ArrayLike) -> NDArray[np.float32]:
    if hasattr(value, "numpy") and not isinstance(value, np.ndarray):  # a tensor of Open3D
        value = value.numpy()
    return np.asarray(value, dtype=np.float32)


def _threads(nthreads: int) -> int | None:
    return nthreads or None


class RaycastingScene:
    """A scene of triangle meshes for ray casting and closest points.

    All numbers are float32, as in Open3D; for float64 use :class:`snell.Scene`. Queries return
    dictionaries of NumPy arrays.

    Parameters
    ----------
    nthreads : int
        The number of threads for building in Open3D. It has no effect here: all cores build.

    Examples
    --------
    >>> import numpy as np
    >>> import snell.open3d
    >>> scene = snell.open3d.RaycastingScene()
    >>> scene.add_triangles(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.uint32))
    0
    >>> scene.count_intersections([[0, 0, 0, 1, 1, 1]])
    array([1], dtype=int32)
    """

    INVALID_ID = INVALID_ID

    def __init__(self, nthreads: int = 0, device: Any = None) -> None:
        self._scene = Scene()

    def add_triangles(self, *args: Any, **kwargs: Any) -> int:
        """Adds a mesh and returns its id: ``(vertex_positions, triangle_indices)``, or one mesh of
        Open3D.
        """
        values = [*args, *kwargs.values()]
        if len(values) == 1:
            return self._scene.add_mesh(values[0])
        positions, indices = values
        if hasattr(indices, "numpy") and not isinstance(indices, np.ndarray):
            indices = indices.numpy()
        return self._scene.add_mesh(_single(positions), indices)

    def cast_rays(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """The first hit of each ray ``(..., 6)``: ``t_hit`` (inf for a miss), ``geometry_ids``,
        ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``."""
        hits = self._scene.cast_rays(_single(rays), threads=_threads(nthreads))
        names = ("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals")
        return {name: hits[name] for name in names}

    def test_occlusions(
        self, rays: ArrayLike, tnear: float = 0.0, tfar: float = np.inf, nthreads: int = 0
    ) -> NDArray[np.bool_]:
        """Whether each ray ``(..., 6)`` hits anything between ``tnear`` and ``tfar``."""
        return self._scene.test_occlusions(
            _single(rays), t_min=tnear, t_max=tfar, threads=_threads(nthreads)
        )

    def count_intersections(self, rays: ArrayLike, nthreads: int = 0) -> NDArray[np.int32]:
        """The number of hits of each ray ``(..., 6)``."""
        return self._scene.count_intersections(_single(rays), threads=_threads(nthreads)).astype(
            np.int32
        )

    def list_intersections(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """All hits of each ray ``(..., 6)``: ``ray_splits``, ``ray_ids``, ``t_hit``,
        ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``.
        """
        found = self._scene.list_intersections(_single(rays), threads=_threads(nthreads))
        names = ("ray_splits", "ray_ids", "t_hit", "geometry_ids", "primitive_ids", "primitive_uvs")
        return {name: found[name] for name in names}

    def compute_closest_points(
        self, query_points: ArrayLike, nthreads: int = 0
    ) -> dict[str, NDArray[Any]]:
        """The nearest surface point of each point ``(..., 3)``: ``points``, ``geometry_ids``,
        ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``."""
        near = self._scene.closest_points(_single(query_points), threads=_threads(nthreads))
        names = ("points", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals")
        return {name: near[name] for name in names}

    def compute_distance(self, query_points: ArrayLike, nthreads: int = 0) -> NDArray[np.float32]:
        """The distance of each point ``(..., 3)`` to the nearest surface."""
        distance: NDArray[np.float32] = self._scene.distance(
            _single(query_points), threads=_threads(nthreads)
        )
        return distance

    def compute_signed_distance(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> NDArray[np.float32]:
        """The distance of each point ``(..., 3)`` to the nearest surface, negative inside. The sign
        follows from the bodies of the scene (see ``snell.Scene.occupancy``), so ``nsamples`` (the
        number of rays that vote in Open3D) has no effect.
        """
        distance: NDArray[np.float32] = self._scene.signed_distance(
            _single(query_points), threads=_threads(nthreads)
        )
        return distance

    def compute_occupancy(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> NDArray[np.float32]:
        """1 for points ``(..., 3)`` inside the surfaces, 0 for all other points."""
        return self._scene.occupancy(_single(query_points), threads=_threads(nthreads)).astype(
            np.float32
        )

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> NDArray[np.float32]:
        """The rays of a pinhole camera, ``(height_px, width_px, 6)``. The arguments are
        ``(intrinsic_matrix, extrinsic_matrix, width_px, height_px)`` or ``(fov_deg, center, eye,
        up, width_px, height_px)``."""
        names = ["intrinsic_matrix", "extrinsic_matrix", "width_px", "height_px"]
        if len(args) == 6 or "fov_deg" in kwargs or (args and np.ndim(args[0]) == 0):
            names = ["fov_deg", "center", "eye", "up", "width_px", "height_px"]
        return create_rays_pinhole(**dict(zip(names, args, strict=False)), **kwargs)
