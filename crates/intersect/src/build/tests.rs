//! Tests trees of every quality against a search without a tree.

use super::*;
use crate::hit::Hit;
use crate::kernel::list::tests::quads;
use crate::mesh::TriangleMesh;
use crate::search::{AcceptAll, Grouping};
use crate::shape::Sphere;
use crate::tree::Forest;
use crate::world::{AcceleratorKind, BuildOptions, Structure, World, WorldBuilder};
use snell_math::simd::Level;
use snell_math::{DVec3, Ray, Transform, Vec3, rng};
use std::sync::Arc;

/// Uniform in -1 to 1.
fn signed(i: u32, k: u32, seed: u32) -> f32 {
    2.0 * rng::to_unit(rng::pcg4d([i, k, seed, 77])[0]) - 1.0
}

fn vector(i: u32, k: u32, seed: u32) -> Vec3 {
    Vec3::new(signed(i, k, seed), signed(i, k + 1, seed), signed(i, k + 2, seed))
}

/// Triangles of all sizes and shapes, some of them coincident, flat along an axis, slivers, or
/// degenerate.
pub(super) fn soup(n: u32, seed: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..n {
        let at = vector(i, 0, seed) * 10.0;
        let size = 3.0f32.powf(-1.0 + 2.0 * signed(i, 3, seed));
        let (a, b) = (vector(i, 4, seed) * size, vector(i, 7, seed) * size);
        let corners = match i % 7 {
            0 => [at, at + a * 20.0, at + a * 20.0 + b * 0.01],
            1 => [
                at,
                Vec3::new(at.x, at.y + a.y, at.z + a.z),
                Vec3::new(at.x, at.y + b.y, at.z + b.z),
            ],
            2 if i % 3 == 0 => [at, at + a, at + a * 2.0],
            _ => [at, at + a, at + b],
        };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.indices.push([first, first + 1, first + 2]);
        if i % 11 == 0 {
            mesh.indices.push([first + 1, first + 2, first]);
        }
    }
    mesh
}

/// Random rays, many of them through vertices and edges, or along an axis.
fn rays(mesh: &TriangleMesh, n: u32) -> Vec<Ray> {
    let bounds = mesh.bounds();
    let (center, size) = (bounds.center(), bounds.size());
    let ray = |i: u32| {
        let origin = center + vector(i, 0, 5) * size * 0.7;
        let vertex = mesh.positions[(rng::hash32(i) % mesh.positions.len() as u32) as usize];
        let direction = match i % 4 {
            0 => vector(i, 3, 5),
            1 => [Vec3::X, -Vec3::Y, Vec3::Z][i as usize % 3],
            _ => vertex - origin,
        };
        Ray::new(origin, direction)
    };
    (0..n).map(ray).collect()
}

fn bits(h: &Hit) -> [u32; 6] {
    [h.t.to_bits(), h.uv.x.to_bits(), h.uv.y.to_bits(), h.instance, h.geometry, h.primitive]
}

fn world_of(meshes: &[Arc<TriangleMesh>], options: &BuildOptions) -> World {
    let mut builder = WorldBuilder::default();
    for mesh in meshes {
        builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
    }
    builder.build(options).expect("a world")
}

/// Options for every quality, compact or not, each with a name.
fn ways() -> impl Iterator<Item = (BuildOptions, String)> {
    let both = |quality| {
        [false, true].map(|compact| BuildOptions { quality, compact, ..BuildOptions::default() })
    };
    Quality::ALL.into_iter().flat_map(both).map(|options| {
        let name = format!("{:?}, compact: {}", options.quality, options.compact);
        (options, name)
    })
}

fn none() -> BuildOptions {
    BuildOptions { accelerator: AcceleratorKind::None, ..BuildOptions::default() }
}

/// Checks that both worlds give the same results for every query of the rays.
fn assert_equal(world: &World, oracle: &World, rays: &[Ray], what: &str) {
    let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    world.occluded(rays, Grouping::None, &AcceptAll, &mut blocked);
    for (i, ray) in rays.iter().enumerate() {
        let expected = oracle.all_one(ray, &AcceptAll);
        let first = expected.first().copied().unwrap_or(Hit::MISS);
        assert_eq!(bits(&hits[i]), bits(&first), "{what} {ray:?}");
        assert_eq!(blocked[i], first.is_hit(), "{what} {ray:?}");
        let all = world.all_one(ray, &AcceptAll);
        assert_eq!(
            all.iter().map(bits).collect::<Vec<_>>(),
            expected.iter().map(bits).collect::<Vec<_>>(),
            "{what}"
        );
    }
}

