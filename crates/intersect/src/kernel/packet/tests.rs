use super::certain;
use super::certain::CertainHits;
use super::exact::{Found, Pairs, exact_hits};
use super::exact_rays::{ExactColumns, LaneRays};
use super::frustum::{Packet, RAYS};
use super::leaf::{SeenBlock, SharedOrigin, Wanted};
use super::projection::sides;
use super::runs::set_up;
use super::triangles::Locals;
use crate::exact::ray::LocalRay;
use crate::exact::triangle::{exact_hit, plane_distance};
use crate::group::mapped;
use crate::hit::{DHit, Hit};
use crate::mesh::{DTriangleMesh, TriangleMesh};
use crate::precision::Single;
use crate::precision::frame::Frame;
use crate::search::rays::Rays;
use crate::search::{AcceptAll, Grouping, HitFilter};
use crate::tree::Blocks;
use crate::tree::block::TriangleBlock;
use crate::tree::node::{ChildRef, WideNode};
use crate::world::AcceleratorKind;
use crate::world::double::DWorldBuilder;
use crate::world::tests::{build, check, lattice_point, levels, nested_scene};
use crate::world::{BuildOptions, GeometryId, WorldBuilder};
use proptest::prelude::*;
#[cfg(target_arch = "x86_64")]
use snell_math::simd::{Avx16, Avx512, Wide};
use snell_math::simd::{Lanes16, Level, Pair, Portable, Portable8, Token, Wide8, WideToken};
use snell_math::{Bounds3, Bounds3d, DAffine3, DRay, DVec3, Ray, Transform, Vec3, rng};
use std::sync::Arc;

/// Pseudo-random numbers in 0 to 1 from a seed.
fn unit(seed: u32, i: u32) -> f32 {
    rng::to_unit(rng::pcg4d([seed, i, 7, 9])[0])
}

fn vector(seed: u32, i: u32) -> Vec3 {
    Vec3::new(unit(seed, 3 * i), unit(seed, 3 * i + 1), unit(seed, 3 * i + 2)) * 2.0 - 1.0
}

fn is_packet(packet: &mut Packet, rays: &[Ray]) -> bool {
    let is_one = set_up::<Pair<Portable8>>(Portable, packet, rays, &rays[0], false);
    packet.rays.write::<Single>(rays);
    is_one
}

/// What the rays of a run have in common.
#[derive(Clone, Copy, Debug)]
enum Kind {
    FromPoint,
    ToPoint,
    Parallel,
    Unlike,
}

fn kinds() -> impl Strategy<Value = Kind> {
    prop_oneof![
        Just(Kind::FromPoint),
        Just(Kind::ToPoint),
        Just(Kind::Parallel),
        Just(Kind::Unlike)
    ]
}

/// Rays around the line between two points, at a distance of up to `width`.
fn rays(kind: Kind, seed: u32, count: usize, from: Vec3, to: Vec3, width: f32) -> Vec<Ray> {
    let ray = |i: usize| {
        let beside = vector(seed, i as u32) * width;
        match kind {
            Kind::FromPoint => Ray::new(from, to + beside - from),
            Kind::ToPoint => Ray::new(from + beside, to - (from + beside)).with_t_max(1.0),
            Kind::Parallel => Ray::new(from + beside, to - from),
            Kind::Unlike => Ray::new(vector(seed, i as u32) * 3.0, vector(seed ^ 1, i as u32)),
        }
    };
    (0..count).map(ray).collect()
}

fn sizes() -> impl Strategy<Value = usize> {
    prop_oneof![Just(1), Just(2), Just(15), Just(16), Just(17), Just(40), Just(150)]
}

