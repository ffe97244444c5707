"""USD stages: networks of materials, tiles of pictures, and files of MaterialX."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_usd import document, floats, stage
from test_usd_surfaces import SHEET, slots

import snell


def picture(folder: Path, name: str, color: str = "255 0 0") -> None:
    (folder / name).write_text(f"P3 1 1 255 {color}")


def painted(inputs: str, nodes: str = "", mesh: str = "") -> str:
    """A sheet with a material: inputs of its surface, and further nodes."""
    return f"""
    def Mesh "sheet" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        {SHEET}
        {mesh}
        rel material:binding = </paint>
    }}
    def Material "paint" {{
        token outputs:surface.connect = </paint/surface.outputs:surface>
        def Shader "surface" {{
            uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface
        }}
        {nodes}
    }}
    """


def reader(name: str, varname: str, kind: str = "float2") -> str:
    return f"""
        def Shader "{name}" {{
            uniform token info:id = "UsdPrimvarReader_{kind}"
            string inputs:varname = "{varname}"
            {kind} outputs:result
        }}
    """


def texture(name: str, file: str, more: str = "") -> str:
    return f"""
        def Shader "{name}" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            {more}
            float3 outputs:rgb
            float outputs:a
        }}
    """


def test_tiles_of_pictures_are_slots_of_the_mesh(tmp_path: Path) -> None:
    picture(tmp_path, "wood.1001.ppm", "255 0 0")
    picture(tmp_path, "wood.1012.ppm", "0 255 0")
    path = stage(
        tmp_path,
        painted(
            "color3f inputs:diffuseColor.connect = </paint/wood.outputs:rgb>",
            texture("wood", "./wood.<UDIM>.ppm"),
            "texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), "
            "(1, 1), (2, 1), (2, 2), (1, 2)] (interpolation = 'faceVarying')",
        ),
    )
    form, remarks = document(path)
    assert remarks == []
    assert slots(form["meshes"][0]) == [1, 1, 2, 2]
    (surface,) = (s for node in form["nodes"] for s in node.get("surfaces", []))
    shown = [form["materials"][number] for number in surface["materials"]]
    images = [form["textures"][m["kind"]["base_color"]["texture"]] for m in shown]
    assert [image["image"] for image in images] == [0, 0, 1]
    assert images[2]["wrap"] == ["clamp", "clamp"]
    # The tile begins at (1, 1); v grows downwards.
    assert images[2]["uv_transform"] == [[1, 0, -1], [0, -1, 2]]
    snell.load(path)
    # What is on a tile that is missing is black.
    (tmp_path / "wood.1012.ppm").unlink()
    form, _ = document(path)
    last = form["materials"][surface["materials"][2]]["kind"]["base_color"]
    assert last == {"factor": [0, 0, 0], "texture": None, "spectrum": None}


def test_texture_coordinates_are_found_by_name(tmp_path: Path) -> None:
    picture(tmp_path, "a.ppm")
    picture(tmp_path, "b.ppm")
    coordinates = "float2[] primvars:{} = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)] ("
    coordinates += "interpolation = 'vertex')\n"
    path = stage(
        tmp_path,
        painted(
            "color3f inputs:diffuseColor.connect = </paint/a.outputs:rgb>\n"
            "color3f inputs:emissiveColor.connect = </paint/b.outputs:rgb>",
            texture("a", "./a.ppm", "float2 inputs:st.connect = </paint/one.outputs:result>")
            + texture("b", "./b.ppm", "float2 inputs:st.connect = </paint/two.outputs:result>")
            + reader("one", "mapA")
            + reader("two", "mapB"),
            coordinates.format("mapA") + coordinates.format("mapB"),
        ),
    )
    form, remarks = document(path)
    assert remarks == []
    assert [texture["uv_set"] for texture in form["textures"]] == [0, 1]
    assert len(floats(form["meshes"][0]["uvs"])) == len(floats(form["meshes"][0]["second_uvs"]))


@pytest.mark.parametrize(
    "node",
    [
        'uniform token info:id = "ND_texcoord_vector2"',
        'uniform token info:id = "ND_geompropvalue_vector2"\nstring inputs:geomprop = "st"',
    ],
)
def test_texture_coordinates_may_be_a_colour(tmp_path: Path, node: str) -> None:
    nodes = f"""
        def Shader "wide" {{
            uniform token info:id = "ND_convert_vector2_vector3"
            float2 inputs:in.connect = </paint/uv.outputs:out>
            float3 outputs:out
        }}
        def Shader "uv" {{
            {node}
            float2 outputs:out
        }}
    """
    color = "color3f inputs:diffuseColor.connect = </paint/wide.outputs:out>"
    corners = [(x / 2, y) for y in range(2) for x in range(3)]
    coordinates = f'texCoord2f[] primvars:st = {corners} (\ninterpolation = "vertex"\n)'
    path = stage(tmp_path, painted(color, nodes, coordinates))
    form, remarks = document(path)
    assert not remarks
    (pattern,) = form["textures"]
    assert form["materials"][0]["kind"]["base_color"]["texture"] == 0
    values = {key: value["factor"] for key, value in pattern.items() if key[0] == "v"}
    assert values == {"v00": [0, 0, 0], "v10": [1, 0, 0], "v01": [0, 1, 0], "v11": [1, 1, 0]}
    assert pattern["mapping"]["uv"]["uv_transform"] == [[1, 0, 0], [0, 1, 0]]


def test_opacity_and_colour_may_be_primvars(tmp_path: Path) -> None:
    inputs = (
        "color3f inputs:diffuseColor.connect = </paint/tint.outputs:result>\n"
        "float inputs:opacity.connect = </paint/fade.outputs:result>"
    )
    nodes = reader("tint", "tint", "float3") + reader("fade", "fade", "float")
    fade = "float[] primvars:fade = [0, 0.5, 1, 0, 0.5, 1] (interpolation = 'vertex')\n"
    path = stage(
        tmp_path, painted(inputs, nodes, fade + "color3f[] primvars:tint = [(0.25, 0.5, 0.75)]")
    )
    form, remarks = document(path)
    assert remarks == []
    (material,) = form["materials"]
    assert material["kind"]["base_color"]["factor"] == [0.25, 0.5, 0.75], "one value for the prim"
    assert material["alpha_mode"] == "blend"
    colors = floats(form["meshes"][0]["colors"]).reshape(-1, 4)
    assert colors[:, 3].tolist() == [0, 0.5, 1, 0, 0.5, 1]
    assert np.all(colors[:, :3] == 1)


def test_the_scale_and_bias_of_pictures_count(tmp_path: Path) -> None:
    picture(tmp_path, "a.ppm")
    more = "float4 inputs:scale = (1, -1, 1, 1)\nfloat4 inputs:bias = (0, 1, 0.5, 0)"
    path = stage(
        tmp_path,
        painted(
            "color3f inputs:diffuseColor.connect = </paint/a.outputs:rgb>\n"
            "normal3f inputs:normal.connect = </paint/n.outputs:rgb>",
            texture("a", "./a.ppm", more)
            + texture(
                "n",
                "./a.ppm",
                "float4 inputs:scale = (2, -2, 2, 1)\nfloat4 inputs:bias = (-1, 1, -1, 0)",
            ),
        ),
    )
    form, remarks = document(path)
    assert remarks == []
    color, normal = (form["textures"][number] for number in (1, 3))
    assert color["pattern"] == normal["pattern"] == "mix"
    assert color["first"]["factor"] == [0, 1, 0.5]
    assert color["second"]["factor"] == [1, 0, 1.5]
    # Green is turned over.
    assert normal["first"]["factor"] == [0, 1, 0]
    assert normal["second"]["factor"] == [1, 0, 1]
    snell.load(path)


def node(name: str, kind: str, inputs: str, output: str = "color3f") -> str:
    return f"""
        def Shader "{name}" {{
            uniform token info:id = "{kind}"
            {inputs}
            {output} outputs:out
        }}
    """


@pytest.mark.parametrize(
    ("kind", "inputs", "color"),
    [
        (
            "add_color3",
            "color3f inputs:in1 = (0.1, 0.2, 0.3)\ncolor3f inputs:in2 = (0.1, 0, 0)",
            0.2,
        ),
        ("multiply_color3FA", "color3f inputs:in1 = (0.5, 1, 1)\nfloat inputs:in2 = 0.5", 0.25),
        ("mix_color3", "color3f inputs:fg = (1, 1, 1)\nfloat inputs:mix = 0.125", 0.125),
        (
            "mix_color4",
            "color4f inputs:fg = (1, 1, 1, 1)\ncolor3f inputs:bg = (0, 0, 0)\n"
            "float inputs:mix = 0.5",
            0.5,
        ),
        (
            "swizzle_color3_color3",
            'color3f inputs:in = (1, 1, 0.5)\nstring inputs:channels = "bgr"',
            0.5,
        ),
        ("convert_vector3_color3", "color3f inputs:in = (0.5, 1, 1)", 0.5),
        ("invert_color3", "color3f inputs:in = (0.75, 1, 1)", 0.25),
        ("power_color3", "color3f inputs:in1 = (0.5, 1, 1)\nfloat inputs:in2 = 2", 0.25),
        ("clamp_color3", "color3f inputs:in = (3, 1, 1)", 1),
        ("contrast_color3", "color3f inputs:in = (0.6, 1, 1)\nfloat inputs:amount = 2", 0.7),
        ("remap_color3", "color3f inputs:in = (0.5, 1, 1)\nfloat inputs:outhigh = 0.5", 0.25),
        ("divide_color3", "color3f inputs:in1 = (0.5, 1, 1)\nfloat inputs:in2 = 2", 0.25),
        (
            "combine3_color3",
            "float inputs:in1 = 0.5\nfloat inputs:in2 = 1\nfloat inputs:in3 = 1",
            0.5,
        ),
    ],
)
def test_nodes_compute_with_constants(tmp_path: Path, kind: str, inputs: str, color: float) -> None:
    connected = "color3f inputs:diffuseColor.connect = </paint/node.outputs:out>"
    path = stage(tmp_path, painted(connected, node("node", f"ND_{kind}", inputs)))
    form, remarks = document(path)
    assert remarks == []
    assert form["materials"][0]["kind"]["base_color"]["factor"][0] == pytest.approx(color)


@pytest.mark.parametrize("kind", ["add", "subtract", "multiply", "mix", "invert", "clamp", "power"])
def test_nodes_compute_with_pictures(tmp_path: Path, kind: str) -> None:
    picture(tmp_path, "a.ppm", "128 255 0")
    picture(tmp_path, "b.ppm", "64 0 255")
    names = {"mix": ("fg", "bg"), "invert": ("in",), "clamp": ("in",), "power": ("in1",)}
    sources = ["</paint/a.outputs:rgb>", "</paint/b.outputs:rgb>"]
    inputs = "\n".join(
        f"color3f inputs:{name}.connect = {source}"
        for name, source in zip(names.get(kind, ("in1", "in2")), sources, strict=False)
    )
    inputs += {"mix": "\nfloat inputs:mix = 0.25", "power": "\nfloat inputs:in2 = 2"}.get(kind, "")
    path = stage(
        tmp_path,
        painted(
            "color3f inputs:diffuseColor.connect = </paint/node.outputs:out>",
            texture("a", "./a.ppm", 'token inputs:sourceColorSpace = "raw"')
            + texture("b", "./b.ppm", 'token inputs:sourceColorSpace = "raw"')
            + node("node", f"ND_{kind}_color3", inputs),
        ),
    )
    form, remarks = document(path)
    assert remarks == []
    a, b = np.array([128, 255, 0]) / 255, np.array([64, 0, 255]) / 255
    expected = {
        "add": a + b,
        "subtract": a - b,
        "multiply": a * b,
        "mix": 0.25 * a + 0.75 * b,
        "invert": 1 - a,
        "clamp": a,
        "power": a**2,
    }[kind]
    shown = form["materials"][0]["kind"]["base_color"]
    assert value(form, shown, [a, b]) == pytest.approx(expected)
    snell.load(path)


def value(form: dict[str, Any], color: dict[str, Any], pixels: list[Any]) -> np.ndarray:
    """A colour with pictures of one pixel."""
    factor = np.array(color["factor"])
    if color["texture"] is None:
        return factor
    texture = form["textures"][color["texture"]]
    get = lambda name: value(form, texture[name], pixels)  # noqa: E731
    kind = texture.get("pattern")
    if kind == "mix":
        amount = get("amount")
        return factor * (get("first") * (1 - amount) + get("second") * amount)
    if kind == "scale":
        return factor * get("texture") * get("scale")
    if kind == "power":
        return factor * get("base") ** texture["exponent"]
    if kind == "ramp":
        return factor * np.clip(get("amount"), 0, 1)
    return factor * pixels[texture["image"]]


PAINT = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <xi:include href="nodes.mtlx" />
  <nodegraph name="graph" fileprefix="tex/">
    <tiledimage name="wood" type="color3">
      <input name="file" type="filename" value="wood.ppm" colorspace="srgb_texture" />
      <input name="uvtiling" type="vector2" value="4, 2" />
    </tiledimage>
    <half name="dim" type="float">
      <input name="of" type="float" value="0.5" />
    </half>
    <output name="color" type="color3" nodename="wood" />
    <output name="rough" type="float" nodename="dim" />
  </nodegraph>
  <standard_surface name="shader" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="graph" output="color" />
    <input name="specular_roughness" type="float" nodegraph="graph" output="rough" />
    <input name="coat_color" type="color3" value="0.5, 0.5, 0.5" colorspace="srgb_texture" />
  </standard_surface>
  <surfacematerial name="Paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="shader" />
  </surfacematerial>
</materialx>
"""
NODES = """<materialx version="1.38">
  <nodedef name="ND_half" node="half">
    <input name="of" type="float" value="1" />
    <output name="out" type="float" />
  </nodedef>
  <nodegraph name="NG_half" nodedef="ND_half">
    <multiply name="times" type="float">
      <input name="in1" type="float" interfacename="of" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <output name="out" type="float" nodename="times" />
  </nodegraph>
</materialx>
"""


