//! Adds a camera and a sky to scenes that have none, so that a bare mesh gives a good picture.

mod air;
mod colors;
mod emission;
mod extent;
mod far;
mod fit;
mod sky;
mod upright;

pub use air::fill_with_fog;
pub use colors::show_colors;
pub use far::{bring_near, far_origin};
pub use fit::frame;
pub use sky::{default_sky, sky_seen_by};
pub use upright::{stand_up, turned, upright};

use crate::camera::Camera;
use crate::graph::{Background, MediumId, NodeId, Scene, SceneError, ShadowCatcher, WarningKind};
use crate::material::{Diffuse, Material};
use crate::medium::Medium;
use crate::motion::Pose;
use snell_math::{Bounds3d, DVec3, Rgb, Transform};
use std::collections::BTreeMap;

/// The default material, a grey one, for surfaces without a material.
pub fn default_material() -> Material {
    Material::new("default", Diffuse::new(Rgb::splat(0.55)))
}

/// The colour of the default background: a dark grey, from which white objects stand out, and on
/// which shadows are visible.
pub const DEFAULT_BACKGROUND: Rgb = Rgb::splat(0.2);

/// Defaults that [`prepare`] uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramingOptions {
    /// The up direction, unless the scene's settings have one. Most formats have `+y` up; `+z` is
    /// common in STL and CAD.
    pub up: DVec3,
    /// Size of the picture in pixels, unless the scene's settings have one.
    pub size: [u32; 2],
    /// True if a scene far from zero may be moved near it. The caller must then have no positions
    /// in the world but those of the scene.
    pub may_move: bool,
}

impl Default for FramingOptions {
    fn default() -> Self {
        Self { up: DVec3::Y, size: [640, 480], may_move: false }
    }
}

/// Adds the parts that a picture needs and the scene lacks: a camera that frames the finite
/// surfaces, and the default sky if nothing emits light (no lights, no environment, no emissive
/// material or medium in use). With the sky comes a background of [`DEFAULT_BACKGROUND`] that shows
/// the scene's shadow on a floor, unless the scene has a background. A scene far from zero is moved
/// near it ([`bring_near`]) with a warning, if the options allow it. Any other complete scene is
/// unchanged.
pub fn prepare(scene: &mut Scene, options: &FramingOptions) -> Result<(), SceneError> {
    prepare_for(scene, &[], options)
}

/// Does what [`prepare`] does, except that an added camera frames the scene in all of these poses
/// instead of its current state.
pub fn prepare_for(
    scene: &mut Scene,
    poses: &[Pose],
    options: &FramingOptions,
) -> Result<(), SceneError> {
    let order = scene.topological_order()?;
    if options.may_move
        && let Some(by) = bring_near(scene)?
    {
        let message = format!(
            "the scene is far from zero for its size, where single precision holds no details: it \
            is shown moved by {} {} {}",
            by.x, by.y, by.z
        );
        scene.warn_of(WarningKind::Choice, message);
    }
    let up = scene.settings.up.unwrap_or(options.up);
    if scene.cameras.is_empty() {
        let [w, h] = scene.settings.size.unwrap_or(options.size).map(|s| f64::from(s.max(1)));
        let camera = of_poses(scene, poses, |scenes| camera_for(scenes, &order, up, w / h));
        scene.cameras.push(camera);
    }
    if scene.lights.is_empty() && scene.environment.is_none() && !uses_emission(scene, &order) {
        add_studio(scene, poses, &order, up);
    }
    Ok(())
}

/// Adds the default sky and background to a scene that only its own emission would light, if its
/// emission is too weak to see other surfaces by. It is for formats whose files are made for
/// programs with lighting of their own; `least` is the radiance from which on a surface counts as a
/// lamp. A scene without emission stays as it is, because [`prepare`] lights it.
pub fn light_unless_lit(scene: &mut Scene, up: DVec3, least: f32) {
    let Ok(order) = scene.topological_order() else { return };
    let up = scene.settings.up.unwrap_or(up);
    let is_lit = !scene.lights.is_empty() || scene.environment.is_some();
    if is_lit || !uses_emission(scene, &order) {
        return;
    }
    if !emission::lights_scene(scene, &finite_bounds(scene, &order), least) {
        add_studio(scene, &[], &order, up);
    }
}

