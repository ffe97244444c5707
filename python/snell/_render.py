"""Pictures of scenes."""

from __future__ import annotations

import importlib
import os
import sys
import textwrap
import time as clock
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from snell._progress import reporter
from snell._snell import Image, Scene, _Render, _render_settings, load

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from snell._settings import RenderSettings
    from snell._snell import Camera

__all__ = ["SceneWarning", "render", "render_iter"]


class SceneWarning(UserWarning):
    """The warning that a part of a scene cannot be rendered as described; it states what is done
    instead.
    """


def _scene(scene: Scene | str | os.PathLike[str]) -> Scene:
    return scene if isinstance(scene, Scene) else load(scene)


def _warn(image: Image) -> None:
    for message in image.metadata["warnings"]:
        warnings.warn(message, SceneWarning, stacklevel=3)


def _denoiser(denoise: Any) -> Any:
    """The setting `denoise`, with True replaced by the folder of the package `pyoidn` if that is
    installed. Otherwise the system's library is used.
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
    threads: int | None = None,
    tonemap: str | None = None,
    shutter: tuple[float, float] | None = None,
    progress: bool | Callable[[float, int], object] = True,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_interval: float = 30.0,
    resume: bool = False,
    **settings: Unpack[RenderSettings],
) -> Image:
    """Renders a scene.

    Omitted settings come from the scene's file, or else are the defaults below. A scene without a
    camera gets one that frames it; a scene without any light gets a grey sky. The scene is
    compiled at the first render and kept until it changes. Python's lock is released during the
    render; Ctrl-C ends it at once.

    Parameters
    ----------
    scene : Scene, str or os.PathLike
        A scene, a file that :func:`load` reads, or the name of a built-in scene.
    camera : Camera, int, str
        A camera, or the number or name of one of the scene's cameras. Default: the first.
    threads : int
        Number of threads. Default: one per core.
    tonemap : str
        Tone map with which the picture is shown: ``"none"``, ``"aces"`` or ``"agx"``.
    shutter : (float, float)
        The times at which the shutter opens and closes. What moves between them
        (:meth:`Scene.update_transform`, or an animation of the file) is blurred. Default: a picture
        of the scene at the first of its times; :meth:`Scene.at` gives others.
    progress : bool or callable
        True shows the progress after a second, by tqdm or rich if the program has imported one of
        them, else as a line of text on a terminal. A callable is given the finished share, 0 to 1,
        and the number of rays so far, ten times a second and at the end; it stops the render by
        returning False.
    checkpoint : str or os.PathLike
        A file in which the unfinished render is saved at intervals, and when it ends, also by
        Ctrl-C. An existing file is refused, unless `resume` is True.
    checkpoint_interval : float
        Seconds between two saves; longer if saving would take more than a hundredth of the time.
    resume : bool
        Continue the render in `checkpoint`, to the same bits as if nothing had ended it; if there
        is none, warn and start from the beginning. A checkpoint of another picture is refused.
    SETTINGS

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
    options = {"integrator": integrator, "spp": spp, "size": size, "camera": camera}
    options |= {"threads": threads, "tonemap": tonemap, "shutter": shutter}  # type: ignore[dict-item]
    options |= _known("render", settings)
    with reporter(progress) as report:
        work = _Render(_scene(scene), options, _kept(checkpoint, checkpoint_interval, resume))
        image = work.render(report=report)
    _warn(image)
    return image


def _kept(
    checkpoint: str | os.PathLike[str] | None, interval: float, resume: bool
) -> tuple[str | os.PathLike[str], float, bool] | None:
    """The file that keeps a render on its way."""
    if checkpoint is None:
        if resume:
            raise ValueError("resume is True, but no checkpoint is named to go on with")
        return None
    return checkpoint, interval, resume


# The settings of a render with their documentation, as the renderer declares them.
_SETTINGS: dict[str, dict[str, Any]] = _render_settings()


def _known(function: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the settings with the path of the denoiser; raises TypeError for an unknown one."""
    for name in settings:
        if name not in _SETTINGS and name not in _OTHERS:
            known = [*_SETTINGS, *_OTHERS]
            near = importlib.import_module("difflib").get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{hint}")
    return {**settings, "denoise": _denoiser(settings.get("denoise"))}


# Keywords beside the settings.
_OTHERS = ("camera", "threads", "tonemap", "shutter")


def _documented() -> str:
    """The settings in the form of a docstring's parameters."""
    lines = []
    for name, about in _SETTINGS.items():
        text = f"{about['summary']}. {about['details']}".strip()
        lines.append(f"{name} : {about['type']}")
        lines += textwrap.wrap(text, 92, initial_indent="    ", subsequent_indent="    ")
    return "\n    ".join(lines)


render.__doc__ = (render.__doc__ or "").replace("SETTINGS", _documented())


def render_iter(
    scene: Scene | str | os.PathLike[str],
    integrator: str | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    *,
    time: float | None = None,
    view: bool | None = None,
    progress: bool | Callable[[float, int], object] = False,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_interval: float = 30.0,
    resume: bool = False,
    **options: Any,
) -> Iterator[Image]:
    """Renders a scene and yields the picture each time its number of samples has quadrupled: at 1,
    4, 16 and so on per pixel. The last picture is the one that :func:`render` returns.

    Each picture is complete, and no sample is taken twice. With `noise`, pixels that have reached
    the requested error get no more samples. With a `checkpoint`, the render is also saved when the
    iterator is closed, and `resume` begins with the picture that was saved.

    Parameters
    ----------
    scene, integrator, spp, size, progress, checkpoint, checkpoint_interval, resume, **options
        As for :func:`render`.
    time : float
        Time limit in seconds for all pictures together.
    view : bool
        Show the pictures in the notebook, each in the place of the previous one. Default: True in
        a notebook.

    Examples
    --------
    >>> import snell
    >>> pictures = snell.render_iter("cornell-box", spp=16, size=(16, 16))
    >>> [image.metadata["samples"] for image in pictures]
    [1, 4, 16]
    """
    options = _known("render_iter", options)
    options |= {"integrator": integrator, "spp": spp, "size": size, "time": time}
    work = _Render(_scene(scene), options, _kept(checkpoint, checkpoint_interval, resume))
    return _refine(work, time, progress, view)


def _refine(
    work: _Render,
    time: float | None,
    progress: bool | Callable[[float, int], object],
    view: bool | None,
) -> Iterator[Image]:
    show = _View() if (_is_notebook() if view is None else view) else None
    start = clock.perf_counter()
    is_last, samples = False, 1
    try:
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
            # What was saved may have more samples.
            while samples <= work.taken:
                samples *= 4
    finally:
        if not is_last:
            work.save()


def _is_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"


class _View:
    """Pictures in a notebook, each replacing the previous one."""

    def __init__(self) -> None:
        self._handle: Any = None

    def __call__(self, image: Image) -> None:
        if self._handle is None:
            self._handle = importlib.import_module("IPython.display").display(
                image, display_id=True
            )
        else:
            self._handle.update(image)
