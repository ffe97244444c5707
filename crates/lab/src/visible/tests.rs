//! Tests of all methods against each other, against rays, and on difficult input.

use super::facet::centre;
use super::*;
use crate::coherence::View;
use snell_intersect::Sphere;
use snell_intersect::{AcceptAll, TriangleMesh};
use snell_intersect::{BuildOptions, WorldBuilder};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Ray, Transform, Vec3, rng};
use std::sync::Arc;

fn random(i: u32, k: u32) -> DVec3 {
    let (a, b) = (rng::uniform2([i, k, 1, 2]), rng::uniform2([i, k, 3, 4]));
    DVec3::new(a.x.into(), a.y.into(), b.x.into())
}

fn mesh_of(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for corners in triangles {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.indices.push([first, first + 1, first + 2]);
    }
    mesh
}

/// Random triangles in the unit cube.
fn soup(seed: u32, count: u32, size: f64) -> TriangleMesh {
    mesh_of((0..count).map(|i| {
        let middle = random(seed * 10_000 + i, 0);
        [1, 2, 3].map(|k| (middle + (random(seed * 10_000 + i, k) - 0.5) * size).as_vec3())
    }))
}

fn world_of(meshes: Vec<TriangleMesh>) -> World {
    let mut builder = WorldBuilder::default();
    for mesh in meshes {
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    }
    builder.build(&BuildOptions::default()).expect("small")
}

const EYE: Vec3 = Vec3::new(0.4, 0.6, -1.5);

/// The unit cube, seen from [`EYE`].
fn view([width, height]: [u32; 2]) -> View {
    let corner = DVec3::new(-0.6, 0.6, 1.3);
    let (across, down) =
        (DVec3::X * 1.2 / f64::from(width), DVec3::NEG_Y * 1.2 / f64::from(height));
    View::perspective(EYE.as_dvec3(), corner, across, down).expect("independent")
}

fn screen(world: &World, size: [u32; 2]) -> Screen {
    Screen::new(world, &view(size), size).expect("triangles")
}

/// The visible items, found by comparing all facets at each pixel.
fn looked_up(screen: &Screen) -> Vec<u32> {
    let [width, height] = screen.size();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.map(|(x, y)| screen.nearest_of(0..screen.facets.len() as u32, x, y)).collect()
}

/// True for methods that must agree exactly. The others trace rays, which round differently.
fn is_exact(method: Method) -> bool {
    !matches!(method, Method::RayCasting | Method::RayCastingAll)
}

/// The required agreement of the methods.
#[derive(Clone, Copy, PartialEq)]
enum Demand {
    /// The pictures must be the same. Methods that trace rays may differ in a few borderline
    /// pixels.
    Same,
    /// The pictures must be the same, although centres of pixels are on edges or triangles
    /// coincide. Methods that trace rays may differ in many pixels, all of them borderline.
    SameDespiteTies,
    /// The pictures may differ in borderline pixels only.
    SameUpToTies,
}

/// Runs all methods, checks their agreement, and returns the picture.
fn check(world: &World, screen: &Screen, demand: Demand, what: &str) -> Vec<u32> {
    let expected = looked_up(screen);
    let width = screen.size()[0];
    for method in Method::ALL {
        let seen = Prepared::new(method, screen, world).and_then(|p| p.run(screen, true));
        let seen = seen.unwrap_or_else(|e| panic!("{what}: {}: {e}", method.name()));
        let differences: Vec<usize> =
            (0..expected.len()).filter(|&i| seen.items[i] != expected[i]).collect();
        if is_exact(method) && demand != Demand::SameUpToTies {
            assert_eq!(differences, [0; 0], "{what}: {}: {:?}", method.name(), seen.work);
        }
        for &i in &differences {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let (a, b) = (seen.items[i], expected[i]);
            let is_borderline = a == EDGE_ON || screen.is_borderline(x, y, a, b, 1e-3);
            assert!(is_borderline, "{what}: {}: {x} {y}: {a} {b}", method.name());
        }
        let is_few = differences.len() * 200 <= expected.len();
        assert!(
            is_few || demand != Demand::Same,
            "{what}: {}: {}",
            method.name(),
            differences.len()
        );
    }
    expected
}

fn work(screen: &Screen, world: &World, method: Method, name: &str) -> u64 {
    let seen = Prepared::new(method, screen, world)
        .and_then(|p| p.run(screen, false))
        .expect("little work");
    seen.work
        .iter()
        .find(|(n, _)| *n == name)
        .unwrap_or_else(|| panic!("no {name}: {:?}", seen.work))
        .1
}

