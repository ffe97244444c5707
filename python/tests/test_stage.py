"""Materials, lights, cameras, textures and surroundings, and scenes as files."""

from __future__ import annotations

import copy
import pathlib
import pickle

import numpy as np
import pytest

import snell

SMALL = {"spp": 4, "size": (32, 24)}
REPOSITORY = pathlib.Path(__file__).parents[2]


def pixels(scene, **options) -> np.ndarray:
    return np.asarray(snell.render(scene, **{**SMALL, **options}))


def checks() -> np.ndarray:
    return np.kron([[0, 1] * 2, [1, 0] * 2] * 2, np.ones((4, 4))).astype(np.uint8) * 255


def everything() -> snell.Scene:
    """A mesh, a textured shape, spheres, an instance, lights, a camera."""
    scene = snell.Scene()
    scene.name = "everything"
    worn = snell.Texture(checks(), filtering="nearest", wrap=("clamp", "mirror"))
    floor = snell.Material("diffuse", reflectance=worn, name="floor")
    scene.add_shape(
        "rectangle",
        [[1, 0, 0, 0], [0, 0, 1, -1], [0, -1, 0, 0]],
        "floor",
        half_size=[4, 4],
        material=floor,
    )
    red, blue = (
        snell.Material("diffuse", reflectance="#ff2020"),
        snell.Material("plastic", diffuse=0.2, specular=1, ior=1.5, roughness=0.1),
    )
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
    colors = np.linspace(0, 1, 12).reshape(4, 3)
    scene.add_mesh(
        square,
        [[0, 1, 2], [0, 2, 3]],
        material=[red, blue],
        material_ids=[0, 1],
        colors=colors,
        uvs=square[:, :2],
    )
    scene.add_mesh(square + [0.1, 1, -1.0], [[0, 1, 2], [0, 2, 3]], np.diag([1, 1, 2, 1]))
    scene.add_spheres(
        [[-1, 0, 0], [-1.5, 0, 0.5]], [0.5, 0.3], material=snell.Material("mirror", reflectance=0.9)
    )
    child = snell.Scene()
    child.add_shape(
        "sphere",
        radius=0.4,
        material=snell.Material("metallic-roughness", roughness=worn.channel("g"), metallic=1),
    )
    child.add_shape("sphere", [[1, 0, 0, 0], [0, 1, 0, 0.8], [0, 0, 1, 0]], radius=0.2)
    for x in (1.5, 2.5):
        scene.add_instance(child, [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]], material=red)
    scene.add_light(snell.Light("point", position=(3, 4, 3), intensity=60))
    scene.add_light(
        snell.Light(
            "spot",
            position=(0, 4, 0),
            direction=(0, -2, 0),
            intensity=(9, 0, 0),
            falloff={"falloff": "smooth", "inner": 0.1, "outer": 0.3},
        )
    )
    scene.environment = 0.2
    scene.add_camera(snell.Camera(eye=(0, 1.5, 6), target=(0, 0, 0), name="front"))
    return scene


def test_copies_pickles_and_files_give_the_same_picture(tmp_path):
    scene = everything()
    first = pixels(scene)
    assert len(np.unique(first)) > 200
    for other in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        np.testing.assert_array_equal(pixels(other), first)
    scene.save(tmp_path / "a.snell")
    again = snell.load(tmp_path / "a.snell")
    np.testing.assert_array_equal(pixels(again), first)
    again.save(tmp_path / "b.snell")
    assert (tmp_path / "a.snell").read_bytes() == (tmp_path / "b.snell").read_bytes()
    # Rays hit the same surfaces, too.
    rays = scene.create_rays_camera(0, 32, 24)
    np.testing.assert_allclose(again.cast_rays(rays).t_hit, scene.cast_rays(rays).t_hit, rtol=1e-5)
    with pytest.raises(
        ValueError, match=r'"xyz" is not a scene format that Snell writes; use \.snell'
    ):
        scene.save(tmp_path / "a.xyz")