def paints(folder: Path) -> str:
    """A stage whose material is in a file of MaterialX."""
    (folder / "tex").mkdir()
    picture(folder / "tex", "wood.ppm")
    (folder / "paint.mtlx").write_text(PAINT)
    (folder / "nodes.mtlx").write_text(NODES)
    text = f"""
    def Scope "paints" (references = @./paint.mtlx@</MaterialX/Materials>) {{ }}
    def Mesh "sheet" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        {SHEET}
        rel material:binding = </paints/Paint>
    }}
    """
    return stage(folder, text)


@pytest.mark.parametrize("confine", [False, True])
def test_files_of_materialx_are_read_without_the_plugin(tmp_path: Path, confine: bool) -> None:
    form, remarks = document(paints(tmp_path), confine=confine)
    assert remarks == []
    (material,), (texture,) = form["materials"], form["textures"]
    surface = material["kind"]
    assert surface["specular_roughness"]["factor"] == 0.25, "a node of the file's own"
    assert surface["coat_color"]["factor"] == pytest.approx([0.2140411] * 3)
    assert texture["encoding"] == "srgb"
    assert texture["uv_transform"] == [[4, 0, 0], [0, -2, 1]]


def test_files_of_materialx_cannot_lead_elsewhere_or_grow(tmp_path: Path) -> None:
    inner = tmp_path / "scene"
    inner.mkdir()
    path = paints(inner)
    (tmp_path / "nodes.mtlx").write_text(NODES)
    (inner / "paint.mtlx").write_text(PAINT.replace('"nodes.mtlx"', '"../nodes.mtlx"'))
    assert document(path)[1] == []
    with pytest.raises(ValueError, match="lies outside of the scene's folder"):
        document(path, confine=True)
    (inner / "paint.mtlx").write_text('<!DOCTYPE x [<!ENTITY a "b">]><materialx />')
    assert (
        document(path)[1][0] == "paint.mtlx is left out: it declares entities, which are not read"
    )
    (inner / "paint.mtlx").write_text("<materialx")
    assert document(path)[1][0].startswith("paint.mtlx is left out: it is not XML: ")


