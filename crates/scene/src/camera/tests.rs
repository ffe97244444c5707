use super::*;
use proptest::prelude::*;
use snell_math::rng::uniform2;
use snell_math::{DMat4, DVec4};

const SIZE: [u32; 2] = [640, 360];

fn ray(camera: &Camera, film: DVec2, size: [u32; 2]) -> CameraRay {
    camera.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, size)
}

fn direction(camera: &Camera, x: f64, y: f64) -> DVec3 {
    ray(camera, DVec2::new(x, y), SIZE).ray.direction.as_dvec3()
}

fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() < 1e-6
}

fn with(projection: Projection) -> Camera {
    Camera::from_direction(
        DVec3::new(1.0, 2.0, 3.0),
        DVec3::new(1.0, -0.2, -2.0),
        DVec3::Y,
        projection,
    )
}

const BARREL: [f64; 12] = [-0.2, 0.03, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

fn examples() -> Vec<Camera> {
    let intrinsics =
        Intrinsics { skew: 3.0, ..Intrinsics::new([500.0, 510.0], [300.0, 200.0], [640, 360]) };
    vec![
        with(Projection::Perspective { tan_half_fov: [Some(0.5), None] }),
        with(Projection::Perspective { tan_half_fov: [None, Some(0.7)] }),
        with(Projection::Perspective { tan_half_fov: [Some(0.5), Some(0.5)] }),
        with(Projection::Intrinsics(intrinsics)),
        with(Projection::Intrinsics(Intrinsics { distortion: BARREL, ..intrinsics })),
        with(Projection::Intrinsics(Intrinsics {
            fisheye: Some([0.02, -0.005, 0.001, 0.0]),
            pixel_center: 0.0,
            ..intrinsics
        })),
        with(Projection::Orthographic { half_size: [Some(3.0), None] }),
        with(Projection::Panoramic),
        with(Projection::EqualArea),
        with(Projection::Fisheye { max_angle: PI }),
        with(Projection::Fisheye { max_angle: 1.9 * PI }),
    ]
}

#[test]
fn central_rays_keep_double_precision_far_from_zero() {
    for mut camera in examples() {
        camera.eye += DVec3::new(448_262.125, 5_411_932.625, 120.0);
        for i in 0..200 {
            let film = uniform2([i, 0, 0, 0]).as_dvec2() * DVec2::new(640.0, 360.0);
            let Some(central) = camera.central_ray(film, SIZE) else {
                assert_eq!(ray(&camera, film, SIZE).weight, 0.0);
                continue;
            };
            assert!((central.direction.length() - 1.0).abs() < 1e-12);
            assert!(close(central.direction, ray(&camera, film, SIZE).ray.direction.as_dvec3()));
            let back = camera.project(central.at(7.0), SIZE).expect("it is seen");
            assert!((back - film).length() < 1e-4, "{camera:?} {film} {back}");
        }
    }
}

#[test]
fn a_clipped_camera_has_the_same_rays_beyond_its_plane() {
    // Of the sight from z = 3 towards -z only what is below z = 1 is left.
    for whole in examples() {
        let camera = Camera { clip: Some([0.0, 0.0, -1.0, 1.0]), ..whole.clone() };
        for i in 0..50 {
            let film = uniform2([i, 1, 0, 0]).as_dvec2() * DVec2::new(640.0, 360.0);
            let (before, after) = (ray(&whole, film, SIZE), ray(&camera, film, SIZE));
            assert_eq!(
                (before.ray.origin, before.ray.direction, before.weight, before.spread),
                (after.ray.origin, after.ray.direction, after.weight, after.spread)
            );
            if after.ray.direction.z < -1e-3 {
                assert!((after.ray.at(after.ray.t_min).z - 1.0).abs() < 1e-4);
                assert_eq!(after.ray.t_max, f32::INFINITY);
            } else if before.ray.origin.z > 1.0 && after.ray.direction.z > 0.0 {
                assert!(!after.ray.is_valid());
            }
        }
    }
}

#[test]
fn rays_pass_through_the_points_that_project_to_their_pixel() {
    for camera in examples() {
        for i in 0..200 {
            let film = uniform2([i, 0, 0, 0]).as_dvec2() * DVec2::new(640.0, 360.0);
            let r = ray(&camera, film, SIZE);
            assert!((r.ray.direction.as_dvec3().length() - 1.0).abs() < 1e-6);
            assert!(r.width >= 0.0 && r.spread >= 0.0);
            if r.weight == 0.0 {
                continue;
            }
            let back =
                camera.project(r.ray.origin.as_dvec3() + 7.0 * r.ray.direction.as_dvec3(), SIZE);
            let back = back.unwrap_or_else(|| panic!("{film} is seen by {camera:?}"));
            assert!((back - film).length() < 2e-3, "{film} came back as {back}: {camera:?}");
        }
    }
}

#[test]
fn the_slides_ray_construction_gives_the_same_rays() {
    // right = towards x up; P1 = P0 + d towards - d tan(theta) right; P2 = P0 + d towards + d
    // tan(theta) right; P = P1 + ((i + 0.5) / width) (P2 - P1); V = (P - P0) / |P - P0|, where
    // theta is the half-angle of the frustum.
    let (p0, towards, up) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.6, 0.0, -0.8), DVec3::Y);
    let (theta, width) = (0.4f64, 11u32);
    let camera = Camera::from_direction(p0, towards, up, Projection::from_half_angle_x(theta));
    for d in [0.01, 1.0, 50.0] {
        let right = towards.cross(up);
        let p1 = p0 + d * towards - d * theta.tan() * right;
        let p2 = p0 + d * towards + d * theta.tan() * right;
        for i in 0..width {
            let s = (f64::from(i) + 0.5) / f64::from(width);
            let p = p1 + s * (p2 - p1);
            let r = ray(&camera, DVec2::new(f64::from(i) + 0.5, 0.5), [width, 1]).ray;
            assert!(
                close(r.direction.as_dvec3(), (p - p0).normalize()) && r.origin == p0.as_vec3()
            );
        }
    }
}