fn widths() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0), Just(1e-4), Just(0.1), Just(0.5), Just(3.0)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn packets_hit_lattices_and_instances_of_them_as_the_oracle_does(
        positions in proptest::collection::vec(lattice_point(), 3..20),
        corners in proptest::collection::vec(proptest::array::uniform3(0u32..1000), 10..60),
        (kind, seed, size) in (kinds(), 0u32..1_000_000, sizes()),
        (from, to, width) in (lattice_point(), lattice_point(), widths()),
        far in prop_oneof![Just(0.0), Just(1000.0f64)],
    ) {
        let n = positions.len() as u32;
        let indices = corners.iter().map(|t| t.map(|i| i % n)).collect();
        let mesh = Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() });
        let offset = DVec3::new(far, -far, far * 0.5);
        let make = |accelerator, simd| {
            let mut builder = WorldBuilder::default();
            let moved = mesh.transformed(&Transform::translation(offset));
            builder.add_mesh(WorldBuilder::ROOT, Arc::new(moved));
            let child = builder.add_group();
            builder.add_mesh(child, mesh.clone());
            let turned =
                DAffine3::from_rotation_y(0.3) * DAffine3::from_scale(DVec3::new(1.0, 0.7, 1.3));
            for shift in [DVec3::ZERO, DVec3::X, DVec3::new(0.1, 2.0, 0.3)] {
                let there = DAffine3::from_translation(offset + shift) * turned;
                let placed = Transform::new(there).expect("invertible");
                builder.add_instance(WorldBuilder::ROOT, child, placed);
            }
            build(builder, accelerator, simd)
        };
        let mut rays = rays(kind, seed, size, from, to, width);
        rays.iter_mut().for_each(|ray| ray.origin += offset.as_vec3());
        let oracle = make(AcceleratorKind::None, Level::Scalar);
        for level in levels() {
            check(&make(AcceleratorKind::Bvh, level), &oracle, Rays::from(&rays), &AcceptAll)?;
        }
    }

    #[test]
    fn packets_in_double_precision_hit_lattices_and_instances_as_the_oracle_does(
        positions in proptest::collection::vec(lattice_point(), 3..20),
        corners in proptest::collection::vec(proptest::array::uniform3(0u32..1000), 10..60),
        (kind, seed, size) in (kinds(), 0u32..1_000_000, sizes()),
        (from, to, width) in (lattice_point(), lattice_point(), widths()),
        scale in prop_oneof![Just(1.0), Just(1e-3), Just(0.1)],
        far in prop_oneof![Just(0.0), Just(1.0f64)],
    ) {
        // A city, in metres.
        let place = DVec3::new(500_000.123, 4_649_776.22, 300.0) * far;
        let n = positions.len() as u32;
        let moved = |p: Vec3| place + p.as_dvec3() * scale;
        let mesh = Arc::new(DTriangleMesh {
            positions: positions.into_iter().map(moved).collect(),
            indices: corners.iter().map(|t| t.map(|i| i % n)).collect(),
        });
        let make = |accelerator, simd| {
            let mut builder = DWorldBuilder::default();
            builder.add_mesh(DWorldBuilder::ROOT, mesh.clone());
            let child = builder.add_group();
            builder.add_mesh(child, mesh.clone());
            let turned =
                DAffine3::from_rotation_y(0.3) * DAffine3::from_scale(DVec3::new(1.0, 0.7, 1.3));
            for shift in [DVec3::X, DVec3::new(0.1, 2.0, 0.3)] {
                let there = DAffine3::from_translation(place + shift * scale) * turned;
                let there = there * DAffine3::from_translation(-place);
                let placed = Transform::new(there).expect("invertible");
                builder.add_instance(DWorldBuilder::ROOT, child, placed);
            }
            let options = BuildOptions { accelerator, simd, ..BuildOptions::default() };
            builder.build(&options).expect("a world")
        };
        let exact = |ray: &Ray| DRay {
            origin: moved(ray.origin),
            direction: ray.direction.as_dvec3() * scale,
            ..DRay::from(ray)
        };
        let rays: Vec<DRay> = rays(kind, seed, size, from, to, width).iter().map(exact).collect();
        let oracle = make(AcceleratorKind::None, Level::Scalar);
        for level in levels() {
            let world = make(AcceleratorKind::Bvh, level);
            let (mut hits, mut blocked) = (vec![DHit::MISS; rays.len()], vec![false; rays.len()]);
            world.closest(&rays, Grouping::Coherent, &AcceptAll, &mut hits);
            world.occluded(&rays, Grouping::Coherent, &AcceptAll, &mut blocked);
            for (i, ray) in rays.iter().enumerate() {
                let expected = oracle.closest_one(ray, &AcceptAll);
                prop_assert_eq!(hits[i], expected, "{:?} {:?}", level, ray);
                prop_assert_eq!(hits[i].t.to_bits(), expected.t.to_bits());
                prop_assert_eq!(blocked[i], expected.is_hit(), "{:?} {:?}", level, ray);
            }
        }
    }

    #[test]
    fn boxes_that_rays_pass_through_are_met(
        (kind, seed, backward) in (kinds(), 0u32..1_000_000, any::<bool>()),
        (from, to, width) in (lattice_point(), lattice_point(), widths()),
        at in 0.0f32..1.0,
        sizes in prop::array::uniform3(
            prop_oneof![Just(0.0f32), Just(1e-3), Just(0.1), Just(20.0)]
        ),
        (scale, far) in (-20i32..20, prop_oneof![Just(0.0f32), Just(100.0)]),
    ) {
        let (scale, far) = (2.0f32.powi(scale), Vec3::new(far, -far, far));
        let mut rays = rays(kind, seed, RAYS, from, to, width);
        for ray in &mut rays {
            (ray.origin, ray.direction) = ((ray.origin + far) * scale, ray.direction * scale);
        }
        let mut packet = Packet::NONE;
        if set_up::<Pair<Portable8>>(Portable, &mut packet, &rays, &rays[0], backward) {
            let mut node = WideNode::EMPTY;
            for (lane, ray) in rays.iter().enumerate() {
                // A corner, an edge or the inside of the box lies on the ray.
                let on_ray = ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(at);
                let side = vector(seed, 40 + lane as u32) * 1.5;
                let share = side.clamp(Vec3::NEG_ONE, Vec3::ONE) * 0.5 + 0.5;
                let size = Vec3::from_array(sizes) * scale;
                let low = on_ray - (share * size).as_dvec3();
                let high = on_ray + ((1.0 - share) * size).as_dvec3();
                let (low, high) = (low.as_vec3(), high.as_vec3());
                // The box is padded as trees pad the boxes of triangles.
                let bounds = Bounds3 {
                    min: low - low.abs() * f32::EPSILON,
                    max: high + high.abs() * f32::EPSILON,
                };
                node.set(lane & 7, &bounds, ChildRef::node(0));
                let one_box = packet.one_box::<Pair<Portable8>>(Portable, &node, lane & 7);
                let met = packet.rays_hitting(Portable, &one_box);
                prop_assert!(met >> lane & 1 == 1, "{ray:?} {low} {high}");
            }
        }
    }

    #[test]
    fn what_the_exact_test_takes_passes_the_filter_and_gets_the_same_bits(
        (kind, seed) in (kinds(), 0u32..1_000_000),
        (from, to, width) in (lattice_point(), lattice_point(), widths()),
        size in prop_oneof![Just(0.0f32), Just(1e-3), Just(1.0)],
        (scale, far) in (-20i32..20, prop_oneof![Just(0.0f32), Just(100.0)]),
    ) {
        let scale = 2.0f32.powi(scale);
        let far = Vec3::new(far, -far, far);
        let mut rays = rays(kind, seed, RAYS, from, to, width);
        for ray in &mut rays {
            (ray.origin, ray.direction) = ((ray.origin + far) * scale, ray.direction * scale);
            ray.t_min = if seed % 3 == 0 { 0.1 * unit(seed, 99) } else { 0.0 };
        }
        let mut block = TriangleBlock::EMPTY;
        for (lane, ray) in rays.iter().enumerate().take(8) {
            // Around points on the rays; some on the lattice, so that edges are hit.
            let u = unit(seed, lane as u32);
            let at = ray.at(match lane % 4 {
                0 => 0.5 * u,
                2 => ray.t_min + (u - 0.5) * 10.0f32.powf(-7.0 * unit(seed, 90 + lane as u32)),
                _ => 1.0 + (u - 0.5) * 1e-3,
            });
            // Some are slivers, and some have the point in their interior.
            let width = [1.0, 1e-3, 1e-6][lane % 3];
            let away = |k: u32| {
                let along = vector(seed ^ 5, 8 * (k / 2) + lane as u32);
                (along + vector(seed ^ 5, 8 * k + lane as u32) * width) * (size * scale)
            };
            let corner = |k: u32| {
                let p = at + if k == 2 && lane % 2 == 0 { -away(0) - away(1) } else { away(k) };
                (if lane < 4 { p } else { (p / scale).round() * scale }).to_array()
            };
            block.set(lane, &[corner(0), corner(1), corner(2)], 0);
        }
        let mut packet = Packet::NONE;
        if is_packet(&mut packet, &rays) {
            check_block::<Pair<Portable8>>(Portable, &packet, &block, &rays)?;
            if let Some(wide) = Level::best().wide() {
                let token = WideToken::from(wide);
                token.run(
                    #[inline(always)]
                    || check_block::<Pair<Wide8>>(token, &packet, &block, &rays),
                )?;
            }
            #[cfg(target_arch = "x86_64")]
            if let Some(token) = Avx512::new() {
                token.run(
                    #[inline(always)]
                    || check_block::<Avx16>(token, &packet, &block, &rays),
                )?;
            }
        }
    }
}

