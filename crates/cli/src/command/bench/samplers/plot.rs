//! The plot: a panel for each integrand, error against number of samples, both logarithmic.

use super::Series;
use crate::command::bench::plot::{Anchor, GREY, INK, Panel, Svg, range};
use snell_math::real;
use snell_render::SamplerKind;

const SIZE: [f64; 2] = [1800.0, 1000.0];
const COLUMNS: usize = 4;

/// Colours that the colour-blind can distinguish (Okabe and Ito, Color universal design, 2008).
fn color(sampler: SamplerKind) -> &'static str {
    match sampler {
        SamplerKind::Independent => "#888888",
        SamplerKind::Stratified => "#E69F00",
        SamplerKind::Sobol => "#56B4E9",
        SamplerKind::ZSobol => "#000000",
    }
}

/// Draws the plot.
pub fn svg(all: &[Series]) -> String {
    let mut svg = Svg::new(SIZE[0], SIZE[1]);
    svg.label([50.0, 56.0], 34.0, INK, Anchor::Start, true, "Error against number of samples");
    let subtitle = "relative root mean square error of a pixel; dashed: after a blur, which shows \
        how errors of neighbours cancel";
    svg.label([50.0, 90.0], 20.0, GREY, Anchor::Start, false, subtitle);
    let panels: Vec<&[Series]> =
        all.chunk_by(|a, b| a.integrand.name == b.integrand.name).collect();
    for (number, series) in panels.iter().enumerate() {
        let [x, y] = [number % COLUMNS, number / COLUMNS].map(|i| i as f64);
        draw(&mut svg, series, [110.0 + 430.0 * x, 165.0 + 430.0 * y]);
    }
    legend(&mut svg, panels.first().copied().unwrap_or_default());
    svg.finish()
}

fn draw(svg: &mut Svg, series: &[Series], [left, top]: [f64; 2]) {
    let points = || series.iter().flat_map(|s| &s.points);
    let panel = Panel {
        left,
        right: left + 320.0,
        top,
        bottom: top + 320.0,
        x: range(points().map(|p| f64::from(p.spp)), 0.05),
        y: range(points().flat_map(|p| [p.error, p.blurred]), 0.1),
    };
    let (name, formula) =
        series.first().map_or(("", ""), |s| (s.integrand.name, s.integrand.formula));
    svg.label([left, top - 14.0], 20.0, INK, Anchor::Start, true, &format!("{name}: {formula}"));
    let powers = (0..=6)
        .map(|p| real::powi(10f64, p))
        .filter(|&n| (panel.x[0]..=panel.x[1]).contains(&real::log10(n)));
    let ticks: Vec<_> = powers.map(|n| (n, n.to_string())).collect();
    panel.axes(svg, &ticks, |power| format!("{}", real::powi(10f64, power)));
    for s in series {
        let at = |y: fn(&super::Point) -> f64| -> Vec<[f64; 2]> {
            s.points.iter().map(|p| panel.at(f64::from(p.spp), y(p))).collect()
        };
        svg.polyline(&at(|p| p.error), color(s.sampler), "none");
        svg.polyline(&at(|p| p.blurred), color(s.sampler), "4 7");
    }
}

/// Draws the legend in place of the last panel.
fn legend(svg: &mut Svg, series: &[Series]) {
    let [left, top] = [110.0 + 430.0 * 3.0, 165.0 + 430.0];
    for (row, s) in series.iter().enumerate() {
        let y = top + 30.0 + 40.0 * row as f64;
        svg.line([left, y], [left + 60.0, y], color(s.sampler), 4.0);
        svg.label([left + 76.0, y + 7.0], 22.0, INK, Anchor::Start, true, s.sampler.name());
    }
}
