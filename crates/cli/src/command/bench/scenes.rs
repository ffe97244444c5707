//! The scenes that are measured: files, built-in scenes and two generated ones, each optionally
//! refined, copied or instanced.

mod generate;

use crate::failure::Failure;
use crate::resources::admit_scene;
use crate::scene_source;
use snell_formats::ReadOptions;
use snell_formats::error::one_line;
use snell_intersect::{BuildOptions, Geometry, GroupId, TriangleMesh, World, WorldBuilder};
use snell_math::{Bounds3d, DAffine3, DVec3, Transform, Vec3, real, rng, rotation};
use snell_render::CompiledScene;
use snell_scene::framing::{self, FramingOptions};
use snell_scene::{Background, Camera, Node, Scene, Surface};
use std::collections::HashMap;
use std::sync::Arc;

/// A scene to be measured.
pub struct Bench {
    /// The name of the scene on the command line.
    pub name: String,
    /// The geometry, without an acceleration structure: see [`super::variants::rebuilt`].
    pub world: World,
    /// The camera of primary rays.
    pub camera: Camera,
    /// The target of shadow rays.
    pub light: Vec3,
}

/// A change to a scene before it is measured: `NAME:subdivide=2`, `NAME:copies=145`,
/// `NAME:instances=145`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// Cuts each triangle into four, `N` times; the surface stays the same.
    Subdivide(u32),
    /// Rotated and spread copies, all in one mesh.
    Copies(u32),
    /// The copies of [`Change::Copies`] as instances.
    Instances(u32),
}

/// Splits a name into the scene and the change.
fn parse(name: &str) -> Result<(&str, Option<Change>), Failure> {
    let Some((scene, change)) = name.rsplit_once(':') else { return Ok((name, None)) };
    let Some((word, number)) = change.split_once('=') else { return Ok((name, None)) };
    let (make, most): (fn(u32) -> Change, u32) = match word {
        "subdivide" => (Change::Subdivide, 8),
        "copies" => (Change::Copies, 100_000),
        "instances" => (Change::Instances, 10_000_000),
        _ => {
            return Err(Failure::Usage(format!(
                "{name}: the possible changes are subdivide=N, copies=N or instances=N"
            )));
        }
    };
    match number.parse() {
        Ok(n) if (1..=most).contains(&n) => Ok((scene, Some(make(n)))),
        _ => Err(Failure::Usage(format!("{name}: {word} takes a number from 1 to {most}"))),
    }
}

/// Checks the name of a scene quickly, so that a benchmark of many scenes does not fail late.
pub fn check(name: &str) -> Result<(), Failure> {
    parse(name).map(|_| ())
}

