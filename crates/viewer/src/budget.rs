//! Chooses how many samples moving pictures have, so that frames come at the requested rate and
//! are large.

/// Chooses the samples of moving pictures from the time that the last ones took. The pictures have
/// twice the width and height (see [`crate::temporal`]).
#[derive(Clone, Debug)]
pub struct Budget {
    /// Time limit for a frame in seconds.
    target: f64,
    /// Seconds per pixel, smoothed; `None` before the first frame.
    cost: Option<f64>,
    scale: f64,
}

/// The minimum scale of width and height.
const LEAST: f64 = 0.0875;
/// The maximum scale, for pictures of full size.
const MOST: f64 = 0.5;
/// The scale of pictures of half the width: frames rather come later than that they are smaller.
const LARGE: f64 = 0.25;
/// How much later they come for that at most, as a multiple of the requested time.
const LATER: f64 = 2.0;
/// Samples of the first picture of a scene.
const FIRST: f64 = 20_000.0;
/// Share of a frame's time that is planned for rendering: some frames take longer than the previous
/// ones.
const SHARE: f64 = 0.85;
/// The size changes only if the ratio of the wanted to the present scale leaves this range, because
/// each change is visible. The range is asymmetric, because a late frame is more noticeable than
/// one that could be larger.
const TOLERANCE: [f64; 2] = [0.95, 1.2];

impl Budget {
    /// A budget for this many frames per second.
    pub fn new(frames_per_second: f64) -> Self {
        Self { target: SHARE / frames_per_second.clamp(1.0, 240.0), cost: None, scale: MOST }
    }

    /// Resets the measured cost, for another scene.
    pub fn reset(&mut self) {
        self.cost = None;
    }

    /// Samples along width and height of the next frame, for a picture of size `full`; both numbers
    /// are even.
    pub fn size(&mut self, full: [u32; 2]) -> [u32; 2] {
        let pixels = f64::from(full[0].max(1)) * f64::from(full[1].max(1));
        let wanted = match self.cost {
            Some(cost) => {
                let within = |seconds: f64| (seconds / (cost * pixels)).sqrt();
                let large = within(LATER * self.target).min(LARGE);
                within(self.target).max(large).clamp(LEAST, MOST)
            }
            // The first frame is small: if it were late, that would be worse than its coarseness.
            None => (FIRST / pixels).sqrt().clamp(LEAST, MOST),
        };
        let change = wanted / self.scale;
        let becomes_large = self.scale < LARGE && wanted >= LARGE;
        let is_far = becomes_large || !(TOLERANCE[0]..=TOLERANCE[1]).contains(&change);
        if is_far || self.cost.is_none() {
            self.scale = wanted;
        }
        full.map(|side| 2 * ((f64::from(side) * self.scale / 2.0).round() as u32).max(1))
    }

    /// Records the time that a frame of this size took.
    pub fn spent(&mut self, size: [u32; 2], seconds: f64) {
        let pixels = f64::from(size[0].max(1)) * f64::from(size[1].max(1));
        let cost = (seconds / pixels).max(1e-12);
        // The estimate rises quickly and falls slowly.
        let weight = if self.cost.is_some_and(|old| cost < old) { 0.2 } else { 0.5 };
        self.cost = Some(self.cost.map_or(cost, |old| old + (cost - old) * weight));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settle(cost_per_pixel: f64) -> [u32; 2] {
        let mut budget = Budget::new(30.0);
        let mut size = [0; 2];
        for _ in 0..50 {
            size = budget.size([1280, 720]);
            budget.spent(size, f64::from(size[0] * size[1]) * cost_per_pixel);
        }
        size
    }

    #[test]
    fn frames_fit_into_their_time() {
        for cost in [1e-8, 5e-8, 2e-7, 4e-7, 1e-6, 4e-6] {
            let size = settle(cost);
            let frames = f64::from(size[0] * size[1]) * cost * 30.0;
            let most = if size[0] <= 320 { LATER } else { 1.0 };
            assert!(frames < most, "{cost}: {size:?}");
            assert!(size == [640, 360] || frames > 0.4, "{cost}: {size:?}");
        }
    }

    #[test]
    fn frames_of_half_the_width_may_come_later() {
        // 320 x 180 samples within one and two times the requested time.
        let cost = |times: f64| times * SHARE / 30.0 / f64::from(320 * 180);
        assert!(settle(cost(0.5))[0] > 400);
        assert!(settle(cost(1.0))[0].abs_diff(320) <= 16);
        assert!(settle(cost(1.9))[0].abs_diff(320) <= 16);
        let mut budget = Budget::new(30.0);
        budget.scale = 0.9 * LARGE;
        budget.spent([320, 180], SHARE / 30.0);
        assert_eq!(budget.size([1280, 720]), [320, 180]);
        assert!(settle(cost(4.0))[0] < 250);
    }

    #[test]
    fn nothing_is_smaller_than_the_least_or_larger_than_half_of_the_picture() {
        assert_eq!(settle(1.0), [112, 62]);
        assert_eq!(settle(0.0), [640, 360]);
        assert_eq!(Budget::new(f64::NAN.max(30.0)).size([1, 1]), [2, 2]);
    }
}
