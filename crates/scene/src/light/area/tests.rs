use super::*;
use snell_intersect::shape::{BoxShape, Disk, Rectangle, Sphere, Triangle};
use snell_intersect::{AnyShape, first_uv_set};
use snell_math::rng::uniform2;
use snell_math::statistics::{chi_squared_deviation, sidak_deviation};
use snell_math::{DAffine3, DMat3};
use std::f64::consts::PI;

/// A mesh of four triangles: two of areas 1 and 3, one without area, and one that does not emit.
fn mesh() -> Arc<TriangleMesh> {
    let p = [[0., 0., 0.], [2., 0., 0.], [0., 1., 0.], [0., 0., 5.], [0., 3., 5.], [0., 0., 7.]];
    Arc::new(TriangleMesh {
        positions: p.map(Vec3::from).to_vec(),
        indices: vec![[0, 1, 2], [0, 1, 1], [0, 1, 5], [3, 4, 5]],
        normals: vec![Vec3::new(0.6, 0.0, -0.8); 6],
        uvs: first_uv_set(p.map(|[x, y, z]| Vec2::new(x, y + z)).to_vec()),
        colors: (0..6).map(|i| [i as f32, 0.0, 0.0, 1.0]).collect(),
        ..TriangleMesh::default()
    })
}

fn stretched() -> Transform {
    let matrix = DMat3::from_cols(
        DVec3::new(2.0, 0.5, 0.0),
        DVec3::new(0.0, -1.0, 0.3),
        DVec3::new(0.0, 0.0, 0.5),
    );
    Transform::new(DAffine3::from_mat3_translation(matrix, DVec3::new(1.0, 2.0, 3.0)))
        .expect("invertible")
}

fn mesh_light(place: Transform) -> AreaLight {
    let geometry = EmissiveGeometry::Mesh { mesh: mesh(), triangles: vec![3, 1, 0, 3, 99] };
    AreaLight::new(geometry, place, (7, 8)).expect("it has area")
}

fn sphere_light(place: Transform) -> AreaLight {
    AreaLight::new(EmissiveGeometry::Shape(Arc::new(Sphere { radius: 2.0 })), place, (7, 8))
        .expect("area")
}

#[test]
fn mesh_points_are_uniform_by_world_area() {
    for place in [Transform::IDENTITY, stretched()] {
        let light = mesh_light(place);
        let area = |t: usize| {
            let [a, b, c] = mesh().corners(t).map(|p| place.point(p.as_dvec3()));
            (b - a).cross(c - a).length() / 2.0
        };
        assert!((light.area() - area(0) - area(3)).abs() < 1e-9);
        let (n, mut first, mut center) = (20_000, 0, DVec3::ZERO);
        for i in 0..n {
            let s = light.sample(uniform2([i, 1, 0, 0])).expect("a point");
            assert!((f64::from(s.pdf_area) * light.area() - 1.0).abs() < 1e-5);
            assert_eq!(s.pdf_area, light.pdf_area(&s.surface));
            if s.surface.primitive == 0 {
                first += 1;
                center += place.inverse().point(s.surface.position.as_dvec3());
            } else {
                assert_eq!(s.surface.primitive, 3);
            }
        }
        let p = area(0) / light.area();
        let sigma = (p * (1.0 - p) / f64::from(n)).sqrt();
        assert!((f64::from(first) / f64::from(n) - p).abs() < 4.0 * sigma);
        // The expected mean is the centroid; the standard deviation of a coordinate is below 0.5.
        let mean = center / f64::from(first);
        assert!(
            (mean - DVec3::new(2.0 / 3.0, 1.0 / 3.0, 0.0)).length() < 3.0 / f64::from(first).sqrt()
        );
    }
}