#[test]
fn the_angle_of_view_is_total_and_its_axis_is_respected() {
    let angle = |projection, size: [u32; 2], axis: usize| {
        let camera = Camera::from_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, projection);
        let mut film = DVec2::new(f64::from(size[0]), f64::from(size[1])) / 2.0;
        film[axis] = 0.0;
        2.0 * ray(&camera, film, size)
            .ray
            .direction
            .as_dvec3()
            .angle_between(DVec3::NEG_Z)
            .to_degrees()
    };
    let (wide, tall) = ([200, 100], [100, 200]);
    for (axis, size, measured) in [
        (FovAxis::X, wide, 0),
        (FovAxis::Y, wide, 1),
        (FovAxis::Larger, wide, 0),
        (FovAxis::Smaller, wide, 1),
        (FovAxis::Larger, tall, 1),
        (FovAxis::Smaller, tall, 0),
    ] {
        let found = angle(Projection::from_fov_degrees(60.0, axis, size), size, measured);
        assert!((found - 60.0).abs() < 1e-4, "{axis:?} {size:?}: {found}");
    }
    let half = angle(Projection::from_half_angle_y(0.25), wide, 1).to_radians();
    assert!((half - 0.5).abs() < 1e-6);
}

#[test]
fn pixels_are_square_unless_both_angles_are_given() {
    let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 0.5);
    let corner = direction(&camera, 0.0, 0.0);
    assert!(close(corner, DVec3::new(-0.5 * 640.0 / 360.0, 0.5, -1.0).normalize()));
}