#[test]
fn every_quality_finds_what_is_there_at_every_scale() {
    for (scale, offset) in
        [(1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1.0, 1e5), (1e-20, 0.0), (1e18, 0.0)]
    {
        for n in [1, 5, 9, 40, 700] {
            let mut mesh = soup(n, 3 + n);
            mesh.positions.iter_mut().for_each(|p| *p = *p * scale + Vec3::splat(offset));
            let rays = rays(&mesh, 400);
            let meshes = [Arc::new(mesh)];
            let oracle = world_of(&meshes, &none());
            for (options, name) in ways() {
                let world = world_of(&meshes, &options);
                assert_equal(
                    &world,
                    &oracle,
                    &rays,
                    &format!("{name}, {n} triangles, {scale} {offset}"),
                );
            }
        }
    }
}

#[test]
fn shapes_and_several_meshes_share_a_tree() {
    let (a, b) = (Arc::new(soup(100, 1)), Arc::new(soup(50, 2)));
    let make = |options: &BuildOptions| {
        let mut builder = WorldBuilder::default();
        for i in 0..40u32 {
            let at = Transform::translation(vector(i, 0, 9).as_dvec3() * 10.0);
            builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 0.7 }), at);
            if i % 20 == 0 {
                builder.add_mesh(WorldBuilder::ROOT, a.clone());
            }
        }
        let group = builder.add_group();
        builder.add_mesh(group, b.clone());
        for x in [-8.0, 8.0] {
            builder.add_instance(WorldBuilder::ROOT, group, Transform::translation(DVec3::X * x));
        }
        builder.build(options).expect("a world")
    };
    let rays = rays(&a, 1000);
    let oracle = make(&none());
    for (options, name) in ways() {
        assert_equal(&make(&options), &oracle, &rays, &name);
    }
}

/// Everything in a tree that affects rays.
fn contents(world: &World) -> (Vec<[u32; 64]>, Vec<u8>) {
    let Structure::Bvh(forest) = &world.structure else { panic!("a tree") };
    let tree = &forest.trees[0];
    let node = |n: &WideNode| {
        let numbers = n.bounds.iter().flatten().flatten().map(|x| x.to_bits());
        let mut all = numbers.chain(n.children.iter().map(|c| c.0)).chain(n.order);
        std::array::from_fn(|_| all.next().expect("64 numbers"))
    };
    (tree.nodes.iter().map(node).collect(), tree.blocks.bytes().to_vec())
}

#[test]
fn trees_do_not_depend_on_threads_or_instructions() {
    let mesh = [Arc::new(soup(120_000, 1))];
    for quality in Quality::ALL {
        let tree = |threads: usize, simd: Level| {
            let pool =
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let options = BuildOptions { quality, simd, ..BuildOptions::default() };
            contents(&pool.install(|| world_of(&mesh, &options)))
        };
        let first = tree(1, Level::best());
        assert!(first == tree(4, Level::best()) && first == tree(3, Level::Scalar), "{quality:?}");
    }
}

#[test]
fn nodes_and_blocks_of_a_subtree_are_next_to_each_other() {
    for quality in Quality::ALL {
        let world = world_of(
            &[Arc::new(soup(20_000, 1))],
            &BuildOptions { quality, ..BuildOptions::default() },
        );
        let Structure::Bvh(forest) = &world.structure else { panic!("a tree") };
        let tree = &forest.trees[0];
        /// Checks a subtree. Returns the numbers after its last node and block.
        fn visit(tree: &GroupTree, child: ChildRef, next: (usize, usize)) -> (usize, usize) {
            if child.is_triangles() {
                assert_eq!(child.block(), next.1);
                return (next.0, next.1 + 1);
            }
            assert_eq!(child.index(), next.0);
            let children = tree.nodes[child.index()].children;
            children
                .iter()
                .filter(|c| **c != ChildRef::NONE)
                .fold((next.0 + 1, next.1), |next, &c| visit(tree, c, next))
        }
        assert_eq!(
            visit(tree, tree.root, (0, 0)),
            (tree.nodes.len(), tree.blocks.end()),
            "{quality:?}"
        );
    }
}

