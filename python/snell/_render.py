"""Pictures of scenes."""

from __future__ import annotations

import importlib
import os
import sys
import time as clock
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from snell._progress import reporter
from snell._snell import Image, Scene, _Render, load

if TYPE_CHECKING:
    from snell._snell import Camera

__all__ = ["SceneWarning", "render", "render_iter"]


class SceneWarning(UserWarning):
    """Something in a scene that cannot be rendered as it says, and what is done instead."""


def _scene(scene: Scene | str | os.PathLike[str]) -> Scene:
    return scene if isinstance(scene, Scene) else load(scene)


def _warn(image: Image) -> None:
    for message in image.metadata["warnings"]:
        warnings.warn(message, SceneWarning, stacklevel=3)


def _denoiser(denoise: Any) -> Any:
    """Where Open Image Denoise is: in a Python package, if one is installed, else wherever the
    system finds it.
    """
    spec = (
        importlib.import_module("importlib.util").find_spec("pyoidn") if denoise is True else None
    )
    return (
        spec.submodule_search_locations[0]
        if spec is not None and spec.submodule_search_locations
        else denoise
    )


def render(
    scene: Scene | str | os.PathLike[str],
    integrator: str | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    *,
    camera: Camera | int | str | None = None,
    aovs: str | Sequence[str] | None = None,
    noise: float | None = None,
    time: float | None = None,
    max_depth: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    guiding: bool | int | None = None,
    denoise: bool | str | os.PathLike[str] | None = None,
    color: str | None = None,
    clamp: float | None = None,
    sampler: str | None = None,
    filter: str | None = None,
    shadows: str | None = None,
    terminator: str | None = None,
    light_samples: str | None = None,
    light_sampler: str | None = None,
    light_groups: Mapping[str, Any] | None = None,
    ao_distance: float | None = None,
    exposure: float | None = None,
    tonemap: str | None = None,
    accelerator: str | None = None,
    quality: str | None = None,
    bvh_cache: str | os.PathLike[str] | None = None,
    bvh_compact: bool = False,
    progress: bool | Callable[[float, int], object] = True,
) -> Image:
    """Renders a scene.

    What is left out is as the scene's file says, else as below. A scene without a camera is framed;
    one without any light is put under a grey sky. The scene is compiled at the first render and
    kept until it changes. Work is done without Python's lock; Ctrl-C ends it at once.

    Parameters
    ----------
    scene : Scene, str or os.PathLike
        A scene, a file that :func:`load` reads, or the name of a built-in scene.
    integrator : str
        How light is computed: ``"path"`` (all of it; the default), ``"direct"``, ``"ao"``,
        ``"whitted"``, ``"raycast"``, ``"flat"`` or ``"aov"``.
    spp : int
        Samples per pixel: 64 for ``"path"``. With `noise` or `time` the most, and as many as it
        takes if left out.
    size : tuple of int
        Width and height in pixels: (960, 720).
    camera : Camera, int, str
        A camera, or number or name of one of the scene's; the first.
    aovs : list of str
        Extra layers, such as ``["depth", "normal", "albedo"]``, or ``"all"``.
    noise : float
        Each pixel stops when its 95 % confidence interval is this narrow on both sides, such as
        0.02 for 2 % of its light (of some grey, where it is dark).
    time : float
        Stop after so many seconds, once every pixel has a sample.
    max_depth : int
        Bounces after the first hit at most.
    seed : int
        Of the random numbers. The picture depends on it, but not on threads or time of day.
    threads : int
        All cores.
    crop : tuple of int
        ``(x0, y0, x1, y1)``: only these pixels, right and lower border excluded.
    guiding : bool or int
        Learn where light comes from before rendering, for caustics and hidden lights (``"path"``);
        a number says in how many passes.
    denoise : bool, str or os.PathLike
        Remove noise with Open Image Denoise, if it is installed (such as by ``pip install pyoidn``)
        or in this folder. What the colours were is the layer ``"noisy"``.
    color : str
        ``"rgb"``, or ``"spectral"``: four wavelengths for each sample.
    clamp : float
        Dim light of two or more bounces to this radiance: no fireflies, but too dark.
    light_groups : dict
        Show the light of some lights apart, as layers: names with lists of numbers of lights, names
        of emissive materials, and ``"environment"``.
    ao_distance : float
        How far ``"ao"`` looks, in units of the scene: half of the scene's radius.
    exposure, tonemap
        How the picture is shown: stops; ``"none"``, ``"aces"`` or ``"agx"``. `noise` looks at it
        with this exposure.
    sampler, filter, shadows, terminator, light_samples, light_sampler, accelerator, quality,
    bvh_cache, bvh_compact
        As the options of the command ``snell render``.
    progress : bool or callable
        True shows how far it is, after a second, by tqdm or rich if the program has imported one of
        them, else as a line of text on a terminal. A callable is given the share that is done and
        the rays so far, and stops the render by answering False.

    Returns
    -------
    Image

    Examples
    --------
    >>> import numpy as np, snell
    >>> image = snell.render("cornell-box", spp=4, size=(32, 32), aovs=["depth"])
    >>> np.asarray(image).shape, image.aovs["depth"].shape
    ((32, 32, 3), (32, 32))
    >>> image = snell.render("cornell-box", size=(16, 16), noise=0.5)
    >>> image.metadata["converged"]
    1.0
    """
    options = {**locals(), "denoise": _denoiser(denoise)}
    del options["scene"], options["progress"]
    with reporter(progress) as report:
        image = _Render(_scene(scene), options).render(report=report)
    _warn(image)
    return image


