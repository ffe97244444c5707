"""Converts USD stages to scenes of Snell, by way of Snell's text format.

This package needs the official wheel ``usd-core`` (``pip install 'snell[usd]'``) and NumPy. As a
program, ``python3 -m snell.usd IN OUT.snell`` writes the scene of a stage. The command ``snell``
runs the modules of this package whenever it is given a ``.usd``, ``.usda``, ``.usdc`` or ``.usdz``,
so they use nothing else of Snell.

What is read: the composed stage (references, payloads, variants as they are chosen), instances and
point instancers, meshes (polygons, and the subdivision surfaces of Catmull and Clark and of Loop),
tetrahedra, patches, spheres, cubes, cylinders, cones, capsules and planes, curves, points
as balls, cameras, the lights of UsdLux, and materials: UsdPreviewSurface, and OpenPBR and standard
surface as MaterialX networks, also from files of MaterialX. Units become metres, and the up axis is
that of the stage. Transforms that change over time are the scene's motion. A remark names
everything that is left out.
"""

from __future__ import annotations

from typing import Any

__all__ = ["EXTENSIONS", "convert", "load"]

#: Extensions of the files that this module reads.
EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")


def load(
    path: Any,
    *,
    variants: dict[str, str] | None = None,
    time: float | None = None,
    confine: bool = False,
) -> Any:
    """Reads the scene of a USD stage, as `snell.load` does for other files.

    Parameters
    ----------
    path : str or PathLike
        A ``.usd``, ``.usda``, ``.usdc`` or ``.usdz`` file.
    variants : dict, optional
        Variants to choose instead of those the file chooses: ``{"/Path/of/prim:set": "name"}``, or
        ``{"set": "name"}`` wherever there is such a set.
    time : float, optional
        Time code at which animated values are read. Default: the stage's default values, or else
        the values of the first time sample.
    confine : bool, optional
        Refuses to open files outside of the stage's folder.
    """
    import os
    import warnings

    import snell
    from snell import _snell

    path = os.fspath(path)
    try:
        text, remarks = convert(path, variants=variants, time=time, confine=confine)
    except ValueError as error:
        raise ValueError(
            str(error).replace("leave out --confine", "leave out confine=True")
        ) from error
    for remark in remarks:
        warnings.warn(remark, snell.SceneWarning, stacklevel=2)
    return _snell._load_stage(path, text)


def convert(
    path: str,
    *,
    variants: dict[str, str] | None = None,
    time: float | None = None,
    confine: bool = False,
    name: str | None = None,
    most_layers: int = 10_000,
) -> tuple[str, list[str]]:
    """The text of a ``.snell`` file for a stage, and remarks on what was left out. `name` is the
    name of the stage's file in messages.
    """
    try:
        import numpy  # noqa: F401
        from pxr import Tf, Usd, UsdUtils
    except ImportError as error:
        raise ImportError(
            "reading USD needs the packages usd-core and numpy: pip install 'snell[usd]', or pip "
            "install usd-core numpy"
        ) from error
    from ._context import Context
    from ._files import Files, Mended, StageError, cause
    from ._tree import document

    name = path if name is None else name
    # USD's own reports become remarks, instead of lines on standard error.
    diagnostics = UsdUtils.CoalescingDiagnosticDelegate()
    mended = Mended()
    stage = context = layers = None
    try:
        files = Files(path, confine=confine, most=most_layers)
        # The list keeps the checked layers open, so that the stage uses them.
        layers = files.layers(mended)
        mended.rates(layers)
        stage = Usd.Stage.Open(path)
        _choose_variants(stage, variants or {})
        context = Context(stage, time, files)
        for remark in mended.remarks:
            context.remark(remark)
        text = document(context, name)
        files.check_opened(stage)
        for remark in dict.fromkeys(files.found):
            context.remark(remark)
        found = context.remarks
    except Tf.ErrorException as error:
        raise ValueError(
            f"{name}: not a USD stage that can be opened: {cause(error)}; check the file"
        ) from error
    except StageError as error:
        raise ValueError(f"{name}: {error}") from error
    except RecursionError as error:
        raise ValueError(f"{name}: prims lie too deep in one another; flatten the stage") from error
    finally:
        reported = [_reported(said.commentary) for said in diagnostics.TakeUncoalescedDiagnostics()]
        # Without the stage, the changes are undone at no cost, and without reports.
        stage = context = None
        mended.undo()
        del layers
        diagnostics.TakeUncoalescedDiagnostics()
    for remark in reported:
        found[remark] = found.get(remark, 0) + 1
    remarks = [
        remark if count == 1 else f"{remark} ({count} times)" for remark, count in found.items()
    ]
    return text, remarks


def _reported(text: str) -> str:
    """A message of USD, without the memory addresses in it."""
    import re

    return " ".join(
        re.sub(
            r"\((?:instantiating|recomposing) stage on stage .*?\)", "", text, flags=re.DOTALL
        ).split()
    )


def _choose_variants(stage: Any, variants: dict[str, str]) -> None:
    for key, name in variants.items():
        prim_path, _, set_name = key.rpartition(":")
        prims = [stage.GetPrimAtPath(prim_path)] if prim_path else list(stage.Traverse())
        found = False
        for prim in prims:
            if prim and set_name in prim.GetVariantSets().GetNames():
                found |= bool(
                    prim.GetVariantSets().GetVariantSet(set_name).SetVariantSelection(name)
                )
        if not found:
            raise ValueError(
                f"there is no variant set {set_name!r}" + (f" on {prim_path}" if prim_path else "")
            )