#[test]
fn all_methods_see_the_same_in_random_soups() {
    let soups = [
        (1, 2, 1.5, [64, 64]),
        (2, 40, 0.9, [64, 64]),
        (3, 120, 1.0, [53, 38]),
        (4, 2000, 0.1, [96, 96]),
        (5, 20_000, 0.01, [64, 64]),
    ];
    for (seed, count, size, picture) in soups {
        let world = world_of(vec![soup(seed, count, size)]);
        let items =
            check(&world, &screen(&world, picture), Demand::Same, &format!("soup of {count}"));
        assert!(items.iter().any(|i| *i != NOTHING));
    }
    for seed in 10..40 {
        let world = world_of(vec![soup(seed, 12, 1.5)]);
        check(&world, &screen(&world, [24, 24]), Demand::Same, &format!("small soup {seed}"));
    }
}

#[test]
fn instances_are_seen_like_any_other_triangles() {
    let mut builder = WorldBuilder::default();
    let (outer, inner) = (builder.add_group(), builder.add_group());
    builder.add_mesh(inner, Arc::new(soup(50, 30, 0.4)));
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(soup(51, 10, 0.4)));
    let placed = |angle: f64, scale: f64, to: DVec3| {
        Transform::new(DAffine3::from_mat3_translation(DMat3::from_rotation_y(angle) * scale, to))
            .expect("not flat")
    };
    builder.add_instance(outer, inner, placed(0.3, 0.5, DVec3::new(0.1, 0.2, 0.3)));
    builder.add_instance(outer, inner, placed(0.0, 0.5, DVec3::new(0.4, 0.4, 0.1)));
    builder.add_instance(WorldBuilder::ROOT, outer, placed(0.1, -1.0, DVec3::new(1.0, 0.8, 0.9)));
    builder.add_instance(WorldBuilder::ROOT, outer, placed(0.0, 1.0, DVec3::ZERO));
    let world = builder.build(&BuildOptions::default()).expect("small");
    let screen = screen(&world, [64, 64]);
    assert_eq!(screen.triangle_count() as u64, world.instanced_triangle_count());
    let items = check(&world, &screen, Demand::Same, "instances");
    let seen: std::collections::BTreeSet<_> =
        items.iter().filter_map(|&i| screen.primitive(i)).map(|id| id.instance).collect();
    assert!(seen.len() >= 4, "{seen:?}");
}

/// Three beams, each overlapping the next: no order paints them correctly.
fn cycle() -> TriangleMesh {
    let corner = |i: u32, r: f64, z: f64, turn: f64| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 3.0 + turn).sin_cos();
        Vec3::new(0.4 + (r * cos) as f32, 0.6 + (r * sin) as f32, z as f32)
    };
    mesh_of((0..3).map(|i| {
        [corner(i, 0.4, 0.2, 0.0), corner(i, 0.4, 0.2, 0.35), corner(i + 1, 0.45, 0.6, 0.3)]
    }))
}

#[test]
fn a_cycle_of_three_is_cut() {
    let world = world_of(vec![cycle()]);
    let screen = screen(&world, [128, 128]);
    let items = check(&world, &screen, Demand::Same, "cycle");
    // Each hides another, and each is hidden by another.
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let both = |i: &usize| {
            [a, b]
                .iter()
                .all(|&k| screen.facets[k as usize].covers(*i as u32 % 128, *i as u32 / 128))
        };
        let seen: std::collections::BTreeSet<_> =
            (0..items.len()).filter(both).map(|i| items[i]).collect();
        assert_eq!(seen.len(), 1, "{a} and {b} do not intersect, and overlap");
    }
    assert!(work(&screen, &world, Method::DepthSort, "cuts") >= 1);
    assert_eq!(work(&screen, &world, Method::DepthSort, "undecided"), 0);
}

#[test]
fn triangles_that_go_through_each_other_are_cut_by_painters() {
    let z = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let world = world_of(vec![mesh_of([
        [z(0.0, 0.3, 0.1), z(0.9, 0.3, 0.8), z(0.4, 1.0, 0.5)],
        [z(0.0, 0.3, 0.8), z(0.9, 0.3, 0.1), z(0.4, 1.0, 0.5)],
    ])]);
    let screen = screen(&world, [64, 64]);
    let items = check(&world, &screen, Demand::Same, "crossing");
    for item in [0, 1] {
        assert!(items.iter().filter(|i| **i == item).count() > 100);
    }
    assert_eq!(work(&screen, &world, Method::DepthSort, "cuts"), 1);
    assert_eq!(work(&screen, &world, Method::Bsp, "cuts"), 1);
    assert!(work(&screen, &world, Method::ScanLine, "halvings") > 10);
}

