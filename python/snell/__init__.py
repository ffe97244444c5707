"""Rays in, hits out: exact and fast ray casting for NumPy.

Examples
--------
>>> import snell
>>> scene = snell.Scene()
>>> ball = scene.add_shape("sphere", radius=1)
>>> scene.cast_rays([0, 0, -5, 0, 0, 1]).t_hit
array(4.)
"""

from snell._cameras import create_rays_pinhole
from snell._images import Comparison, compare
from snell._render import SceneWarning, render
from snell._snell import (
    INVALID_ID,
    SHAPES,
    ClosestPoints,
    Hits,
    Image,
    Intersections,
    Scene,
    __version__,
    load,
)

__all__ = [
    "INVALID_ID",
    "SHAPES",
    "ClosestPoints",
    "Comparison",
    "Hits",
    "Image",
    "Intersections",
    "Scene",
    "SceneWarning",
    "__version__",
    "compare",
    "create_rays_pinhole",
    "load",
    "render",
]
