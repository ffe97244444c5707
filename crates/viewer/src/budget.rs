//! Chooses the size of moving pictures, so that frames come at the requested rate.

/// Chooses the size of moving pictures from the time that the last ones took.
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
        Self { target: SHARE / frames_per_second.clamp(1.0, 240.0), cost: None, scale: 0.5 }
    }

    /// Resets the measured cost, for another scene.
    pub fn reset(&mut self) {
        self.cost = None;
    }

    /// Width and height of the next frame, for a picture of size `full`.
    pub fn size(&mut self, full: [u32; 2]) -> [u32; 2] {
        let pixels = f64::from(full[0].max(1)) * f64::from(full[1].max(1));
        let wanted = match self.cost {
            Some(cost) => (self.target / (cost * pixels)).sqrt().clamp(LEAST, 1.0),
            // The first frame is small: if it were late, that would be worse than its coarseness.
            None => (25_000.0 / pixels).sqrt().clamp(LEAST, 1.0),
        };
        let change = wanted / self.scale;
        if !(TOLERANCE[0]..=TOLERANCE[1]).contains(&change) || self.cost.is_none() {
            self.scale = wanted;
        }
        full.map(|side| ((f64::from(side) * self.scale).round() as u32).clamp(1, side.max(1)))
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
        for cost in [1e-8, 5e-8, 2e-7, 1e-6] {
            let size = settle(cost);
            let seconds = f64::from(size[0] * size[1]) * cost;
            assert!(seconds < 1.0 / 30.0, "{cost}: {size:?}");
            assert!(size == [1280, 720] || seconds > 0.4 / 30.0, "{cost}: {size:?}");
        }
    }

    #[test]
    fn nothing_is_smaller_than_the_least_or_larger_than_the_picture() {
        assert_eq!(settle(1.0), [112, 63]);
        assert_eq!(settle(0.0), [1280, 720]);
        assert_eq!(Budget::new(f64::NAN.max(30.0)).size([1, 1]), [1, 1]);
    }
}