@pytest.mark.parametrize("name", ["scenes/pyramid.gltf", "scenes/balls.scn", "spheres", "teapot"])
def test_a_loaded_scene_is_rendered_alike_before_and_after_an_edit(name):
    path = REPOSITORY / name
    scene = snell.load(path if path.exists() else name)
    before = pixels(scene, spp=1)
    # After an edit, the scene is rendered from the objects in Python, not from the nodes of the
    # file.
    scene.remove(scene.add_shape("sphere", radius=1))
    after = pixels(scene, spp=1)
    assert (np.abs(before - after) > 1e-3).mean() < 0.02
    rays = scene.create_rays_camera(0, 16, 12)
    assert np.isfinite(scene.cast_rays(rays).t_hit).any()


def test_every_example_of_a_material_can_be_made_and_replaced():
    for kind, names in snell.MATERIALS.items():
        required = {"conductor": {"spectrum": 0.5}}
        given = {}
        for _ in names:
            try:
                material = snell.Material(kind, **given)
                break
            except TypeError as error:
                name = str(error).split('"')[1]
                given[name] = required.get(name, 0.5)
        else:
            material = snell.Material(kind, **given)
        assert material.kind == kind and set(names) <= set(material.parameters)
        brighter = material.replace(emission=3, name="lamp")
        assert (
            brighter.emission == (3, 3, 3)
            and brighter.name == "lamp"
            and material.emission == (0, 0, 0)
        )
        assert repr(pickle.loads(pickle.dumps(brighter))) == repr(brighter)


def test_a_metal_in_a_coat_is_said_shortly_and_replaced():
    texture = snell.Texture(checks())
    metals = (
        "copper",
        "metal:Cu",
        0.5,
        (0.9, 0.6, 0.2),
        "#e0a040",
        texture,
        {"color": 0.5},
        {"measured": {"eta": 0.2, "k": (3, 2, 1)}},
    )
    for spectrum in metals:
        metal = snell.Material("conductor", spectrum=spectrum, roughness=0.3)
        for inside in (metal, {"spectrum": spectrum, "roughness": 0.3}):
            coated = snell.Material(
                "coated-conductor", conductor=inside, roughness=texture.channel("g")
            )
            assert coated.conductor["spectrum"] == metal.spectrum
            assert coated.ior == 1.5 and coated.conductor["roughness"] == pytest.approx(0.3)
            thick = coated.replace(ior=1.8)
            assert thick.ior == pytest.approx(1.8) and thick.conductor == coated.conductor
            assert repr(pickle.loads(pickle.dumps(thick)).conductor["roughness"]) == repr(
                thick.conductor["roughness"]
            )
    with pytest.raises(ValueError, match="conductor"):
        snell.Material("coated-conductor", conductor={"spectrum": "unobtainium"})


def test_what_a_declaration_leaves_out_is_usual():
    assert repr(snell.Material("dielectric", ior=1.5)) == (
        "Material(\"dielectric\", ior=1.5, roughness=0.0, microfacets='ggx', tint=(1.0, 1.0, "
        "1.0), "
        "absorption=(0.0, 0.0, 0.0))"
    )
    assert snell.Material("plastic", diffuse=0.5).ior == 1.5
    assert snell.Medium("homogeneous", sigma_s=0.1).parameters == {
        "sigma_a": (0, 0, 0),
        "sigma_s": (0.1, 0.1, 0.1),
        "emission": (0, 0, 0),
        "g": 0,
    }


def test_parameters_take_what_means_the_same():
    grey = repr(snell.Material("diffuse", reflectance=0.5))
    for value in ((0.5, 0.5, 0.5), [0.5] * 3, np.full(3, 0.5), np.float32(0.5), {"factor": 0.5}):
        assert repr(snell.Material("diffuse", reflectance=value)) == grey
    assert snell.Material("diffuse", reflectance="#ffffff").reflectance == (1, 1, 1)
    sun = snell.Light("directional", direction=(0, -3, 4), irradiance=2)
    np.testing.assert_allclose(sun.direction, (0, -0.6, 0.8))
    assert sun.replace(irradiance=1).irradiance == (1, 1, 1) and repr(
        pickle.loads(pickle.dumps(sun))
    ) == repr(sun)
    texture = snell.Texture(checks())
    bumpy = snell.Material(
        "diffuse",
        reflectance=0.5,
        bump_map={"texture": texture, "height": 0.25},
        normal_map={"texture": texture, "scale": 2},
    )
    assert bumpy.bump_map["texture"] is texture
    assert bumpy.bump_map["height"] == 0.25
    assert bumpy.normal_map["scale"] == 2
    with pytest.raises(TypeError, match='bump_map: "height" is missing'):
        snell.Material("diffuse", reflectance=0.5, bump_map=texture)
    material = snell.Material(
        "metallic-roughness", base_color=texture, roughness=texture.channel("g"), normal_map=texture
    )
    assert material.base_color is texture and material.roughness.number == 1
    assert material.normal_map["texture"] is texture
    assert texture.size == [16, 16]