#[inline(always)]
fn check_block<W: Lanes16>(
    token: W::Token,
    packet: &Packet,
    block: &TriangleBlock,
    rays: &[Ray],
) -> Result<(), TestCaseError> {
    let seen = SeenBlock::new::<W, Single>(
        token,
        block,
        &packet.packet_rays,
        packet.axes,
        Wanted { planes: true, depths: true },
    );
    let axis = packet.axes.z();
    let near_packet = seen.near_packet::<W::Half>(W::half_token(token), packet);
    for triangle in 0..8 {
        let hitting = seen.hits::<W>(token, &packet.packet_rays, triangle, 0xffff);
        let (mut low, mut high) = ([0.0; RAYS], [0.0; RAYS]);
        hitting.low.store(&mut low);
        hitting.high.store(&mut high);
        let (mut inside, mut outside, mut found, mut projected) = (0, 0, None, CertainHits::NONE);
        if packet.is_aligned {
            [inside, outside] = sides::<W>(token, block, triangle, packet);
            let places = [triangle as u32; RAYS];
            found = Some(certain::test::<W>(
                token,
                &Blocks::of(&[*block]),
                packet,
                [inside; 2],
                &places,
                &mut projected,
            ));
        }
        for (lane, ray) in rays.iter().enumerate() {
            let corners = block.corners(triangle);
            let expected = exact_hit(&LocalRay::new(&DRay::from(ray)), &corners, ray.t_min.into());
            let wanted = expected.filter(|(t, _)| *t as f32 > ray.t_min && (*t as f32) < ray.t_max);
            let (possible, certain) =
                (hitting.possible >> lane & 1 == 1, hitting.certain >> lane & 1 == 1);
            prop_assert!(possible || wanted.is_none(), "{ray:?} {corners:?}");
            prop_assert!(wanted.is_some() || !certain, "{ray:?} {corners:?}");
            prop_assert!(
                near_packet >> triangle & 1 == 1 || wanted.is_none(),
                "{ray:?} {corners:?}"
            );
            let near =
                seen.near_two::<W>(token, &packet.packet_rays, &mut (1 << lane | 1 << (lane / 2)));
            let edge_tests =
                seen.edge_tests::<W>(token, &packet.packet_rays, 1 << lane, 1 << triangle);
            prop_assert!(edge_tests.near != 0 || wanted.is_none(), "{ray:?} {corners:?}");
            prop_assert!(edge_tests.certain == 0 || wanted.is_some(), "{ray:?} {corners:?}");
            prop_assert_eq!(
                edge_tests.rays[triangle],
                [edge_tests.near, edge_tests.certain].map(|of| of >> triangle << lane)
            );
            // The lane is the second of the two, or both are the same.
            let half = u32::from(lane > 0);
            prop_assert!(
                near >> (8 * half) >> triangle & 1 == 1 || wanted.is_none(),
                "{ray:?} {corners:?}"
            );
            if !packet.packet_rays.separate {
                let near = SharedOrigin::<W::Half>::new::<Single>(
                    W::half_token(token),
                    block,
                    &packet.packet_rays,
                    packet.axes,
                )
                .candidates(W::half_token(token), &packet.packet_rays, lane);
                prop_assert!(near >> triangle & 1 == 1 || wanted.is_none(), "{ray:?} {corners:?}");
            }
            let line = exact_hit(&LocalRay::new(&DRay::from(ray)), &corners, f64::NEG_INFINITY);
            prop_assert!(inside >> lane & 1 == 0 || line.is_some(), "{ray:?} {corners:?}");
            prop_assert!(outside >> lane & 1 == 0 || line.is_none(), "{ray:?} {corners:?}");
            let mut is_projected = false;
            if let Some((t, uv)) = line.filter(|_| inside >> lane & 1 == 1) {
                let found = found.as_ref().expect("tested");
                let is_moved = t
                    != plane_distance(&ray.origin.as_dvec3(), &ray.direction.as_dvec3(), &corners);
                prop_assert!(!is_moved || found.hits >> lane & 1 == 0, "{ray:?} {corners:?}");
                if found.hits >> lane & 1 == 1 {
                    let bits = [projected.t[lane], projected.b1[lane], projected.b2[lane]]
                        .map(f32::to_bits);
                    prop_assert_eq!(bits, [t as f32, uv.x, uv.y].map(f32::to_bits));
                }
                is_projected = hitting.nearer >> lane & 1 == 1 && found.moved >> lane & 1 == 0;
                prop_assert!(wanted.is_some() || !is_projected, "{ray:?} {corners:?}");
            }
            if let (Some((t, _)), true) = (expected, certain || is_projected) {
                let along = f64::from(ray.origin[axis]) + t * f64::from(ray.direction[axis]);
                let z = (along - f64::from(packet.packet_rays.point[2]))
                    * f64::from(packet.packet_rays.forward);
                prop_assert!(
                    f64::from(low[lane]) <= z && z <= f64::from(high[lane]),
                    "{z} {low:?} {high:?} {ray:?}"
                );
            }
            if packet.is_aligned {
                let pairs = Pairs {
                    triangles: [triangle as u32; 8],
                    rays: [lane as u32; 8],
                    count: 8,
                    mask: 0,
                };
                let mut found = Found::NONE;
                exact_hits::<W>(token, &Blocks::of(&[*block]), packet, &pairs, &mut found);
                prop_assert!(
                    [0, 0xff].contains(&found.uncertain) && [0, 0xff].contains(&found.hits)
                );
                if found.uncertain == 0 {
                    prop_assert_eq!(found.hits != 0, expected.is_some(), "{:?} {:?}", ray, corners);
                    if let Some((t, uv)) = expected {
                        let bits = [found.t[7], found.b1[7], found.b2[7]].map(f32::to_bits);
                        prop_assert_eq!(bits, [t as f32, uv.x, uv.y].map(f32::to_bits));
                    }
                }
            }
        }
    }
    if packet.is_aligned {
        check_pairs::<W>(token, packet, block, rays.len())?;
    }
    Ok(())
}

