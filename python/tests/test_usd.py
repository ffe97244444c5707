"""USD stages as scenes: places, materials, lights, cameras; each stage is made here, as text."""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import snell
import snell.usd

HEADER = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
"""

MESH = """
    def Mesh "sheet" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "none"
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
        rel material:binding = </World/paint>
    }
    def Material "paint"
    {
        token outputs:surface.connect = </World/paint/surface.outputs:surface>
        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.5, 0.25, 0.125)
            float inputs:roughness = 0.75
            token outputs:surface
        }
    }
"""


def stage(folder: Path, text: str, name: str = "stage.usda") -> str:
    pytest.importorskip("pxr")
    path = folder / name
    # A statement must end with a line, so closing braces get lines of their own.
    path.write_text(HEADER + text.replace(" }", "\n}"))
    return str(path)


def document(path: str, **options: Any) -> tuple[dict[str, Any], list[str]]:
    text, remarks = snell.usd.convert(path, **options)
    return json.loads(text), remarks


def floats(numbers: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(numbers), dtype="<f4")


def test_a_mesh_keeps_its_place_its_coordinates_and_its_material(tmp_path: Path) -> None:
    path = stage(
        tmp_path,
        'def Xform "World"\n{\n    double3 xformOp:translate = (0, 0, 3)\n    uniform token[] '
        'xformOpOrder = ["xformOp:translate"]\n' + MESH + "}\n",
    )
    scene = snell.load(path)
    hits = scene.cast_rays(np.array([[1.5, 0.5, 0, 0, 0, 1]], dtype=np.float32))
    assert hits.t_hit == pytest.approx(3)
    form, remarks = document(path)
    assert remarks == []
    (material,) = form["materials"]
    assert material["kind"]["base_color"]["factor"] == [0.5, 0.25, 0.125]
    assert material["kind"]["specular_roughness"]["factor"] == 0.75
    assert len(floats(form["meshes"][0]["uvs"])) == 8


def test_instances_share_what_they_show_and_variants_can_be_chosen(tmp_path: Path) -> None:
    text = """
def Xform "World" (variants = { string size = "small" }; prepend variantSets = "size")
{
    def Xform "a" (instanceable = true; prepend references = </Ball>) {
        double3 xformOp:translate = (2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "b" (instanceable = true; prepend references = </Ball>) {}
    variantSet "size" = {
        "small" { def Sphere "extra" { double radius = 0.25 } }
        "large" { def Sphere "extra" { double radius = 4 } }
    }
}
class Xform "Ball" { def Sphere "ball" { double radius = 0.5 } }
"""
    path = stage(tmp_path, text)
    form, _ = document(path)
    radii = sorted(s["shape"]["radius"] for n in form["nodes"] for s in n.get("surfaces", []))
    assert radii == [0.25, 0.5], "the ball of both instances is there once"
    form, _ = document(path, variants={"size": "large"})
    assert 4 in [s["shape"]["radius"] for n in form["nodes"] for s in n.get("surfaces", [])]
    with pytest.raises(ValueError, match="no variant set"):
        document(path, variants={"colour": "red"})


def test_units_become_metres_and_the_up_axis_is_told(tmp_path: Path) -> None:
    text = 'def Xform "World" { def Cube "c" { double size = 200 } }'
    pytest.importorskip("pxr")
    path = tmp_path / "centimetres.usda"
    path.write_text(
        '#usda 1.0\n( metersPerUnit = 0.01; upAxis = "Z" )\n' + text.replace(" }", "\n}")
    )
    form, _ = document(str(path))
    assert form["settings"]["up"] == [0, 0, 1]
    hits = snell.load(path).cast_rays(np.array([[0, 0, -5, 0, 0, 1]], dtype=np.float32))
    assert hits.t_hit == pytest.approx(4)


def test_lights_have_the_brightness_that_the_schema_says(tmp_path: Path) -> None:
    text = """
def Xform "World"
{
    def DistantLight "sun" { float inputs:intensity = 2; bool inputs:normalize = 1 }
    def RectLight "panel"
    {
        float inputs:width = 2; float inputs:height = 3
        float inputs:intensity = 12; bool inputs:normalize = 1
    }
    def SphereLight "bulb"
    {
        float inputs:radius = 0.5; float inputs:intensity = 3; float inputs:exposure = 1
    }
    def DomeLight "sky" { color3f inputs:color = (0.1, 0.2, 0.3); float inputs:intensity = 2 }
}
"""
    form, _ = document(stage(tmp_path, text))
    (sun,) = form["lights"]
    assert sun["irradiance"] == [2, 2, 2] and sun["direction"] == [0, 0, -1]
    radiance = {m["name"]: m["emission"]["factor"] for m in form["materials"]}
    assert radiance == {"panel": [2, 2, 2], "bulb": [6, 6, 6]}
    assert form["environment"]["constant"] == pytest.approx([0.2, 0.4, 0.6])


def test_instancers_of_instancers_are_made_once(tmp_path: Path) -> None:
    """Two instancers on each of 30 levels show both of the next level: 2^31 balls in all."""
    depth = 30
    levels = [
        f"""
    def PointInstancer "{name}{i}" {{
        rel prototypes = [</World/P/A{i + 1}>, </World/P/B{i + 1}>]
        int[] protoIndices = [0, 1]
        point3f[] positions = [({x}, 0, 0), (0, {x}, 0)] }}
"""
        for i, x in ((i, 2.0**i) for i in range(depth))
        for name in "AB"
    ]
    text = f"""
def Xform "World" {{
    class "P" {{
        {"".join(levels)}
        def Sphere "A{depth}" {{ double radius = 0.2 }}
        def Sphere "B{depth}" {{ double radius = 0.2 }} }}
    def PointInstancer "top" {{
        rel prototypes = </World/P/A0>
        int[] protoIndices = [0]
        point3f[] positions = [(0, 0, 0)] }} }}
"""
    form, remarks = document(stage(tmp_path, text))
    assert not remarks
    assert len(form["nodes"]) < 8 * depth


@pytest.mark.parametrize(("emission", "is_lit"), [(0.5, True), (50.0, False)])
def test_weak_emission_does_not_put_the_sky_out(
    tmp_path: Path, emission: float, is_lit: bool
) -> None:
    text = f"""
def Sphere "display" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </World/glow>
}}
def Xform "World" {{
    def Sphere "beside" {{ double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"] }}
    def Material "glow" {{
        token outputs:surface.connect = </World/glow/surface.outputs:surface>
        def Shader "surface" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = ({emission}, {emission}, {emission})
            token outputs:surface }} }} }}