#[test]
fn of_coincident_triangles_the_first_is_seen() {
    let [a, b, c] = [Vec3::new(0.0, 0.2, 0.4), Vec3::new(0.9, 0.3, 0.5), Vec3::new(0.3, 1.0, 0.1)];
    let world = world_of(vec![mesh_of([[c, b, a], [a, b, c], [b, c, a], [c, a, b], [a, c, b]])]);
    let items = check(&world, &screen(&world, [64, 64]), Demand::SameDespiteTies, "coincident");
    assert!(items.iter().all(|&i| i == 0 || i == NOTHING) && items.contains(&0));
}

/// A rectangle perpendicular to z, made of cells of two triangles.
fn lattice(low: DVec2, step: DVec2, cells: [u32; 2], z: f64) -> TriangleMesh {
    let at = |i: u32, j: u32| (low + step * DVec2::new(i.into(), j.into())).extend(z).as_vec3();
    mesh_of((0..cells[0] * cells[1]).flat_map(|k| {
        let (i, j) = (k % cells[0], k / cells[0]);
        [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j + 1), at(i + 1, j), at(i, j + 1)]]
    }))
}

#[test]
fn a_centre_on_shared_edges_and_corners_belongs_to_one_triangle() {
    // Vertices and diagonals pass through pixel centres, because a cell has the size of two pixels.
    let view = View::perspective(DVec3::ZERO, DVec3::Z, DVec3::X, DVec3::Y).expect("independent");
    let world = world_of(vec![lattice(DVec2::splat(0.5), DVec2::splat(2.0), [6, 6], 1.0)]);
    let screen = Screen::new(&world, &view, [16, 16]).expect("triangles");
    let mut covered = 0;
    for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
        let count = screen.facets.iter().filter(|f| f.covers(x, y)).count();
        assert!(count <= 1, "{x} {y}: {count}");
        covered += count;
    }
    // Two sides of the border belong to the lattice.
    assert_eq!(covered, 12 * 12);
    check(&world, &screen, Demand::SameDespiteTies, "lattice");
}

#[test]
fn rows_of_pixels_are_those_that_are_covered() {
    for seed in 60..70 {
        let world = world_of(vec![soup(seed, 40, 2.5)]);
        let screen = screen(&world, [40, 40]);
        for facet in &screen.facets {
            for y in facet.rows[0]..facet.rows[1] {
                let [low, end] = facet.span(y);
                for x in 0..40 {
                    assert_eq!(facet.covers(x, y), (low..end).contains(&x), "{seed} {x} {y}");
                    let exact = facet.inside(centre(x, y));
                    assert!(exact.abs() < 1e-9 || facet.covers(x, y) == (exact > 0.0));
                }
            }
        }
    }
}

#[test]
fn scenes_in_which_everything_touches_differ_at_ties_only() {
    // Boxes on a floor, seen along the axes, with decals in the planes of other faces.
    let z = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let quad = |a: Vec3, b: Vec3, c: Vec3| [[a, b, c], [b + c - a, b, c]];
    let mut all: Vec<[Vec3; 3]> = Vec::new();
    all.extend(quad(z(-1.0, 0.0, -1.0), z(2.0, 0.0, -1.0), z(-1.0, 0.0, 3.0)));
    for i in 0..3 {
        let o = z(0.3 * i as f32, 0.0, 0.25 * i as f32);
        let (x, y, w) = (Vec3::X * 0.25, Vec3::Y * 0.4, Vec3::Z * 0.25);
        for (corner, u, v) in
            [(o, x, y), (o + w, x, y), (o, w, y), (o + x, w, y), (o + y, x, w), (o, x, w)]
        {
            all.extend(quad(corner, corner + u, corner + v));
        }
        all.extend(quad(o + y * 0.5, o + y * 0.5 + x * 0.5, o + y));
    }
    let world = world_of(vec![mesh_of(all)]);
    check(&world, &screen(&world, [64, 64]), Demand::SameUpToTies, "boxes");
}