def test_patterns_take_the_place_of_colours_numbers_and_parts_of_patterns(tmp_path):
    for kind, names in snell.PATTERNS.items():
        pattern = snell.Pattern(kind)
        assert pattern.kind == kind and tuple(pattern.parameters) == names
        assert repr(pickle.loads(pickle.dumps(pattern))) == repr(pattern)
    noise = snell.Pattern("wrinkled", octaves=3)
    texture = snell.Texture(checks())
    veins = snell.Pattern("mix", first="#400000", second=texture, amount=noise)
    assert veins.amount is noise and veins.second is texture
    stone = snell.Material("metallic-roughness", base_color=veins, roughness=noise)
    assert stone.base_color is veins and stone.roughness is noise
    copy = pickle.loads(pickle.dumps(stone))
    assert repr(copy.base_color) == repr(veins)
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1, material=stone)
    assert repr(scene.materials[0].base_color) == repr(veins)
    plain = snell.Scene()
    plain.add_shape("sphere", radius=1, material=stone.replace(base_color=0.2, roughness=0.5))
    pictures = [np.asarray(snell.render(s, spp=4, size=(32, 32))) for s in (scene, plain)]
    assert np.isfinite(pictures[0]).all() and abs(pictures[0] - pictures[1]).max() > 0.01
    scene.save(tmp_path / "a.snell")
    np.testing.assert_array_equal(
        np.asarray(snell.render(snell.load(tmp_path / "a.snell"), spp=4, size=(32, 32))),
        pictures[0],
    )
    with pytest.raises(TypeError, match="octave"):
        snell.Pattern("fbm", octave=3)


def test_cameras():
    camera = snell.Camera(eye=(0, 0, 5), target=(0, 0, 0), fov=90)
    np.testing.assert_allclose(camera.tan_half_fov[1], 1)
    np.testing.assert_allclose(
        camera.project([[0, 0, 0], [0, 5, 0], [0, 0, 9]], (200, 100))[:2],
        [[100, 50], [100, 0]],
        atol=1e-9,
    )
    assert np.isnan(camera.project([0, 0, 9], (200, 100))).all()
    for kind, parameters in {
        "fisheye": {"fov": 180},
        "panoramic": {},
        "equal-area": {},
        "orthographic": {"half_size": (None, 2)},
    }.items():
        other = snell.Camera(kind, eye=(0, 0, 5), **parameters)
        assert other.kind == kind and other.rays(8, 4).shape == (4, 8, 6)
        assert repr(pickle.loads(pickle.dumps(other))) == repr(other)
    matrix = snell.Camera(
        "intrinsics",
        eye=(0, 0, 5),
        focal_length=(50, 50),
        principal_point=(100, 50),
        size=(200, 100),
    )
    np.testing.assert_allclose(matrix.project([0, 5, 0], (200, 100)), [100, 0], atol=1e-9)
    scene = everything()
    assert [camera.name for camera in scene.cameras] == ["front"]
    by_object = pixels(scene, camera=scene.cameras[0])
    np.testing.assert_array_equal(by_object, pixels(scene, camera="front"))
    scene.cameras = [camera, matrix]
    assert len(scene.cameras) == 2
    # A lens blurs what is not in focus.
    sharp = snell.Camera(eye=(0, 0, 5), target=(0, 0, 0))
    blurred = snell.Camera(eye=(0, 0, 5), target=(0, 0, 0), aperture_radius=0.5, focus_distance=1)
    assert (
        np.abs(
            pixels(scene, camera=sharp, integrator="flat")
            - pixels(scene, camera=blurred, integrator="flat")
        ).mean()
        > 0.02
    )