#[test]
fn the_density_of_triangles_that_do_not_emit_is_zero() {
    let light = mesh_light(Transform::IDENTITY);
    let mut surface = light.sample(Vec2::splat(0.3)).expect("a point").surface;
    for (primitive, positive) in
        [(0, true), (1, false), (2, false), (3, true), (99, false), (u32::MAX, false)]
    {
        surface.primitive = primitive;
        assert_eq!(light.pdf_area(&surface) > 0.0, positive, "{primitive}");
    }
}

#[test]
fn a_mesh_point_carries_everything_that_emission_may_look_at() {
    let light = mesh_light(Transform::IDENTITY);
    for i in 0..100 {
        let s = light.sample(uniform2([i, 3, 3, 3])).expect("a point").surface;
        let p = s.position;
        assert!((s.uv[0] - Vec2::new(p.x, p.y + p.z)).length() < 1e-5 && s.uv[1] == Vec2::ZERO);
        assert_eq!((s.instance, s.geometry), (7, 8));
        let (n, color) =
            if s.primitive == 0 { (Vec3::Z, p.x / 2.0 + 2.0 * p.y) } else { (Vec3::X, 0.0) };
        assert!((s.geometric_normal - n).length() < 1e-6 && s.shading_normal.dot(n) > 0.0);
        assert!((s.shading_normal.length() - 1.0).abs() < 1e-6);
        if s.primitive == 0 {
            assert!((s.color[0] - color).abs() < 1e-5);
            assert!((s.dpdu - Vec3::X).length() < 1e-5 && (s.dpdv - Vec3::Y).length() < 1e-5);
        }
        assert!(s.position_error.cmpge(Vec3::ZERO).all() && s.position_error.max_element() < 1e-5);
    }
}

#[test]
fn a_mirrored_mesh_keeps_its_outer_side() {
    let mirror =
        Transform::new(DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0))).expect("invertible");
    let s = mesh_light(mirror).sample(Vec2::new(0.01, 0.5)).expect("a point").surface;
    assert_eq!((s.primitive, s.geometric_normal), (0, Vec3::NEG_Z));
}

#[test]
fn shape_densities_integrate_to_one_under_any_transform() {
    for place in [Transform::IDENTITY, stretched()] {
        let light = sphere_light(place);
        // Integrates the density over the ellipsoid, in longitude and height of the sphere.
        let (n, mut integral, mut area) = (300, 0.0, 0.0);
        for i in 0..n {
            for j in 0..n {
                let (z, phi) = (
                    1.0 - 2.0 * (i as f64 + 0.5) / n as f64,
                    2.0 * PI * (j as f64 + 0.5) / n as f64,
                );
                let r = (1.0 - z * z).sqrt();
                let normal = DVec3::new(r * phi.cos(), r * phi.sin(), z);
                let mut surface = light.sample(Vec2::ZERO).expect("a point").surface;
                surface.geometric_normal = place.normal(normal).normalize().as_vec3();
                let patch = 16.0 * PI / f64::from(n * n) * place.area_scale(normal);
                integral += f64::from(light.pdf_area(&surface)) * patch;
                area += patch;
            }
        }
        assert!((integral - 1.0).abs() < 1e-5, "{integral}");
        assert!((light.area() / area - 1.0).abs() < 0.01, "{} {area}", light.area());
    }
}

#[test]
fn shape_samples_estimate_the_world_area_without_bias() {
    let light = sphere_light(stretched());
    let n = 50_000;
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..n {
        let s = light.sample(uniform2([i, 2, 2, 2])).expect("a point");
        assert_eq!(s.pdf_area, light.pdf_area(&s.surface));
        let local = stretched().inverse().point(s.surface.position.as_dvec3());
        assert!((local.length() - 2.0).abs() < 1e-5);
        let x = 1.0 / f64::from(s.pdf_area);
        sum += x;
        squares += x * x;
    }
    let mean = sum / f64::from(n);
    let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
    assert!(
        (mean - light.area()).abs() < 3.0 * error + 0.01 * mean,
        "{mean} {error} {}",
        light.area()
    );
}