#[test]
fn hostile_triangles_end_well() {
    let z = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let eye = EYE;
    let hostile = vec![
        // NaN, infinite, a single point, collinear.
        [z(f32::NAN, 0.0, 0.0), z(1.0, 0.0, 0.0), z(0.0, 1.0, 0.0)],
        [z(f32::INFINITY, 0.0, 0.0), z(1.0, 0.0, 0.0), z(0.0, 1.0, 0.0)],
        [z(0.5, 0.5, 0.5); 3],
        [z(0.0, 0.0, 0.5), z(0.5, 0.5, 0.5), z(1.0, 1.0, 0.5)],
        // Behind the eye, around it, through its plane, with it as a corner or on an edge, or in
        // its plane.
        [z(0.0, 0.0, -9.0), z(1.0, 0.0, -9.0), z(0.0, 1.0, -9.0)],
        [z(-50.0, -0.5, -50.0), z(50.0, -0.5, -50.0), z(0.0, -0.5, 90.0)],
        [z(0.0, 0.2, -4.0), z(1.0, 0.1, -4.0), z(0.3, 0.3, 4.0)],
        [eye, z(0.2, 0.4, 0.5), z(0.5, 0.1, 0.7)],
        [eye + Vec3::Y, eye - Vec3::Y, z(0.2, 0.4, 0.9)],
        [z(0.0, 0.6, 0.0), z(1.0, 0.6, 0.0), z(0.0, 0.6, 1.0)],
        // Huge, tiny, and thin.
        [z(-1e30, -1e30, 3.0), z(1e30, -1e30, 3.0), z(0.0, 1e30, 3.0)],
        [z(-1e6, -1e6, 2.0), z(1e6, -1e6, 2.0), z(0.0, 1e6, 2.5)],
        [z(0.5, 0.5, 0.5), z(0.5 + 1e-6, 0.5, 0.5), z(0.5, 0.5 + 1e-6, 0.5)],
        [z(0.0, 0.0, 0.3), z(1.0, 1.0, 0.3), z(1.0, 1.0 + 1e-7, 0.3)],
        [z(1e-38, 0.0, 0.3), z(0.0, 1e-38, 0.3), z(0.0, 0.0, 0.3)],
    ];
    // Each triangle alone, with a few others, and all at once.
    for i in 0..=hostile.len() {
        let some: Vec<_> = if i < hostile.len() { vec![hostile[i]] } else { hostile.clone() };
        for with in [0, 20] {
            let world = world_of(vec![mesh_of(some.clone()), soup(70, with, 0.5)]);
            for size in [[24, 24], [1, 1], [31, 1], [1, 31]] {
                let screen = screen(&world, size);
                for method in Method::ALL {
                    let seen =
                        Prepared::new(method, &screen, &world).and_then(|p| p.run(&screen, true));
                    let seen = seen.unwrap_or_else(|e| panic!("{i} {}: {e}", method.name()));
                    assert_eq!(seen.items.len(), (size[0] * size[1]) as usize);
                    // In object space, small triangles vanish beside enormous coordinates.
                    let is_huge = i == 10 || i == hostile.len();
                    let is_in_space = matches!(
                        method,
                        Method::Bsp | Method::BspFrontToBack | Method::WeilerAtherton
                    );
                    if is_exact(method) && !(is_huge && is_in_space) {
                        let expected = looked_up(&screen);
                        let width = size[0] as usize;
                        for k in (0..expected.len()).filter(|&k| seen.items[k] != expected[k]) {
                            let (x, y) = ((k % width) as u32, (k / width) as u32);
                            let is_tie =
                                screen.is_borderline(x, y, seen.items[k], expected[k], 1e-3);
                            assert!(is_tie, "{i} {with} {size:?} {}: {x} {y}", method.name());
                        }
                    }
                }
                HiddenLines::new(&screen).expect("few edges");
            }
        }
    }
}

#[test]
fn an_empty_world_and_an_empty_picture_show_nothing() {
    for (world, size) in [(world_of(vec![]), [8, 8]), (world_of(vec![soup(1, 5, 0.5)]), [0, 0])] {
        let screen = Screen::new(&world, &view([8, 8]), size).expect("triangles");
        for method in Method::ALL {
            let seen = Prepared::new(method, &screen, &world)
                .and_then(|p| p.run(&screen, true))
                .expect("nothing to do");
            assert!(
                seen.items.iter().all(|i| *i == NOTHING)
                    && seen.items.len() == (size[0] * size[1]) as usize
            );
        }
    }
}

