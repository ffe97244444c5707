//! Building blocks of plots: panels with logarithmic axes, in SVG.

mod svg;

use snell_math::real;
pub use svg::{Anchor, Svg};

/// Colour of text and axes.
pub const INK: &str = "#222222";
/// Colour of grid lines.
pub const FAINT: &str = "#e4e4e4";
/// Colour of subtitles.
pub const GREY: &str = "#666666";

/// A panel: a rectangle of the picture that shows a range of logarithms.
pub struct Panel {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
    /// Range of the data in decimal logarithms.
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl Panel {
    /// The position in the picture of a point of the data.
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let part = |v: f64, [low, high]: [f64; 2]| (real::log10(v) - low) / (high - low);
        [
            self.left + part(x, self.x) * (self.right - self.left),
            self.bottom - part(y, self.y) * (self.bottom - self.top),
        ]
    }

    /// Draws lines at powers of ten, with their names.
    pub fn axes(&self, svg: &mut Svg, ticks: &[(f64, String)], y_name: fn(i32) -> String) {
        for (x, name) in ticks {
            let [px, _] = self.at(*x, 1.0);
            svg.line([px, self.top], [px, self.bottom], FAINT, 1.0);
            svg.label([px, self.bottom + 30.0], 20.0, INK, Anchor::Middle, false, name);
        }
        for power in self.y[0].ceil() as i32..=self.y[1].floor() as i32 {
            let [_, py] = self.at(1.0, real::powi(10f64, power));
            svg.line([self.left, py], [self.right, py], FAINT, 1.0);
            svg.label([self.left - 12.0, py + 7.0], 20.0, INK, Anchor::End, false, &y_name(power));
        }
        svg.line([self.left, self.bottom], [self.right, self.bottom], INK, 1.5);
    }
}

/// The range of the values' logarithms, with a margin on both sides.
pub fn range(values: impl Iterator<Item = f64>, margin: f64) -> [f64; 2] {
    let (low, high) = values
        .map(real::log10)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |a, v| (a.0.min(v), a.1.max(v)));
    if low > high { [0.0, 1.0] } else { [low - margin, high + margin] }
}
