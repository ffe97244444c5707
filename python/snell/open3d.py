"""Open3D's ray casting, exact at edges, on NumPy arrays and on tensors.

:class:`RaycastingScene` has the methods, arguments, keys, dtypes and meanings of
``open3d.t.geometry.RaycastingScene``. Answers are NumPy arrays (with ``numpy()`` and
``cpu()``, as tensors have), or tensors of Open3D if the question was one.

Examples
--------
>>> import numpy as np
>>> import snell.open3d
>>> scene = snell.open3d.RaycastingScene()
>>> id = scene.add_triangles(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.uint32))
>>> scene.cast_rays(np.array([[0, 0, 0, 1, 1, 1]], dtype=np.float32))["t_hit"].round(3).tolist()
[0.3330000042915344]
"""

from __future__ import annotations

from typing import Any, overload

import numpy as np

from snell._arrays import array_of
from snell._cameras import create_rays_pinhole
from snell._snell import INVALID_ID, Scene

__all__ = ["Array", "RaycastingScene"]

# Rays start at this parameter: the largest number below 0 in single precision. So the surface on
# which a ray starts counts, as with Open3D.
_AT_ORIGIN = float(np.nextafter(np.float32(0), np.float32(-1)))


def _single(value: Any, name: str) -> np.ndarray:
    return array_of(value, name).astype(np.float32, copy=False)


def _threads(nthreads: int) -> int | None:
    return nthreads or None


class Array(np.ndarray):
    """A NumPy array that also has what programs ask of Open3D's tensors: ``numpy()``, ``cpu()``."""

    def numpy(self) -> np.ndarray:
        """The array as a plain one."""
        return np.asarray(self)

    def cpu(self) -> Array:
        """The array itself, which is in main memory."""
        return self


def _is_tensor(value: Any) -> bool:
    """True for a tensor of Open3D."""
    kind = type(value)
    return kind.__name__ == "Tensor" and kind.__module__.partition(".")[0] == "open3d"


def _like(question: Any, answer: np.ndarray) -> Any:
    """An answer as a tensor of Open3D if the question was one, else as an array."""
    if _is_tensor(question):
        return type(question).from_numpy(np.ascontiguousarray(answer))
    return np.asarray(answer).view(Array)


