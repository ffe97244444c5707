"""Errors about an argument have its name and the first bad place. Nothing crashes."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from conftest import sphere_mesh

import snell

V = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]
F = [[0, 1, 2]]
RAY = [0.0, 0, -1, 0, 0, 1]


def scene() -> snell.Scene:
    made = snell.Scene()
    made.add_mesh(V, F)
    return made


NAN = float("nan")
BAD = [
    (
        lambda s: s.add_mesh([[0, 0, 0], [NAN, 0, 0]], F),
        ValueError,
        r"vertices\[1, 0\] is NaN, expected a finite number",
    ),
    (
        lambda s: s.add_mesh([[0, 0], [1, 0]], F),
        ValueError,
        r"vertices: shape is \(2, 2\), expected \(n, 3\)",
    ),
    (lambda s: s.add_mesh(V, [[0, 1, 3]]), ValueError, r"faces\[0, 2\] is 3, expected 0 to 2"),
    (
        lambda s: s.add_mesh(V, [[0, 1, 2], [0, -1, 2]]),
        ValueError,
        r"faces\[1, 1\] is -1, expected 0 to 2",
    ),
    (
        lambda s: s.add_mesh(V, np.array([[0, 1, 2**33]])),
        ValueError,
        r"faces\[0, 2\] is 8589934592, expected 0 to 2",
    ),
    (
        lambda s: s.add_mesh(V, [[0.0, 1, 2]]),
        TypeError,
        "faces: dtype is float64, expected integers",
    ),
    (
        lambda s: s.add_mesh(V, [[0, 1, 2, 2]]),
        ValueError,
        r"faces: shape is \(1, 4\), expected \(n, 3\)",
    ),
    (lambda s: s.add_mesh([], F), ValueError, r"faces\[0, 0\] is 0, but there are no vertices"),
    (
        lambda s: s.add_mesh("mesh.obj"),
        TypeError,
        "faces is left out, and vertices is str, not a mesh of",
    ),
    (
        lambda s: s.add_mesh(np.array(V, dtype=complex), F),
        TypeError,
        "vertices: dtype is complex128",
    ),
    (lambda s: s.add_mesh([["a", "b", "c"]], F), TypeError, "vertices: dtype is <U1"),
    (
        lambda s: s.add_mesh([[0, 0, 0], [1]], F),
        TypeError,
        "vertices: this does not convert to an array",
    ),
    (
        lambda s: s.add_mesh(V, F, normals=[[0, 0, 1]]),
        ValueError,
        "normals: there are 1, expected 3, one per vertex",
    ),
    (
        lambda s: s.add_mesh(V, F, np.eye(3)),
        ValueError,
        r"transform: shape is \(3, 3\), expected \(4, 4\) or \(3, 4\)",
    ),
    (lambda s: s.add_mesh(V, F, np.zeros((3, 4))), ValueError, "transform is singular"),
    (
        lambda s: s.add_mesh(V, F, np.diag([1, 1, 1, 2])),
        ValueError,
        r"transform\[3\] is .*, expected \[0, 0, 0, 1\]",
    ),
    (lambda s: s.add_mesh(V, F, np.full((4, 4), NAN)), ValueError, r"transform\[0, 0\] is NaN"),
    (
        lambda s: s.add_mesh(V, F, mask=-1),
        ValueError,
        "mask is -1, expected 64 bits: 0 to 18446744073709551615",
    ),
    (
        lambda s: s.add_shape("spere", radius=1),
        ValueError,
        'there is no shape "spere"; did you mean "sphere"?',
    ),
    (
        lambda s: s.add_shape("sphere", radios=1),
        TypeError,
        'sphere has no parameter "radios"; did you mean "radius"?',
    ),
    (lambda s: s.add_shape("sphere"), TypeError, 'sphere: the parameter "radius" is missing'),
    (
        lambda s: s.add_shape("sphere", radius=-1),
        ValueError,
        "sphere: radius is -1, expected a positive number",
    ),
    (
        lambda s: s.add_shape("sphere", radius=NAN),
        ValueError,
        "radius is NaN, expected a finite number",
    ),
    (
        lambda s: s.add_shape("sphere", radius="one"),
        TypeError,
        "radius is 'one', expected a number",
    ),
    (
        lambda s: s.add_spheres(V, [1, 2]),
        ValueError,
        r"radii: shape is \(2,\), expected \(3,\) or one number",
    ),
    (
        lambda s: s.add_spheres(V, [1, 0, 1]),
        ValueError,
        r"radii\[1\] is 0, expected a positive number",
    ),
    (
        lambda s: s.update_vertices(0, V[:2]),
        ValueError,
        "vertices: there are 2, expected 3 as before",
    ),
    (
        lambda s: s.update_vertices(s.add_shape("sphere", mask=0, radius=1), V),
        TypeError,
        "id 1 is not a mesh",
    ),
    (
        lambda s: s.update_transform(7, np.eye(4)),
        IndexError,
        "id 7 is not in the scene, which has given 1 ids",
    ),
    (lambda s: s.remove(-1), IndexError, "id -1 is not in the scene"),
    (
        lambda s: s.cast_rays(np.zeros((4, 5))),
        ValueError,
        r"rays: shape is \(4, 5\), expected \(\.\.\., 6\)",
    ),
    (lambda s: s.cast_rays(3.0), ValueError, r"rays: shape is \(\), expected \(\.\.\., 6\)"),
    (
        lambda s: s.cast_rays(np.zeros(6, dtype=bool)),
        TypeError,
        "rays: dtype is bool, expected real numbers",
    ),
    (lambda s: s.cast_rays((np.zeros((2, 3)), np.zeros((3, 3)))), ValueError, "do not broadcast"),
    (
        lambda s: s.cast_rays((np.zeros((2, 3)), np.zeros((2, 2)))),
        ValueError,
        r"rays\[1\] \(directions\): shape is \(2, 2\)",
    ),
    (
        lambda s: s.cast_rays(RAY, t_min=[0, 1]),
        ValueError,
        r"t_min: shape \(2,\) does not broadcast to \(\)",
    ),
    (lambda s: s.cast_rays(RAY, t_max="far"), TypeError, "t_max: dtype is <U3"),
    (
        lambda s: s.cast_rays([RAY] * 3, mask=[1, -2, 3]),
        ValueError,
        r"mask\[1\] is -2, expected 0 to 18446744073709551615",
    ),
    (lambda s: s.cast_rays(RAY, mask=0.5), TypeError, "mask: dtype is float64, expected integers"),
    (lambda s: s.cast_rays(RAY, threads=0), ValueError, "threads is 0, expected 1 to 4096"),
    (
        lambda s: s.cast_rays(RAY, threads=1.5),
        TypeError,
        "threads is 1.5, expected a whole number: 1 to 4096, or None for all cores",
    ),
    (lambda s: s.distance(V, mask=1.5), TypeError, "mask is 1.5, expected a whole number: 64 bits"),
    (
        lambda s: snell.Camera.from_opencv(np.eye(3), size=(640.0, 480.0)),
        TypeError,
        r"size is \(640.0, 480.0\), expected the width and height in pixels",
    ),
    (
        lambda s: s.distance([[1, 2]]),
        ValueError,
        r"points: shape is \(1, 2\), expected \(\.\.\., 3\)",
    ),
    (lambda s: s.commit(np.float16), ValueError, "dtype is float16, expected float32 or float64"),
    (
        lambda s: snell.create_rays_pinhole(),
        TypeError,
        "expected intrinsic_matrix and extrinsic_matrix",
    ),
    (lambda s: snell.Hits({}), TypeError, "there is no t_hit"),
]


@pytest.mark.parametrize(("call", "error", "message"), BAD, ids=[message for _, _, message in BAD])
def test_bad_arguments_are_named_and_change_nothing(call, error, message):
    tried = scene()
    with pytest.raises(error, match=message.replace("?", r"\?")):
        call(tried)
    assert tried.cast_rays([0.2, 0.2, -1, 0, 0, 1]).t_hit == 1


def test_random_calls_give_answers_or_exceptions(rng):
    """Ten thousand calls with arguments of any kind and shape; numbers include those that are not
    finite, huge and tiny.
    """
    special = np.array(
        [0, -0.0, 1, -1, 0.5, 1e-45, 1e-300, 3e38, -3e38, 1e300, np.inf, -np.inf, np.nan]
    )
    tried = snell.Scene()
    tried.add_mesh(*sphere_mesh(6, 8))

    def number():
        return float(rng.choice(special))

    def array(width=None):
        shape = tuple(rng.integers(0, 5, size=rng.integers(0, 4)))
        if width or rng.random() < 0.7:
            shape = (*shape[:2], width or int(rng.choice([3, 6, 2])))
        kind = rng.choice([np.float32, np.float64, np.int8, np.uint64, np.float16])
        with np.errstate(all="ignore"):
            return rng.choice(special, size=shape).astype(kind)

    def anything():
        makers = [
            array,
            array,
            array,
            number,
            lambda: None,
            lambda: "x",
            lambda: (array(), array()),
            dict,
            list,
            lambda: int(rng.integers(-3, 12)),
            lambda: np.diag([number(), 1, 1, 1]),
            lambda: V,
            lambda: F,
        ]
        return makers[rng.integers(len(makers))]()

    queries = ("cast_rays", "test_occlusions", "count_intersections", "list_intersections")
    of_points = ("closest_points", "distance", "signed_distance", "occupancy", "winding_number")
    edits = (
        "add_mesh",
        "add_spheres",
        "update_transform",
        "update_vertices",
        "remove",
        "add_instance",
        "update_mask",
    )
    succeeded = failed = 0
    for i in range(10_000):
        name = str(rng.choice(queries + of_points + edits + ("add_shape",)))
        arguments = (
            [anything() for _ in range(rng.integers(1, 3))] if name in edits else [anything()]
        )
        if name in queries + of_points and rng.random() < 0.5:
            arguments = [array(6 if name in queries else 3)]
        options = {}
        if name in queries and rng.random() < 0.5:
            options = {str(rng.choice(["t_min", "t_max", "mask"])): anything()}
        if name == "add_shape":
            arguments = [str(rng.choice(sorted(snell.SHAPES)))]
            options = {key: anything() for key in snell.SHAPES[arguments[0]]}
        if i % 500 == 0:
            tried = snell.Scene()
            tried.add_mesh(*sphere_mesh(6, 8))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                answer = getattr(tried, name)(*arguments, **options)
                if hasattr(answer, "items"):
                    answer.items()
            succeeded += 1
        except (ValueError, TypeError, IndexError, OverflowError):
            failed += 1
    assert succeeded > 1000 and failed > 1000, (succeeded, failed)


def test_names_are_texts():
    made = scene()
    for call in [
        lambda: made.add_mesh(V, F, name=3),
        lambda: made.add_shape("sphere", name=b"ball", radius=1),
        lambda: made.add_instance(snell.Scene(), name=["a"]),
        lambda: made.update_name(0, 3),
        lambda: snell.Camera(eye=(0, 0, 1), name=3),
    ]:
        with pytest.raises(TypeError, match=r"^name is .*, expected a text"):
            call()
    with pytest.raises(TypeError, match=r"^name is 3, expected a text"):
        made.name = 3
    assert made.names == {}


@pytest.mark.parametrize("name", [b"ball", bytearray(b"ball")])
def test_bytes_are_no_names_and_no_ids(name):
    made = scene()
    for argument in ("only", "exclude"):
        with pytest.raises(TypeError, match=f"{argument} is .*ball.*expected a text.*decode"):
            made.cast_rays(RAY, **{argument: name})


def test_texts_are_no_places():
    made = scene()
    for call in [
        lambda: made.add_mesh(V, F, "triangle"),
        lambda: made.add_shape("sphere", "ball", radius=1),
        lambda: made.update_transform(0, "here"),
    ]:
        with pytest.raises(TypeError, match="transform"):
            call()


def test_a_list_of_masks_is_one_for_each_ray():
    made = snell.Scene()
    made.add_mesh(V, F, mask=2)
    rays = [[0.2, 0.2, -1, 0, 0, 1]] * 3
    assert made.test_occlusions(rays, mask=[1, 2, 3]).tolist() == [False, True, True]
    with pytest.raises(TypeError, match="mask"):
        made.add_mesh(V, F, mask=[1, 2])
    with pytest.raises(TypeError, match="mask"):
        made.occupancy([[0, 0, 0]], mask=[1])


def test_reports_that_cannot_be_called_are_refused_at_once():
    with pytest.raises(TypeError, match="progress is 3, expected True, False or a function"):
        snell.render(scene(), spp=1, size=(4, 4), progress=3)
