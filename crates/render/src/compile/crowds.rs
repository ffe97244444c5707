//! Instances of instances that overlap: nesting multiplies what a ray enters, so that a small file
//! may hold more than any ray gets through.

use super::{CompileError, SurfaceTable};
use snell_intersect::{GroupId, World, WorldError};
use snell_math::{Bounds3d, DVec3, Ray, Vec3, rng};
use snell_scene::{Scene, Warning};

/// Worlds with fewer occurrences are not tried: their rays cannot enter many instances.
const FEW: u32 = SLOW;
/// The number of rays that are traced.
const RAYS: u32 = 8;
/// From this mean number of instances per ray on, there is a warning. A ray through a forest of a
/// billion trees enters a few hundred.
const SLOW: u32 = 1 << 14;
/// From this mean number of instances per ray on, about a twentieth of a second for each, a picture
/// would take days.
const ENDLESS: u32 = 1 << 19;

/// Traces a few rays towards random occurrences, most of which are where most instances are. If
/// rays enter very many instances, adds a warning; if they enter so many that no picture would ever
/// be done, returns an error.
pub(super) fn check(
    scene: &Scene,
    world: &World,
    surfaces: &SurfaceTable,
    warnings: &mut Vec<Warning>,
) -> Result<(), CompileError> {
    let count = world.instance_count();
    if count < FEW {
        return Ok(());
    }
    let (mut entered, mut worst) = (0, (0, 0));
    for number in 0..RAYS {
        let occurrence = rng::hash_combine(number, 54) % count;
        let n = world.instances_entered(&towards(world, occurrence, number), RAYS * ENDLESS);
        entered += u64::from(n);
        worst = worst.max((n, occurrence));
        if entered >= u64::from(RAYS) * u64::from(ENDLESS) {
            break;
        }
    }
    let mean = entered / u64::from(RAYS);
    if mean < u64::from(SLOW) {
        return Ok(());
    }
    let place = place(scene, world, surfaces, worst.1);
    let remedy = "move them apart, nest them less deeply, or remove copies at the same place";
    if mean >= u64::from(ENDLESS) {
        return Err(CompileError::World(WorldError::Limit(format!(
            "instances{place} overlap so much that a ray enters more than {ENDLESS} of them, and a \
                picture would never be finished; {remedy}"
        ))));
    }
    let message = format!(
        "instances{place} overlap so much that a ray enters about {mean} of them, which is slow; \
            {remedy}"
    );
    Warning::note(warnings, message, 1);
    Ok(())
}

/// A ray from outside of the world towards an occurrence.
fn towards(world: &World, occurrence: u32, number: u32) -> Ray {
    let inside = group_of(world, occurrence).map_or(Bounds3d::EMPTY, |id| world.group_bounds(id));
    let inside = super::finite_part(&inside);
    let inside = if inside.is_empty() { DVec3::ZERO } else { inside.center() };
    let target = world.world_from_instance(occurrence).point(inside);
    let uniform = |i| f64::from(rng::to_unit(rng::hash_combine(number, i))) - 0.5;
    // Not along an axis, where flat things are not met.
    let direction = DVec3::new(uniform(1), uniform(2), uniform(3)) + DVec3::splat(1e-3);
    let bounds = super::finite_part(&world.bounds());
    let far = (bounds.center() - target).length() + 2.0 * bounds.radius();
    let direction = direction.normalize_or(DVec3::Z);
    let origin: Vec3 = (target - direction * far).as_vec3();
    Ray::new(origin, direction.as_vec3())
}

/// The group of an occurrence; none for the root.
fn group_of(world: &World, occurrence: u32) -> Option<GroupId> {
    let (parent, at) = world.instance_path(occurrence).pop()?;
    Some(world.group(parent).instances.get(at)?.child)
}

/// The place of an occurrence in the scene graph, as a part of a sentence.
fn place(scene: &Scene, world: &World, surfaces: &SurfaceTable, occurrence: u32) -> String {
    const MOST: usize = 4;
    let Some(id) = group_of(world, occurrence) else { return String::new() };
    let Some(geometry) = world.group(id).geometries.first() else { return String::new() };
    let path = surfaces.node_path(world, occurrence, geometry.0);
    let names = path.iter().map(|&node| scene.nodes[node.index()].name.as_str());
    let mut names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    if names.is_empty() {
        return String::new();
    }
    let rest = if names.len() > MOST { " > ..." } else { "" };
    names.truncate(MOST);
    format!(" in node \"{}\"{rest}", names.join(" > "))
}

#[cfg(test)]
mod tests {
    use crate::compile::CompiledScene;
    use snell_intersect::BuildOptions;
    use snell_intersect::shape::{AnyShape, Sphere};
    use snell_math::DAffine3;
    use snell_scene::{Geometry, Node, Scene, Surface};

    /// A ball below `depth` nodes, each of which is placed twice in the next, `step` apart at
    /// first and twice as far at each further level.
    fn doubled(depth: u32, step: f64) -> Scene {
        let mut scene = Scene::new("doubled");
        let ball = AnyShape::Sphere(Sphere { radius: 1.0 });
        let mut below = scene.add_node(Node {
            surfaces: vec![Surface::new(Geometry::Shape(ball.into()))],
            ..Node::named("ball")
        });
        for level in 0..depth {
            let pair = match level + 1 == depth {
                true => scene.root,
                false => scene.add_node(Node::named(format!("level {level}"))),
            };
            for side in [-0.5, 0.5] {
                let x = side * step * f64::from(level).exp2();
                let transform = DAffine3::from_translation(snell_math::DVec3::new(x, 0.0, 0.0));
                let place = scene.add_child(pair, Node { transform, ..Node::default() });
                scene.nodes[place.index()].children.push(below);
            }
            below = pair;
        }
        scene
    }

    fn compiled(depth: u32, step: f64) -> Result<CompiledScene, String> {
        CompiledScene::new(&doubled(depth, step), &BuildOptions::default())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn instances_that_overlap_without_end_are_an_error_and_others_are_not() {
        let start = std::time::Instant::now();
        let error = compiled(30, 1e-9).map(|_| ()).expect_err("a billion balls at one place");
        assert!(error.contains("level") && error.contains("nest them less deeply"), "{error}");
        let slow = compiled(16, 1e-9).expect("65536 balls at one place");
        assert!(slow.warnings.iter().any(|w| w.message.contains("slow")), "{:?}", slow.warnings);
        for (depth, step) in [(30, 3.0), (4, 1e-9)] {
            let good = compiled(depth, step).expect("balls side by side, and few");
            assert!(good.warnings.is_empty(), "{:?}", good.warnings);
        }
        assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
    }
}
