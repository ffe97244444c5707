"""Names of files in USD stages that are not those of the files here."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import snell
import snell.usd

#: A red picture of one pixel.
PICTURE = b"P6 1 1 255\n\xff\x00\x00"

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    subLayers = [@%s@]
)
def Xform "World"
{
    def "Part" (references = @%s@)
    {
    }
    def Material "paint"
    {
        token outputs:surface.connect = </World/paint/surface.outputs:surface>
        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/paint/picture.outputs:rgb>
            token outputs:surface
        }
        def Shader "picture"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @%s@
            float3 outputs:rgb
        }
    }
    def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/paint>
    }
}
"""

LAYER = '#usda 1.0\n(\n    defaultPrim = "Box"\n)\ndef Cube "Box"\n{\n}\n'


def stage(folder: Path, *names: str) -> str:
    pytest.importorskip("pxr")
    scene = folder / "scene"
    (scene / "Maps").mkdir(parents=True)
    (scene / "Maps" / "wood.ppm").write_bytes(PICTURE)
    (scene / "near.ppm").write_bytes(PICTURE)
    (folder / "far.ppm").write_bytes(PICTURE)
    (scene / "Parts").mkdir()
    (scene / "Parts" / "Box.usda").write_text(LAYER)
    (scene / "base.usda").write_text(LAYER.replace("Box", "Base"))
    path = scene / "stage.usda"
    path.write_text(STAGE % names)
    return str(path)


@pytest.mark.parametrize(
    "name",
    [
        "maps/Wood.PPM",
        ".\\Maps\\wood.ppm",
        "Maps/wood.ppm?v=3",
        "file:///C:/work/near.ppm",
        "/home/me/near.ppm",
        "D:\\work\\NEAR.ppm",
        "Maps/w%6Fod.ppm",
        "../FAR.ppm",
    ],
)
def test_names_lead_to_the_files_that_they_mean(tmp_path: Path, name: str) -> None:
    path = stage(tmp_path, "C:\\work\\BASE.usda", "parts\\box.usda", name)
    text, remarks = snell.usd.convert(path)
    form = json.loads(text)
    assert len(form["images"]) == 1 and "encoded" in form["images"][0]
    shapes = [s["shape"]["shape"] for n in form["nodes"] for s in n.get("surfaces", [])]
    assert sorted(shapes) == ["box", "box", "sphere"]
    assert len(remarks) == 3 - (name == ".\\Maps\\wood.ppm") and all(
        "was found as" in remark for remark in remarks
    )
    # Nothing is left changed for the next reading.
    assert snell.usd.convert(path)[1] == remarks


def test_a_confined_stage_finds_nothing_outside_of_its_folder(tmp_path: Path) -> None:
    path = stage(tmp_path, "BASE.usda", "parts/box.usda", "Maps/WOOD.ppm")
    assert "encoded" in json.loads(snell.usd.convert(path, confine=True)[0])["images"][0]
    text = Path(path).read_text()
    Path(path).write_text(text.replace("Maps/WOOD.ppm", "../FAR.ppm"))
    form = json.loads(snell.usd.convert(path, confine=False)[0])
    assert "encoded" in form["images"][0]
    with pytest.raises(ValueError, match="outside of the scene's folder"):
        snell.usd.convert(path, confine=True)