#[test]
fn stratified_numbers_stay_stratified_over_the_triangles() {
    let light = mesh_light(Transform::IDENTITY);
    let first = (0..400).filter(|i| {
        let s = light.sample(Vec2::new((*i as f32 + 0.5) / 400.0, 0.5)).expect("a point");
        s.surface.primitive == 0
    });
    assert_eq!(first.count(), 100);
}

#[test]
fn surfaces_without_area_are_no_lights() {
    let light = |triangles| {
        AreaLight::new(
            EmissiveGeometry::Mesh { mesh: mesh(), triangles },
            Transform::IDENTITY,
            (0, 0),
        )
    };
    assert!(light(vec![1]).is_none() && light(vec![]).is_none() && light(vec![99]).is_none());
    let point = EmissiveGeometry::Shape(Arc::new(Sphere { radius: 0.0 }));
    assert!(AreaLight::new(point, Transform::IDENTITY, (0, 0)).is_none());
    let mut broken = (*mesh()).clone();
    broken.positions[2] = Vec3::NAN;
    let geometry = EmissiveGeometry::Mesh { mesh: Arc::new(broken), triangles: vec![0] };
    assert!(AreaLight::new(geometry, Transform::IDENTITY, (0, 0)).is_none());
}

#[test]
fn every_shape_with_area_can_be_a_light() {
    for shape in AnyShape::examples() {
        for place in [Transform::IDENTITY, stretched()] {
            let Some(light) =
                AreaLight::new(EmissiveGeometry::Shape(Arc::new(shape.clone())), place, (0, 0))
            else {
                assert!(!shape.area().is_finite() || shape.area() == 0.0, "{shape:?}");
                continue;
            };
            for i in 0..50 {
                let s = light.sample(uniform2([i, 6, 6, 6])).expect("a point");
                assert!(
                    s.pdf_area > 0.0 && s.pdf_area.is_finite() && s.surface.position.is_finite()
                );
                assert!(s.surface.geometric_normal.is_normalized(), "{shape:?}");
                let again = light.pdf_area(&s.surface);
                assert!((again / s.pdf_area - 1.0).abs() < 1e-5);
            }
        }
    }
}

/// Lights of each kind that can be sampled by solid angle, and of some that cannot, in two places.
fn seen_lights() -> Vec<AreaLight> {
    let turned = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.1) * 1.5;
    let turned =
        Transform::new(DAffine3::from_mat3_translation(turned, DVec3::new(0.2, -0.1, 0.3)))
            .expect("invertible");
    let shapes: Vec<AnyShape> = vec![
        Sphere { radius: 0.7 }.into(),
        Disk { radius: 1.0, inner_radius: 0.0 }.into(),
        Disk { radius: 1.0, inner_radius: 0.5 }.into(),
        Rectangle { half_size: DVec2::new(1.2, 0.4) }.into(),
        Triangle { vertices: [DVec3::ZERO, DVec3::new(1.5, 0.0, 0.1), DVec3::new(0.2, 0.9, -0.3)] }
            .into(),
        BoxShape { min: DVec3::splat(-0.5), max: DVec3::new(0.5, 0.4, 0.8) }.into(),
    ];
    let mut lights = vec![mesh_light(turned), mesh_light(stretched())];
    for shape in shapes {
        for place in [turned, stretched()] {
            let geometry = EmissiveGeometry::Shape(Arc::new(shape.clone()));
            lights.push(AreaLight::new(geometry, place, (0, 0)).expect("it has area"));
        }
    }
    lights
}