def test_a_material_without_a_known_surface_shows_the_display_colour(tmp_path: Path) -> None:
    color = "color3f[] primvars:displayColor = [(0, 0.5, 0)]"
    text = painted("", "", color).replace("UsdPreviewSurface", "SomeSurface")
    form, remarks = document(stage(tmp_path, text))
    assert remarks == ["/paint: no surface of a kind that is known (SomeSurface); it is left out"]
    assert form["materials"][0]["kind"]["base_color"]["factor"] == [0, 0.5, 0]


def test_inputs_and_pictures_that_are_left_out_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.tex").write_bytes(b"\xce\xfa\x03\x00")
    path = stage(
        tmp_path,
        painted(
            "color3f inputs:diffuseColor.connect = </paint/a.outputs:rgb>\n"
            "float inputs:glitter = 1",
            texture("a", "./a.tex"),
        ),
    )
    _, remarks = document(path)
    assert "which is no picture that Snell knows; a magenta checkerboard" in remarks[0]
    assert remarks[1] == "/paint/surface: left out: glitter"


def test_materials_for_final_pictures_count_before_those_for_previews(tmp_path: Path) -> None:
    def paint(name: str, kind: str, red: float) -> str:
        text = painted(f"color3f inputs:diffuseColor = ({red}, 0, 0)").partition("def Material")[2]
        return "def Material" + text.replace("paint", name).replace("UsdPreviewSurface", kind)

    sheet = painted("").partition("def Material")[0]
    bindings = "rel material:binding:full = </final>\nrel material:binding:preview = </rough>\n"
    sheet = sheet.replace("rel material:binding = </paint>", bindings)
    for kind, red in (("UsdPreviewSurface", 0.25), ("SomeSurface", 0.75)):
        text = sheet + paint("final", kind, 0.25) + paint("rough", "UsdPreviewSurface", 0.75)
        form, _ = document(stage(tmp_path, text))
        assert form["materials"][0]["kind"]["base_color"]["factor"][0] == red