#[inline(always)]
fn tested<W: Lanes16>(
    token: W::Token,
    blocks: &[TriangleBlock],
    packet: &Packet,
    pairs: &Pairs,
) -> Found<f32> {
    let mut found = Found::NONE;
    exact_hits::<W>(token, &Blocks::of(blocks), packet, pairs, &mut found);
    found
}

/// Checks that pairs of triangles from several blocks give the same results together as alone.
#[inline(always)]
fn check_pairs<W: Lanes16>(
    token: W::Token,
    packet: &Packet,
    block: &TriangleBlock,
    rays: usize,
) -> Result<(), TestCaseError> {
    let mut blocks = [*block; 3];
    for (turn, turned) in blocks.iter_mut().enumerate() {
        (0..8).for_each(|lane| turned.set((lane + 3 * turn) % 8, &block.corners(lane), 0));
    }
    for count in [1, 3, 8] {
        let mut pairs = Pairs::NONE;
        for i in 0..count {
            let (block, lane, ray) = (i * (count - 1) % 3, (5 * i + count) % 8, 3 * i % rays);
            pairs.push(ray as u32, (8 * block + lane) as u32);
        }
        let together = tested::<W>(token, &blocks, packet, &pairs);
        for i in 0..count {
            let mut one = Pairs::NONE;
            one.push(pairs.rays[i], pairs.triangles[i]);
            let alone = tested::<W>(token, &blocks, packet, &one);
            prop_assert_eq!(
                [together.hits >> i & 1, together.uncertain >> i & 1],
                [alone.hits & 1, alone.uncertain & 1]
            );
            if alone.hits & 1 == 1 {
                let bits = |found: &Found<f32>, i: usize| {
                    [found.t[i], found.b1[i], found.b2[i]].map(f32::to_bits)
                };
                prop_assert_eq!(bits(&together, i), bits(&alone, 0));
            }
        }
    }
    Ok(())
}

