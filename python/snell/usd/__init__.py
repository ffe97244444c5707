"""USD stages as scenes of Snell, by way of its text format.

Needs the official wheel ``usd-core`` (``pip install 'snell[usd]'``) and NumPy. As a program, ``python3 -m snell.usd IN OUT.snell`` writes the
scene of a stage; the command ``snell`` runs the modules of this package whenever it is given a ``.usd``, ``.usda``, ``.usdc`` or ``.usdz``, so
they use nothing else of Snell.

What is read: the composed stage (references, payloads, variants as they are chosen), instances and point instancers, meshes (polygons; those of
subdivision schemes with smooth normals), spheres, cubes, cylinders, cones, capsules and planes, curves as tubes, points as balls, cameras, the
lights of UsdLux, and materials: UsdPreviewSurface, and OpenPBR and standard surface as MaterialX networks. Units become metres, and the up axis
is that of the stage. Transforms that change over time are the scene's motion. What is left out is told.
"""

from __future__ import annotations

from typing import Any

__all__ = ["EXTENSIONS", "convert", "load"]

#: Endings of files that this module reads.
EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")


def load(path: Any, *, variants: dict[str, str] | None = None, time: float | None = None) -> Any:
    """The scene of a USD stage, as `snell.load` gives it for other files.

    Parameters
    ----------
    path : str or PathLike
        A ``.usd``, ``.usda``, ``.usdc`` or ``.usdz`` file.
    variants : dict, optional
        Variants to choose instead of those the file chooses: ``{"/Path/of/prim:set": "name"}``, or ``{"set": "name"}`` wherever there is
        such a set.
    time : float, optional
        Time code at which values that change are read; without it, the default values, or else those of the first sample.
    """
    import os
    import tempfile
    import warnings

    import snell
    from snell import _snell

    path = os.fspath(path)
    text, remarks = convert(path, variants=variants, time=time)
    for remark in remarks:
        warnings.warn(remark, snell.SceneWarning, stacklevel=2)
    with tempfile.TemporaryDirectory() as folder:
        bridge = os.path.join(folder, "stage.snell")
        with open(bridge, "w", encoding="utf-8") as file:
            file.write(text)
        return _snell.load(bridge)


def convert(path: str, *, variants: dict[str, str] | None = None, time: float | None = None) -> tuple[str, list[str]]:
    """The text of a ``.snell`` file for a stage, and remarks on what was left out."""
    try:
        import numpy  # noqa: F401
        from pxr import Usd
    except ImportError as error:
        raise ImportError("reading USD needs the packages usd-core and numpy: pip install 'snell[usd]', or pip install usd-core numpy") from error
    from ._context import Context
    from ._tree import document

    try:
        stage = Usd.Stage.Open(path)
    except Exception as error:
        # The first of the errors is the cause; what stands before the colon is where in the library.
        first = next((line.split(" : '", 1)[1] for line in str(error).splitlines() if " : '" in line), str(error))
        raise ValueError(f"{path}: not a USD stage that can be opened: {first.strip().rstrip(chr(39))}") from error
    _choose_variants(stage, variants or {})
    try:
        return document(Context(stage, time), path)
    except RecursionError as error:
        raise ValueError(f"{path}: prims lie too deep in one another") from error


def _choose_variants(stage: Any, variants: dict[str, str]) -> None:
    for key, name in variants.items():
        prim_path, _, set_name = key.rpartition(":")
        prims = [stage.GetPrimAtPath(prim_path)] if prim_path else list(stage.Traverse())
        found = False
        for prim in prims:
            if prim and set_name in prim.GetVariantSets().GetNames():
                found |= bool(prim.GetVariantSets().GetVariantSet(set_name).SetVariantSelection(name))
        if not found:
            raise ValueError(f"there is no variant set {set_name!r}" + (f" on {prim_path}" if prim_path else ""))