def test_the_specular_workflow_keeps_its_colour(tmp_path: Path) -> None:
    inputs = (
        "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:diffuseColor = (0.5, 0.5, 0.5)\n"
        "color3f inputs:specularColor = (0.16, 0.04, 0)"
    )
    form, remarks = document(stage(tmp_path, painted(inputs)))
    assert remarks == []
    surface = form["materials"][0]["kind"]
    assert surface["specular_color"]["factor"] == pytest.approx([1, 0.25, 0])
    # The reflectance of this index at normal incidence is 0.16.
    assert surface["specular_ior"]["factor"] == pytest.approx(7 / 3)


def test_single_channels_are_chosen(tmp_path: Path) -> None:
    picture(tmp_path, "a.ppm")
    connections = "\n".join(
        f"float inputs:{name}.connect = </paint/{node}.outputs:{output}>"
        for name, node, output in (
            ("metallic", "apart", "outg"),
            ("roughness", "third", "out"),
            ("clearcoat", "blue", "out"),
            ("opacity", "a", "b"),
        )
    )
    color = "color3f inputs:in = (0.25, 0.5, 0.75)"
    from_picture = "color3f inputs:in.connect = </paint/a.outputs:rgb>"
    path = stage(
        tmp_path,
        painted(
            connections,
            texture("a", "./a.ppm", "float outputs:b")
            + node("apart", "ND_separate3_color3", color + "\nfloat outputs:outg")
            + node("third", "ND_extract_color3", color + "\nint inputs:index = 2", "float")
            + node(
                "blue",
                "ND_swizzle_color3_float",
                from_picture + '\nstring inputs:channels = "b"',
                "float",
            ),
        ),
    )
    form, remarks = document(path)
    assert remarks == []
    (material,) = form["materials"]
    surface = material["kind"]
    assert surface["base_metalness"]["factor"] == 0.5
    assert surface["specular_roughness"]["factor"] == 0.75
    assert surface["coat_weight"]["texture"][1] == 2
    assert material["alpha"]["texture"][1] == 2


