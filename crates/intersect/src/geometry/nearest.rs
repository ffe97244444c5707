//! The nearest point of a ball, and of the space swept by a ball.

use super::rounded_cone::Ball;
use crate::shape::Metric;
use crate::shape::nearest::{golden_section, on_sphere};
use snell_math::DVec3;

/// The point of a ball's surface nearest to `point`, and its distance by `metric`, negative if
/// `point` is inside.
pub(super) fn on_ball(metric: &Metric, point: DVec3, ball: &Ball) -> (DVec3, f64) {
    let from_center = point - ball.center;
    let position = if ball.radius > 0.0 {
        ball.center + on_sphere(metric, from_center, ball.radius)
    } else {
        ball.center
    };
    let distance = metric.length_squared(position - point).sqrt();
    (position, if from_center.length() < ball.radius { -distance } else { distance })
}

/// The point nearest to `point` on the surface of the space swept by `ball(u)` for `u` from 0 to 1,
/// its signed distance, and the `u` of its ball: the ball with the least signed distance, found
/// among `samples` and refined by golden-section search.
pub(super) fn on_sweep(
    metric: &Metric,
    point: DVec3,
    samples: usize,
    ball: impl Fn(f64) -> Ball,
) -> (DVec3, f64, f64) {
    let step = 1.0 / samples as f64;
    let distance = |u: f64| on_ball(metric, point, &ball(u)).1;
    let sampled: Vec<f64> = (0..=samples).map(|i| distance(i as f64 * step)).collect();
    let (mut best, mut least) = (0.0, f64::INFINITY);
    let mut consider = |u: f64| {
        let found = distance(u);
        if found < least {
            (best, least) = (u, found);
        }
    };
    for i in 0..=samples {
        let (low, high) = (i.saturating_sub(1), (i + 1).min(samples));
        if sampled[i] <= sampled[low] && sampled[i] <= sampled[high] {
            consider(i as f64 * step);
            consider(golden_section(low as f64 * step, high as f64 * step, distance));
        }
    }
    let (position, distance) = on_ball(metric, point, &ball(best));
    (position, distance, best)
}