def test_surroundings():
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1, material=snell.Material("diffuse", reflectance=1))
    assert scene.environment is None and scene.background == "environment"
    scene.environment = 0.5
    assert scene.environment == (0.5, 0.5, 0.5)
    # A white ball in a white furnace cannot be seen.
    np.testing.assert_allclose(pixels(scene), 0.5, rtol=1e-4)
    scene.set_environment(np.full((4, 8, 3), 0.25, dtype=np.float32), scale=2)
    np.testing.assert_allclose(pixels(scene, spp=16).mean(), 0.5, rtol=2e-2)
    assert scene.environment.shape == (4, 8, 3)
    scene.background = (1, 0, 0)
    np.testing.assert_allclose(pixels(scene)[0, 0], (1, 0, 0), atol=1e-6)
    scene.environment = "sky"
    scene.environment = None
    scene.lights = [snell.Light("directional", direction=(0, 0, -1), irradiance=np.pi)]
    assert len(scene.lights) == 1
    scene.lights = []
    assert scene.lights == []


def test_media():
    fog = snell.Medium("homogeneous", sigma_a=0, sigma_s=0.3, emission=0, g=0)
    assert repr(pickle.loads(pickle.dumps(fog))) == repr(fog) and fog.replace(g=0.5).g == 0.5
    glass = snell.Material(
        "dielectric",
        ior=1.5,
        roughness=0,
        tint=1,
        absorption=0,
        interior={"medium": fog, "priority": 1},
    )
    assert repr(glass.interior["medium"]) == repr(fog)
    again = pickle.loads(pickle.dumps(glass))
    assert repr(again) == repr(glass)
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1, material=again)
    scene.environment = 1
    scene.medium = fog
    assert repr(scene.medium) == repr(fog) and repr(scene.materials[0].interior["medium"]) == repr(
        fog
    )
    outer = snell.Scene()
    outer.add_instance(scene)
    outer.environment, outer.cameras = 1, [snell.Camera(eye=(0, 0, 5))]
    assert np.isfinite(pixels(outer)).all()
    scene.medium = None
    assert scene.medium is None