#[test]
fn long_boxes_beside_rays_are_not_met() {
    // Projected along two of the axes, rays seem to pass through, but not projected along the
    // third.
    let mut packet = Packet::NONE;
    let (from, to) = (Vec3::new(0.0, 0.0, -10.0), Vec3::new(5.0, 5.0, 10.0));
    for kind in [Kind::FromPoint, Kind::ToPoint, Kind::Parallel] {
        assert!(is_packet(&mut packet, &rays(kind, 1, RAYS, from, to, 0.1)));
        let mut node = WideNode::EMPTY;
        let column = |x: f32, y: f32| Bounds3 {
            min: Vec3::new(x, y, -10.0),
            max: Vec3::new(x + 0.5, y + 0.5, 10.0),
        };
        for (slot, (x, y)) in [(1.0, 3.5), (3.5, 1.0), (2.25, 2.25)].into_iter().enumerate() {
            node.set(slot, &column(x, y), ChildRef::node(0));
            let met = packet
                .rays_hitting(Portable, &packet.one_box::<Pair<Portable8>>(Portable, &node, slot));
            assert_eq!(met, if x == y { 0xffff } else { 0 }, "{kind:?} {x} {y}");
        }
    }
}

#[test]
fn runs_with_a_common_point_are_packets_and_others_are_not() {
    let mut packet = Packet::NONE;
    let (from, to) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.5, -1.0, -2.0));
    let mut kind_of = |rays: &[Ray]| {
        is_packet(&mut packet, rays).then_some((packet.kind.common, packet.kind.reversed))
    };
    assert_eq!(kind_of(&rays(Kind::FromPoint, 1, 16, from, to, 0.1)), Some((true, false)));
    assert_eq!(kind_of(&rays(Kind::ToPoint, 1, 16, from, to, 0.1)), Some((false, true)));
    assert_eq!(kind_of(&rays(Kind::Parallel, 1, 9, from, to, 0.1)), Some((false, false)));
    assert_eq!(kind_of(&rays(Kind::Unlike, 1, 16, from, to, 0.1)), None);
    assert_eq!(kind_of(&rays(Kind::FromPoint, 1, 3, from, to, 0.1)), None);
    for (k, broken) in [f32::NAN, f32::INFINITY, -1.0].into_iter().enumerate() {
        let mut rays = rays(Kind::FromPoint, 1, 16, from, to, 0.1);
        match k {
            0 => rays[7].direction.y = broken,
            1 => rays[7].origin.y = broken,
            _ => rays[7].t_max = broken,
        }
        assert_eq!(kind_of(&rays), None, "{broken}");
    }
}

