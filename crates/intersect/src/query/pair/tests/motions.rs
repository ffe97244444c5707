//! Moments of contact, against many small steps.

use super::super::{Motion, time_of_impact};
use super::*;

const TOLERANCE: f64 = 1e-7;

fn impact(a: &PairScene, motion: &Motion, b: &PairScene) -> f64 {
    time_of_impact(a, motion, (b, &Pose::IDENTITY), TOLERANCE, &PairQuery::default())
        .expect("not stopped")
}

fn gap(a: &PairScene, motion: &Motion, b: &PairScene, t: f64) -> f64 {
    let posed = Pose::new(motion.at(t)).expect("rigid");
    nearest((a, &posed), (b, &Pose::IDENTITY)).expect("a pair").distance
}

#[test]
fn nothing_meets_before_the_moment_found() {
    let mut rng = Rng(4 << 20);
    let mut found = 0;
    for i in 0..60 {
        let (a, b) = (scene(&soup(&mut rng, 12, 0.5)), scene(&soup(&mut rng, 12, 0.5)));
        let (from, to) = (pose(&mut rng, 2.2), pose(&mut rng, 2.2));
        let motion = Motion::new(&from, &to).expect("a motion");
        let ends = motion.at(1.0);
        assert!((ends.matrix3 - to.matrix3).to_cols_array().iter().all(|x| x.abs() < 1e-12));
        let t = impact(&a, &motion, &b);
        found += usize::from(t.is_finite());
        if t.is_finite() {
            assert!((0.0..=1.0).contains(&t));
            assert!(gap(&a, &motion, &b, t) <= TOLERANCE * 1.001, "{i}: {t}");
        }
        for k in 0..=400 {
            let at = f64::from(k) / 400.0;
            assert!(at >= t || gap(&a, &motion, &b, at) > 0.0, "{i}: meets at {at} before {t}");
        }
    }
    assert!((15..58).contains(&found), "{found} of 60 meet");
}

#[test]
fn thin_things_do_not_tunnel() {
    let wall = scene(&cuboid(DVec3::new(-5.0, -5.0, 0.0), DVec3::new(5.0, 5.0, 1e-6)));
    let bullet = scene(&cuboid(DVec3::splat(-1e-3), DVec3::splat(1e-3)));
    let at = |z: f64| DAffine3::from_translation(DVec3::new(0.3, 0.2, z));
    let motion = Motion::new(&at(1e3), &at(-1e3)).expect("a motion");
    let expected = (1e3 - 1e-6 - 1e-3) / 2e3;
    let t = impact(&bullet, &motion, &wall);
    assert!(t <= expected && t > expected - TOLERANCE / 2e3 * 1.01, "{t} {expected}");
    // Beside the wall and past it.
    let beside = |z: f64| DAffine3::from_translation(DVec3::new(5.0 + 2e-3, 0.2, z));
    let motion = Motion::new(&beside(1e3), &beside(-1e3)).expect("a motion");
    assert_eq!(impact(&bullet, &motion, &wall), f64::INFINITY);
}

#[test]
fn a_rod_that_turns_meets_a_post_at_its_angle() {
    let rod = scene(&cuboid(DVec3::new(0.0, -1e-9, -0.1), DVec3::new(2.0, 1e-9, 0.1)));
    let angle: f64 = 1.1;
    let corner = DVec3::new(angle.cos(), angle.sin(), 0.0) * 1.5;
    let post = scene(&[[corner - DVec3::Z, corner + DVec3::Z, corner * 1.2]]);
    let to = DAffine3::from_axis_angle(DVec3::Z, 2.0);
    let motion = Motion::new(&DAffine3::IDENTITY, &to).expect("a motion");
    let t = impact(&rod, &motion, &post);
    assert!((t - angle / 2.0).abs() < 1e-6, "{t}");
    // At the start, and for poses that are no motion.
    let here = DAffine3::from_axis_angle(DVec3::Z, angle);
    let resting = Motion::new(&here, &here).expect("a motion");
    assert_eq!(impact(&rod, &resting, &post), 0.0);
    assert!(Motion::new(&here, &DAffine3::from_scale(DVec3::splat(2.0))).is_err());
    assert!(Motion::new(&here, &DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0))).is_err());
}
