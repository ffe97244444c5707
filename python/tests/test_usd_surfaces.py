"""USD stages: surfaces, their primvars, instances, cameras and layers in memory."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_usd import document, floats, stage, surfaces

import snell

SHEET = """
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
        uniform token subdivisionScheme = "none"
"""


def slots(mesh: dict[str, Any]) -> list[int]:
    return np.frombuffer(base64.b64decode(mesh["material_slots"]), dtype="<u2").tolist()


def test_the_first_level_of_a_tetrahedron_has_the_points_of_loop() -> None:
    pytest.importorskip("pxr")
    from snell.usd._subdivision import LoopTopology

    none = np.zeros((0, 2), dtype=np.int64), np.zeros(0)
    pins = np.zeros(0, dtype=np.int64), np.zeros(0)
    corners = np.array([0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0])
    level = LoopTopology(4, np.full(4, 3), corners, *none, *pins, True)
    points = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)
    found = level.smooth(points)
    # The points around a corner sum to its opposite, and so do the ends of opposite edges.
    assert found[:4] == pytest.approx(points / 4)
    assert found[4:] == pytest.approx(points[level.ends].sum(axis=1) / 4)
    finer = level.divided()
    assert len(finer.counts) == 16
    assert np.bincount(level.parents).tolist() == [4, 4, 4, 4]
    assert np.all(np.bincount(finer.edge) == 2), "the parts are closed again"
    # Values that grow linearly along the corners keep doing so.
    ramp = np.arange(12.0)[:, None]
    assert level.of_corners(ramp)[:12, 0].tolist() == [
        0,
        0.5,
        1,
        1,
        1.5,
        0.5,
        2,
        1,
        1.5,
        0.5,
        1.5,
        1,
    ]


def test_smooth_triangles_pull_at_their_edges() -> None:
    pytest.importorskip("pxr")
    from snell.usd._subdivision import Topology

    none = np.zeros((0, 2), dtype=np.int64), np.zeros(0)
    pins = np.zeros(0, dtype=np.int64), np.zeros(0)
    corners = np.array([0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0])
    points = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)
    for is_smooth, middle in ((False, 0.25), (True, 0.47)):
        level = Topology(4, np.full(4, 3), corners, *none, *pins, True, is_smooth)
        ends = points[level.ends].sum(axis=1)
        # The middles of the two triangles sum to a third of the ends, with these ends.
        edges = ends * (0.5 - middle) + middle * ends / 3
        assert level.smooth(points)[4:10] == pytest.approx(edges)


def test_primvars_whose_indices_are_missing_are_told(tmp_path: Path) -> None:
    text = f"""
    def Mesh "sheet" {{
        {SHEET}
        texCoord2f[] primvars:st = [(0, 0), (1, 1)] (interpolation = "faceVarying")
        int[] primvars:st:indices.timeSamples = {{ 5: [0, 1, 0, 1, 0, 1, 0, 1], }}
        color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "uniform")
        int[] primvars:displayColor:indices = [7]
    }}
    """
    form, remarks = document(stage(tmp_path, text))
    assert len(surfaces(form)) == 1
    assert all("do not fit" in remark or "primvar" in remark for remark in remarks)
    assert remarks


def test_values_of_the_first_time_stand_in_for_those_that_are_missing(tmp_path: Path) -> None:
    text = """
    def Sphere "ball" {
        double radius.timeSamples = { 3: 5, 4: 6, }
        color3f[] primvars:displayColor.timeSamples = { 7: [(0, 1, 0)], }
        double3 xformOp:translate.timeSamples = { 3: (1, 2, 3), }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    """
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    assert surfaces(form)[0]["shape"]["radius"] == 5
    assert form["materials"][0]["kind"]["base_color"]["factor"] == [0, 1, 0]
    places = [node["transform"] for node in form["nodes"][1:] if "transform" in node]
    assert [[row[3] for row in place] for place in places] == [[1, 2, 3]]


def test_schemes_for_other_faces_and_corners_that_do_not_fit_are_told(tmp_path: Path) -> None:
    text = f"""
    def Mesh "loop" {{ {SHEET.replace('"none"', '"loop"')} }}
    def Mesh "pins" {{
        {SHEET.replace('"none"', '"catmullClark"')}
        int[] cornerIndices = [0, 77]
        float[] cornerSharpnesses = [1, 1]
    }}
    """
    _, remarks = document(stage(tmp_path, text))
    assert remarks == [
        "/loop: the scheme loop is for triangles; the polygons are shown instead",
        "/pins: corners that do not fit the mesh are left out",
    ]


def test_opacities_of_vertices_and_faces_are_kept(tmp_path: Path) -> None:
    text = f"""
    def Mesh "sheet" {{
        {SHEET}
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "uniform")
        float[] primvars:displayOpacity = [0, 0.5, 1, 0, 0.5, 1] (interpolation = "vertex")
    }}
    def Cube "box" {{
        float[] primvars:displayOpacity = [0.5, 1, 0.25, 1, 0.75, 1] (interpolation = "uniform")
    }}
    def Sphere "ball" {{
        float[] primvars:displayOpacity = [0.5]
    }}
    """
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    colors = floats(form["meshes"][0]["colors"]).reshape(-1, 4)
    positions = floats(form["meshes"][0]["positions"]).reshape(-1, 3)
    assert colors[:, 3].tolist() == (positions[:, 0] / 2).tolist()
    assert {tuple(color) for color in colors[:, :3].tolist()} == {(1, 0, 0), (0, 1, 0)}
    sides = floats(form["meshes"][1]["colors"]).reshape(-1, 4)
    places = floats(form["meshes"][1]["positions"]).reshape(-1, 3)
    top = sides[:, 3] == 0.5
    assert np.all(places[top][:, 2] == 1), "the first face of a cube is at +z"
    assert [m["alpha_mode"] for m in form["materials"]] == ["blend"] * 3
    assert form["materials"][2]["alpha"]["factor"] == 0.5


def test_only_the_parts_whose_material_reads_colours_have_them(tmp_path: Path) -> None:
    text = f"""
    def Mesh "sheet" {{
        {SHEET}
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "uniform")
        def GeomSubset "right" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </paint>
        }}
    }}
    def Material "paint" {{
        token outputs:surface.connect = </paint/surface.outputs:surface>
        def Shader "surface" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
            token outputs:surface
        }}
    }}
    """
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    (mesh,) = form["meshes"]
    colors = floats(mesh["colors"]).reshape(-1, 4)[:, :3]
    right = floats(mesh["positions"]).reshape(-1, 3)[:, 0] == 2
    assert np.all(colors[right] == 1), "the painted part is not tinted"
    assert [1, 0, 0] in colors.tolist()
    assert [0, 1, 0] not in colors.tolist()


def test_instances_differ_where_their_primvars_do(tmp_path: Path) -> None:
    text = """
    class Xform "Ball" { def Sphere "ball" { } }
    def Xform "a" (instanceable = true; inherits = </Ball>) {
        color3f[] primvars:displayColor = [(1, 0, 0)]
    }
    def Xform "b" (instanceable = true; inherits = </Ball>) {
        color3f[] primvars:displayColor = [(0, 1, 0)]
    }
    def PointInstancer "many" {
        point3f[] positions = [(0, 3, 0), (2, 3, 0), (4, 3, 0), (6, 3, 0)]
        int[] protoIndices = [0, 0, 0, 0]
        rel prototypes = </many/dot>
        color3f[] primvars:displayColor = [(0, 0, 1), (1, 1, 0), (0, 0, 1), (1, 1, 0)] (
            interpolation = "varying"
        )
        float[] primvars:age = [1, 2, 3, 4] (interpolation = "varying")
        def Sphere "dot" { }
    }
    """
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    shown = [
        form["materials"][s["materials"][0]]["kind"]["base_color"]["factor"] for s in used(form)
    ]
    assert sorted(shown) == [[0, 0, 1], [0, 0, 1], [0, 1, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]]
    # One dot for each colour, and one that was made before the colours were known.
    assert len(surfaces(form)) == 5


def used(form: dict[str, Any]) -> list[Any]:
    """The surfaces below the root, as often as they are seen."""

    def below(number: int) -> list[Any]:
        node = form["nodes"][number]
        inner = [below(child) for child in node.get("children", [])]
        return sum(inner, list(node.get("surfaces", [])))

    return below(form["root"])


def test_equal_meshes_are_stored_once(tmp_path: Path) -> None:
    text = f"""
    class Mesh "sheet" {{ {SHEET} }}
    def Mesh "a" (inherits = </sheet>) {{ }}
    def Mesh "b" (inherits = </sheet>) {{
        double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Mesh "c" (inherits = </sheet>) {{
        uniform token orientation = "leftHanded"
    }}
    def Scope "tinted" {{
        texCoord2f[] primvars:st = [(0, 1)] (interpolation = "constant")
        def Mesh "d" (inherits = </sheet>) {{ }}
    }}
    """
    form, _ = document(stage(tmp_path, text))
    assert [surface["mesh"] for surface in surfaces(form)] == [0, 0, 1, 2]


def test_prototypes_lie_anywhere(tmp_path: Path) -> None:
    text = """
    over "library" { def Sphere "ball" { } }
    class "stock" { def Xform "box" { def Cube "cube" { } } }
    def PointInstancer "many" {
        point3f[] positions = [(0, 0, 0), (3, 0, 0)]
        int[] protoIndices = [0, 1]
        rel prototypes = [</library/ball>, </stock/box>]
    }
    """
    form, _ = document(stage(tmp_path, text))
    assert [s["shape"]["shape"] for s in used(form)] == ["sphere", "box"]


def test_types_that_are_not_known_fall_back_on_those_that_are(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    path = tmp_path / "stage.usda"
    path.write_text(
        '#usda 1.0\n( fallbackPrimTypes = { token[] Bubble = ["Sphere"] } )\n'
        'def Bubble "ball"\n{\n    double radius = 3\n}\n'
    )
    form, _ = document(str(path))
    assert surfaces(form)[0]["shape"] == {"shape": "sphere", "radius": 3}


def test_splines_with_knots_are_computed(tmp_path: Path) -> None:
    half = 0.5**0.5
    text = f"""
    def NurbsCurves "quarter" {{
        point3f[] points = [(1, 0, 0), (1, 1, 0), (0, 1, 0)]
        double[] pointWeights = [1, {half}, 1]
        int[] curveVertexCounts = [3]
        int[] order = [3]
        double[] knots = [0, 0, 0, 1, 1, 1]
        float[] widths = [0.002] (interpolation = "constant")
    }}
    def HermiteCurves "arch" {{
        point3f[] points = [(0, 0, 0), (1, 0, 0)]
        vector3f[] tangents = [(0, 2, 0), (0, -2, 0)]
        int[] curveVertexCounts = [2]
        float[] widths = [0.002] (interpolation = "constant")
    }}
    def NurbsPatch "barrel" {{
        point3f[] points = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0, 5), (1, 1, 5), (0, 1, 5)]
        double[] pointWeights = [1, {half}, 1, 1, {half}, 1]
        int uVertexCount = 3
        int vVertexCount = 2
        int uOrder = 3
        int vOrder = 2
        double[] uKnots = [0, 0, 0, 1, 1, 1]
        double[] vKnots = [0, 0, 1, 1]
    }}
    """
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    quarter, barrel = (floats(mesh["positions"]).reshape(-1, 3) for mesh in form["meshes"])
    assert np.linalg.norm(quarter, axis=1) == pytest.approx(1, abs=2e-3)
    arch = floats(form["curves"][0]["points"]).reshape(-1, 4)
    rise = 2 / 3
    assert arch.tolist() == pytest.approx(
        np.array([[0, 0, 0, 1e-3], [0, rise, 0, 1e-3], [1, rise, 0, 1e-3], [1, 0, 0, 1e-3]])
    )
    assert np.linalg.norm(barrel[:, :2], axis=1) == pytest.approx(1, abs=1e-5)
    assert barrel[:, 2].max() == pytest.approx(5)


@pytest.mark.parametrize(
    ("basis", "wrap", "points", "ends"),
    [
        ("bspline", "pinned", 4, [0.01, 2.99]),
        ("catmullRom", "pinned", 4, [0.01, 2.99]),
        ("catmullRom", "nonperiodic", 4, [1.01, 1.99]),
        ("bezier", "nonperiodic", 4, [0.01, 2.99]),
        ("bspline", "periodic", 5, [0.8, 3.0]),
        ("bezier", "periodic", 6, [0.01, 2.99]),
        ("linear", "nonperiodic", 4, [0.01, 2.99]),
        ("bspline", "pinned", 2, [0.01, 0.99]),
    ],
)
def test_curves_reach_as_far_as_their_basis_says(
    tmp_path: Path, basis: str, wrap: str, points: int, ends: list[float]
) -> None:
    kind = "linear" if basis == "linear" else "cubic"
    basis = "" if kind == "linear" else f'uniform token basis = "{basis}"'
    text = f"""
    def BasisCurves "line" {{
        point3f[] points = {[(i, 0, 0) for i in range(points)]}
        int[] curveVertexCounts = [{points}]
        uniform token type = "{kind}"
        {basis}
        uniform token wrap = "{wrap}"
        float[] widths = [0.25] (interpolation = "constant")
    }}
    """
    path = stage(tmp_path, text)
    form, remarks = document(path)
    assert remarks == []
    assert len(form["curves"]) == 1
    rays = np.array([[x, 0, 5, 0, 0, -1] for x in ends], dtype=np.float32)
    assert snell.load(path).cast_rays(rays).t_hit == pytest.approx(4.875, abs=1e-4)


def test_tetrahedra_have_an_outside(tmp_path: Path) -> None:
    text = """
    def TetMesh "two" {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]
        int4[] tetVertexIndices = [(0, 1, 2, 3), (4, 2, 1, 3)]
    }
    """
    form, _ = document(stage(tmp_path, text))
    assert len(base64.b64decode(form["meshes"][0]["indices"])) == 6 * 3 * 4


def test_the_aperture_of_a_camera_has_an_offset_and_a_shape(tmp_path: Path) -> None:
    text = """
    def Camera "shifted" {
        float horizontalAperture = 40
        float verticalAperture = 20
        float horizontalApertureOffset = 10
        float verticalApertureOffset = 5
        float focalLength = 50
    }
    def Camera "plan" {
        token projection = "orthographic"
        float horizontalAperture = 40
        float verticalAperture = 40
        float horizontalApertureOffset = 10
    }
    """
    form, remarks = document(stage(tmp_path, text))
    assert remarks == []
    shifted, plan = form["cameras"]
    assert shifted["resolution"] == [960, 480]
    assert shifted["projection"] == {
        "projection": "intrinsics",
        "focal_length": [1200, 1200],
        # What lies straight ahead is left of the middle, and below it.
        "principal_point": [240, 360],
        "size": [960, 480],
    }
    assert plan["resolution"] == [960, 960]
    assert plan["eye"] == pytest.approx([1, 0, 0])


def test_the_exposure_of_the_first_camera_counts(tmp_path: Path) -> None:
    text = """
    def Camera "bright" { float exposure = 2 }
    def Camera "plain" { }
    """
    path = stage(tmp_path, text.replace("{ float", "{\n float"))
    form, remarks = document(path)
    assert form["settings"]["imaging_ratio"] == 4
    assert remarks == ["the exposures of the cameras differ; that of the first counts for all"]


def test_changes_of_layers_in_memory_are_taken_back(tmp_path: Path) -> None:
    from pxr import Sdf

    (tmp_path / "red.mtlx").write_text('<materialx version="1.38"></materialx>')
    path = stage(tmp_path, 'def "paints" (references = @./red.mtlx@</MaterialX>) { }')
    Path(path).write_text(Path(path).read_text().replace('upAxis = "Y"', "timeCodesPerSecond = 0"))
    mine = Sdf.Layer.FindOrOpen(path)
    before = mine.ExportToString()
    _, remarks = document(path)
    assert len(remarks) == 1
    assert mine.ExportToString() == before
    assert mine.timeCodesPerSecond == 0


def test_what_lights_leave_out_is_told(tmp_path: Path) -> None:
    text = """
    def SphereLight "lamp" (prepend apiSchemas = ["CollectionAPI:lightLink"]) {
        uniform bool collection:lightLink:includeRoot = 0
        rel collection:lightLink:includes = </ball>
        bool inputs:shadow:enable = 0
    }
    def Sphere "ball" { }
    """
    form, remarks = document(stage(tmp_path, text))
    assert [remark.split(": ")[1].split(";")[0] for remark in remarks] == [
        "the light casts shadows, which the file switches off",
        "the light linking is left out",
    ]
    lamp = next(m for m in form["materials"] if m["name"] == "lamp")
    assert not lamp["double_sided"], "a camera inside of a lamp sees out of it"
