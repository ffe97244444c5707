"""The modules that the names of the package come from, for :mod:`snell` to import on first use."""

from __future__ import annotations

_OF_MODULES = {
    "_bake": "Baked bake",
    "_cameras": "create_rays_pinhole",
    "_clouds": "PointCloud load_points",
    "_images": "Comparison compare",
    "_load": "load",
    "_pairs": "ClosestPair closest_pair collides time_of_impact",
    "_points": "save_points",
    "_render": "SceneWarning render render_iter",
    "_snell": (
        "INVALID_ID LIGHTS MATERIALS MEDIA PATTERNS PROJECTIONS SHAPES Camera Channel "
        "ClosestPoints Hits Image Intersections Light Material Medium Pattern Scene Texture View "
        "__version__ describe"
    ),
    "_sun": "sun_direction",
    "_view": "explain view",
    "_views": "Node",
}

NAMES = {name: module for module, names in _OF_MODULES.items() for name in names.split()}