def test_names_with_backslashes_are_found(tmp_path: Path) -> None:
    (tmp_path / "tex").mkdir()
    picture(tmp_path / "tex", "a.ppm")
    connected = "color3f inputs:diffuseColor.connect = </paint/a.outputs:rgb>"
    path = stage(tmp_path, painted(connected, texture("a", ".\\tex\\a.ppm")))
    assert document(path, confine=True)[1] == []


def test_triangles_over_several_tiles_are_cut(tmp_path: Path) -> None:
    picture(tmp_path, "wood.1001.ppm", "255 0 0")
    picture(tmp_path, "wood.1002.ppm", "0 255 0")
    path = stage(
        tmp_path,
        painted(
            "color3f inputs:diffuseColor.connect = </paint/wood.outputs:rgb>",
            texture("wood", "./wood.<UDIM>.ppm"),
            "texCoord2f[] primvars:st = [(0, 0), (1.5, 0), (1.5, 1), (0, 1), "
            "(0, 0), (0.5, 0), (0.5, 1), (0, 1)] (interpolation = 'faceVarying')",
        ),
    )
    form, remarks = document(path)
    assert remarks == []
    (mesh,) = form["meshes"]
    uvs, found = floats(mesh["uvs"]).reshape(-1, 2), np.array(slots(mesh))
    indices = np.frombuffer(base64.b64decode(mesh["indices"]), dtype="<u4")
    triangles = indices.reshape(-1, 3)
    sides = uvs[triangles][:, :, 0]
    assert (sides[found == 1] <= 1 + 1e-6).all() and (sides[found == 2] >= 1 - 1e-6).all()
    # The area in texture coordinates is as before: 1.5 and 0.5.
    a, b, c = np.moveaxis(uvs[triangles], 1, 0)
    areas = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))) / 2
    assert areas[found == 1].sum() == pytest.approx(1.5)
    assert areas[found == 2].sum() == pytest.approx(0.5)
    # The positions are cut where the coordinates are.
    points = floats(mesh["positions"]).reshape(-1, 3)
    assert len(points) == len(uvs) and np.isfinite(points).all()
