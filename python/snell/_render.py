"""Pictures of scenes."""

from __future__ import annotations

import importlib
import os
import sys
import time as clock
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from snell._progress import reporter
from snell._snell import Image, Scene, _render, _samples, load

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


def render(
    scene: Scene | str | os.PathLike[str],
    integrator: str | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    *,
    camera: Camera | int | str | None = None,
    aovs: str | Sequence[str] | None = None,
    time: float | None = None,
    max_depth: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    sampler: str | None = None,
    filter: str | None = None,
    shadows: str | None = None,
    light_samples: str | None = None,
    light_sampler: str | None = None,
    ao_distance: float | None = None,
    color: str | None = None,
    quality: str | None = None,
    progress: bool | Callable[[float, int], object] = True,
) -> Image:
    """Renders a scene.

    What is left out is as the scene's file says, else as below. A scene without a camera is framed; one without any light is put under a grey
    sky. The scene is compiled at the first render and kept until it changes. Work is done without Python's lock; Ctrl-C ends it at once.

    Parameters
    ----------
    scene : Scene, str or os.PathLike
        A scene, a file that :func:`load` reads, or the name of a built-in scene.
    integrator : str
        How light is computed: ``"path"`` (all of it; the default), ``"direct"``, ``"ao"``, ``"whitted"``, ``"raycast"``, ``"flat"`` or ``"aov"``.
    spp : int
        Samples per pixel: 64 for ``"path"``.
    size : tuple of int
        Width and height in pixels: (1280, 720).
    camera : Camera, int, str
        A camera, or number or name of one of the scene's; the first.
    aovs : list of str
        Extra layers, such as ``["depth", "normal", "albedo"]``, or ``"all"``.
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
    sampler, filter, shadows, light_samples, light_sampler, ao_distance, color, quality
        As the options of the command ``snell render``.
    progress : bool or callable
        True shows how far it is, after a second, by tqdm or rich if the program has imported one of them, else as a line of text on a terminal. A
        callable is given the share that is done and the rays so far, and stops the render by answering False.

    Returns
    -------
    Image

    Examples
    --------
    >>> import numpy as np, snell
    >>> image = snell.render("cornell-box", spp=4, size=(32, 32), aovs=["depth"])
    >>> np.asarray(image).shape, image.aovs["depth"].shape
    ((32, 32, 3), (32, 32))
    """
    options = {
        "integrator": integrator,
        "spp": spp,
        "size": size,
        "camera": camera,
        "aovs": aovs,
        "time": time,
        "max_depth": max_depth,
        "seed": seed,
        "threads": threads,
        "crop": crop,
        "sampler": sampler,
        "filter": filter,
        "shadows": shadows,
        "light_samples": light_samples,
        "light_sampler": light_sampler,
        "ao_distance": ao_distance,
        "color": color,
        "quality": quality,
    }
    with reporter(progress) as report:
        image = _render(_scene(scene), options, report)
    _warn(image)
    return image


def render_iter(
    scene: Scene | str | os.PathLike[str],
    integrator: str | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    *,
    time: float | None = None,
    view: bool | None = None,
    **options: Any,
) -> Iterator[Image]:
    """Renders a scene again and again with more samples: 1, 4, 16 and so on per pixel. The last picture is that of :func:`render`.

    Each picture is whole; all but the last together cost a third of its time.

    Parameters
    ----------
    scene, integrator, spp, size, **options
        As of :func:`render`.
    time : float
        Stop after so many seconds altogether.
    view : bool
        Show the pictures in the notebook, each in the place of the one before. Left out: if this is a notebook.

    Examples
    --------
    >>> import snell
    >>> pictures = snell.render_iter("cornell-box", spp=16, size=(16, 16))
    >>> [image.metadata["samples"] for image in pictures]
    [1, 4, 16]
    """
    scene = _scene(scene)
    show = _View() if (_is_notebook() if view is None else view) else None
    start = clock.perf_counter()
    options = {**options, "integrator": integrator, "size": size, "progress": options.get("progress", False)}
    asked = {key: value for key, value in options.items() if key != "progress"}
    last = _samples(scene, {**asked, "spp": spp, "time": time})
    step = 1
    while True:
        left = None if time is None else max(time - (clock.perf_counter() - start), 1e-3)
        count = min(step, last)
        image = render(scene, spp=count, time=left, **options)
        is_last = count == last or not image.metadata["is_complete"] or (left is not None and left <= 1e-3)
        if show is not None:
            show(image)
        yield image
        if is_last:
            return
        step *= 4


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
            self._handle = importlib.import_module("IPython.display").display(image, display_id=True)
        else:
            self._handle.update(image)
