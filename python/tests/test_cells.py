"""The surfaces of meshes of cells, of meshio and PyVista."""

from __future__ import annotations

import types

import numpy as np
import pytest

import snell
from snell._cells import blocks_of_vtk, surface

# One cell of each solid kind around (0.4, 0.4, 0.4), with its corners in the order of VTK.
CUBE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
SOLIDS = {
    "tetra": ([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]], 8 / 6),
    "hexahedron": (CUBE, 1.0),
    "wedge": ([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 1], [2, 0, 1], [0, 2, 1]], 2.0),
    "pyramid": ([*CUBE[:4], [0, 0, 3]], 1.0),
}
EDGES = {
    "tetra10": ("tetra", [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]),
    "hexahedron20": (
        "hexahedron",
        [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
        + [(0, 4), (1, 5), (2, 6), (3, 7)],
    ),
    "wedge15": (
        "wedge",
        [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    ),
    "pyramid13": (
        "pyramid",
        [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
    ),
}


def volume(points: np.ndarray, faces: np.ndarray) -> float:
    """Signed: positive if the outer sides are outside."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    return float((np.cross(a, b) * c).sum() / 6)


def is_closed(faces: np.ndarray) -> bool:
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forth = sorted(map(tuple, edges))
    back = sorted(map(tuple, edges[:, ::-1]))
    return forth == back and len(set(forth)) == len(forth)


def meshio_mesh(points, *blocks):
    cells = [types.SimpleNamespace(type=kind, data=data) for kind, data in blocks]
    return types.SimpleNamespace(
        points=np.asarray(points, float), cells=cells, cells_dict={}, cell_data_dict={}
    )


@pytest.mark.parametrize("kind", SOLIDS)
@pytest.mark.parametrize("is_mirrored", [False, True])
def test_a_solid_cell_is_closed_and_faces_outwards(kind, is_mirrored):
    points, expected = SOLIDS[kind]
    points = np.array(points, float) * ([1, 1, -1] if is_mirrored else 1)
    faces = surface(points, [(kind, np.arange(len(points))[None])], "meshio")
    assert is_closed(faces) and abs(volume(points, faces) - expected) < 1e-12


@pytest.mark.parametrize("kind", EDGES)
def test_cells_of_second_order_bulge(kind):
    base, edges = EDGES[kind]
    corners = np.array(SOLIDS[base][0], float)
    center = corners.mean(axis=0)
    for bulge, is_larger in ((0.0, False), (0.2, True)):
        middles = np.array([corners[list(edge)].mean(axis=0) for edge in edges])
        points = np.concatenate([corners, middles + bulge * (middles - center)])
        faces = surface(points, [(kind, np.arange(len(points))[None])], "meshio")
        assert is_closed(faces) and len(np.unique(faces)) == len(points)
        found = volume(points, faces)
        assert found > SOLIDS[base][1] + 0.05 if is_larger else abs(found - SOLIDS[base][1]) < 1e-12


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A cube of n^3 hexahedra."""
    points = np.stack(np.meshgrid(*[np.arange(n + 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    at = lambda x, y, z: number[x : x + n, y : y + n, z : z + n].ravel()  # noqa: E731
    order = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return points, np.stack([at(*corner) for corner in order], axis=-1)


def test_inner_faces_are_left_out_and_surface_cells_are_not_doubled():
    points, cells = grid(4)
    bottom = np.array([cell[[0, 1, 2, 3]] for cell in cells if points[cell[0], 2] == 0])
    inner = np.array([cell[[0, 1, 2, 3]] for cell in cells if points[cell[0], 2] == 2])
    faces = surface(points, [("hexahedron", cells), ("quad", bottom)], "meshio")
    assert len(faces) == 6 * 16 * 2 and is_closed(faces) and volume(points, faces) == 64
    with_inner = surface(points, [("quad", inner), ("hexahedron", cells)], "meshio")
    assert len(with_inner) == len(faces) + 2 * 16
    # Tetrahedra on one side of a wall of hexahedra, with the other diagonal: both sides are kept.
    half = [cell for cell in cells if points[cell[0], 0] < 2]
    mixed = surface(points, [("hexahedron", np.array(half)), ("triangle", [[0, 1, 2]])], "meshio")
    assert len(mixed) == 2 * (2 * 16 + 4 * 8) + 1


def test_polygons_and_polyhedra():
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [1, 1, 0], [0, 4, 0]], float)
    faces = surface(points, [("polygon", [[0, 1, 2, 3, 4], [0, 1, 2]])], "meshio")
    area = np.cross(
        points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    )
    assert len(faces) == 4 and (area[:, 2] > 0).all() and area[:, 2].sum() / 2 == 10 + 8
    cube = np.array(CUBE, float)
    polyhedron = [
        [0, 3, 2, 1],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [0, 4, 7, 3],
    ]
    turned = [polyhedron[0][::-1], *polyhedron[1:]]
    faces = surface(cube, [("polyhedron8", [turned])], "meshio")
    assert is_closed(faces) and volume(cube, faces) == 1


def test_cells_of_vtk_have_their_order():
    points = np.array(CUBE, float)
    voxel, pixel = [0, 1, 3, 2, 4, 5, 7, 6], [0, 1, 3, 2]
    strip = [0, 1, 3, 2]
    kinds = np.array([11, 8, 6])
    nodes = np.array([*voxel, *pixel, *strip])
    blocks = blocks_of_vtk(kinds[:1], np.array([0, 8]), nodes)
    assert volume(points, surface(points, blocks, "PyVista")) == 1
    blocks = blocks_of_vtk(kinds[1:], np.array([0, 4, 8]), nodes[8:])
    faces = surface(points, blocks, "PyVista")
    normals = np.cross(
        points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    )
    assert len(faces) == 4 and (normals[:, 2] == 1).all()
    with pytest.raises(TypeError, match=r"VTK's kind 68.*extract_surface"):
        blocks_of_vtk(np.array([68]), np.array([0, 3]), np.arange(3))


def test_lines_and_points_are_told():
    points = np.eye(3)
    with pytest.warns(UserWarning, match="line are left out"):
        mesh = meshio_mesh(points, ("line", [[0, 1]]), ("triangle", [[0, 1, 2]]))
        assert len(snell.Scene().add_mesh and mesh.cells) == 2
        snell.Scene().add_mesh(mesh)
    with pytest.raises(TypeError, match=r"only cells of the kind vertex, line.*add_curves"):
        snell.Scene().add_mesh(meshio_mesh(points, ("vertex", [[0]]), ("line", [[0, 1]])))
    with pytest.raises(TypeError, match="kind VTK_LAGRANGE_TETRAHEDRON"):
        snell.Scene().add_mesh(meshio_mesh(points, ("VTK_LAGRANGE_TETRAHEDRON", [[0, 1, 2]])))


def test_meshio(tmp_path):
    meshio = pytest.importorskip("meshio")
    points, cells = grid(3)
    mesh = meshio.Mesh(points, [("hexahedron", cells[:20]), ("hexahedron", cells[20:])])
    mesh.write(tmp_path / "a.vtk")
    scene = snell.Scene()
    scene.add_mesh(meshio.read(tmp_path / "a.vtk"))
    assert scene.occupancy([[1.5, 1.5, 1.5], [3.5, 1, 1]]).tolist() == [True, False]
    assert scene.count_intersections([-1, 1.5, 1.2, 1, 0, 0]) == 2
    flat = meshio.Mesh([[0, 0], [1, 0], [0, 1]], [("triangle", [[0, 1, 2]])])
    assert scene.add_mesh(flat) == 1 and scene.mesh(1).vertices.shape == (3, 3)


def test_pyvista():
    pv = pytest.importorskip("pyvista")
    points, cells = grid(3)
    rows = np.column_stack([np.full(len(cells), 8), cells]).ravel()
    solid = pv.UnstructuredGrid(rows, np.full(len(cells), pv.CellType.HEXAHEDRON), points)
    image = pv.ImageData(dimensions=(4, 4, 4))
    strips = pv.Sphere().strip()
    for mesh, expected in [(solid, 27), (image, 27), (pv.Cube(), 1), (strips, pv.Sphere().volume)]:
        scene = snell.Scene()
        scene.add_mesh(mesh)
        assert abs(volume(*scene.mesh(0)) - expected) < 1e-4
    scene = snell.Scene()
    scene.add_mesh(pv.MultiBlock([pv.Cube(), pv.MultiBlock([pv.Sphere()])]))
    assert len(scene.mesh(0).faces) == 12 + pv.Sphere().n_cells
    second = pv.examples.cells.QuadraticTetrahedron()
    scene.add_mesh(second)
    assert len(scene.mesh(1).faces) == 16
    for mesh in (pv.PolyData(np.eye(3)), pv.Line()):
        with pytest.raises(TypeError, match="add_spheres"):
            scene.add_mesh(mesh)
