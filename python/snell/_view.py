"""Scenes in the browser, and explanations of pixels."""

from __future__ import annotations

import json
import warnings
import webbrowser
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from snell._render import _scene, render
from snell._snell import View, _explain, _view

if TYPE_CHECKING:
    import os

    from snell._snell import Scene

__all__ = ["View", "explain", "view"]


def preview(scene: Scene) -> bytes | None:
    """A picture of a scene as PNG, made within about two seconds; ``None`` for a scene in which
    there is nothing to see.
    """
    if len(scene) == 0:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        image = render(scene, size=(320, 240), spp=16, time=2, progress=False)
    return bytes(image._repr_png_())


def explain(
    scene: Scene | str | os.PathLike[str],
    pixel: tuple[int, int],
    sample: int | None = None,
    *,
    structures: Sequence[str] = (),
    **options: Any,
) -> dict[str, Any]:
    """Explains the colour that :func:`render` with the same options gives a pixel.

    Parameters
    ----------
    scene : Scene, str or os.PathLike
        As for :func:`render`.
    pixel : tuple of int
        Column and row, from the upper left corner.
    sample : int
        Number of the sample whose path is reported, from 0. Default: the sample whose colour is
        nearest to that of the pixel.
    structures : list of str
        Acceleration structures through which the camera ray is followed, such as ``["bvh",
        "kdtree"]``.
    **options
        As for :func:`render`: ``spp``, ``size``, ``camera`` and so on.

    Returns
    -------
    dict
        ``value`` is the pixel (red, green, blue, alpha). ``samples`` are the colours of its
        samples, whose mean is ``value``; ``convergence`` is the mean after some of the samples.
        ``classes`` is the light of the pixel by class of path: E for the eye, then for each vertex
        D (diffuse), G (glossy), S (mirror), T (through a surface) or V (in a medium), and L for the
        light. ``tree`` is the path of one sample: ``vertices`` with what each adds to the sample's
        ``color``. ``traces`` is the traversal of each structure by the camera ray.

    Examples
    --------
    >>> import snell
    >>> report = snell.explain("cornell-box", (32, 20), spp=4, size=(64, 48))
    >>> [vertex["material"] for vertex in report["tree"]["vertices"]][:1]
    ['white']
    """
    report: dict[str, Any] = json.loads(
        _explain(_scene(scene), options, pixel, sample, list(structures))
    )
    return report


def view(
    scene: Scene | str | os.PathLike[str],
    *,
    port: int = 0,
    open: bool | None = None,
    fps: float = 30.0,
    **options: Any,
) -> View:
    """Shows a scene in the browser, as ``snell view`` does: the picture follows the camera that you
    steer, and is refined while the camera rests.

    Parameters
    ----------
    scene : Scene, str or os.PathLike
        As for :func:`render`. Later changes of the scene are not shown.
    port : int
        Port on which the server listens, on this machine only. Default: any free one.
    open : bool
        Whether the page is opened in the browser. Default: no in a notebook, whose cell shows the
        page, and yes elsewhere.
    fps : float
        Frames per second while something moves, 1 to 240.
    **options
        As for :func:`render`: the settings of the picture at rest.

    Returns
    -------
    View
        The view, which ends with ``close()``, at the end of a ``with`` block, or with the program.

    Examples
    --------
    >>> import snell
    >>> with snell.view("cornell-box", spp=16, open=False) as view:
    ...     view.url.startswith("http://127.0.0.1:")
    True
    """
    shown = _view(_scene(scene), options, port, fps)
    if open or (open is None and not _is_notebook()):
        # Other users of the machine can read the browser's command line, so it has no token in it.
        webbrowser.open(shown._url_for_browser())
    return shown


def _is_notebook() -> bool:
    try:
        shell: object = get_ipython()  # type: ignore[name-defined]
        return type(shell).__name__ == "ZMQInteractiveShell"
    except NameError:
        return False