#[test]
fn a_refitted_tree_finds_what_has_moved() {
    for (options, name) in ways() {
        let mut mesh = soup(5000, 4);
        let before = Arc::new(mesh.clone());
        for (i, p) in mesh.positions.iter_mut().enumerate() {
            *p += vector(i as u32, 0, 6) * 0.3;
        }
        // One triangle becomes degenerate (a compact block may have no room for its new corner);
        // triangles that could not be hit still cannot.
        if !options.compact {
            mesh.positions[4] = mesh.positions[3];
        }
        for i in 0..before.indices.len() {
            if before.is_degenerate(i) {
                for v in before.indices[i] {
                    mesh.positions[v as usize] = before.positions[v as usize];
                }
            }
        }
        // The second mesh is a floor, whose triangles are outliers.
        let floor = |y: f32| {
            [[-900.0, y, -900.0], [900.0, y, -900.0], [900.0, y, 900.0], [-900.0, y, 900.0]]
        };
        let (before, after) =
            ([before, quads(&[floor(-20.0)])], [Arc::new(mesh), quads(&[floor(-5.0)])]);
        let mut world = world_of(&after, &options);
        let Structure::Bvh(old) = world_of(&before, &options).structure else { panic!("a tree") };
        assert_eq!(old.outliers.is_some(), options.quality != Quality::Fast);
        let list = |meshes: &[Arc<TriangleMesh>]| GroupList {
            meshes: (0..).zip(meshes.iter().cloned()).collect(),
            ..GroupList::default()
        };
        let refitted = old.trees[0].refit(&list(&after), &[]).expect("the same triangles");
        // The meshes move back to their old positions.
        let back = refitted.refit(&list(&before), &[]).expect("the same triangles");
        assert!(back.nodes.len() == old.trees[0].nodes.len());
        world.structure = Structure::Bvh(Forest::of(vec![Arc::new(refitted)], &[0]));
        assert_equal(&world, &world_of(&after, &none()), &rays(&after[0], 500), &name);
        let mut world = world_of(&before, &options);
        world.structure = Structure::Bvh(Forest::of(vec![Arc::new(back)], &[0]));
        assert_equal(&world, &world_of(&before, &none()), &rays(&before[0], 500), &name);
        let other = [Arc::new(soup(5001, 4)), before[1].clone()];
        assert!(old.trees[0].refit(&list(&other), &[]).is_none(), "other triangles");
    }
}

/// A square terrain of `side` squares along each side, with hills.
fn hills(side: u32) -> TriangleMesh {
    let at = |i: u32| {
        let (x, z) = ((i % (side + 1)) as f32, (i / (side + 1)) as f32);
        Vec3::new(x, 5.0 * (0.1 * x).sin() * (0.13 * z).sin(), z)
    };
    let squares = (0..side * side).map(|i| i + i / side);
    TriangleMesh {
        positions: (0..(side + 1) * (side + 1)).map(at).collect(),
        indices: squares
            .flat_map(|i| [[i, i + 1, i + side + 1], [i + 1, i + side + 2, i + side + 1]])
            .collect(),
        ..TriangleMesh::default()
    }
}

#[test]
fn a_compact_tree_of_a_mesh_is_smaller_and_finds_the_same() {
    let mesh = [Arc::new(hills(120))];
    let (rays, eye) = (rays(&mesh[0], 4000), Vec3::new(50.0, 30.0, -20.0));
    let seen: Vec<Ray> = (0..4096u32)
        .map(|i| Ray::new(eye, Vec3::new((i % 64) as f32 * 1.9, 0.0, (i / 64) as f32 * 1.9) - eye))
        .collect();
    for quality in Quality::ALL {
        for simd in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let [plain, compact] = [false, true].map(|compact| {
                world_of(&mesh, &BuildOptions { quality, compact, simd, ..BuildOptions::default() })
            });
            assert_equal(&compact, &plain, &rays, quality.name());
            for rays in [&rays, &seen] {
                let [mut a, mut b] =
                    [false, true].map(|is_hit| vec![(Hit::MISS, is_hit); rays.len()]);
                for (world, answers) in [(&plain, &mut a), (&compact, &mut b)] {
                    let (mut hits, mut blocked) =
                        (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
                    world.closest(&rays[..], Grouping::Coherent, &AcceptAll, &mut hits);
                    world.occluded(&rays[..], Grouping::Coherent, &AcceptAll, &mut blocked);
                    answers
                        .iter_mut()
                        .zip(hits.into_iter().zip(blocked))
                        .for_each(|(to, from)| *to = from);
                }
                assert!(
                    a.iter().zip(&b).all(|(a, b)| bits(&a.0) == bits(&b.0)
                        && a.1 == b.1
                        && a.1 == a.0.is_hit())
                );
                assert!(a.iter().filter(|(hit, _)| hit.is_hit()).count() > rays.len() / 5);
            }
            let [a, b] = [&plain, &compact]
                .map(|world| world.memory_bytes() as f64 / mesh[0].indices.len() as f64);
            assert!(b < 0.75 * a && b < 38.0, "{a} and {b} bytes a triangle");
            assert_eq!(plain.stats().triangle_blocks, compact.stats().triangle_blocks);
        }
    }
}

