"""Cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from ._context import Context, direction

__all__ = ["camera"]

#: Apertures and focal lengths are tenths of units of the stage.
_TENTH = 0.1
#: The longer side of pictures for which the stage gives no size, in pixels.
_LONGER = 960


def camera(context: Context, prim: Any, world: np.ndarray) -> None:
    """Adds a camera, whose field of view and shape of pictures follow from the aperture."""
    given = UsdGeom.Camera(prim)
    get = lambda attribute, default: float(context.value(attribute, default))  # noqa: E731
    size = np.array(
        [
            get(given.GetHorizontalApertureAttr(), 20.955),
            get(given.GetVerticalApertureAttr(), 15.2908),
        ]
    )
    offset = np.array(
        [
            get(given.GetHorizontalApertureOffsetAttr(), 0),
            get(given.GetVerticalApertureOffsetAttr(), 0),
        ]
    )
    focal = get(given.GetFocalLengthAttr(), 50)
    is_parallel = str(context.value(given.GetProjectionAttr())) == "orthographic"
    if not size.min() > 0 or not (focal > 0 or is_parallel):
        context.remark(
            f"{prim.GetPath()}: a camera without an aperture or a focal length is left out"
        )
        return
    if len(context.value(given.GetClippingPlanesAttr(), [])):
        context.remark(f"{prim.GetPath()}: the clipping planes of the camera are left out")
    towards = np.array(direction(-world[:3, 2]))
    up = world[:3, 1] - towards * towards.dot(world[:3, 1])
    eye = world[:3, 3]
    resolution = _resolution(size)
    projection: dict[str, Any]
    if is_parallel:
        # The eye of a parallel view may stand anywhere on its plane.
        moved = offset * _TENTH
        eye = eye + world[:3, 0] * moved[0] + world[:3, 1] * moved[1]
        projection = {
            "projection": "orthographic",
            "half_size": [None, size[1] * _TENTH / 2 * context.scale],
        }
    elif np.any(offset):
        pixels = np.array(resolution, dtype=np.float64)
        projection = {
            "projection": "intrinsics",
            "focal_length": [float(x) for x in focal / size * pixels],
            "principal_point": [
                float(x) for x in (0.5 - np.array([1, -1]) * offset / size) * pixels
            ],
            "size": resolution,
        }
    else:
        projection = {"projection": "perspective", "tan_half_fov": [None, size[1] / (2 * focal)]}
    stop, focus = get(given.GetFStopAttr(), 0), get(given.GetFocusDistanceAttr(), 0)
    context.known["camera", str(prim.GetPath())] = len(context.cameras)
    # Versions of USD before 25.2 have no exposure but stops.
    scale = getattr(given, "ComputeLinearExposureScale", None)
    context.exposures.append(float(scale(context.time)) if scale else 1.0)
    context.cameras.append(
        {
            "name": prim.GetName(),
            "eye": [float(x) for x in eye],
            "towards": [float(x) for x in towards],
            "up": direction(up),
            "projection": projection,
            "aperture_radius": focal * _TENTH * context.scale / (2 * stop)
            if stop > 0 and focus > 0
            else 0.0,
            "focus_distance": focus * context.scale if focus > 0 else 1.0,
            "resolution": resolution,
        }
    )


def _resolution(size: np.ndarray) -> list[int]:
    """A size of pictures in which pixels of the aperture are square."""
    width, height = size / size.max()
    return [max(1, round(_LONGER * width)), max(1, round(_LONGER * height))]
