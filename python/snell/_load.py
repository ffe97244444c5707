"""Reads scenes: by the compiled module, and USD by `snell.usd`."""

from __future__ import annotations

import os

from snell import _snell

__all__ = ["load"]


def load(
    path: str | os.PathLike[str], *, threads: int | None = None, confine: bool = False
) -> _snell.Scene:
    """Read a scene or mesh file, or make a built-in scene.

    Parameters
    ----------
    path : str or PathLike
        A file of any format that Snell reads, or the name of a built-in scene. USD (``.usd``,
        ``.usda``, ``.usdc``, ``.usdz``) needs the package ``usd-core``: ``pip install
        'snell[usd]'``; `snell.usd.load` also chooses variants and a time.

    threads : int, optional
        Number of threads for the reading, except for USD, which has its own threads. Default: one
        per core.

    confine : bool, optional
        Refuse to open files outside of the folder of `path`. By default, the scene may name files
        anywhere.

    Returns
    -------
    Scene

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If the file is not a valid scene; the message gives the place and reason.
    ImportError
        If the file is USD and ``usd-core`` is missing.
    """
    name = os.fspath(path)
    if name.lower().endswith((".usd", ".usda", ".usdc", ".usdz")) and os.path.exists(name):
        from snell import usd

        scene: _snell.Scene = usd.load(name, confine=confine)
        return scene
    return _snell.load(path, threads=threads, confine=confine)