/// Chi-squared test of points sampled by solid angle: they fall into cells of the surface as often
/// as the integral of the density over the cell by area says. Where the density does not integrate
/// to 1, the rest are samples that miss the part (those of the square around a disk).
#[test]
fn points_seen_from_somewhere_are_distributed_by_their_density() {
    const N: u32 = 6000;
    const CELLS: usize = 5;
    let (mut tests, mut worst) = (0, (0.0, String::new()));
    for (number, light) in seen_lights().into_iter().enumerate() {
        for (k, from) in
            [Vec3::new(0.4, 0.9, 1.6), Vec3::new(-3.0, 2.0, -1.0), Vec3::new(0.3, 0.5, -9.0)]
                .into_iter()
                .enumerate()
        {
            for part in (0..light.part_count()).filter(|&part| light.part_area(part) > 0.0) {
                let cell = |s: &SurfaceInteraction| {
                    let uv = if s.primitive_uv == Vec2::ZERO { s.uv[0] } else { s.primitive_uv };
                    let at = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
                    at(uv.x) * CELLS + at(uv.y) + CELLS * CELLS * (s.primitive as usize % 6)
                };
                let mut expected = vec![0.0; CELLS * CELLS * 6 + 1];
                let n = 300;
                for i in 0..n * n {
                    let u = (UVec2::new(i % n, i / n).as_vec2() + 0.5) / n as f32;
                    let Some(s) = light.part_surface(part, u) else { continue };
                    let area = match &light.table {
                        Table::Mesh { .. } => light.part_area(part),
                        Table::Shape { pdf, .. } => {
                            1.0 / f64::from(light.shape_pdf(*pdf, s.geometric_normal))
                        }
                    };
                    let way = s.position - from;
                    let direction = way.normalize();
                    let cos = direction.dot(s.geometric_normal).abs();
                    let per_area =
                        light.pdf_from(part, from, &s, direction) * cos / way.length_squared();
                    expected[cell(&s)] +=
                        f64::from(per_area) * area / f64::from(n * n) * f64::from(N);
                }
                let total: f64 = expected.iter().sum::<f64>() / f64::from(N);
                let is_disk =
                    matches!(&light.table, Table::Shape { outline: Outline::Disk { .. }, .. });
                assert!(total < 1.01 && (is_disk || total > 0.99), "{number} {k} {part}: {total}");
                *expected.last_mut().expect("there are cells") =
                    (1.0 - total).max(0.0) * f64::from(N);
                let mut found = vec![0; expected.len()];
                for i in 0..N {
                    match light.sample_from(
                        part,
                        from,
                        uniform2([i, number as u32, k as u32, part]),
                    ) {
                        Some(s) => {
                            let again = light.pdf_from(part, from, &s.surface, s.direction);
                            assert!(
                                (again / s.pdf - 1.0).abs() < 1e-3,
                                "{number} {k}: {again} {}",
                                s.pdf
                            );
                            let way = (s.surface.position - from).normalize();
                            assert!((way - s.direction).length() < 1e-5, "{number} {k}");
                            found[cell(&s.surface)] += 1;
                        }
                        None => found[expected.len() - 1] += 1,
                    }
                }
                let deviation = chi_squared_deviation(&found, &expected);
                tests += 1;
                if deviation > worst.0 {
                    worst = (deviation, format!("{number} {k} {part}: {found:?} {expected:?}"));
                }
            }
        }
    }
    assert!(
        tests > 40 && worst.0 < sidak_deviation(0.01, tests),
        "{tests} tests, the worst {worst:?}"
    );
}

/// Viewpoints that are very near, very far, inside of a sphere, or in the plane of a flat light
/// must give finite densities, and two estimates of the same integral must agree.
#[test]
fn hostile_viewpoints_give_finite_densities() {
    for (number, light) in seen_lights().into_iter().enumerate() {
        let p = light.sample(Vec2::splat(0.4)).expect("a point").surface;
        let froms = [
            p.position,
            p.position + p.geometric_normal * 1e-6,
            p.position - p.geometric_normal * 1e-3,
            p.position + p.dpdu * 0.3,
            p.position + p.geometric_normal * 1e6,
            Vec3::splat(1e30),
            Vec3::splat(f32::INFINITY),
            Vec3::NAN,
        ];
        for from in froms {
            for i in 0..200 {
                for part in 0..light.part_count() {
                    let Some(s) = light.sample_from(part, from, uniform2([i, 5, 5, number as u32]))
                    else {
                        continue;
                    };
                    assert!(
                        s.pdf > 0.0 && s.pdf.is_finite() && s.direction.is_normalized(),
                        "{number} {from}: {s:?}"
                    );
                    assert!(s.surface.position.is_finite());
                }
            }
        }
    }
}