/// The background of scenes without light: [`DEFAULT_BACKGROUND`], with a floor under the lowest
/// point of the scene that shows the scene's shadow. A graph with a cycle has no lowest point, and
/// its floor goes through the origin.
pub fn studio_background(scene: &Scene, up: DVec3) -> Background {
    let up = scene.settings.up.unwrap_or(up);
    let order = scene.topological_order().unwrap_or_default();
    floor_under(&[scene], &order, up)
}

/// Lights a scene with the default sky, as the first camera sees it. Unless the scene has a
/// background, it gets one with a floor under the lowest point in all of these poses.
fn add_studio(scene: &mut Scene, poses: &[Pose], order: &[NodeId], up: DVec3) {
    let seen = |camera| sky_seen_by(camera, up);
    scene.environment = Some(scene.cameras.first().map_or_else(default_sky, seen));
    if scene.background == Background::Environment {
        scene.background = of_poses(scene, poses, |scenes| floor_under(scenes, order, up));
    }
}

/// Calls `f` with the scene in each of these poses, or as it is if there are none.
fn of_poses<T>(scene: &Scene, poses: &[Pose], f: impl FnOnce(&[&Scene]) -> T) -> T {
    let posed: Vec<Scene> = poses.iter().map(|pose| posed(scene, pose)).collect();
    let shown: Vec<&Scene> = if posed.is_empty() { vec![scene] } else { posed.iter().collect() };
    f(&shown)
}

/// A background with a floor under the lowest point of all of these scenes, which have the same
/// nodes. Without any point the floor goes through the origin.
fn floor_under(scenes: &[&Scene], order: &[NodeId], up: DVec3) -> Background {
    let up = up.try_normalize().filter(|u| u.is_finite()).unwrap_or(DVec3::Y);
    let depths = scenes.iter().filter(|_| !order.is_empty()).map(|scene| {
        let bounds = finite_bounds(scene, order);
        extent::extent_of_scene(scene, &bounds, &[-up; 4]).reach[0]
    });
    let height = -depths.fold(f64::NEG_INFINITY, f64::max);
    let height = if height.is_finite() { height } else { 0.0 };
    Background::ShadowCatcher(ShadowCatcher { color: DEFAULT_BACKGROUND, up, height })
}

/// A scene that has the nodes of `scene` in a pose, and nothing else.
fn posed(scene: &Scene, pose: &Pose) -> Scene {
    let mut posed = Scene { nodes: scene.nodes.clone(), root: scene.root, ..Scene::default() };
    posed.apply(pose);
    posed
}

/// A camera that frames all of these scenes, which have the same nodes.
fn camera_for(scenes: &[&Scene], order: &[NodeId], up: DVec3, aspect: f64) -> Camera {
    let bounds: Vec<_> = scenes.iter().map(|scene| finite_bounds(scene, order)).collect();
    let all = || scenes.iter().zip(&bounds);
    let boxes = all().map(|(scene, bounds)| placed(scene, scene.root, &bounds[&scene.root]));
    let world = boxes.fold(Bounds3d::EMPTY, |a, b| a.union(&b));
    fit::frame_content(&world, up, aspect, |directions| {
        let extents =
            all().map(|(scene, bounds)| extent::extent_of_scene(scene, bounds, directions));
        extents.fold(fit::Extent::EMPTY, fit::Extent::union)
    })
}