# What can be asked for beside the scene.
_OPTIONS = tuple(render.__kwdefaults__ or ())


def render_iter(
    scene: Scene | str | os.PathLike[str],
    integrator: str | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    *,
    time: float | None = None,
    view: bool | None = None,
    progress: bool | Callable[[float, int], object] = False,
    **options: Any,
) -> Iterator[Image]:
    """Renders a scene and yields the picture whenever it has four times the samples: 1, 4, 16 and
    so on per pixel. The last picture is that of :func:`render`.

    Each picture is whole, and nothing is rendered twice. With `noise`, pixels that have stopped
    stay as they are.

    Parameters
    ----------
    scene, integrator, spp, size, progress, **options
        As of :func:`render`.
    time : float
        Stop after so many seconds altogether.
    view : bool
        Show the pictures in the notebook, each in the place of the one before. Left out: if this is
        a notebook.

    Examples
    --------
    >>> import snell
    >>> pictures = snell.render_iter("cornell-box", spp=16, size=(16, 16))
    >>> [image.metadata["samples"] for image in pictures]
    [1, 4, 16]
    """
    for name in options:
        if name not in _OPTIONS:
            near = importlib.import_module("difflib").get_close_matches(name, _OPTIONS, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise TypeError(f"render_iter() got an unexpected keyword argument {name!r}{hint}")
    options |= {"integrator": integrator, "spp": spp, "size": size, "time": time}
    return _refine(_scene(scene), options, time, progress, view)


def _refine(
    scene: Scene,
    options: dict[str, Any],
    time: float | None,
    progress: bool | Callable[[float, int], object],
    view: bool | None,
) -> Iterator[Image]:
    show = _View() if (_is_notebook() if view is None else view) else None
    start = clock.perf_counter()
    work = _Render(scene, {**options, "denoise": _denoiser(options.get("denoise"))})
    is_last, samples = False, 1
    while not is_last:
        left = None if time is None else max(time - (clock.perf_counter() - start), 1e-3)
        with reporter(progress) as report:
            image = work.render(samples, left, report)
        is_last = work.is_done or not image.metadata["is_complete"]
        if samples == 1:
            _warn(image)
        if show is not None:
            show(image)
        yield image
        samples *= 4


def _is_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"


class _View:
    """Pictures in a notebook, each in the place of the one before."""

    def __init__(self) -> None:
        self._handle: Any = None

    def __call__(self, image: Image) -> None:
        if self._handle is None:
            self._handle = importlib.import_module("IPython.display").display(
                image, display_id=True
            )
        else:
            self._handle.update(image)
