"""Renders on Dask or on Ray."""

from __future__ import annotations

import hashlib
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from snell._progress import Report, reporter
from snell._render import _is_notebook, _known, _scene, _View, _warn
from snell._snell import Image, Scene, _pack_scene
from snell.distributed._dask import Dask
from snell.distributed._engine import Engine
from snell.distributed._frames import Frame, run
from snell.distributed._ray import Ray

__all__ = ["Rendering", "render", "render_frames", "render_iter", "start"]

# The part of the time that may go into pictures on the way.
_SHARE = 0.1

# Keywords of renders that are not in the list of settings.
_OWN = ("integrator", "spp", "size")


def render(
    scene: Scene | str | os.PathLike[str],
    client: Any = None,
    *,
    engine: str = "dask",
    progress: bool | Report = True,
    partial: Callable[[Image], object] | None = None,
    every: float = 2.0,
    view: bool | None = None,
    **options: Any,
) -> Image:
    """Renders a scene on the workers of a cluster. The picture has the same bits as that of
    :func:`snell.render` with the same keywords.

    The scene is sent to each worker once, and each process compiles it once. Workers may come and
    go; a task whose worker has died is done again. Ctrl-C ends the render and its tasks.

    Parameters
    ----------
    scene : Scene, str or os.PathLike
        A scene, a file that :func:`snell.load` reads, or the name of a built-in scene. Only this
        program reads files.
    client : distributed.Client, distributed cluster or str
        With Dask, a client, a cluster or the address of a scheduler; default: workers on this
        machine, which end with the render. (Python starts processes by importing the program's main
        file, so a script then needs the line ``if __name__ == "__main__":``.) With Ray, the
        address of a cluster; default: the one that the program is connected to, or else one on this
        machine that ends with the render.
    engine : str
        ``"dask"`` or ``"ray"``. ``pip install "snell[dask]"`` or ``"snell[ray]"`` installs it.
    progress : bool or callable
        As for :func:`snell.render`: True shows it; a callable is given the finished share and the
        number of rays, and stops the render by returning False. Then the picture so far is
        returned, whose metadata has ``is_complete`` False. With `noise`, the share is that of the
        pixels that have reached it.
    partial : callable
        Is given the picture so far, every few seconds.
    every : float
        Seconds between two such pictures. They take no more than a tenth of the time.
    view : bool
        Show these pictures in the notebook, each in the place of the previous one. Default: True in
        a notebook.
    **options
        All other keywords of :func:`snell.render` except `time`. `threads` are those of this
        program; each worker uses its own.

    Returns
    -------
    Image

    Examples
    --------
    >>> import snell, snell.distributed
    >>> with LocalCluster(n_workers=4) as cluster:  # doctest: +SKIP
    ...     image = snell.distributed.render("cornell-box", cluster, spp=256)
    """
    show = _View() if (_is_notebook() if view is None else view) else None
    frame = None
    with (
        _Cluster(scene, client, engine, options, "render") as cluster,
        reporter(progress) as report,
    ):
        shown = _Clock(every)
        for frame in cluster.run([{}]):
            if not _tell(report, frame):
                cluster.cancel()
            if (partial or show) and not frame.is_done and shown.is_time():
                with shown:
                    image = frame.film.picture()
                    _ = partial and partial(image)
                    _ = show and show(image)
        assert frame is not None
        image = frame.film.picture()
    if show is not None:
        show(image)
    _warn(image)
    return image


def render_iter(
    scene: Scene | str | os.PathLike[str],
    client: Any = None,
    *,
    engine: str = "dask",
    progress: bool | Report = False,
    every: float = 2.0,
    view: bool | None = None,
    **options: Any,
) -> Iterator[Image]:
    """Renders a scene on the workers of a cluster and yields the picture so far every few seconds.
    The last picture is the one that :func:`render` returns. Closing the iterator ends the render.

    Parameters
    ----------
    scene, client, engine, progress, every, view, **options
        As for :func:`render`. Pixels without samples are black.

    Examples
    --------
    >>> import snell, snell.distributed
    >>> for image in snell.distributed.render_iter("cornell-box"):  # doctest: +SKIP
    ...     print(image.metadata["is_complete"])
    """
    show = _View() if (_is_notebook() if view is None else view) else None
    cluster = _Cluster(scene, client, engine, options, "render_iter")
    shown, frame = _Clock(every), None
    with cluster, reporter(progress) as report:
        for frame in cluster.run([{}]):
            if not _tell(report, frame):
                cluster.cancel()
            if not frame.is_done and shown.is_time():
                with shown:
                    image = frame.film.picture()
                    _ = show and show(image)
                yield image
        assert frame is not None
        image = frame.film.picture()
    if show is not None:
        show(image)
    _warn(image)
    yield image