#[test]
fn packets_agree_with_the_oracle_on_nested_instances_with_masks_and_rejections() {
    struct Sieve;
    impl HitFilter for Sieve {
        fn accept(&self, _: &Ray, hit: &Hit) -> bool {
            rng::hash32(hit.primitive ^ hit.instance) & 3 != 0
        }
    }
    let make = |accelerator, simd| {
        let mut builder = nested_scene(5);
        (0..builder.geometries.len() as u32)
            .step_by(2)
            .for_each(|g| builder.set_filtered(GeometryId(g)));
        builder.set_mask(GeometryId(1), 2);
        build(builder, accelerator, simd)
    };
    let oracle = make(AcceleratorKind::None, Level::Scalar);
    let worlds: Vec<_> = levels().map(|level| make(AcceleratorKind::Bvh, level)).collect();
    for seed in 0..60 {
        let kind = [Kind::FromPoint, Kind::ToPoint, Kind::Parallel][seed as usize % 3];
        let rays = rays(kind, seed, 50, vector(seed, 100) * 6.0, vector(seed, 101), 0.3);
        let masks: Vec<u64> = (0..50).map(|i| 1 + (i / 5) % 3).collect();
        for world in &worlds {
            check(world, &oracle, Rays::new(&rays).with_masks(&masks), &Sieve)
                .expect("the same hits");
        }
    }
}