class RaycastingScene:
    """A scene of triangle meshes for ray casting and closest points.

    All numbers are float32, as in Open3D; for float64 use :class:`snell.Scene`. Queries take
    arrays, nested lists and tensors in main memory. They return :class:`Array`, or tensors of
    Open3D for tensors of Open3D.

    Parameters
    ----------
    nthreads : int
        The number of threads for building in Open3D. It has no effect here: all cores build.
    device
        The CPU: there is no other.

    Examples
    --------
    >>> import numpy as np
    >>> import snell.open3d
    >>> scene = snell.open3d.RaycastingScene()
    >>> scene.add_triangles(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.uint32))
    0
    >>> scene.count_intersections([[0, 0, 0, 1, 1, 1]])
    Array([1], dtype=int32)
    """

    INVALID_ID = INVALID_ID

    def __init__(self, nthreads: int = 0, device: Any = None) -> None:
        if device is not None and not str(device).upper().startswith("CPU"):
            raise ValueError(f"device is {device}, expected the CPU: rays are traced there")
        self._scene = Scene()

    def add_triangles(
        self, vertex_positions: Any = None, triangle_indices: Any = None, *, mesh: Any = None
    ) -> int:
        """Adds a mesh and returns its id: ``(vertex_positions, triangle_indices)``, or ``(mesh)``
        of Open3D.
        """
        if mesh is None and triangle_indices is None:
            vertex_positions, mesh = None, vertex_positions
        if mesh is not None and vertex_positions is None and triangle_indices is None:
            return self._scene.add_mesh(mesh)
        if mesh is not None or vertex_positions is None:
            raise TypeError(
                "add_triangles: expected vertex_positions and triangle_indices, or one mesh"
            )
        return self._scene.add_mesh(
            _single(vertex_positions, "vertex_positions"),
            array_of(triangle_indices, "triangle_indices"),
        )

    def cast_rays(self, rays: Any, nthreads: int = 0) -> dict[str, Any]:
        """The first hit of each ray ``(..., 6)``: ``t_hit`` (inf for a miss), ``geometry_ids``,
        ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``."""
        hits = self._scene.cast_rays(
            _single(rays, "rays"), t_min=_AT_ORIGIN, threads=_threads(nthreads)
        )
        names = ("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals")
        return {name: _like(rays, hits[name]) for name in names}

    def test_occlusions(
        self, rays: Any, tnear: float = 0.0, tfar: float = np.inf, nthreads: int = 0
    ) -> Any:
        """Whether each ray ``(..., 6)`` hits anything from ``tnear`` to ``tfar``: bool."""
        ends = np.nextafter(
            np.array([tnear, tfar], np.float32), np.array([-np.inf, np.inf], np.float32)
        )
        found = self._scene.test_occlusions(
            _single(rays, "rays"), t_min=ends[0], t_max=ends[1], threads=_threads(nthreads)
        )
        return _like(rays, found)

    def count_intersections(self, rays: Any, nthreads: int = 0) -> Any:
        """The number of hits of each ray ``(..., 6)``: int32."""
        found = self._scene.count_intersections(
            _single(rays, "rays"), t_min=_AT_ORIGIN, threads=_threads(nthreads)
        )
        return _like(rays, found.astype(np.int32))

    def list_intersections(self, rays: Any, nthreads: int = 0) -> dict[str, Any]:
        """All hits of each ray ``(..., 6)``: ``ray_splits``, ``ray_ids`` (both uint32), ``t_hit``,
        ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``.
        """
        found = self._scene.list_intersections(
            _single(rays, "rays"), t_min=_AT_ORIGIN, threads=_threads(nthreads)
        )
        names = ("ray_splits", "ray_ids", "t_hit", "geometry_ids", "primitive_ids", "primitive_uvs")
        as_there = {"ray_splits": np.uint32, "ray_ids": np.uint32}
        return {
            name: _like(rays, found[name].astype(as_there.get(name, found[name].dtype), copy=False))
            for name in names
        }

    def compute_closest_points(self, query_points: Any, nthreads: int = 0) -> dict[str, Any]:
        """The nearest surface point of each point ``(..., 3)``: ``points``, ``geometry_ids``,
        ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``."""
        near = self._scene.closest_points(
            _single(query_points, "query_points"), threads=_threads(nthreads)
        )
        names = ("points", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals")
        return {name: _like(query_points, near[name]) for name in names}

    def compute_distance(self, query_points: Any, nthreads: int = 0) -> Any:
        """The distance of each point ``(..., 3)`` to the nearest surface."""
        points = _single(query_points, "query_points")
        return _like(query_points, self._scene.distance(points, threads=_threads(nthreads)))

    def compute_signed_distance(
        self, query_points: Any, nthreads: int = 0, nsamples: int = 1
    ) -> Any:
        """The distance of each point ``(..., 3)`` to the nearest surface, negative inside. The sign
        follows from the bodies of the scene (see ``snell.Scene.occupancy``), so ``nsamples`` (the
        number of rays that vote in Open3D) has no effect.
        """
        _check_odd(nsamples)
        points = _single(query_points, "query_points")
        return _like(query_points, self._scene.signed_distance(points, threads=_threads(nthreads)))

    def compute_occupancy(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Any:
        """1 for points ``(..., 3)`` inside the surfaces, 0 for all other points: float32.
        ``nsamples`` has no effect, as for :meth:`compute_signed_distance`.
        """
        _check_odd(nsamples)
        points = _single(query_points, "query_points")
        found = self._scene.occupancy(points, threads=_threads(nthreads))
        return _like(query_points, found.astype(np.float32))

    @overload
    @staticmethod
    def create_rays_pinhole(
        intrinsic_matrix: Any, extrinsic_matrix: Any, width_px: int, height_px: int
    ) -> Any: ...
    @overload
    @staticmethod
    def create_rays_pinhole(
        fov_deg: float, center: Any, eye: Any, up: Any, width_px: int, height_px: int
    ) -> Any: ...
    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> Any:
        """The rays of a pinhole camera, ``(height_px, width_px, 6)``. The arguments are
        ``(intrinsic_matrix, extrinsic_matrix, width_px, height_px)`` or ``(fov_deg, center, eye,
        up, width_px, height_px)``; see :func:`snell.create_rays_pinhole`."""
        is_by_view = len(args) > 4 or "fov_deg" in kwargs or (args and np.ndim(args[0]) == 0)
        rays = (_rays_by_view if is_by_view else _rays_by_matrices)(*args, **kwargs)
        return _like(next(filter(_is_tensor, [*args, *kwargs.values()]), None), rays)


def _rays_by_matrices(
    intrinsic_matrix: Any, extrinsic_matrix: Any, width_px: int, height_px: int
) -> np.ndarray:
    return create_rays_pinhole(intrinsic_matrix, extrinsic_matrix, width_px, height_px)


def _rays_by_view(
    fov_deg: float, center: Any, eye: Any, up: Any, width_px: int, height_px: int
) -> np.ndarray:
    return create_rays_pinhole(
        fov_deg=fov_deg, center=center, eye=eye, up=up, width_px=width_px, height_px=height_px
    )


def _check_odd(nsamples: int) -> None:
    if nsamples < 1 or nsamples % 2 == 0:
        raise ValueError(f"nsamples is {nsamples}, expected an odd number from 1")