#[test]
fn camera_matrices_project_known_points_to_known_pixels() {
    // With fx = 100 and the centre (50, 40), the point (0.1, 0.2, 1), measured to the right, down
    // and in front, appears at (60, 60).
    let intrinsics = Intrinsics::new([100.0; 2], [50.0, 40.0], [100, 80]);
    let projection = Projection::Intrinsics(intrinsics);
    let pose = DMat4::from_rotation_y(0.7) * DMat4::from_translation(DVec3::new(1.0, -2.0, 5.0));
    for (axes, local) in [
        (CameraAxes::OpenCv, DVec3::new(0.1, 0.2, 1.0)),
        (CameraAxes::OpenGl, DVec3::new(0.1, -0.2, -1.0)),
        (CameraAxes::Ros, DVec3::new(1.0, -0.1, -0.2)),
    ] {
        let point = pose.transform_point3(local);
        for camera in [
            Camera::from_matrix(pose, axes, projection).expect("a pose"),
            Camera::from_extrinsics(pose.inverse(), axes, projection).expect("a pose"),
        ] {
            let pixel = camera.project(point, [100, 80]).expect("in front");
            assert!((pixel - DVec2::new(60.0, 60.0)).length() < 1e-9, "{axes:?} {pixel}");
            // A picture of twice the resolution shows the same view.
            let pixel = camera.project(point, [200, 160]).expect("in front");
            assert!((pixel - DVec2::new(120.0, 120.0)).length() < 1e-9, "{axes:?} {pixel}");
            assert!((camera.matrix(axes) - pose).abs_diff_eq(DMat4::ZERO, 1e-12));
        }
    }
}

#[test]
fn a_distorting_lens_shows_what_opencv_computes() {
    // cv2.projectPoints([[0.4, -0.3, 2], [-1, 0.8, 3]], 0, 0, K, BARREL[:5]) of OpenCV 4.
    let intrinsics = Intrinsics {
        pixel_center: 0.0,
        distortion: BARREL,
        ..Intrinsics::new([500.0, 510.0], [300.0, 200.0], [640, 360])
    };
    let pose = DMat4::IDENTITY;
    let camera = Camera::from_matrix(pose, CameraAxes::OpenCv, Projection::Intrinsics(intrinsics))
        .expect("a pose");
    for (point, expected) in [
        ([0.4, -0.3, 2.0], [398.69609375, 124.51741015625001]),
        ([-1.0, 0.8, 3.0], [139.0513827160494, 331.38983170370375]),
    ] {
        let seen = camera.project(DVec3::from_array(point), [640, 360]).expect("in front");
        let expected = DVec2::from(expected) + 0.5;
        assert!((seen - expected).length() < 1e-9, "{seen} {expected}");
    }
}

#[test]
fn skew_moves_points_sideways_by_height() {
    let intrinsics =
        Intrinsics { skew: 10.0, ..Intrinsics::new([100.0; 2], [50.0, 40.0], [100, 80]) };
    let camera = Camera::from_matrix(
        DMat4::IDENTITY,
        CameraAxes::OpenCv,
        Projection::Intrinsics(intrinsics),
    )
    .expect("a pose");
    let pixel = camera.project(DVec3::new(0.0, 0.2, 1.0), [100, 80]).expect("in front");
    assert!((pixel - DVec2::new(52.0, 60.0)).length() < 1e-9);
}

#[test]
fn matrices_that_are_no_pose_are_refused() {
    let projection = Projection::Panoramic;
    let mirrored = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let singular = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let transposed = DMat4::from_translation(DVec3::X).transpose();
    let refused = |m| Camera::from_matrix(m, CameraAxes::OpenCv, projection).expect_err("no pose");
    assert_eq!(refused(mirrored), CameraError::Mirrored);
    assert_eq!(refused(singular), CameraError::NotAPose);
    assert_eq!(refused(transposed), CameraError::NotAPose);
    assert_eq!(
        refused(DMat4::from_cols(DVec4::NAN, DVec4::Y, DVec4::Z, DVec4::W)),
        CameraError::NotAPose
    );
    assert!(Camera::from_extrinsics(singular, CameraAxes::OpenGl, projection).is_err());
}

#[test]
fn a_panorama_shows_the_axes_where_they_belong() {
    let camera = Camera::from_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, Projection::Panoramic);
    assert!(close(direction(&camera, 320.0, 180.0), DVec3::NEG_Z));
    assert!(close(direction(&camera, 480.0, 180.0), DVec3::X));
    assert!(close(direction(&camera, 160.0, 180.0), DVec3::NEG_X));
    assert!(close(direction(&camera, 0.0, 180.0), DVec3::Z));
    assert!(close(direction(&camera, 77.0, 0.0), DVec3::Y));
    assert!(close(direction(&camera, 77.0, 360.0), DVec3::NEG_Y));
}