def render_frames(
    scene: Scene | str | os.PathLike[str],
    frames: Iterable[Mapping[str, Any]],
    client: Any = None,
    *,
    engine: str = "dask",
    progress: bool | Report = True,
    **options: Any,
) -> Iterator[Image]:
    """Renders the pictures of an animation on the workers of a cluster, and yields them in order.
    Workers begin with the next picture while the last tasks of the one before are done. Each
    picture has the same bits as that of :func:`snell.render`.

    Parameters
    ----------
    frames : iterable of dict
        For each picture the keywords in which it differs from the others, such as ``{"camera":
        camera}`` for a camera that moves, or ``{"shutter": (time, time)}`` for the scene at a time.
    scene, client, engine, progress, **options
        As for :func:`render`. The progress is that of the picture that comes next.

    Examples
    --------
    >>> import snell, snell.distributed
    >>> times = [{"shutter": (frame / 24, frame / 24)} for frame in range(48)]
    >>> pictures = snell.distributed.render_frames("scene.gltf", times)  # doctest: +SKIP
    >>> for number, image in enumerate(pictures):  # doctest: +SKIP
    ...     image.save(f"{number:03}.exr")
    """
    cluster = _Cluster(scene, client, engine, options, "render_frames")
    checked = (cluster.checked("render_frames", frame) for frame in frames)
    with cluster, reporter(progress) as report:
        for frame in cluster.run(checked):
            if not _tell(report, frame):
                cluster.cancel()
            if frame.is_done:
                image = frame.film.picture()
                _warn(image)
                yield image


def start(
    scene: Scene | str | os.PathLike[str],
    client: Any = None,
    *,
    engine: str = "dask",
    **options: Any,
) -> Rendering:
    """Starts a render on the workers of a cluster, and returns at once.

    Parameters
    ----------
    scene, client, engine, **options
        As for :func:`render`.

    Examples
    --------
    >>> import snell, snell.distributed
    >>> rendering = snell.distributed.start("cornell-box", "tcp://head:8786")  # doctest: +SKIP
    >>> rendering.picture()  # doctest: +SKIP
    >>> rendering.cancel()  # doctest: +SKIP
    """
    return Rendering(_Cluster(scene, client, engine, options, "start"))


class Rendering:
    """A render on a cluster, which goes on while the program does something else. A notebook shows
    the picture so far.

    Examples
    --------
    >>> rendering = snell.distributed.start("cornell-box")  # doctest: +SKIP
    >>> rendering.result()  # doctest: +SKIP
    """

    def __init__(self, cluster: _Cluster) -> None:
        self._cluster = cluster
        self._frame: Frame | None = None
        self._error: BaseException | None = None
        self._began = threading.Event()
        self._thread = threading.Thread(target=self._run, name="snell-distributed", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            with self._cluster as cluster:
                for self._frame in cluster.run([{}]):
                    self._began.set()
        except BaseException as error:
            self._error = error
        finally:
            self._began.set()

    @property
    def progress(self) -> float:
        """The finished share, from 0 to 1."""
        return 0.0 if self._frame is None else self._frame.progress()[0]

    def done(self) -> bool:
        """True if the render is complete, was cancelled or has failed."""
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Ends the render and its tasks. The picture so far stays."""
        self._cluster.cancel()

    def picture(self) -> Image:
        """The picture so far. Pixels without samples are black."""
        self._began.wait()
        if self._frame is None:
            raise self._error or RuntimeError("the render was cancelled before it began")
        return self._frame.film.picture()

    def result(self, timeout: float | None = None) -> Image:
        """Waits for the picture, at most `timeout` seconds. A cancelled render gives the picture
        so far; one that has failed raises its error.
        """
        self._thread.join(timeout)
        if self._thread.is_alive():
            raise TimeoutError(f"the picture is not complete after {timeout} s")
        if self._error is not None:
            raise self._error
        return self.picture()

    def _repr_png_(self) -> bytes:
        return self.picture()._repr_png_()


class _Cluster:
    """The engine of a render, with its scene."""

    def __init__(
        self,
        scene: Scene | str | os.PathLike[str],
        client: Any,
        engine: str,
        options: Mapping[str, Any],
        function: str,
    ) -> None:
        self._options = self.checked(function, options)
        if engine not in ("dask", "ray"):
            raise ValueError(f"engine is {engine!r}, expected 'dask' or 'ray'")
        self._scene = _scene(scene)
        self._client = client
        self._start = Ray if engine == "ray" else Dask
        self._engine: Engine | None = None
        self._stopped = threading.Event()

    @staticmethod
    def checked(function: str, options: Mapping[str, Any]) -> dict[str, Any]:
        if options.get("time") is not None:
            raise ValueError(
                f"time is {options['time']!r}, but the picture of many machines cannot depend on "
                "their speed; leave it out, and give spp or noise"
            )
        own = {name: options[name] for name in _OWN if name in options}
        rest = {name: value for name, value in options.items() if name not in _OWN}
        return {**_known(function, rest), **own}

    def run(self, frames: Iterable[Mapping[str, Any]]) -> Iterator[Frame]:
        packed = _pack_scene(self._scene)
        name = hashlib.sha256(packed).hexdigest()
        made = (Frame(self._scene, name, {**self._options, **own}) for own in frames)
        # What is wrong with the first picture shows before workers are started.
        first = next(made, None)
        if first is not None:
            self._engine = self._start(self._client, packed)
            yield from run(self._engine, itertools.chain([first], made), self._stopped.is_set)

    def cancel(self) -> None:
        self._stopped.set()

    def __enter__(self) -> _Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        if self._engine is not None:
            self._engine.close()


class _Clock:
    """Says when it is time for the next picture."""

    def __init__(self, every: float) -> None:
        self._every = every
        self._next = time.monotonic() + every

    def is_time(self) -> bool:
        return time.monotonic() >= self._next

    def __enter__(self) -> None:
        self._begin = time.monotonic()

    def __exit__(self, *_: object) -> None:
        now = time.monotonic()
        self._next = now + max(self._every, (now - self._begin) / _SHARE)


def _tell(report: Report | None, frame: Frame) -> bool:
    """Reports the progress; False if the render is to be stopped."""
    return report is None or report(*frame.progress()) is not False