/// Unused lanes beside the last pairs hold earlier pairs, which must be of the same tree.
#[test]
fn instances_of_large_groups_leave_nothing_behind_for_small_ones() {
    let soup = |seed: u32, count: u32| {
        let positions =
            (0..3 * count).map(|i| vector(seed, i / 3) + 0.3 * vector(seed ^ 1, i)).collect();
        let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() })
    };
    let (large, small) = (soup(1, 4000), soup(2, 30));
    let double = |mesh: &TriangleMesh| {
        let positions = mesh.positions.iter().map(|p| p.as_dvec3()).collect();
        Arc::new(DTriangleMesh { positions, indices: mesh.indices.clone() })
    };
    let (double_large, double_small) = (double(&large), double(&small));
    let places: Vec<_> =
        (0..8).map(|i| Transform::translation(vector(3, i).as_dvec3() * 3.0)).collect();
    let make = |accelerator, simd| {
        let mut builder = WorldBuilder::default();
        for mesh in [&large, &small] {
            let child = builder.add_group();
            builder.add_mesh(child, mesh.clone());
            for placed in &places {
                builder.add_instance(WorldBuilder::ROOT, child, *placed);
            }
        }
        build(builder, accelerator, simd)
    };
    let make_double = |simd| {
        let mut builder = DWorldBuilder::default();
        for mesh in [&double_large, &double_small] {
            let child = builder.add_group();
            builder.add_mesh(child, mesh.clone());
            for placed in &places {
                builder.add_instance(DWorldBuilder::ROOT, child, *placed);
            }
        }
        builder.build(&BuildOptions { simd, ..BuildOptions::default() }).expect("a world")
    };
    let oracle = make(AcceleratorKind::None, Level::Scalar);
    for level in levels() {
        let (world, double) = (make(AcceleratorKind::Bvh, level), make_double(level));
        for seed in 0..20 {
            let kind = [Kind::FromPoint, Kind::ToPoint, Kind::Parallel][seed as usize % 3];
            let rays = rays(kind, seed, 64, vector(seed, 100) * 6.0, vector(seed, 101), 0.3);
            check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
            let exact: Vec<DRay> = rays.iter().map(DRay::from).collect();
            let mut hits = vec![DHit::MISS; rays.len()];
            double.closest(&exact, Grouping::Coherent, &AcceptAll, &mut hits);
            let alone = exact.iter().map(|ray| double.closest_one(ray, &AcceptAll));
            assert!(hits.iter().zip(alone).all(|(hit, alone)| *hit == alone), "{seed}");
        }
    }
}