#[test]
fn what_cannot_be_done_is_refused() {
    let world = world_of(vec![soup(1, 5, 0.5)]);
    let flat = View::parallel(DVec3::Z, DVec3::ZERO, DVec3::X, DVec3::Y).expect("independent");
    assert_eq!(Screen::new(&world, &flat, [8, 8]).err(), Some(VisibleError::NotPinhole));
    let mut builder = WorldBuilder::default();
    builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    let ball = builder.build(&BuildOptions::default()).expect("small");
    assert_eq!(Screen::new(&ball, &view([8, 8]), [8, 8]).err(), Some(VisibleError::NotTriangles));
    let many = world_of(vec![soup(1, 2000, 0.1)]);
    let large = screen(&many, [2048, 2048]);
    let refused =
        Prepared::new(Method::RayCastingAll, &large, &many).and_then(|p| p.run(&large, false));
    assert!(matches!(refused.err(), Some(VisibleError::TooMuchWork { .. })));
}

/// The twelve triangles of a box.
fn cube(low: Vec3, high: Vec3) -> TriangleMesh {
    let corner = |i: usize| {
        Vec3::new([low.x, high.x][i & 1], [low.y, high.y][i >> 1 & 1], [low.z, high.z][i >> 2])
    };
    let mesh = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    mesh_of(mesh.into_iter().flat_map(|f| {
        let [a, b, c, d] = f.map(corner);
        [[a, b, c], [a, c, d]]
    }))
}

#[test]
fn of_the_edges_of_a_box_nine_are_seen() {
    let world = world_of(vec![cube(Vec3::new(0.55, 0.7, 0.0), Vec3::new(0.8, 0.9, 0.3))]);
    let found = HiddenLines::new(&screen(&world, [256, 256])).expect("few edges");
    // Three faces are visible from a corner: nine of twelve edges, six of them contours.
    let count = |is_seen: bool, kind: LineKind| {
        found
            .stretches
            .iter()
            .filter(|s| (s.invisibility == 0) == is_seen && s.kind == kind)
            .count()
    };
    assert_eq!((count(true, LineKind::Contour), count(true, LineKind::Crease)), (6, 3));
    assert_eq!((count(false, LineKind::Contour), count(false, LineKind::Crease)), (0, 3));
    // A ray behind a closed box passes two faces, but an edge at the back has only one face in
    // front of it.
    assert!(found.stretches.iter().all(|s| s.invisibility <= 1));
    assert_eq!((found.work.edges, found.work.counts), (18, 18));
}

#[test]
fn stretches_of_lines_are_hidden_where_rays_are_stopped() {
    let worlds = [
        world_of(vec![soup(80, 12, 1.2)]),
        world_of(vec![soup(81, 150, 0.5)]),
        world_of(vec![cycle()]),
        world_of(vec![
            cube(Vec3::new(0.2, 0.2, 0.0), Vec3::new(0.5, 0.5, 0.4)),
            cube(Vec3::new(0.43, 0.4, 0.2), Vec3::new(0.8, 0.9, 0.7)),
            cube(Vec3::new(0.1, 0.63, 0.5), Vec3::new(0.3, 0.9, 0.9)),
        ]),
    ];
    for (i, world) in worlds.iter().enumerate() {
        let screen = screen(world, [256, 256]);
        let found = HiddenLines::new(&screen).expect("few edges");
        let long: Vec<_> = found.stretches.iter().filter(|s| s.length() > 0.5).collect();
        let mut wrong = 0;
        for stretch in &long {
            let is_hidden = stretch.invisibility > 0;
            assert_eq!(stretch.is_surely_hidden(&screen, 1e-6), is_hidden, "{i}: {stretch:?}");
            wrong += usize::from(stretch.is_occluded(&screen, world) != is_hidden);
        }
        assert!(wrong * 200 <= long.len(), "{i}: {wrong} of {}", long.len());
        let hidden = long.iter().filter(|s| s.invisibility > 0).count();
        assert!(hidden > 0 && hidden < long.len(), "{i}: {hidden} of {}", long.len());
    }
}

#[test]
fn invisibility_is_the_number_of_faces_that_a_ray_meets_before_the_line() {
    let world = world_of(vec![soup(82, 60, 0.8)]);
    let screen = screen(&world, [256, 256]);
    let found = HiddenLines::new(&screen).expect("few edges");
    let (mut compared, mut most) = (0, 0);
    for stretch in found.stretches.iter().filter(|s| s.length() > 1.0) {
        let (place, near) = stretch.middle();
        let ray = Ray {
            t_max: ((1.0 - 1e-4) / near) as f32,
            ..Ray::new(EYE, view([256, 256]).direction(place).as_vec3())
        };
        let mut count = [0];
        world.count(&[ray], &AcceptAll, &mut count);
        assert_eq!(count[0], stretch.invisibility, "{stretch:?}");
        compared += 1;
        most = most.max(count[0]);
    }
    assert!(compared > 200 && most >= 4, "{compared} {most}");
}
