"""Cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import UsdGeom

from ._context import Context, direction

__all__ = ["camera"]

#: Apertures and focal lengths are tenths of units of the stage.
_TENTH = 0.1


def camera(context: Context, prim: Any, world: np.ndarray) -> None:
    """Adds a camera, whose field of view follows from the vertical aperture."""
    given = UsdGeom.Camera(prim)
    get = lambda attribute, default: float(context.value(attribute, default))  # noqa: E731
    height, focal = (
        get(given.GetVerticalApertureAttr(), 15.2908),
        get(given.GetFocalLengthAttr(), 50),
    )
    towards = np.array(direction(-world[:3, 2]))
    up = world[:3, 1] - towards * towards.dot(world[:3, 1])
    if get(given.GetHorizontalApertureOffsetAttr(), 0) or get(
        given.GetVerticalApertureOffsetAttr(), 0
    ):
        context.remark(f"{prim.GetPath()}: the offset of the aperture is left out")
    projection: dict[str, Any]
    if str(context.value(given.GetProjectionAttr())) == "orthographic":
        projection = {
            "projection": "orthographic",
            "half_size": [None, height * _TENTH / 2 * context.scale],
        }
    elif height > 0 and focal > 0:
        projection = {"projection": "perspective", "tan_half_fov": [None, height / (2 * focal)]}
    else:
        context.remark(
            f"{prim.GetPath()}: a camera without an aperture or a focal length is left out"
        )
        return
    stop, focus = get(given.GetFStopAttr(), 0), get(given.GetFocusDistanceAttr(), 0)
    context.known["camera", str(prim.GetPath())] = len(context.cameras)
    context.cameras.append(
        {
            "name": prim.GetName(),
            "eye": [float(x) for x in world[:3, 3]],
            "towards": [float(x) for x in towards],
            "up": direction(up),
            "projection": projection,
            "aperture_radius": focal * _TENTH * context.scale / (2 * stop)
            if stop > 0 and focus > 0
            else 0.0,
            "focus_distance": focus * context.scale if focus > 0 else 1.0,
            "resolution": None,
        }
    )
