"""Answers say what was hit: ids and names through nested instances, and parts of many answers."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import snell


def moved(x: float) -> np.ndarray:
    return np.array([[1.0, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]])


@pytest.fixture
def street() -> snell.Scene:
    """Two cars of two wheels each, and a ball in no instance; first something that was removed."""
    wheel, car, street = snell.Scene(), snell.Scene(), snell.Scene()
    gone = wheel.add_shape("box", min=[-9, -9, -9], max=[9, 9, 9])
    wheel.add_shape("sphere", moved(0), "tyre", radius=1)
    wheel.remove(gone)
    car.add_mesh(np.eye(3) + [0, 50, 0], [[0, 1, 2]], moved(1))
    car.add_instance(wheel, moved(-3), "rear")
    car.add_instance(wheel, moved(3))
    street.add_shape("sphere", moved(40), "ball", radius=1)
    street.add_instance(car, moved(0), "taxi")
    street.add_instance(car, moved(20))
    return street


RAYS = [[x, 0, 9, 0, 0, -1] for x in (-3, 3, 17, 23, 40, 99)]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_copies_in_nested_instances_are_told_apart(street, dtype):
    hits = street.cast_rays(np.array(RAYS, dtype=dtype))
    none = snell.INVALID_ID
    assert hits.geometry_ids.tolist() == [1, 1, 1, 1, 0, none]
    assert hits.instance_ids.tolist() == [1, 1, 2, 2, none, none]
    assert hits.instance_paths.tolist() == [
        [1, 1], [1, 2], [2, 1], [2, 2], [none, none], [none, none],
    ]  # fmt: skip
    names = ["taxi/rear/tyre", "taxi/2/tyre", "2/rear/tyre", "2/2/tyre", "ball", ""]
    assert hits.names.tolist() == names
    near = street.closest_points(np.array(RAYS, dtype=dtype)[:5, :3])
    assert near.names.tolist() == names[:5]
    np.testing.assert_array_equal(near.instance_paths, hits.instance_paths[:5])


def test_an_index_selects_answers(street):
    hits = street.cast_rays(np.array(RAYS).reshape(2, 3, 6))
    assert hits[hits.is_hit].t_hit.tolist() == [8] * 5
    assert hits[1].shape == (3,) and hits[1, 2].t_hit == np.inf and hits[0, 1].shape == ()
    assert hits[:, 1].names.tolist() == ["taxi/2/tyre", "ball"]
    np.testing.assert_array_equal(hits[..., 0].points, hits.points[:, 0])
    assert hits[0][0].instance_paths.tolist() == [1, 1]
    part = pickle.loads(pickle.dumps(hits[1]))
    assert part.keys() == hits.keys() and part.is_hit.tolist() == [True, True, False]
    for wrong in (7, 1.5, (0, 0, 0)):
        with pytest.raises(IndexError, match="Hits of shape"):
            hits[wrong]
    with pytest.raises(KeyError):
        hits["t"]


def test_parts_of_a_list_keep_its_rows(street):
    found = street.list_intersections(RAYS)
    assert found.is_entering.tolist() == [True, False] * 5
    entered = found[found.is_entering]
    assert entered.ray_splits.tolist() == [0, 1, 2, 3, 4, 5, 5]
    assert entered.ray_ids.tolist() == [0, 1, 2, 3, 4]
    with pytest.raises(IndexError, match="keep their order"):
        found[::-1]


def test_rays_enter_from_outside(street):
    hits = street.cast_rays([[40, 0, 9, 0, 0, -1], [40, 0, 0, 0, 0, -1], [99, 0, 0, 0, 0, 1]])
    assert hits.is_entering.tolist() == [True, False, False]