"""
    scene = snell.load(stage(tmp_path, text))
    assert (scene.environment is not None) == is_lit


def test_lights_of_older_versions_of_usd_have_names_without_a_prefix(tmp_path: Path) -> None:
    text = """
def RectLight "panel"
{
    float width = 2; float height = 3; color3f color = (1, 0.5, 0.25)
    float intensity = 12; bool normalize = 1
}
def DistantLight "sun" { float intensity = 2; bool normalize = 1 }
"""
    form, remarks = document(stage(tmp_path, text))
    assert not remarks
    assert form["lights"][0]["irradiance"] == [2, 2, 2]
    (panel,) = form["materials"]
    assert panel["emission"]["factor"] == [2, 1, 0.5]


@pytest.mark.parametrize("normalize", ["", "; bool inputs:normalize = 1"])
def test_lights_of_blender_have_its_power(tmp_path: Path, normalize: str) -> None:
    """A lamp of 1000 W, a panel of 30 W and a sun of 3 W/m², as Blender 3 and 4 write them."""
    pytest.importorskip("pxr")
    lamp, panel, sun = (1000 / np.pi, 30 / np.pi, 3 / 4) if normalize else (10, 0.3, 3)
    path = tmp_path / "a.usda"
    path.write_text(
        f"""#usda 1.0
( doc = "Blender v3.6.0"; metersPerUnit = 1; upAxis = "Z" )
def SphereLight "lamp"
{{
    float inputs:radius = 0.1; bool treatAsPoint = 1; float inputs:intensity = {lamp}{normalize}
}}
def RectLight "panel"
{{
    float inputs:width = 2; float inputs:height = 3; float inputs:intensity = {panel}{normalize}
}}
def DistantLight "sun"
{{
    float inputs:intensity = {sun}{normalize}
}}
"""
    )
    form, remarks = document(str(path))
    point, distant = form["lights"]
    assert point["intensity"] == pytest.approx([1000 / (4 * np.pi)] * 3)
    assert distant["irradiance"] == pytest.approx([3] * 3)
    (panel,) = form["materials"]
    assert panel["emission"]["factor"] == pytest.approx([30 / (np.pi * 6)] * 3)
    assert any("a sun of Blender" in remark for remark in remarks)
    assert any("taken as 100 W" in remark for remark in remarks) == (not normalize)


def test_materialx_surfaces_are_read(tmp_path: Path) -> None:
    text = """