/// The name of a scene without its folders, for tables.
pub fn short_name(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// Loads or generates the scene of this name, with a camera. Generated scenes return their light
/// separately.
pub fn load_scene(name: &str, read: &ReadOptions) -> Result<(Scene, Option<Vec3>), Failure> {
    let (base, change) = parse(name)?;
    let (mut scene, light) = match base {
        "terrain" => generate::terrain(),
        "room" => generate::room(),
        _ => (scene_source::load(base.as_ref(), read)?, None),
    };
    if let Some(change) = change {
        scene = changed(&compile(base, &scene)?, change);
    }
    let framing = FramingOptions { size: [1024; 2], ..FramingOptions::default() };
    framing::prepare(&mut scene, &framing).map_err(|e| Failure::Scene(format!("{name}: {e}")))?;
    // Other programs draw no shadow outside of the scene.
    if matches!(scene.background, Background::ShadowCatcher(_)) {
        scene.background = Background::Color(framing::DEFAULT_BACKGROUND);
    }
    Ok((scene, light))
}

/// The camera of a scene.
pub fn camera(name: &str, scene: &Scene) -> Result<Camera, Failure> {
    scene
        .cameras
        .first()
        .cloned()
        .ok_or_else(|| Failure::Scene(format!("{name}: the scene has no camera")))
}

/// Loads or generates the scene of this name, ready for rays.
pub fn load(name: &str, read: &ReadOptions) -> Result<Bench, Failure> {
    let (scene, light) = load_scene(name, read)?;
    let camera = camera(name, &scene)?;
    let world = compile(name, &scene)?;
    if world.bounds().is_empty() {
        let why = scene
            .warnings
            .first()
            .map_or(String::new(), |w| format!(" ({})", one_line(&w.message)));
        return Err(Failure::Scene(format!(
            "{name}: the scene has no surfaces to trace rays at{why}; name another one"
        )));
    }
    let light = light.unwrap_or_else(|| light_above(&world.bounds(), camera.eye));
    Ok(Bench { name: name.into(), world, camera, light })
}

fn compile(name: &str, scene: &Scene) -> Result<World, Failure> {
    let options = BuildOptions {
        accelerator: snell_intersect::AcceleratorKind::None,
        ..BuildOptions::default()
    };
    admit_scene(name, scene)?;
    let compiled =
        CompiledScene::new(scene, &options).map_err(|e| Failure::Scene(format!("{name}: {e}")))?;
    let shared = || Failure::Other(format!("{name}: the world is in use elsewhere"));
    Arc::into_inner(compiled.world).ok_or_else(shared)
}

/// The position of a point light: above the corner of a scene that is seen from outside, below the
/// ceiling of one that is seen from inside.
fn light_above(bounds: &Bounds3d, eye: DVec3) -> Vec3 {
    if bounds.is_empty() || !bounds.is_finite() {
        return (eye + DVec3::Y).as_vec3();
    }
    let (center, size) = (bounds.center(), bounds.size());
    let light = if bounds.contains(eye) {
        DVec3::new(center.x, bounds.max.y - 0.05 * size.y, center.z)
    } else {
        bounds.max + bounds.radius()
    };
    light.as_vec3()
}

fn changed(world: &World, change: Change) -> Scene {
    let mesh = merged(world);
    let mut scene = Scene::new("");
    match change {
        Change::Subdivide(times) => {
            let mesh = (0..times).fold(mesh, |mesh, _| subdivided(&mesh));
            scene.nodes[0].surfaces.push(surface(mesh));
        }
        Change::Copies(n) => {
            let placed = (0..n).map(|i| place(i, n, &mesh));
            let mesh = joined(placed.map(|at| mesh.transformed(&at)));
            scene.nodes[0].surfaces.push(surface(mesh));
        }
        Change::Instances(n) => {
            let surfaces = vec![surface(mesh.clone())];
            for i in 0..n {
                let transform = *place(i, n, &mesh).matrix();
                scene.add_child(
                    scene.root,
                    Node { transform, surfaces: surfaces.clone(), ..Node::default() },
                );
            }
        }
    }
    scene
}

fn surface(mesh: TriangleMesh) -> Surface {
    Surface::new(snell_scene::Geometry::Mesh(Arc::new(mesh)))
}

/// All triangles of a world in one mesh, positions only.
pub fn merged(world: &World) -> TriangleMesh {
    let mut meshes = Vec::new();
    let mut stack: Vec<(GroupId, Transform)> = vec![(WorldBuilder::ROOT, Transform::IDENTITY)];
    while let Some((group, placed)) = stack.pop() {
        let contents = world.group(group);
        for &id in &contents.geometries {
            if let Geometry::Mesh(mesh) = world.geometry(id) {
                let (positions, indices) = (mesh.positions.clone(), mesh.indices.clone());
                meshes.push(
                    TriangleMesh { positions, indices, ..TriangleMesh::default() }
                        .transformed(&placed),
                );
            }
        }
        stack.extend(
            contents.instances.iter().map(|i| (i.child, placed.compose(&i.group_from_child))),
        );
    }
    joined(meshes)
}

/// Several meshes as one, positions only.
fn joined(meshes: impl IntoIterator<Item = TriangleMesh>) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(mesh.positions);
        all.indices.extend(mesh.indices.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// The transform of copy `i` of `n`: randomly rotated, and spread in a cube that keeps the density.
fn place(i: u32, n: u32, mesh: &TriangleMesh) -> Transform {
    let u = |k: u32| f64::from(rng::to_unit(rng::pcg4d([i, k, 0, 0])[0]));
    let bounds = Bounds3d::from(mesh.bounds());
    let turn = rotation::about(DVec3::new(u(0), u(1), u(2) + 0.1).normalize(), u(3) * 6.0);
    let spread = bounds.size().max_element() * real::cbrt(f64::from(n)) * 0.7;
    let offset = DVec3::new(u(4), u(5), u(6)) * spread;
    let map = DAffine3::from_mat3_translation(turn, offset - turn * bounds.center());
    // A rotation is never singular; a mesh that is not finite is never hit anyway.
    Transform::new(map).unwrap_or(Transform::IDENTITY)
}

/// Cuts each triangle into four at the midpoints of its sides. Shared edges stay shared.
pub fn subdivided(mesh: &TriangleMesh) -> TriangleMesh {
    let mut positions = mesh.positions.clone();
    let mut middles: HashMap<(u32, u32), u32> = HashMap::with_capacity(mesh.indices.len() * 3 / 2);
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            positions.push((mesh.positions[a as usize] + mesh.positions[b as usize]) * 0.5);
            positions.len() as u32 - 1
        })
    };
    let mut indices = Vec::with_capacity(mesh.indices.len() * 4);
    for &[a, b, c] in &mesh.indices {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        indices.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    TriangleMesh { positions, indices, ..TriangleMesh::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriangleMesh {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let indices = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        TriangleMesh { positions, indices, ..TriangleMesh::default() }
    }

    #[test]
    fn a_subdivided_mesh_stays_closed() {
        let mesh = subdivided(&subdivided(&tetrahedron()));
        assert_eq!(mesh.indices.len(), 4 * 16);
        // By Euler's formula, the number of vertices is half the number of triangles, plus two.
        assert_eq!(mesh.positions.len(), 4 * 16 / 2 + 2);
    }

    #[test]
    fn names_say_what_is_done() {
        assert!(matches!(parse("a:b.ply"), Ok(("a:b.ply", None))));
        assert!(matches!(parse("a.ply:copies=145"), Ok(("a.ply", Some(Change::Copies(145))))));
        assert!(parse("a.ply:copies=0").is_err());
        assert!(parse("a.ply:turn=1").is_err());
    }

    #[test]
    fn copies_and_instances_are_the_same_triangles() {
        let mut scene = Scene::new("");
        scene.nodes[0].surfaces.push(surface(subdivided(&subdivided(&tetrahedron()))));
        let world = compile("test", &scene).expect("a mesh");
        let count = |change| {
            let world = compile("test", &changed(&world, change)).expect("meshes");
            (world.instanced_triangle_count(), world.bounds())
        };
        let (copies, instances) = (count(Change::Copies(5)), count(Change::Instances(5)));
        assert_eq!((copies.0, instances.0), (320, 320));
        // Bounds of instances are those of rotated boxes; vertices of copies are rounded.
        let slack = 1e-5;
        assert!(
            instances.1.contains(copies.1.min + slack)
                && instances.1.contains(copies.1.max - slack)
        );
    }
}
