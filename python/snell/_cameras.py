"""Rays of cameras."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from snell._arrays import array_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, DTypeLike, NDArray


def _vector(value: ArrayLike, name: str) -> NDArray[np.float64]:
    vector = array_of(value, name).astype(np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name} is {value!r}, expected three finite numbers")
    return vector


def _matrix(value: ArrayLike, side: int, name: str) -> NDArray[np.float64]:
    matrix = array_of(value, name).astype(np.float64)
    if matrix.shape != (side, side):
        raise ValueError(f"{name}: shape is {matrix.shape}, expected ({side}, {side})")
    if not np.isfinite(matrix).all():
        first = np.argwhere(~np.isfinite(matrix))[0]
        raise ValueError(
            f"{name}[{first[0]}, {first[1]}] is {matrix[tuple(first)]}, expected a finite number"
        )
    last = np.eye(side)[-1]
    if not np.allclose(matrix[-1], last, rtol=0, atol=1e-6):
        remedy = f"; if it is made for row vectors, give {name}.T"
        if not matrix[-1, :-1].any():
            remedy = f"; divide it by {name}[{side - 1}, {side - 1}]"
        raise ValueError(
            f"{name}[{side - 1}] is {matrix[-1].tolist()}, expected {last.tolist()}{remedy}"
        )
    return matrix


def _size(value: Any, name: str) -> int:
    if int(value) != value or value < 1:
        raise ValueError(f"{name} is {value!r}, expected a whole number from 1")
    return int(value)


def create_rays_pinhole(
    intrinsic_matrix: ArrayLike | None = None,
    extrinsic_matrix: ArrayLike | None = None,
    width_px: int = 640,
    height_px: int = 480,
    *,
    fov_deg: float | None = None,
    center: ArrayLike | None = None,
    eye: ArrayLike | None = None,
    up: ArrayLike | None = None,
    dtype: DTypeLike = np.float32,
) -> NDArray[Any]:
    """Rays of a pinhole camera, one through the centre of each pixel: an array ``(height_px,
    width_px, 6)``.

    The camera is given either by matrices or by ``fov_deg``, ``center``, ``eye`` and ``up``; the
    arguments have the meanings of Open3D.

    Parameters
    ----------
    intrinsic_matrix : array (3, 3)
        From camera coordinates (x right, y down, z forward) to pixels; the upper left corner of the
        picture is (0, 0).
    extrinsic_matrix : array (4, 4)
        From the scene's coordinates to those of the camera.
    width_px, height_px : int
        Size of the picture.
    fov_deg : float
        Horizontal field of view, in degrees between 0 and 180.
    center : array (3,)
        The point looked at.
    eye : array (3,)
        The position of the camera.
    up : array (3,)
        The direction in which the rows of pixels follow each other, as in Open3D, whose pictures
        are therefore upside down: the opposite of what is up in the scene gives an upright picture.
    dtype : numpy.float32 or numpy.float64
        The dtype of the rays.

    Returns
    -------
    numpy.ndarray
        Directions have depth 1 in camera coordinates, so ``t_hit`` is the depth and not the
        distance.

    Examples
    --------
    >>> import snell
    >>> rays = snell.create_rays_pinhole(
    ...     fov_deg=90, center=[0, 0, 0], eye=[0, 0, -5], up=[0, 1, 0], width_px=4, height_px=2
    ... )
    >>> rays.shape, rays[0, 0].tolist()
    ((2, 4, 6), [0.0, 0.0, -5.0, -0.75, -0.25, 1.0])
    """
    width, height = _size(width_px, "width_px"), _size(height_px, "height_px")
    kind = np.dtype(dtype)
    if kind not in (np.dtype(np.float32), np.dtype(np.float64)):
        raise ValueError(f"dtype is {kind}, expected float32 or float64")
    if intrinsic_matrix is not None and extrinsic_matrix is not None:
        intrinsics = _matrix(intrinsic_matrix, 3, "intrinsic_matrix")
        camera_from_world = _matrix(extrinsic_matrix, 4, "extrinsic_matrix")
        try:
            pixels_to_camera = np.linalg.inv(intrinsics)
            world_from_camera = np.linalg.inv(camera_from_world)
        except np.linalg.LinAlgError as error:
            raise ValueError("intrinsic_matrix and extrinsic_matrix must have inverses") from error
        axes, position = world_from_camera[:3, :3], world_from_camera[:3, 3]
    elif fov_deg is not None and center is not None and eye is not None and up is not None:
        if not 0 < fov_deg < 180:
            raise ValueError(f"fov_deg is {fov_deg!r}, expected a number between 0 and 180")
        position = _vector(eye, "eye")
        forward = _vector(center, "center") - position
        right = np.cross(_vector(up, "up"), forward)
        if not np.linalg.norm(forward) > 0:
            raise ValueError("center is where eye is: there is no direction to look in")
        if not np.linalg.norm(right) > 1e-12 * np.linalg.norm(forward):
            raise ValueError("up is 0 or parallel to the direction from eye to center")
        forward = forward / np.linalg.norm(forward)
        right = right / np.linalg.norm(right)
        axes = np.stack([right, np.cross(forward, right), forward], axis=1)
        focal = 0.5 * width / np.tan(np.radians(fov_deg) / 2)
        pixels_to_camera = np.array(
            [[1 / focal, 0, -width / 2 / focal], [0, 1 / focal, -height / 2 / focal], [0, 0, 1]]
        )
    else:
        raise TypeError(
            "expected intrinsic_matrix and extrinsic_matrix, or fov_deg, center, eye and up"
        )
    world_from_pixels = axes @ pixels_to_camera
    across = np.arange(width) + 0.5
    down = np.arange(height)[:, None] + 0.5
    rays = np.empty((height, width, 6), dtype=kind)
    rays[..., :3] = position
    for axis in range(3):
        x, y, one = world_from_pixels[axis]
        rays[..., 3 + axis] = across * x + (down * y + one)
    return rays
