"""Rays in, hits out; scenes in, pictures out: exact and fast ray casting, and physically based
rendering, for NumPy.

Examples
--------
>>> import snell
>>> scene = snell.Scene()
>>> ball = scene.add_shape("sphere", radius=1)
>>> scene.cast_rays([0, 0, -5, 0, 0, 1]).t_hit
array(4.)
>>> snell.render(scene, spp=1, size=(64, 48))
<snell.Image: 64 x 48 pixels, 1 samples each>
"""

from importlib import import_module as _import_module

from snell._names import NAMES as _NAMES

# Names are imported when they are first used, so that the command `snell`, which is part of this
# package, starts without NumPy. What type checkers read is compared with the table by a test. They
# know this constant by its name; the module `typing`, which has it too, takes time to import.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from snell._bake import Baked, bake
    from snell._cameras import create_rays_pinhole
    from snell._clouds import PointCloud, load_points
    from snell._images import Comparison, compare
    from snell._load import load
    from snell._pairs import ClosestPair, closest_pair, collides, time_of_impact
    from snell._points import save_points
    from snell._render import SceneWarning, render, render_iter
    from snell._snell import (
        INVALID_ID,
        LIGHTS,
        MATERIALS,
        MEDIA,
        PATTERNS,
        PROJECTIONS,
        SHAPES,
        Camera,
        Channel,
        ClosestPoints,
        Hits,
        Image,
        Intersections,
        Light,
        Material,
        Medium,
        Pattern,
        Scene,
        Texture,
        View,
        __version__,
        describe,
    )
    from snell._sun import sun_direction
    from snell._view import explain, view
    from snell._views import Node

__all__ = [
    "INVALID_ID",
    "LIGHTS",
    "MATERIALS",
    "MEDIA",
    "PATTERNS",
    "PROJECTIONS",
    "SHAPES",
    "Baked",
    "Camera",
    "Channel",
    "ClosestPair",
    "ClosestPoints",
    "Comparison",
    "Hits",
    "Image",
    "Intersections",
    "Light",
    "Material",
    "Medium",
    "Node",
    "Pattern",
    "PointCloud",
    "Scene",
    "SceneWarning",
    "Texture",
    "View",
    "__version__",
    "bake",
    "closest_pair",
    "collides",
    "compare",
    "create_rays_pinhole",
    "describe",
    "explain",
    "load",
    "load_points",
    "render",
    "render_iter",
    "save_points",
    "sun_direction",
    "time_of_impact",
    "view",
]


def __getattr__(name: str) -> object:
    module = _NAMES.get(name)
    if module is None:
        raise AttributeError(f"module 'snell' has no attribute {name!r}")
    value = getattr(_import_module(f"snell.{module}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