#[test]
fn an_equal_area_square_shows_the_axes_where_they_belong() {
    let camera = Camera::from_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, Projection::EqualArea);
    assert!(close(direction(&camera, 320.0, 180.0), DVec3::Y));
    assert!(close(direction(&camera, 640.0, 180.0), DVec3::X));
    assert!(close(direction(&camera, 0.0, 180.0), DVec3::NEG_X));
    assert!(close(direction(&camera, 320.0, 360.0), DVec3::NEG_Z));
    assert!(close(direction(&camera, 320.0, 0.0), DVec3::Z));
    assert!(close(direction(&camera, 0.0, 0.0), DVec3::NEG_Y));
}

#[test]
fn a_fisheye_is_equidistant_and_ends_at_its_circle() {
    let camera = Camera::from_direction(
        DVec3::ZERO,
        DVec3::NEG_Z,
        DVec3::Y,
        Projection::Fisheye { max_angle: PI },
    );
    assert!(close(direction(&camera, 320.0, 180.0), DVec3::NEG_Z));
    assert!(close(direction(&camera, 500.0, 180.0), DVec3::X));
    assert!(close(direction(&camera, 320.0, 0.0), DVec3::Y));
    assert!(close(direction(&camera, 410.0, 180.0), DVec3::new(1.0, 0.0, -1.0).normalize()));
    assert_eq!(ray(&camera, DVec2::new(501.0, 180.0), SIZE).weight, 0.0);
    assert_eq!(ray(&camera, DVec2::new(499.0, 180.0), SIZE).weight, 1.0);
}

#[test]
fn orthographic_rays_are_parallel_and_span_the_given_size() {
    let projection = Projection::Orthographic { half_size: [None, Some(2.0)] };
    let camera = Camera::from_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, projection);
    let r = ray(&camera, DVec2::new(0.0, 0.0), [200, 100]);
    assert_eq!((r.ray.origin, r.ray.direction), (Vec3::new(-4.0, 2.0, 0.0), Vec3::NEG_Z));
    assert_eq!((r.width, r.spread), (0.04, 0.0));
    assert!(!camera.has_common_origin());
}

#[test]
fn all_rays_through_the_lens_meet_in_the_plane_of_focus() {
    for projection in [
        Projection::from_half_angle_y(0.4),
        Projection::Orthographic { half_size: [None, Some(2.0)] },
        Projection::Intrinsics(Intrinsics::new([300.0; 2], [320.0, 180.0], SIZE)),
    ] {
        let pinhole = with(projection);
        let camera = pinhole.clone().with_lens(0.3, 5.0);
        assert!(!camera.has_common_origin());
        let film = DVec2::new(100.0, 300.0);
        let chief = ray(&pinhole, film, SIZE).ray;
        let at_focus = |r: &Ray| {
            let depth = (r.origin.as_dvec3() - camera.eye).dot(camera.towards);
            let t = (5.0 - depth) / r.direction.as_dvec3().dot(camera.towards);
            r.origin.as_dvec3() + r.direction.as_dvec3() * t
        };
        let mut widest = 0.0f64;
        for i in 0..100 {
            let r = camera.ray(&CameraSample { film, lens: uniform2([i, 5, 5, 5]) }, SIZE).ray;
            assert!((at_focus(&r) - at_focus(&chief)).length() < 1e-5);
            let offset = (r.origin - chief.origin).as_dvec3();
            assert!(offset.dot(camera.towards).abs() < 1e-6);
            widest = widest.max(offset.length());
        }
        assert!(widest > 0.27 && widest <= 0.3 + 1e-6);
    }
}

