"""Types of the settings of a render, as the renderer declares them.

`cargo xtask parameters` writes this file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence


class RenderSettings(TypedDict, total=False):
    """Keywords of :func:`snell.render`. ``None`` is as if they were left out."""

    noise: float | None
    """Stop each pixel when its 95 % confidence interval is this narrow on both sides, such as
    0.02. In bright regions the value is relative to the light; see the documentation. The
    number of samples and the time are upper limits.
    """

    time: float | str | None
    """Stop after this time, such as 30s, 5m or 1h (the first pass over the picture is always
    finished).
    """

    max_depth: int | None
    """Maximum number of bounces after the first hit. Default: 8 for whitted, 10000 for path,
    else 1.
    """

    roulette_depth: int | None
    """Bounces after which `path` may end paths that have lost light, by Russian roulette.
    Default: 1, or 4 where most light comes evenly from all directions.
    """

    crop: tuple[int, int, int, int] | None
    """Render only this rectangle of pixels (right and lower border exclusive)."""

    seed: int | None
    """Seed of the random numbers. Default: 0."""

    color: str | None
    """Colours in light transport (`spectral` has four wavelengths per sample): rgb or
    spectral. Default: rgb.
    """

    sampler: str | None
    """Source of random numbers: independent, stratified, sobol or zsobol. Default: zsobol."""

    filter: str | None
    """Reconstruction filter: box, tent, gaussian, mitchell, blackman-harris or lanczos.
    Default: blackman-harris.
    """

    shadows: str | None
    """Shadows of `raycast` and `whitted`: none, hard or soft. Default: hard."""

    terminator: str | None
    """Shadow terminator on coarse meshes with smooth normals: smooth or faceted. Default:
    smooth.
    """

    light_samples: str | None
    """Samples that find lights in `path` and `direct`: mis, light or bsdf. Default: mis."""

    light_sampler: str | None
    """Choice of a light among many: uniform, power or bvh. Default: bvh."""

    guiding: bool | int | None
    """Learn where light comes from before rendering, for caustics and hidden lights (`path`).
    The value is the number of training passes; `auto` takes a quarter of the samples or of
    the time. Default: off.
    """

    caustics: str | None
    """Find caustics of small lamps by photons (`path`): the light that glass, water and
    polished metal gather: auto, on or off. Default: auto.
    """

    photons: int | None
    """Photons for each 16 samples of a pixel (`caustics`). A million take up to 32 MB, and 116
    MB in fog. Default: twice as many as the picture has pixels, from 131072 to 4194304.
    """

    clamp: float | None
    """Clamp light after two or more bounces to this radiance, which removes fireflies but
    makes the picture too dark. Default: off.
    """

    ao_distance: float | None
    """Distance within which `ao` counts occluders, in scene units. Default: half of the
    scene's radius.
    """

    accelerator: str | None
    """Acceleration structure, which never changes the picture: none, graph, spheres, bvh,
    grid, octree, octree-hierarchical, bsp or kdtree. Default: bvh.
    """

    quality: str | None
    """Build quality of the bvh, which never changes the picture: fast, medium or high.
    Default: medium.
    """

    bvh_cache: str | os.PathLike[str] | None
    """Keep acceleration structures of large meshes in this folder, for the next render."""

    bvh_compact: bool | None
    """Store the bvh in about two thirds of the memory; rays take somewhat longer. Never
    changes the picture.
    """

    aovs: str | Sequence[str] | None
    """Extra layers, separated by commas, such as depth,normal,albedo (`all` for all)."""

    light_groups: Mapping[str, Any] | None
    """Write the light of some lights as a separate layer: NAME=LIST of light numbers, names of
    emissive materials, and `environment`.
    """

    denoise: bool | str | os.PathLike[str] | None
    """Remove noise with Open Image Denoise, if it is installed; PATH is its library or folder.
    Default: off.
    """

    exposure: float | None
    """Exposure in stops, for display formats. Default: 0."""