@pytest.mark.parametrize(
    "make, message",
    [
        (
            lambda: snell.Material("metallic-roughness", roughness=7),
            "metallic-roughness: .*roughness.* 7 is not possible",
        ),
        (lambda: snell.Material("dielectric", ior=-1), "dielectric: .*ior.* -1 is not possible"),
        (
            lambda: snell.Material("diffuse", reflectance=0.5).replace(alpha=-2),
            "alpha.* -2 is not possible",
        ),
        (lambda: snell.Medium("homogeneous", g=1.5), "homogeneous: .*g.* 1.5 is not possible"),
        (
            lambda: snell.Light("point", position=(0, 0, 0), intensity=-3),
            "point: intensity.* -3 is not possible",
        ),
        (
            lambda: snell.Light("point", position=(0, 0, 0), intensity=1e33),
            "intensity.* 1e33 is not possible",
        ),
    ],
)
def test_numbers_that_mean_nothing(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_light_that_is_too_bright_is_limited_and_told():
    scene = snell.Scene()
    scene.add_shape("sphere", radius=1, material=snell.Material("diffuse", reflectance=0.5))
    scene.environment = 1e33
    scene.cameras = [snell.Camera(eye=(0, 0, 5))]
    with pytest.warns(snell.SceneWarning, match="1e33, and 1e24 is the most"):
        image = snell.render(scene, "path", spp=4, size=(8, 8))
    assert np.isfinite(np.asarray(image)).all()


def glass_box(medium):
    """A box that holds a medium and has no surface, before a white sky, seen from the front."""
    scene = snell.Scene()
    scene.add_shape(
        "box",
        min=(-1, -1, -1),
        max=(1, 1, 1),
        material=snell.Material("interface", interior=medium),
    )
    scene.environment = 1.0
    scene.cameras = [snell.Camera(eye=(0, 0, 50), target=(0, 0, 0), fov=2)]
    return scene


def test_media_from_arrays():
    rng = np.random.default_rng(1)
    box = [(-1, -1, -1), (1, 1, 1)]
    # Density adds up along z. The left half absorbs no red, and the lower half is denser (rows of
    # pixels go down, against y).
    density = np.zeros((4, 2, 2))
    density[:, 0, :], density[:, 1, :] = 1.0, 0.25
    tint = np.ones((1, 1, 2, 3))
    tint[..., 0, :] = (0.0, 1.0, 1.0)
    smoke = snell.Medium(
        "grid", density=density, sigma_a=(0.5, 1, 2), sigma_a_tint=tint, bounds=box
    )
    assert (
        smoke.density.shape == (4, 2, 2)
        and smoke.density.dtype == np.float32
        and smoke.sigma_s_tint is None
    )
    np.testing.assert_array_equal(smoke.density, density)
    np.testing.assert_array_equal(smoke.sigma_a_tint, tint)
    np.testing.assert_allclose(
        smoke.world_from_grid, [[2, 0, 0, -1], [0, 2, 0, -1], [0, 0, 2, -1], [0, 0, 0, 1]]
    )
    picture = np.asarray(
        snell.render(glass_box(smoke), "path", spp=4096, size=(8, 8), filter="box")
    )
    for row, thickness in [(1, 0.25), (6, 1.0)]:
        for column, factors in [(1, (0, 1, 1)), (6, (1, 1, 1))]:
            expected = np.exp(-2 * thickness * np.multiply((0.5, 1, 2), factors))
            np.testing.assert_allclose(picture[row, column], expected, atol=0.03)
    # Arrays survive pickling, materials, scenes and files.
    assert "density=<array (4, 2, 2)>" in repr(smoke)
    for again in [
        pickle.loads(pickle.dumps(smoke)),
        pickle.loads(pickle.dumps(snell.Material("interface", interior=smoke))).interior["medium"],
        glass_box(smoke).materials[0].interior["medium"],
        pickle.loads(pickle.dumps(glass_box(smoke))).materials[0].interior["medium"],
        smoke.replace(g=0.5).replace(g=0),
    ]:
        np.testing.assert_array_equal(again.density, density)
        np.testing.assert_array_equal(again.sigma_a_tint, tint)
        assert repr(again) == repr(smoke)
    moved = smoke.replace(bounds=[(0, 0, 0), (1, 2, 3)])
    np.testing.assert_allclose(np.diag(moved.world_from_grid), (1, 2, 3, 1))
    # Arrays may have other types of numbers, be views, and contain NaN.
    odd = rng.normal(size=(6, 5, 4)).astype(np.float16)[::2, :, ::-1]
    odd[0, 0, 0] = np.nan
    kept = snell.Medium("grid", density=odd, sigma_s=1).density
    np.testing.assert_array_equal(kept, np.where(odd > 0, odd, 0).astype(np.float32))
    fire = snell.Medium(
        "grid",
        density=np.ones((2, 2, 2), int),
        emission=1,
        temperature=np.full((1, 1, 1), 3000),
        bounds=box,
    )
    glow = np.asarray(snell.render(glass_box(fire), "path", spp=64, size=(4, 4)))
    assert (glow[..., 0] > glow[..., 2] + 0.1).all()


@pytest.mark.parametrize(
    "parameters, message",
    [
        ({}, 'grid: the parameter "density" is missing'),
        ({"density": [1, 2]}, r"density: shape is \(2,\), expected \(z, y, x\)"),
        (
            {"density": np.ones((2, 2, 2, 3))},
            r"density: shape is \(2, 2, 2, 3\), expected \(z, y, x\)",
        ),
        ({"density": np.ones((2, 0, 2))}, "density: there are no cells"),
        ({"density": np.ones((2, 2, 2), complex)}, "density: dtype is complex128"),
        (
            {"density": np.ones((2, 2, 2)), "sigma_s_tint": np.ones((2, 2))},
            r"sigma_s_tint: .*expected \(z, y, x, 3\) or",
        ),
        (
            {"density": np.ones((2, 2, 2)), "bounds": [(0, 0, 0), (1, 0, 1)]},
            "the lower corner first",
        ),
        (
            {"density": np.ones((2, 2, 2)), "bounds": [(0, 0, 0)]},
            r"bounds: shape is \(1, 3\), expected \(2, 3\)",
        ),
        (
            {"density": np.ones((2, 2, 2)), "world_from_grid": np.zeros((4, 4))},
            r"world_from_grid\[3\] is",
        ),
        ({"density": np.ones((2, 2, 2)), "densty": 1}, 'did you mean "density"'),
    ],
)
def test_media_from_other_things(parameters, message):
    with pytest.raises((TypeError, ValueError), match=message):
        snell.Medium("grid", **parameters)


def test_materials_of_a_scene_are_shared_and_replaced():
    scene = snell.load("cornell-box")
    names = [material.name for material in scene.materials]
    assert len(names) > 2
    red = next(i for i, name in enumerate(names) if name == "red")
    before = pixels(scene, integrator="flat")
    scene.replace_material("red", scene.materials[red].replace(reflectance=(0, 0, 1)))
    after = pixels(scene, integrator="flat")
    assert 0.02 < (before != after).any(axis=-1).mean() < 0.6
    one = snell.Material("diffuse", reflectance=0.3)
    scene = snell.Scene()
    for _ in range(3):
        scene.add_shape("sphere", radius=1, material=one)
    assert len(scene.materials) == 1
    scene.update_material(1, snell.Material("diffuse", reflectance=0.4))
    assert len(scene.materials) == 2


BAD = [
    (
        lambda: snell.Material("difuse"),
        ValueError,
        'there is no material "difuse"; did you mean "diffuse"?',
    ),
    (
        lambda: snell.Material("diffuse", reflectence=1),
        TypeError,
        'diffuse has no parameter "reflectence"; did you mean "reflectance"?',
    ),
    (
        lambda: snell.Material("diffuse", reflectance="red"),
        TypeError,
        "reflectance is 'red', expected a colour",
    ),
    (
        lambda: snell.Material("diffuse", reflectance=(1, 2)),
        TypeError,
        r"reflectance is \(1, 2\), expected a colour",
    ),
    (
        lambda: snell.Material("diffuse", reflectance=float("nan")),
        ValueError,
        "reflectance is NaN, expected a finite number",
    ),
    (
        lambda: snell.Material("diffuse"),
        TypeError,
        'diffuse: the parameter "reflectance" is missing',
    ),
    (
        lambda: snell.Material("diffuse", reflectance=1, double_sided=3),
        TypeError,
        "double_sided is 3, expected True or False",
    ),
    (
        lambda: snell.Material("diffuse", reflectance=1, alpha_mode="opaqe"),
        ValueError,
        "unknown variant `opaqe`",
    ),
    (lambda: snell.Light("lamp"), ValueError, 'there is no light "lamp"'),
    (
        lambda: snell.Light("point", position=(0, 0, 0)),
        TypeError,
        'point: the parameter "intensity" is missing',
    ),
    (
        lambda: snell.Light("directional", direction=(0, 0, 0), irradiance=1),
        ValueError,
        "expected a direction that is not 0",
    ),
    (lambda: snell.Camera(eye=1), TypeError, "eye is 1, expected 3 numbers"),
    (lambda: snell.Camera(eye=(0, 0, 0), target=(0, 0, 0)), ValueError, "target is where eye is"),
    (
        lambda: snell.Camera("fisheye", eye=(0, 0, 0), fov=400),
        ValueError,
        "fov is 400, expected degrees from 0 to 360",
    ),
    (lambda: snell.Camera("fish", eye=(0, 0, 0)), ValueError, 'there is no projection "fish"'),
    (lambda: snell.Texture(np.zeros((2, 2, 5))), ValueError, r"image: shape is \(2, 2, 5\)"),
    (lambda: snell.Texture(np.zeros((2, 2), dtype=complex)), TypeError, "dtype is complex128"),
    (lambda: snell.Texture(checks(), wrap=3), TypeError, "wrap is 3, expected"),
    (
        lambda: snell.Texture(checks(), filter=1),
        TypeError,
        'Texture has no parameter "filter"; did you mean "filtering"?',
    ),
    (
        lambda: snell.Scene().add_shape("sphere", radius=1, material="red"),
        TypeError,
        "material is 'red', expected a Material",
    ),
    (
        lambda: snell.Scene().add_mesh([[0, 0, 0]], [[0, 0, 0]], material_ids=[0, 1]),
        ValueError,
        r"material_ids: shape is \(2,\), expected \(1,\)",
    ),
    (lambda: setattr(snell.Scene(), "lights", [3]), TypeError, r"lights\[0\] is 3"),
    (
        lambda: setattr(snell.Scene(), "background", "rot"),
        TypeError,
        "background is 'rot', expected a colour",
    ),
    (
        lambda: setattr(snell.Scene(), "environment", -1),
        ValueError,
        "environment: a colour has no negative numbers",
    ),
]


@pytest.mark.parametrize(("call", "error", "message"), BAD, ids=[message for _, _, message in BAD])
def test_bad_arguments_are_named(call, error, message):
    with pytest.raises(error, match=message):
        call()