#[test]
fn the_spread_is_the_root_of_the_pixels_solid_angle() {
    // The pixels of a whole panorama cover the sphere, and those of a square view of 90 degrees
    // cover a sixth of the sphere.
    let total = |camera: &Camera, size: [u32; 2]| {
        let mut sum = 0.0;
        for y in 0..size[1] {
            for x in 0..size[0] {
                let r = ray(camera, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), size);
                sum += f64::from(r.spread).powi(2) * f64::from(r.weight);
            }
        }
        sum / (4.0 * PI)
    };
    assert!((total(&with(Projection::Panoramic), [120, 60]) - 1.0).abs() < 1e-3);
    assert!((total(&with(Projection::EqualArea), [60, 60]) - 1.0).abs() < 1e-6);
    assert!(
        (total(&with(Projection::from_half_angle_x(PI / 4.0)), [64, 64]) - 1.0 / 6.0).abs() < 1e-4
    );
    assert!((total(&with(Projection::Fisheye { max_angle: PI }), [128, 128]) - 0.5).abs() < 5e-3);
}

#[test]
fn degenerate_cameras_still_have_orthonormal_axes() {
    let (nan, zero) = (DVec3::splat(f64::NAN), DVec3::ZERO);
    for towards in [
        DVec3::Y,
        DVec3::NEG_Y,
        DVec3::Z,
        DVec3::new(1e-200, 0.0, 1e-200),
        zero,
        nan,
        DVec3::splat(1e300),
    ] {
        for up in [DVec3::Y, DVec3::NEG_Y * 1e-300, DVec3::new(0.0, 1.0, 1e-12), zero, nan, towards]
        {
            let c =
                Camera::from_direction(zero, towards, up, Projection::from_half_angle_x(f64::NAN));
            let right = c.right();
            for (a, b) in [(c.towards, c.up), (c.up, right), (right, c.towards)] {
                assert!(
                    (a.length() - 1.0).abs() < 1e-9 && a.dot(b).abs() < 1e-9,
                    "{towards} {up}: {c:?}"
                );
            }
            assert!(ray(&c, DVec2::new(1.0, 2.0), SIZE).ray.is_valid());
        }
    }
}

proptest! {
    #[test]
    fn the_camera_looks_at_its_target_with_up_upwards(
        eye in prop::array::uniform3(-10.0..10.0f64),
        target in prop::array::uniform3(-10.0..10.0f64),
    ) {
        let (eye, target) = (DVec3::from(eye), DVec3::from(target));
        prop_assume!((target - eye).length() > 0.1);
        let camera = Camera::from_target(eye, target, DVec3::Y, Projection::from_half_angle_x(0.5));
        let pixel = camera.project(target, SIZE).expect("the target is in front");
        prop_assert!((pixel - DVec2::new(320.0, 180.0)).length() < 1e-6);
        prop_assert!(camera.up.y >= -1e-9 && camera.right().y.abs() < 1e-9);
        prop_assert!((camera.focus_distance - eye.distance(target)).abs() < 1e-9);
    }
}

#[test]
fn many_rays_are_those_of_single_points_at_every_level() {
    let with_lens = |camera: Camera| {
        [Camera { aperture_radius: 0.1, focus_distance: 3.0, ..camera.clone() }, camera]
    };
    for camera in examples().into_iter().flat_map(with_lens) {
        let view = camera.view(SIZE);
        let film: [[f64; 40]; 2] = [[0.37, 640.0], [0.81, 360.0]].map(|[step, side]: [f64; 2]| {
            std::array::from_fn(|i| (i as f64 * step).fract() * side)
        });
        let lens: [[f32; 40]; 2] =
            [0.29, 0.53].map(|step: f32| std::array::from_fn(|i| (i as f32 * step).fract()));
        for level in snell_math::simd::Level::ALL {
            let mut rays = CameraRays::default();
            let is_known = view.many_rays(&film, &lens, level.wide(), &mut rays);
            let is_flat = match camera.projection {
                Projection::Perspective { .. } => true,
                Projection::Intrinsics(k) => !k.is_distorted(),
                _ => false,
            };
            assert_eq!(is_known, is_flat);
            for (i, (&x, &y)) in film[0].iter().zip(&film[1]).enumerate().filter(|_| is_known) {
                let lens = Vec2::new(lens[0][i], lens[1][i]);
                let single = view.ray(&CameraSample { film: DVec2::new(x, y), lens });
                assert_eq!(rays.get(i), single, "{:?} {level}", camera.projection);
            }
        }
    }
}