#[test]
fn parts_are_chosen_by_how_strongly_they_shine() {
    let light = mesh_light(Transform::IDENTITY)
        .measured(1, |s, _| if s.primitive == 0 { 9.0 } else { 0.0 });
    let [bright, dark] = [0, 2].map(|part| light.part_probability(part));
    assert!(bright > 0.99 && dark > 0.0, "{bright} {dark}");
    assert!((light.mean_radiance() - 9.0 / 4.0).abs() < 1e-5);
    assert_eq!(
        (light.part_bounds(0, false).intensity, light.part_bounds(2, false).intensity),
        (9.0, 0.0)
    );
    for i in 0..100 {
        let s = light.sample(uniform2([i, 1, 1, 1])).expect("a point");
        assert_eq!(s.pdf_area, light.pdf_area(&s.surface));
    }
}

#[test]
fn flat_parts_sampled_from_afar_cover_their_solid_angle() {
    let place = Transform::new(
        DAffine3::from_translation(DVec3::new(1.0, 2.0, -3.0)) * DAffine3::from_rotation_x(0.7),
    )
    .expect("not singular");
    let shapes: [AnyShape; 2] = [
        Rectangle { half_size: DVec2::new(0.3, 0.8) }.into(),
        Triangle { vertices: [DVec3::ZERO, DVec3::X, DVec3::new(0.2, 0.9, 0.0)] }.into(),
    ];
    for (number, shape) in shapes.into_iter().enumerate() {
        let outline = Outline::of(&shape, &place);
        let light = AreaLight::new(EmissiveGeometry::Shape(Arc::new(shape)), place, (0, 0))
            .expect("it has an area");
        let flat = light.flat(0).expect("it is flat");
        for from in [Vec3::new(4.0, 2.0, 1.0), Vec3::new(-3.0, 6.0, -9.0)] {
            assert!(flat.is_far(from) && light.seen_from(0, from).is_none());
            let solid_angle =
                1.0 / outline.seen_from(from.as_dvec3()).expect("it can be seen").pdf();
            let samples: Vec<_> =
                (0..20_000).map(|i| flat.sample(from, uniform2([i, 3, 1, 9]))).collect();
            assert!(samples.iter().all(|s| s.exists && s.direction.is_normalized() && s.pdf > 0.0));
            let mean = samples.iter().map(|s| 1.0 / s.pdf).sum::<f32>() / samples.len() as f32;
            assert!((mean / solid_angle - 1.0).abs() < 0.01, "{number}: {mean} {solid_angle}");
            let is_front =
                (from.as_dvec3() - place.point(DVec3::ZERO)).dot(flat.normal.as_dvec3()) > 0.0;
            assert!(samples.iter().all(|s| s.is_front == is_front), "{number}");
            // The end of the shadow ray must lie before the surface.
            let before =
                |p: Vec3| (p - flat.corner).dot(flat.normal) * if is_front { 1.0 } else { -1.0 };
            assert!(
                samples.iter().all(|s| before(s.end) >= 0.0 && before(s.end) < 1e-4),
                "{number}"
            );
        }
        assert!(!flat.is_far(place.point(DVec3::new(0.1, 0.1, 0.5)).as_vec3()));
    }
}