/// Far away, the error of the projection exceeds the padding of the box of a small triangle.
#[test]
fn rays_that_hit_the_projection_of_a_triangle_beside_its_box_are_left_to_others() {
    let (apex, size) = (Vec3::new(1017.88086, 600.2, 2022.0814), 0.9);
    let corners = [apex, apex + Vec3::X * size, apex + Vec3::Y * size];
    let mut block = TriangleBlock::EMPTY;
    block.set(0, &corners.map(|v| v.to_array()), 0);
    let mesh = Arc::new(TriangleMesh {
        positions: corners.to_vec(),
        indices: vec![[0, 1, 2]],
        ..TriangleMesh::default()
    });
    let make = |accelerator, simd| {
        let mut builder = WorldBuilder::default();
        // A second mesh, so that the tree has a node.
        for x in 0..100 {
            let away = Transform::translation(DVec3::new(f64::from(x), 0.0, f64::from(x)));
            builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh.transformed(&away)));
        }
        build(builder, accelerator, simd)
    };
    let oracle = make(AcceleratorKind::None, Level::Scalar);
    let worlds: Vec<_> = levels().map(|level| make(AcceleratorKind::Bvh, level)).collect();
    let (mut moved, mut certain) = (0, CertainHits::NONE);
    for seed in 0..40 {
        // Along the left edge, in rounded directions.
        let direction = |i: u32| {
            let beside = f64::from(unit(seed, 3 * i) - 0.5) * 2e-4;
            let point = apex.as_dvec3()
                + DVec3::new(beside, f64::from(unit(seed, 3 * i + 1) * 0.7 * size), 0.0);
            (point * (0.0005 + 0.0005 * f64::from(unit(seed, 3 * i + 2)))).as_vec3()
        };
        let rays: Vec<Ray> = (0..16).map(|i| Ray::new(Vec3::ZERO, direction(i))).collect();
        let mut packet = Packet::NONE;
        assert!(is_packet(&mut packet, &rays) && packet.is_aligned);
        moved |= {
            let [inside, _] = sides::<Pair<Portable8>>(Portable, &block, 0, &packet);
            let blocks = Blocks::of(&[block]);
            certain::test::<Pair<Portable8>>(
                Portable,
                &blocks,
                &packet,
                [inside; 2],
                &[0; RAYS],
                &mut certain,
            )
            .moved
        };
        for world in &worlds {
            check(world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
        }
    }
    assert_ne!(moved, 0);
}

#[test]
fn locals_are_built_once_and_are_those_of_the_rays() {
    let rays = rays(Kind::FromPoint, 3, 16, Vec3::ZERO, Vec3::Z, 0.1);
    let mut packet = Packet::NONE;
    assert!(is_packet(&mut packet, &rays));
    let mut locals = Locals::new();
    for lane in [3, 3, 0] {
        assert_eq!(locals.get(&packet, lane).exact.direction, rays[lane].direction.as_dvec3());
    }
    assert_eq!(locals.built, 0b1001);
}

/// Compares rays transformed in lanes, by a map and by a frame, with single ones.
fn in_lanes<W: Lanes16>(
    token: W::Token,
    rays: &ExactColumns,
    map: &DAffine3,
    frame: &Frame,
) -> [ExactColumns; 2] {
    let mut images = [*rays; 2];
    let rays = LaneRays::<W>::load(token, rays);
    rays.mapped(token, map).store(&mut images[0]);
    rays.framed(token, &frame.center, frame.scale).store(&mut images[1]);
    images
}

#[test]
fn rays_in_lanes_are_mapped_to_the_bits_of_rays_one_by_one() {
    let third = |v: Vec3| v.as_dvec3() / 3.0;
    for seed in 0..50 {
        let state = |i: u32| third(vector(seed, i));
        let map = DAffine3::from_cols(state(100), state(101), state(102), state(103) * 1e3);
        let frame = Frame::of(&Bounds3d { min: state(104) - 5.0, max: state(105) + 7.0 });
        let rays: Vec<DRay> =
            (0..16).map(|i| DRay::new(state(2 * i) * 1e4, state(2 * i + 1))).collect();
        let columns = |rays: &[DRay]| -> ExactColumns {
            let column = |of: &dyn Fn(&DRay) -> f64| std::array::from_fn(|i| of(&rays[i]));
            [
                std::array::from_fn(|axis| column(&|ray| ray.origin[axis])),
                std::array::from_fn(|axis| column(&|ray| ray.direction[axis])),
            ]
        };
        let image = |of: &dyn Fn(&DRay) -> DRay| columns(&rays.iter().map(of).collect::<Vec<_>>());
        let expected = [image(&|ray| mapped(&map, ray)), image(&|ray| frame.ray(ray))];
        let rays = columns(&rays);
        for level in levels() {
            let found = match level.wide() {
                #[cfg(target_arch = "x86_64")]
                Some(Wide::Avx512(token)) => in_lanes::<Avx16>(token, &rays, &map, &frame),
                Some(wide) => in_lanes::<Pair<Wide8>>(WideToken::from(wide), &rays, &map, &frame),
                None => in_lanes::<Pair<Portable8>>(Portable, &rays, &map, &frame),
            };
            assert_eq!(found, expected, "{level}");
        }
    }
}