/// The bounds of the bounded surfaces at and below each node, in the node's coordinates. `order`
/// has children before parents.
fn finite_bounds(scene: &Scene, order: &[NodeId]) -> BTreeMap<NodeId, Bounds3d> {
    let mut bounds: BTreeMap<NodeId, Bounds3d> = BTreeMap::new();
    for &id in order {
        let node = &scene.nodes[id.index()];
        let own = node.surfaces.iter().map(|s| s.geometry.bounds()).filter(Bounds3d::is_finite);
        let below = node.children.iter().map(|child| placed(scene, *child, &bounds[child]));
        let all = own.chain(below).fold(Bounds3d::EMPTY, |a, b| a.union(&b));
        bounds.insert(id, all);
    }
    bounds
}

/// The box of a node in the coordinates of its parent; empty if it is not finite there.
fn placed(scene: &Scene, id: NodeId, own: &Bounds3d) -> Bounds3d {
    let bounds = Transform::new(scene.nodes[id.index()].transform)
        .map_or(Bounds3d::EMPTY, |m| m.bounds(own));
    if bounds.is_finite() { bounds } else { Bounds3d::EMPTY }
}

/// True if any material in use emits light, or any medium around the scene or inside of a surface.
fn uses_emission(scene: &Scene, order: &[NodeId]) -> bool {
    let glows = |id: MediumId| scene.media.get(id.index()).is_some_and(Medium::is_emissive);
    order.iter().any(|id| {
        let node = &scene.nodes[id.index()];
        let of_surfaces = node.surfaces.iter().flat_map(|s| s.materials.iter().flatten());
        of_surfaces.chain(&node.material).any(|m| {
            let material = &scene.materials[m.index()];
            let inside = material.interior.and_then(|interior| interior.medium);
            material.is_emissive() || inside.is_some_and(glows)
        })
    }) || scene.medium.is_some_and(glows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Projection;
    use crate::graph::{Environment, Geometry, Node, Surface};
    use crate::light::Directional;
    use crate::medium::Homogeneous;
    use snell_intersect::TriangleMesh;
    use snell_intersect::shape::Sphere;
    use snell_math::{DAffine3, Vec3};
    use std::sync::Arc;

    fn ball() -> Scene {
        let mut scene = Scene::new("ball");
        let sphere = Geometry::Shape(Arc::new(Sphere { radius: 2.0 }.into()));
        let transform = DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0));
        scene.add_child(
            scene.root,
            Node { transform, surfaces: vec![Surface::new(sphere)], ..Node::default() },
        );
        scene
    }

    #[test]
    fn a_bare_object_gets_a_camera_a_sky_and_a_background() {
        let mut scene = ball();
        prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
        let camera = &scene.cameras[0];
        let center = camera.project(DVec3::new(5.0, 0.0, 0.0), [640, 480]).expect("in view");
        assert!((center - snell_math::DVec2::new(320.0, 240.0)).length() < 30.0, "{center}");
        assert!(matches!(scene.environment, Some(Environment::Image { .. })));
        let floor = ShadowCatcher { color: DEFAULT_BACKGROUND, up: DVec3::Y, height: -2.0 };
        assert_eq!(scene.background, Background::ShadowCatcher(floor));
        let again = scene.clone();
        prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
        assert_eq!(scene.cameras, again.cameras);
    }

    #[test]
    fn a_scene_with_light_keeps_it() {
        let mut lit = ball();
        lit.add_light(Directional { direction: DVec3::NEG_Y, irradiance: Rgb::WHITE });
        let mut surrounded = ball();
        surrounded.environment = Some(Environment::Constant(Rgb::WHITE));
        let mut glowing = ball();
        let lamp = glowing.add_material(default_material().emitting(Rgb::WHITE));
        glowing.nodes[1].material = Some(lamp);
        let fire = Homogeneous { emission: Rgb::WHITE, ..Homogeneous::absorbing(Rgb::WHITE) };
        let mut burning = ball();
        let fire_inside = burning.add_medium(fire.clone());
        let hearth = burning.add_material(Material::interface("hearth", fire_inside));
        burning.nodes[1].material = Some(hearth);
        let mut in_fire = ball();
        in_fire.medium = Some(in_fire.add_medium(fire));
        for mut scene in [lit, surrounded, glowing, burning, in_fire] {
            prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
            assert!(!matches!(scene.environment, Some(Environment::Image { .. })));
            assert_eq!((scene.background, scene.cameras.len()), (Background::Environment, 1));
        }
    }

    #[test]
    fn an_emissive_material_that_nothing_uses_is_no_light() {
        let mut scene = ball();
        scene.add_material(default_material().emitting(Rgb::WHITE));
        prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
        assert!(scene.environment.is_some());
    }

    #[test]
    fn weak_emission_is_seen_in_the_studio_and_strong_emission_alone() {
        let with_lamp = |radius: f64, emission: f32| {
            let mut scene = ball();
            let lamp = scene.add_material(default_material().emitting(Rgb::splat(emission)));
            let sphere = Geometry::Shape(Arc::new(Sphere { radius }.into()));
            let surfaces = vec![Surface::with_material(sphere, lamp)];
            scene.add_child(scene.root, Node { surfaces, ..Node::default() });
            light_unless_lit(&mut scene, DVec3::Y, 1.0);
            scene.environment.is_none()
        };
        assert!(with_lamp(0.5, 20.0), "a lamp");
        assert!(!with_lamp(0.5, 1.0), "a display");
        assert!(!with_lamp(0.01, 20.0), "a filament");
        let mut dark = ball();
        light_unless_lit(&mut dark, DVec3::Y, 1.0);
        assert!(dark.environment.is_none(), "a scene without emission is left to `prepare`");
    }

    #[test]
    fn the_floor_lies_under_the_lowest_point_of_all_poses() {
        let mut scene = ball();
        let lower = DAffine3::from_translation(DVec3::new(5.0, -7.0, 0.0));
        let transforms = BTreeMap::from([(NodeId(1), lower)]);
        let pose = Pose { transforms, ..Pose::default() };
        prepare_for(&mut scene, &[Pose::default(), pose], &FramingOptions::default())
            .expect("no cycle");
        let Background::ShadowCatcher(floor) = scene.background else { panic!("a floor") };
        assert_eq!(floor.height, -9.0);
    }

    #[test]
    fn the_files_own_camera_and_background_stay() {
        let mut scene = ball();
        let own = Camera::from_target(DVec3::ONE, DVec3::ZERO, DVec3::Y, Projection::Panoramic);
        scene.cameras.push(own.clone());
        scene.background = Background::Transparent;
        prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
        assert_eq!((scene.cameras, scene.background), (vec![own], Background::Transparent));
    }

    #[test]
    fn unbounded_surfaces_do_not_decide_the_view() {
        let mut scene = ball();
        let huge = TriangleMesh {
            positions: vec![Vec3::splat(-f32::MAX), Vec3::splat(f32::MAX), Vec3::X],
            indices: vec![[0, 1, 2]],
            ..TriangleMesh::default()
        };
        // The transform makes the bounds infinite.
        let transform = DAffine3::from_scale(DVec3::splat(1e300));
        let surfaces = vec![Surface::new(Geometry::Mesh(Arc::new(huge)))];
        scene.add_child(scene.root, Node { transform, surfaces, ..Node::default() });
        prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
        assert!(scene.cameras[0].eye.distance(DVec3::new(5.0, 0.0, 0.0)) < 20.0);
    }

    #[test]
    fn an_empty_scene_and_a_broken_graph_are_handled() {
        let mut empty = Scene::new("empty");
        prepare(&mut empty, &FramingOptions::default()).expect("no cycle");
        assert!(empty.cameras[0].eye.is_finite());
        let mut cyclic = Scene::new("cyclic");
        let root = cyclic.root;
        cyclic.nodes[0].children.push(root);
        assert!(prepare(&mut cyclic, &FramingOptions::default()).is_err());
    }
}