#[test]
fn near_triangles_are_sampled_alike_with_and_without_all_of_the_surface() {
    let mesh = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(0.2, 0.9, 0.1), Vec3::new(1.5, 0.7, 0.3)],
        indices: vec![[0, 1, 2], [2, 1, 3]],
        ..TriangleMesh::default()
    };
    let geometry = EmissiveGeometry::Mesh { mesh: Arc::new(mesh), triangles: vec![0, 1] };
    let light = AreaLight::new(geometry, Transform::IDENTITY, (0, 0)).expect("it has an area");
    let mut near = 0;
    for i in 0..2000 {
        let number = |k: u32| uniform2([i, k, 8, 8]);
        let from = Vec3::new(number(0).x, number(0).y, number(1).x) * 4.0 - 1.5;
        let (part, u) = (i % 2, number(2));
        near += u32::from(!light.flat(part).expect("it is flat").is_far(from));
        let sample = light.sample_simple(part, from, u).filter(|sample| sample.exists);
        let whole = light.sample_from(part, from, u);
        assert_eq!(sample.is_some(), whole.is_some(), "{from}");
        if let Some((sample, whole)) = sample.zip(whole) {
            assert_eq!((sample.direction, sample.pdf), (whole.direction, whole.pdf), "{from}");
            assert_eq!(sample.end, whole.surface.ray_origin(-sample.direction), "{from}");
        }
    }
    assert!(near > 100, "{near}");
}

#[test]
fn spheres_are_sampled_alike_with_and_without_all_of_the_surface() {
    let map =
        DAffine3::from_translation(DVec3::new(1.0, 2.0, -3.0)) * DAffine3::from_rotation_x(0.7);
    let place =
        Transform::new(map * DAffine3::from_scale(DVec3::splat(1.5))).expect("not singular");
    let geometry = EmissiveGeometry::Shape(Arc::new(Sphere { radius: 0.4 }));
    let light = AreaLight::new(geometry, place, (0, 0)).expect("it has an area");
    let (center, mut inside, mut sum) = (Vec3::new(1.0, 2.0, -3.0), 0, 0.0);
    for i in 0..4000 {
        let number = |k: u32| uniform2([i, k, 6, 6]);
        let from = center + (Vec3::new(number(0).x, number(0).y, number(1).x) - 0.5) * 2.0;
        let u = number(2);
        let sample = light
            .sample_simple(0, from, u)
            .filter(|sample| sample.exists)
            .expect("it is seen from everywhere");
        assert!(sample.direction.is_normalized() && sample.pdf > 0.0);
        if (from - center).length() < 0.5999 {
            assert!(!sample.is_front);
            // From there the whole part is visible, and it is sampled by area.
            let inner = center + (from - center) * 0.5;
            inside += 1;
            sum += 1.0
                / f64::from(
                    light.sample_simple(0, inner, u).expect("it is seen from everywhere").pdf,
                );
        } else if (from - center).length() > 0.6001 {
            let whole = light.sample_from(0, from, u).expect("it is seen from everywhere");
            assert!((sample.direction - whole.direction).length() < 1e-6, "{from}");
            assert!((sample.pdf / whole.pdf - 1.0).abs() < 1e-6 && sample.is_front, "{from}");
            // The end of the shadow ray must lie before the surface.
            let before = (sample.end - center).length() - 0.6;
            assert!((-1e-7..1e-5).contains(&before), "{from}: {before}");
        }
    }
    let all = sum / f64::from(inside) / (4.0 * PI);
    assert!(inside > 300 && (all - 1.0).abs() < 0.03, "{inside}: {all}");
    for from in
        [center, Vec3::splat(1e30), Vec3::splat(f32::INFINITY), Vec3::NAN, center + Vec3::X * 0.6]
    {
        let sample =
            light.sample_simple(0, from, Vec2::new(0.3, 0.6)).filter(|sample| sample.exists);
        if let Some(sample) = sample {
            assert!(
                sample.direction.is_normalized() && sample.pdf > 0.0 && sample.pdf.is_finite(),
                "{from}"
            );
        }
    }
}