def Xform "World"
{
    def Sphere "s" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/m>
    }
    def Material "m"
    {
        token outputs:mtlx:surface.connect = </World/m/surface.outputs:out>
        def Shader "surface"
        {
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            float inputs:base_metalness = 1
            color3f inputs:base_color.connect = </World/m/half.outputs:out>
            token outputs:out
        }
        def Shader "half"
        {
            uniform token info:id = "ND_multiply_color3"
            color3f inputs:in1 = (0.5, 1, 0.25)
            color3f inputs:in2 = (0.5, 0.5, 0.5)
            color3f outputs:out
        }
    }
}
"""
    form, remarks = document(stage(tmp_path, text))
    kind = form["materials"][0]["kind"]
    assert kind["base_metalness"]["factor"] == 1 and kind["base_color"]["factor"] == [
        0.25,
        0.5,
        0.125,
    ]
    assert remarks == []


def test_cameras_look_where_the_stage_says(tmp_path: Path) -> None:
    text = """
def Camera "World"
{
    float focalLength = 50
    float verticalAperture = 20
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    form, _ = document(stage(tmp_path, text))
    (camera,) = form["cameras"]
    assert (
        camera["eye"] == [1, 2, 3] and camera["towards"] == [0, 0, -1] and camera["up"] == [0, 1, 0]
    )
    assert camera["projection"]["tan_half_fov"] == [None, 0.2]


def test_concave_polygons_holes_and_left_handed_faces_become_the_right_triangles(
    tmp_path: Path,
) -> None:
    text = """
def Xform "World"
{
    def Mesh "arrow"
    {
        int[] faceVertexCounts = [5, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 0, 1, 2]
        int[] holeIndices = [1]
        uniform token orientation = "leftHanded"
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0)]
        uniform token subdivisionScheme = "none"
    }
}
"""
    path = stage(tmp_path, text)
    scene = snell.load(path)
    down = lambda x, y: [x, y, 5, 0, 0, -1]  # noqa: E731
    hits = scene.cast_rays(
        np.array([down(0.2, 1.0), down(1.8, 1.0), down(1.0, 1.2), down(1.0, 0.2)], dtype=np.float32)
    )
    assert np.isfinite(hits.t_hit).tolist() == [True, True, False, True]
    form, _ = document(path)
    triangles = np.frombuffer(base64.b64decode(form["meshes"][0]["indices"]), dtype="<u4").reshape(
        -1, 3
    )
    points = floats(form["meshes"][0]["positions"]).reshape(-1, 3)
    areas = [np.cross(points[b] - points[a], points[c] - points[a])[2] / 2 for a, b, c in triangles]
    assert max(areas) < 0 and sum(areas) == pytest.approx(-2.5)


def test_what_is_no_stage_is_an_error_and_what_is_left_out_is_told(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    broken = tmp_path / "broken.usda"
    broken.write_text("this is no stage")
    with pytest.raises(ValueError, match=r"broken\.usda"):
        snell.load(broken)
    path = stage(tmp_path, 'def Xform "World" { def Mesh "m" { point3f[] points = [(0, 0, 0)] } }')
    with pytest.warns(snell.SceneWarning, match="left out"):
        snell.load(path)


def test_colours_of_points_of_vertices_and_of_curves_are_kept(tmp_path: Path) -> None:
    text = """
def Xform "World"
{
    def Points "dust"
    {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
        float[] widths = [0.5, 0.5, 1]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1), (1, 0, 0)] (
            interpolation = "vertex"
        )
    }
    def BasisCurves "hair"
    {
        uniform token type = "linear"
        int[] curveVertexCounts = [2, 3]
        point3f[] points = [(0, 0, 0), (0, 1, 0), (3, 0, 0), (3, 1, 0), (3, 2, 0)]
        float[] widths = [0.2, 0.4] (interpolation = "uniform")
        color3f[] primvars:displayColor = [(0, 1, 0), (0.5, 0.5, 0.5)] (interpolation = "uniform")
    }
    def Mesh "sheet" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0)]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:tint = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (interpolation = "vertex")
        rel material:binding = </World/paint>
    }
    def Material "paint"
    {
        token outputs:surface.connect = </World/paint/surface.outputs:surface>
        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/paint/read.outputs:result>
            token outputs:surface
        }
        def Shader "read"
        {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "tint"
            float3 outputs:result
        }
    }
}
"""
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    hair, sheet = form["meshes"]
    tube = floats(hair["positions"]).reshape(-1, 3)
    assert np.ptp(tube[tube[:, 0] < 1, 0]) == pytest.approx(0.2, rel=0.15) and np.ptp(
        tube[tube[:, 0] > 1, 0]
    ) == pytest.approx(0.4, rel=0.15)
    colors = floats(hair["colors"]).reshape(-1, 4)
    assert np.unique(colors[tube[:, 0] < 1], axis=0).tolist() == [[0, 1, 0, 1]]
    assert floats(sheet["colors"]).tolist() == [1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1]
    nodes = form["nodes"]
    places = [node for node in nodes if "transform" in node and node.get("children")][1:]
    shown = [nodes[node["children"][0]]["surfaces"][0]["materials"][0] for node in places]
    assert [form["materials"][number]["kind"]["base_color"]["factor"] for number in shown] == [
        [1, 0, 0],
        [0, 0, 1],
        [1, 0, 0],
    ]


def test_meshes_shine_and_a_panel_shows_its_picture_upright(tmp_path: Path) -> None:
    Image = pytest.importorskip("PIL.Image")
    picture = np.zeros((2, 2, 3), dtype=np.uint8)
    picture[0, 0], picture[0, 1], picture[1, 0] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    Image.fromarray(picture).save(tmp_path / "picture.png")
    text = """
def Xform "World"
{
    def RectLight "panel"
    {
        float inputs:width = 2; float inputs:height = 2; float inputs:intensity = 3
        asset inputs:texture:file = @picture.png@
    }
    def Mesh "lamp" (prepend apiSchemas = ["MeshLightAPI"])
    {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(9, 0, 0), (11, 0, 0), (9, 2, 0)]
        uniform token subdivisionScheme = "none"
        float inputs:intensity = 8
        bool inputs:normalize = 1
    }
}
"""
    path = stage(tmp_path, text)
    form, _ = document(path)
    assert form["materials"][-1]["emission"]["factor"] == [4, 4, 4]
    scene = snell.load(path)
    # Seen from the side to which it shines, +x is to the left.
    camera = snell.Camera(eye=(0, 0, -4), target=(0, 0, 0), up=(0, 1, 0), fov=40)
    pixels = np.asarray(snell.render(scene, camera=camera, size=(9, 9), spp=4))
    assert pixels[2, 2].argmax() == 0 and pixels[2, 6].argmax() == 1 and pixels[6, 2].argmax() == 2
    assert pixels[6, 6].max() < 0.2 < 1 < pixels[2, 2].max()


def test_power_is_divided_by_areas_in_units_of_the_stage(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    path = tmp_path / "centimetres.usda"
    lights = """
def RectLight "panel"
{
    float inputs:width = 10; float inputs:height = 20
    float inputs:intensity = 400; bool inputs:normalize = 1
}
def SphereLight "dot"
{
    bool treatAsPoint = 1; float inputs:radius = 5
    float inputs:intensity = 4; bool inputs:normalize = 1
}
"""
    path.write_text("#usda 1.0\n( metersPerUnit = 0.01 )\n" + lights)
    form, _ = document(str(path))
    assert form["materials"][0]["emission"]["factor"] == [2, 2, 2]
    # The radiance of the ball, times the area of its silhouette in square metres.
    seen = 4 / (4 * np.pi * 5**2) * np.pi * 0.05**2
    assert form["lights"][0]["intensity"] == pytest.approx([seen] * 3)


def test_skins_are_posed_at_the_time_asked_for(tmp_path: Path) -> None:
    text = """
def SkelRoot "World"
{
    def Skeleton "bones" (prepend apiSchemas = ["SkelBindingAPI"])
    {
        uniform token[] joints = ["root"]
        uniform matrix4d[] bindTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
        ]
        uniform matrix4d[] restTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
        ]
        rel skel:animationSource = </World/motion>
    }
    def SkelAnimation "motion"
    {
        uniform token[] joints = ["root"]
        float3[] translations.timeSamples = { 0: [(0, 0, 0)], 10: [(0, 0, 5)] }
        quatf[] rotations = [(1, 0, 0, 0)]
        half3[] scales = [(1, 1, 1)]
    }
    def Mesh "skin" (prepend apiSchemas = ["SkelBindingAPI"])
    {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0)]
        uniform token subdivisionScheme = "none"
        int[] primvars:skel:jointIndices = [0, 0, 0] (elementSize = 1; interpolation = "vertex")
        float[] primvars:skel:jointWeights = [1, 1, 1] (elementSize = 1; interpolation = "vertex")
        rel skel:skeleton = </World/bones>
    }
}
"""
    path = stage(tmp_path, text)
    before = Path(path).read_bytes()
    for time, depth in ((0, 0), (4, 2), (10, 5)):
        form, remarks = document(path, time=time)
        assert remarks == []
        assert floats(form["meshes"][0]["positions"]).reshape(-1, 3)[
            :, 2
        ].tolist() == pytest.approx([depth] * 3)
    assert Path(path).read_bytes() == before


def test_render_settings_choose_the_size_and_the_camera(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    path = tmp_path / "settings.usda"
    text = """#usda 1.0
( metersPerUnit = 1; renderSettingsPrimPath = "/Render/settings" )
def Camera "first" {}
def Camera "second" {}
def Scope "Render"
{
    def RenderSettings "settings"
    {
        uniform int2 resolution = (320, 180)
        rel camera = </second>
    }
}
"""
    path.write_text(text)
    form, remarks = document(str(path))
    assert remarks == [] and form["settings"]["size"] == [320, 180]
    assert [camera["name"] for camera in form["cameras"]] == ["second", "first"]
    snell.load(path)


def test_transforms_that_change_are_a_motion(tmp_path: Path) -> None:
    text = """
    def Xform "World"
    {
        def Xform "cart"
        {
            double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 48: (4, 0, 0)}
            float xformOp:rotateY.timeSamples = {0: 0, 48: 360}
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
            def Camera "eye"
            {
            }
            def SphereLight "lamp"
            {
            }
        }
        def Cube "still"
        {
        }
    }
"""
    form, _ = document(stage(tmp_path, text))
    motion = form["motion"]
    (channel,) = motion["clips"][0]["channels"]
    assert motion["joints"][channel["joint"]]["name"] == "cart"
    keys = channel["track"]["transform"]
    assert len(keys) == 49 and keys[0][0] == 0 and keys[-1][0] == pytest.approx(2)
    # After a quarter of the time, a quarter of the turn is done. Two samples alone would not show
    # that.
    assert keys[12][0] == pytest.approx(0.5)
    np.testing.assert_allclose(keys[12][1], [[0, 0, 1, 1], [0, 1, 0, 0], [-1, 0, 0, 0]], atol=1e-12)
    names = [motion["joints"][joint]["name"] for _, joint in motion["cameras"]]
    assert names == ["eye"] and all(
        0 <= joint < len(motion["joints"]) for _, joint in motion["lights"]
    )
    joint = motion["joints"][motion["cameras"][0][1]]
    assert motion["joints"][joint["parent"]]["name"] == "cart"
    still, _ = document(
        stage(
            tmp_path,
            text.replace(".timeSamples = {0: (0, 0, 0), 48: (4, 0, 0)}", " = (1, 0, 0)").replace(
                ".timeSamples = {0: 0, 48: 360}", " = 5"
            ),
        )
    )
    assert "motion" not in still


BALL = '#usda 1.0\n( defaultPrim = "ball" )\ndef Sphere "ball"\n{\n}\n'


def folder_with_a_file_outside(tmp_path: Path) -> Path:
    pytest.importorskip("pxr")
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    for folder in (inside, outside):
        (folder / "ball.usda").write_text(BALL)
    (inside / "link.usda").symlink_to(outside / "ball.usda")
    (inside / "linked").symlink_to(outside)
    (inside / "clip.001.usda").symlink_to(outside / "ball.usda")
    return inside


CLIPS = (
    '(clips = { dictionary default = { CLIP string primPath = "/ball"; double2[] active = [(0, '
    "0)]; double2[] times = [(0, 0)] } })"
)


@pytest.mark.parametrize(
    "text",
    [
        'def "s" (references = @../outside/ball.usda@) {\n}',
        'def "s" (references = @link.usda@) {\n}',
        'def "s" (references = @linked/ball.usda@) {\n}',
        'def "s" (payload = @../outside/ball.usda@) {\n}',
        'def "s" (references = @/nowhere/ball.usda@) {\n}',
        'def "s" (references = @file:///nowhere/ball.usda@) {\n}',
        'def "s" (references = @../outside/ball.usdz[ball.usda]@) {\n}',
        'def "s" (references = @`"../outside/ball.usda"`@) {\n}',
        "( subLayers = [@../outside/ball.usda@] )",
        'def "s" (variants = { string v = "a" }; prepend variantSets = "v") {\n variantSet "v" = '
        '{\n "a" (references = @../outside/ball.usda@) {\n}\n}\n}',
        'def Sphere "ball" '
        + CLIPS.replace(
            "CLIP",
            "asset[] assetPaths = [@../outside/ball.usda@]; asset manifestAssetPath = @ball.usda@;",
        )
        + " {\n}",
        'def Sphere "ball" '
        + CLIPS.replace("CLIP", 'string templateAssetPath = "./clip.###.usda";')
        + " {\n}",
        'def RectLight "panel" {\n asset inputs:texture:file = @/etc/passwd@\n}',
        'def RectLight "panel" {\n asset inputs:texture:file = @../outside/a.png@\n}',
        'def DomeLight "sky" {\n asset inputs:texture:file = @../outside/a.<UDIM>.png@\n}',
    ],
)
def test_a_file_outside_of_the_folder_of_a_stage_is_refused_before_it_is_opened(
    tmp_path: Path, text: str
) -> None:
    path = folder_with_a_file_outside(tmp_path) / "stage.usda"
    path.write_text("#usda 1.0\n" + text)
    with pytest.raises(
        ValueError,
        match=r"out(side)? of the scene's folder; .*, or leave out --confine",
    ) as error:
        snell.usd.convert(str(path), confine=True)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    with pytest.raises(ValueError, match="leave out confine=True"):
        snell.load(path, confine=True)


def test_a_stage_names_files_anywhere_unless_it_is_confined(
    tmp_path: Path,
) -> None:
    inside = folder_with_a_file_outside(tmp_path)
    (inside / "good.usda").symlink_to(inside / "ball.usda")
    path = inside / "stage.usda"
    for name in ("./ball.usda", "good.usda"):
        path.write_text(f'#usda 1.0\ndef "s" (references = @{name}@) {{\n}}\n')
        assert snell.usd.convert(str(path), confine=True)[1] == []
    path.write_text('#usda 1.0\ndef "s" (references = @../outside/ball.usda@) {\n}\n')
    form, remarks = document(str(path))
    assert remarks == [] and any(node.get("surfaces") for node in form["nodes"])
    path.write_text('#usda 1.0\ndef "s" (references = @./missing.usda@) {\n}\n')
    (remark,) = snell.usd.convert(str(path))[1]
    assert "Could not open asset" in remark and "missing.usda" in remark and "0x" not in remark


def test_nodes_that_are_named_many_times_are_looked_at_once(tmp_path: Path) -> None:
    """Each node mixes the one before with itself: 2^40 ways lead to the first."""
    pytest.importorskip("pxr")
    shader = """def Shader "n{0}" {{
        uniform token info:id = "ND_mix_color3"
        color3f inputs:fg.connect = </m/n{1}.outputs:out>
        color3f inputs:bg.connect = </m/n{1}.outputs:out>
        float inputs:mix.connect = </m/n{0}.outputs:out>
        color3f outputs:out
    }}"""
    nodes = "\n".join(shader.format(i, i - 1) for i in range(1, 41))
    path = tmp_path / "stage.usda"
    path.write_text(
        f"""#usda 1.0
def Material "m" {{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/n40.outputs:out>
        token outputs:surface
    }}
    {nodes}
}}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    rel material:binding = </m>
}}
"""
    )
    form, _ = document(str(path))
    assert form["materials"]


def test_pipes_and_devices_are_not_opened(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    os.mkfifo(tmp_path / "pipe.usda")
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(ValueError, match="this is a pipe, not a file"):
        snell.load(tmp_path / "pipe.usda")
    path = tmp_path / "stage.usda"
    path.write_text('#usda 1.0\ndef "s" (references = @./pipe.usda@) {\n}\n')
    for confine in (False, True):
        with pytest.raises(
            ValueError, match=r'at /s: it names "\./pipe\.usda": this is a pipe, not a file'
        ):
            snell.usd.convert(str(path), confine=confine)
    for name in ("pipe.png", "/dev/zero"):
        path.write_text(
            f'#usda 1.0\ndef RectLight "panel" {{\n asset inputs:texture:file = @{name}@\n}}\n'
        )
        (remark,) = snell.usd.convert(str(path))[1]
        assert "not a file; a magenta checkerboard" in remark


def test_values_that_the_schema_does_not_know_leave_their_prim_out(tmp_path: Path) -> None:
    path = stage(
        tmp_path,
        """
        def Sphere "ball" {
            string radius = "wide"
        }
        def Mesh "sheet" {
            int points = 1
        }
        def Mesh "wide" {
            float4[] points = [(0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1)]
        }
        def Cube "box" { }
        """,
    )
    form, remarks = document(path)
    assert [surface["shape"]["shape"] for surface in surfaces(form)] == ["box"]
    for remark, path in zip(remarks, ("/ball", "/sheet", "/wide"), strict=True):
        assert remark.startswith(f"at {path}: its values cannot be used: ")


def surfaces(form: dict[str, Any]) -> list[Any]:
    return [surface for node in form["nodes"] for surface in node.get("surfaces", [])]


def test_numbers_that_are_not_finite_are_errors_with_their_prim(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    path = tmp_path / "stage.usda"
    for radius in ("double radius = nan", "double radius = inf"):
        path.write_text(f'#usda 1.0\ndef Sphere "ball"\n{{\n    {radius}\n}}\n')
        with pytest.raises(
            ValueError,
            match=r"stage\.usda: at /ball: its values cannot be used: .*; write them as the "
            "schema says",
        ):
            snell.load(path)


def test_a_layer_of_no_rate_ends_with_a_remark(tmp_path: Path) -> None:
    moving = """
    def Xform "World" {
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 10: (1, 0, 0), }
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Cube "box" { }
    }
"""
    layer = Path(stage(tmp_path, moving, "moving.usda"))
    layer.write_text(layer.read_text().replace('upAxis = "Y"', "timeCodesPerSecond = 0", 1))
    path = stage(tmp_path, 'def "World" (references = @./moving.usda@</World>) { }')
    form, remarks = document(path)
    assert remarks == ["moving.usda: 0 time codes per second are no rate; 24 were used"]
    keys = form["motion"]["clips"][0]["channels"][0]["track"]["transform"]
    assert [keys[0][0], keys[-1][0]] == [1 / 24, 10 / 24]


def test_a_mixture_with_black_is_a_factor_of_the_picture(tmp_path: Path) -> None:
    (tmp_path / "a.ppm").write_text("P3 1 1 255 9 9 9")
    mixed = """
    def Xform "World" {
        def Mesh "sheet" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0)]
            uniform token subdivisionScheme = "none"
            rel material:binding = </World/paint>
        }
        def Material "paint" {
            token outputs:mtlx:surface.connect = </World/paint/surface.outputs:out>
            def Shader "picture" {
                uniform token info:id = "ND_image_color3"
                asset inputs:file = @a.ppm@
                color3f outputs:out
            }
            def Shader "mix" {
                uniform token info:id = "ND_mix_color3"
                color3f inputs:fg.connect = </World/paint/picture.outputs:out>
                color3f inputs:bg = (0, 0, 0)
                float inputs:mix = 0.5
                color3f outputs:out
            }
            def Shader "surface" {
                uniform token info:id = "ND_standard_surface_surfaceshader"
                color3f inputs:base_color.connect = </World/paint/mix.outputs:out>
                token outputs:out
            }
        }
    }
"""
    form, remarks = document(stage(tmp_path, mixed))
    color = form["materials"][-1]["kind"]["base_color"]
    assert (color["factor"], color["texture"], remarks) == ([0.5, 0.5, 0.5], 0, [])


CUBE = """
    def Mesh "cube" {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0,1,3,2, 2,3,7,6, 6,7,5,4, 4,5,1,0, 2,6,4,0, 7,3,1,5]
        point3f[] points = [(-1,-1,1),(1,-1,1),(-1,1,1),(1,1,1),
            (-1,-1,-1),(1,-1,-1),(-1,1,-1),(1,1,-1)]
        MORE
    }
"""


def test_a_cube_of_subdivision_becomes_a_ball_unless_its_edges_are_sharp(tmp_path: Path) -> None:
    faces = [[0, 1, 3, 2], [2, 3, 7, 6], [6, 7, 5, 4], [4, 5, 1, 0], [2, 6, 4, 0], [7, 3, 1, 5]]
    rims = [[*face, face[0]] for face in faces]
    chain = [point for rim in rims for point in rim]
    sharp = f"int[] creaseIndices = {chain}\nint[] creaseLengths = {[5] * 6}\n"
    for more, nearest, farthest in (
        ("", 0.84, 0.88),
        (sharp + f"float[] creaseSharpnesses = {[10] * 6}", 1.0, 3**0.5),
    ):
        form, remarks = document(stage(tmp_path, CUBE.replace("MORE", more)))
        assert remarks == []
        data = form["meshes"][0]["positions"]
        points = np.frombuffer(base64.b64decode(data), np.float32).reshape(-1, 3)
        distances = np.linalg.norm(points, axis=1)
        assert len(points) == 6 * 8 * 8 + 2
        assert distances.min() >= nearest - 1e-6
        assert distances.max() <= farthest + 1e-6
        assert more == "" or distances.max() > farthest - 1e-6


def test_the_first_level_of_a_cube_has_the_published_points() -> None:
    from snell.usd._subdivision import Topology

    faces = [0, 1, 3, 2, 2, 3, 7, 6, 6, 7, 5, 4, 4, 5, 1, 0, 2, 6, 4, 0, 7, 3, 1, 5]
    none = np.zeros((0, 2), dtype=np.int64), np.zeros(0)
    level = Topology(
        8, np.full(6, 4), np.array(faces), *none, np.zeros(0, dtype=np.int64), none[1], True
    )
    z = [1, 1, 1, 1, -1, -1, -1, -1]
    points = np.array([[2 * (i & 1) - 1, (i & 2) - 1, z[i]] for i in range(8)], dtype=float)
    divided = level.smooth(points)
    assert np.allclose(np.abs(divided[:8]), 5 / 9)
    assert np.allclose(np.sort(np.abs(divided[8:20]), axis=1), [0, 0.75, 0.75])
    assert np.allclose(np.sort(np.abs(divided[20:]), axis=1), [0, 0, 1])
    # Each part is inside of its face, so its corners turn the same way.
    parts = level.divided()
    assert (len(parts.counts), parts.points) == (24, 26)


def test_a_flat_sheet_of_subdivision_stays_flat_and_keeps_its_corners(tmp_path: Path) -> None:
    sheet = """
    def Mesh "sheet" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
    }
"""
    form, _ = document(stage(tmp_path, sheet))
    points, uvs = (
        np.frombuffer(base64.b64decode(form["meshes"][0][name]), np.float32)
        for name in ("positions", "uvs")
    )
    points, uvs = points.reshape(-1, 3), uvs.reshape(-1, 2)
    assert (len(points), points.min(), points.max()) == (81, 0.0, 2.0)
    corner = points[np.argmax(points.sum(axis=1))]
    assert corner.tolist() == [2.0, 2.0, 0.0]
    assert uvs[np.argmax(points.sum(axis=1))].tolist() == [1.0, 1.0]


def test_a_material_takes_the_constant_primvars_of_each_prim(tmp_path: Path) -> None:
    glass = """
    def Xform "World" {
        def Material "paint" {
            token outputs:surface.connect = </World/paint/surface.outputs:surface>
            def Shader "surface" {
                uniform token info:id = "UsdPreviewSurface"
                float inputs:opacity.connect = </World/paint/reader.outputs:result>
                token outputs:surface
            }
            def Shader "reader" {
                uniform token info:id = "UsdPrimvarReader_float"
                string inputs:varname = "fade"
                float inputs:fallback = 0.75
                float outputs:result
            }
        }
        BALLS
    }
"""
    ball = """
        def Sphere "ball%d" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            %s
            rel material:binding = </World/paint>
        }
"""
    quarter = "float primvars:fade = 0.25"
    fades = [quarter, "float[] primvars:fade = [0.5]", "", quarter]
    balls = "".join(ball % pair for pair in enumerate(fades))
    form, remarks = document(stage(tmp_path, glass.replace("BALLS", balls)))
    assert [m["alpha"]["factor"] for m in form["materials"]] == [0.25, 0.5, 0.75]
    used = [n["surfaces"][0]["materials"][0] for n in form["nodes"] if n.get("surfaces")]
    assert used == [0, 1, 2, 0]
    assert len(remarks) == 1
