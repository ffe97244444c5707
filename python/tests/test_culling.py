"""Choosing hits: sides of surfaces, objects by id and name, masks of 64 bits, first hits."""

import numpy as np
import pytest

import snell


def scene_of_everything():
    rng = np.random.default_rng(3)
    scene, inner = snell.Scene(), snell.Scene()
    inner.add_shape("cylinder", radius=0.4, height=1, name="can")
    inner.add_mesh(rng.normal(size=(30, 3)), np.arange(30).reshape(10, 3), name="soup")
    scene.add_shape("box", min=[-1, -1, -1], max=[0.5, 0.5, 0.5], name="box")
    scene.add_spheres(rng.normal(size=(6, 3)), 0.4, name="balls")
    scene.add_mesh(rng.normal(size=(90, 3)), np.arange(90).reshape(30, 3), name="soup")
    mirrored = np.array([[-1, 0.3, 0, 1], [0, 1, 0, 0], [0, 0.2, 1.5, 0], [0, 0, 0, 1]])
    scene.add_instance(inner, mirrored, name="mirrored")
    scene.add_instance(inner, [[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0]])
    return scene


def some_rays(dtype, count=2000):
    rng = np.random.default_rng(4)
    origins = 4 * rng.normal(size=(count, 3))
    return np.concatenate([origins, rng.normal(size=(count, 3)) - origins], axis=-1).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("cull", ["back", "front"])
def test_culled_queries_have_the_hits_of_the_other_side(dtype, cull):
    scene, rays = scene_of_everything(), some_rays(dtype)
    every = scene.list_intersections(rays)
    kept = every.is_entering == (cull == "back")
    found = scene.list_intersections(rays, cull=cull)
    assert found.ray_ids.tolist() == every.ray_ids[kept].tolist()
    assert found.t_hit.tolist() == every.t_hit[kept].tolist()
    counts = np.bincount(every.ray_ids[kept], minlength=len(rays))
    assert scene.count_intersections(rays, cull=cull).tolist() == counts.tolist()
    assert scene.test_occlusions(rays, cull=cull).tolist() == (counts > 0).tolist()
    first = np.full(len(rays), np.inf, dtype)
    np.minimum.at(first, every.ray_ids[kept], every.t_hit[kept])
    assert scene.cast_rays(rays, cull=cull).t_hit.tolist() == first.tolist()


def test_objects_by_id_and_name():
    scene, rays = scene_of_everything(), some_rays(np.float64)
    every = scene.list_intersections(rays)

    def times(**choice):
        return scene.list_intersections(rays, **choice).t_hit.tolist()

    names = every.names
    for only, kept in [
        ("box", names == "box"),
        ("soup", names == "soup"),
        (["box", "balls"], (names == "box") | (names == "balls")),
        (0, names == "box"),
        (np.array([1, 3]), (names == "balls") | (every.instance_ids == 3)),
        ("mirrored", every.instance_ids == 3),
        ("mirrored/can", names == "mirrored/can"),
        (["4/soup"], names == "4/soup"),
        ([], np.zeros(len(names), bool)),
    ]:
        assert kept.any() or only == []
        assert times(only=only) == every.t_hit[kept].tolist()
        assert times(exclude=only) == every.t_hit[~kept].tolist()
    both = (every.instance_ids == 3) & (names != "mirrored/can")
    assert times(only=3, exclude="mirrored/can") == every.t_hit[both].tolist()
    assert (
        times(only=3, cull="back")
        == every.t_hit[(every.instance_ids == 3) & every.is_entering].tolist()
    )


def test_wrong_choices_are_named():
    scene = scene_of_everything()
    ray = [0, 0, 0, 0, 0, 1]
    for choice, error, message in [
        ({"cull": "both"}, ValueError, r'^cull is "both"'),
        ({"cull": True}, TypeError, r"^cull is True, expected \"back\", \"front\" or None"),
        ({"only": "bix"}, ValueError, r'^only: nothing has the name "bix"; did you mean "box"\?'),
        ({"only": ["box", 99]}, ValueError, r"^only\[1\]: id 99 is not in the scene"),
        ({"exclude": [1.5]}, TypeError, r"^exclude\[0\] is 1.5, expected an id or a name"),
        ({"exclude": 1.5}, TypeError, r"^exclude is of type"),
        ({"exclude": [True]}, TypeError, r"^exclude\[0\] is True"),
        ({"mask": 2**64}, ValueError, r"^mask is 18446744073709551616, expected 64 bits"),
        ({"mask": -1}, ValueError, r"^mask is -1, expected 64 bits"),
    ]:
        with pytest.raises(error, match=message):
            scene.cast_rays(ray, **choice)
    for value in (0, -1, 2.5, "2", True):
        with pytest.raises(
            (TypeError, ValueError), match=r"^max_hits is .*, expected a whole number"
        ):
            scene.count_intersections(ray, max_hits=value)