#[test]
fn a_compact_tree_is_built_anew_where_corners_part() {
    let mut mesh = hills(40);
    let options = BuildOptions { compact: true, ..BuildOptions::default() };
    let world = world_of(&[Arc::new(mesh.clone())], &options);
    let Structure::Bvh(forest) = &world.structure else { panic!("a tree") };
    // Each triangle gets separate corners, first at their old positions.
    mesh.positions = mesh.indices.iter().flatten().map(|&i| mesh.positions[i as usize]).collect();
    mesh.indices = (0..mesh.indices.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let list = |mesh: &TriangleMesh| GroupList {
        meshes: vec![(0, Arc::new(mesh.clone()))],
        ..GroupList::default()
    };
    assert!(forest.trees[0].refit(&list(&mesh), &[]).is_some());
    mesh.positions.iter_mut().enumerate().for_each(|(i, p)| p.y += i as f32 * 1e-3);
    assert!(forest.trees[0].refit(&list(&mesh), &[]).is_none());
}

#[test]
fn a_cached_tree_is_the_same_and_a_damaged_file_is_replaced() {
    for compact in [false, true] {
        check_cached(compact);
    }
}

fn check_cached(compact: bool) {
    let folder = tempfile::tempdir().expect("a folder");
    // The second mesh is a floor, whose triangles are outliers.
    let corners = [
        [-900.0, -99.0, -900.0],
        [900.0, -99.0, -900.0],
        [900.0, -99.0, 900.0],
        [-900.0, -99.0, 900.0],
    ];
    let mesh = [Arc::new(soup(70_000, 8)), quads(&[corners])];
    let options =
        BuildOptions { compact, cache: Some(folder.path().join("new")), ..BuildOptions::default() };
    let cached = |world: &World| (world.stats().cached_groups, world.warnings().len());
    let built = world_of(&mesh, &options);
    assert_eq!(cached(&built), (0, 0));
    let found = world_of(&mesh, &options);
    assert_eq!(cached(&found), (1, 0));
    assert!(contents(&built) == contents(&found));
    assert!(matches!(&found.structure, Structure::Bvh(forest) if forest.outliers.is_some()));
    let rays = rays(&mesh[0], 300);
    assert_equal(&found, &world_of(&mesh, &none()), &rays, "cached");
    let files: Vec<_> =
        std::fs::read_dir(folder.path().join("new")).expect("a folder").flatten().collect();
    assert_eq!(files.len(), 1, "nothing else is left there");
    let path = files[0].path();
    let whole = std::fs::read(&path).expect("a file");
    // Other contents and qualities have other file names.
    let high = BuildOptions { quality: Quality::High, ..options.clone() };
    assert_eq!(cached(&world_of(&mesh, &high)), (0, 0));
    assert_eq!(
        cached(&world_of(&mesh, &BuildOptions { compact: !compact, ..options.clone() })),
        (0, 0)
    );
    assert_eq!(cached(&world_of(&[Arc::new(soup(70_000, 9))], &options)), (0, 0));
    let mut damages: Vec<Vec<u8>> =
        vec![Vec::new(), whole[..100].to_vec(), whole[..whole.len() - 1].to_vec()];
    // Damage in the header, in a box and the references of a node, and in the corners and numbers
    // of blocks.
    let last = whole.len() - 4 * 1024;
    for place in [3, 40, 120, 4000, 4096 + 20, 4096 + 195, last - 333, last, last + 291] {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x35;
        damages.push(bytes);
    }
    for (i, damage) in damages.iter().enumerate() {
        std::fs::write(&path, damage).expect("written");
        let world = world_of(&mesh, &options);
        assert_eq!(cached(&world), (0, 1), "damage {i}");
        assert!(world.warnings()[0].contains("replaced"));
        assert!(contents(&built) == contents(&world));
        assert_eq!(cached(&world_of(&mesh, &options)), (1, 0), "it was replaced");
    }
    std::fs::remove_file(&path).expect("it was a file");
    std::fs::create_dir(&path).expect("a folder");
    let world = world_of(&mesh, &options);
    assert!(contents(&built) == contents(&world));
    assert!(
        matches!(&world.warnings()[..], [warning] if warning.contains("could not be replaced"))
    );
    std::fs::remove_dir(&path).expect("a folder");
    std::fs::write(&path, whole).expect("written");
    let nowhere = BuildOptions { cache: Some(path.join("below a file")), ..options };
    let world = world_of(&mesh, &nowhere);
    assert_eq!(cached(&world), (0, 1));
    assert!(contents(&built) == contents(&world));
}