def test_masks_have_64_bits():
    scene = snell.Scene()
    inner = snell.Scene()
    inner.add_shape("plane")
    objects = [
        scene.add_instance(inner, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -i]], mask=1 << i)
        for i in range(64)
    ]
    rays = np.tile([0, 0, 9, 0, 0, -1], (64, 1))
    masks = np.uint64(1) << np.arange(64, dtype=np.uint64)
    for dtype in (np.float32, np.float64):
        hits = scene.cast_rays(rays.astype(dtype), mask=masks)
        assert hits.instance_ids.tolist() == objects
        assert hits.t_hit.tolist() == list(range(9, 73))
        assert (
            scene.cast_rays(rays[0].astype(dtype), mask=2**64 - 2**40).instance_ids == objects[40]
        )
    ball = scene.add_shape("sphere", mask=2**63, radius=5)
    assert scene.distance([0, 0, 6], mask=2**63) == 1
    assert scene.closest_points([0.0, 0, 6], mask=2**62).instance_ids == objects[62]
    scene.update_mask(ball, 2**64 - 1)
    assert scene.cast_rays(rays[0], mask=2**50).t_hit == 4


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_first_hits(dtype):
    scene, rays = scene_of_everything(), some_rays(dtype)
    every = scene.list_intersections(rays)
    for most in (1, 2, 5, 1000, 2**40):
        kept = np.arange(len(every.t_hit)) - every.ray_splits[every.ray_ids] < most
        first = scene.list_intersections(rays, max_hits=most)
        assert first.t_hit.tolist() == every.t_hit[kept].tolist()
        assert first.primitive_ids.tolist() == every.primitive_ids[kept].tolist()
        counts = np.minimum(np.diff(every.ray_splits), most)
        assert scene.count_intersections(rays, max_hits=np.int64(most)).tolist() == counts.tolist()


def test_colours_are_those_of_the_layer():
    rng = np.random.default_rng(5)
    image = rng.integers(0, 255, (2, 2, 3), dtype=np.uint8)
    texture = snell.Texture(image, filtering="nearest")
    scene, inner = snell.Scene(), snell.Scene()
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    quad = [[0, 1, 2], [0, 2, 3]]
    uvs = (corners[:, :2] + 1) / 2
    painted = snell.Material("diffuse", reflectance=texture)
    inner.add_mesh(corners, quad, uvs=uvs, material=painted)
    inner.add_mesh(0.4 * corners + [0, 0, 0.5], quad)
    scene.add_instance(inner, [[1, 0, 0, -1.2], [0, 1, 0, 0], [0, 0, 1, 0]])
    scene.add_mesh(corners + [1.2, 0, 0], quad, colors=rng.random((4, 3)))
    scene.add_shape(
        "sphere",
        [[1, 0, 0, 0], [0, 1, 0, 1.6], [0, 0, 1, 0]],
        radius=0.5,
        material=snell.Material("metallic-roughness", base_color=(0.9, 0.5, 0.2), metallic=1),
    )
    scene.add_instance(
        inner,
        [[1, 0, 0, 0], [0, 1, 0, -2.5], [0, 0, 1, 0]],
        material=snell.Material("diffuse", reflectance=(0.1, 0.2, 0.3)),
    )
    ball_material = scene.cast_rays([0, 1.6, 5, 0, 0, -1]).material_ids
    camera = snell.Camera(
        "orthographic", eye=(0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), half_size=(4, 4)
    )
    picture = snell.render(
        scene, spp=16, size=(96, 96), camera=camera, aovs=["albedo"], progress=False
    )
    layer = picture.aovs["albedo"]
    hits = scene.cast_rays(camera.rays(96, 96, dtype=np.float64))
    albedo = hits.albedo
    assert albedo.shape == (96, 96, 3)
    assert (albedo[~hits.is_hit] == 0).all()
    # A pixel of the picture is filtered, so that its colour is among those around it.
    around = [np.roll(albedo, (i, j), axis=(0, 1)) for i in range(-2, 3) for j in range(-2, 3)]
    low, high = np.min(around, axis=0), np.max(around, axis=0)
    inner = (slice(2, -2), slice(2, -2))
    assert (layer >= low - 2e-3)[inner].all()
    assert (layer <= high + 2e-3)[inner].all()
    assert ((high - low).max(axis=-1) < 1e-6)[hits.is_hit].mean() > 0.2
    texels = {tuple(c) for c in albedo[hits.instance_ids == 0].round(4).tolist()}
    assert len(texels) > 3
    # Metal looks different along its normal, and borders of texels are between two colours.
    plain = ((high - low).max(axis=-1) < 1e-6) & hits.is_hit & (hits.material_ids != ball_material)
    near = scene.closest_points(hits.points[plain] + [0, 0, 0.01])
    assert near.albedo == pytest.approx(albedo[plain], abs=1e-5)
    listed = scene.list_intersections(camera.rays(96, 96, dtype=np.float64))
    first = listed.ray_splits[:-1][hits.is_hit.ravel()]
    assert listed.albedo[first] == pytest.approx(albedo[hits.is_hit])
