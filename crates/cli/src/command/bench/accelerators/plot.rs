//! The plot: the growth of the cost of a ray with the number of triangles, and the cost by
//! resolution of the uniform grid. Both axes are logarithmic, and every line has its name at its
//! end. The colours are distinguishable for the colour-blind (Okabe and Ito, Color universal
//! design, 2008), and dashes differ too.

use super::SweepPoint;
use super::growth::Growth;
use crate::command::bench::plot::{Anchor, GREY, INK, Panel, Svg, range};
use snell_intersect::AcceleratorKind;
use snell_math::real;

const SIZE: [f64; 2] = [1600.0, 900.0];

/// Left edge of the names beside the lines, in pixels.
const NAMES: f64 = 774.0;
/// Font size of those names, in pixels.
const NAME_SIZE: f64 = 21.0;
/// Left edge of the second panel, in pixels.
const SWEEP: f64 = 1190.0;

/// Colour and dashes of a structure.
fn style(kind: AcceleratorKind) -> (&'static str, &'static str) {
    match kind {
        AcceleratorKind::None => ("#888888", "none"),
        AcceleratorKind::Graph => ("#888888", "4 7"),
        AcceleratorKind::Spheres => ("#CC79A7", "none"),
        AcceleratorKind::Bvh => ("#000000", "none"),
        AcceleratorKind::Grid => ("#E69F00", "none"),
        AcceleratorKind::Octree => ("#009E73", "none"),
        AcceleratorKind::OctreeHierarchical => ("#009E73", "10 6"),
        AcceleratorKind::Bsp => ("#56B4E9", "none"),
        AcceleratorKind::KdTree => ("#D55E00", "none"),
    }
}

/// Draws the plot.
pub fn svg(scene: &str, growths: &[Growth], sweep: &[SweepPoint]) -> String {
    let mut svg = Svg::new(SIZE[0], SIZE[1]);
    svg.label(
        [60.0, 62.0],
        36.0,
        INK,
        Anchor::Start,
        true,
        "Ray intersection is sub-linear in the number of primitives",
    );
    let subtitle = format!(
        "{scene}, decimated and subdivided; diffuse rays, one thread; in brackets the exponent of \
            the fitted power"
    );
    svg.label([60.0, 98.0], 21.0, GREY, Anchor::Start, false, &subtitle);
    growth_panel(&mut svg, growths);
    sweep_panel(&mut svg, sweep);
    svg.finish()
}

/// The name of a power of ten seconds, in a readable unit.
fn duration_name(power: i32) -> String {
    let (unit, rest) = match power {
        ..=-7 => ("ns", power + 9),
        -6..=-4 => ("µs", power + 6),
        -3..=-1 => ("ms", power + 3),
        _ => ("s", power),
    };
    format!("{} {unit}", real::powi(10f64, rest))
}

fn count_name(n: f64) -> String {
    if n >= 1e6 {
        format!("{} M", n / 1e6)
    } else if n >= 1e3 {
        format!("{} k", n / 1e3)
    } else {
        n.to_string()
    }
}

fn growth_panel(svg: &mut Svg, growths: &[Growth]) {
    let points = || growths.iter().flat_map(|g| &g.points);
    let panel = Panel {
        left: 140.0,
        right: NAMES - 34.0,
        top: 190.0,
        bottom: 800.0,
        x: range(points().map(|p| p.triangles), 0.02),
        y: range(points().map(|p| p.seconds), 0.1),
    };
    svg.label([60.0, 160.0], 23.0, INK, Anchor::Start, true, "Time for one ray");
    let powers = panel.x[0].floor() as i32..=panel.x[1].floor() as i32;
    let ticks = powers.flat_map(|p| [1.0, 3.0].map(|n| n * real::powi(10f64, p)));
    let is_inside = |&n: &f64| (panel.x[0]..=panel.x[1]).contains(&real::log10(n));
    let ticks: Vec<_> = ticks.filter(is_inside).map(|n| (n, count_name(n))).collect();
    panel.axes(svg, &ticks, duration_name);
    svg.label(
        [(panel.left + panel.right) / 2.0, 866.0],
        22.0,
        INK,
        Anchor::Middle,
        false,
        "triangles",
    );
    let mut names = Vec::new();
    for growth in growths {
        let (color, dash) = style(growth.kind);
        let line: Vec<[f64; 2]> =
            growth.points.iter().map(|p| panel.at(p.triangles, p.seconds)).collect();
        svg.polyline(&line, color, dash);
        line.iter().for_each(|p| svg.dot(*p, color));
        if let Some(end) = line.last() {
            let name = line_name(growth.kind, growth.exponents().0);
            names.push(Name { end: *end, y: end[1], color, name });
        }
    }
    place(&mut names, panel.top, panel.bottom);
    for name in names {
        svg.line([name.end[0] + 8.0, name.end[1]], [NAMES - 6.0, name.y], name.color, 1.0);
        svg.label([NAMES, name.y + 7.0], NAME_SIZE, name.color, Anchor::Start, true, &name.name);
    }
}

fn line_name(kind: AcceleratorKind, exponent: f64) -> String {
    format!("{}  ({exponent:.2})", kind.name())
}

/// The name of a line, and its position.
struct Name {
    end: [f64; 2],
    y: f64,
    color: &'static str,
    name: String,
}

/// Moves names apart so that they do not overlap.
fn place(names: &mut [Name], top: f64, bottom: f64) {
    const APART: f64 = 29.0;
    names.sort_by(|a, b| a.y.total_cmp(&b.y));
    for _ in 0..200 {
        for i in 1..names.len() {
            let overlap = names[i - 1].y + APART - names[i].y;
            if overlap > 0.0 {
                names[i - 1].y -= overlap / 2.0;
                names[i].y += overlap / 2.0;
            }
        }
        for name in names.iter_mut() {
            name.y = name.y.clamp(top, bottom);
        }
    }
}

fn sweep_panel(svg: &mut Svg, sweep: &[SweepPoint]) {
    let panel = Panel {
        left: SWEEP,
        right: 1560.0,
        top: 190.0,
        bottom: 800.0,
        x: range(sweep.iter().map(|p| f64::from(p.0)), 0.05),
        y: range(sweep.iter().map(|p| p.1 * 1e-6), 0.3),
    };
    svg.label(
        [1110.0, 160.0],
        23.0,
        INK,
        Anchor::Start,
        true,
        "Uniform grid: too coarse, too fine",
    );
    let ticks: Vec<_> =
        sweep.iter().step_by(2).map(|p| (f64::from(p.0), p.0.to_string())).collect();
    panel.axes(svg, &ticks, duration_name);
    svg.label(
        [(panel.left + panel.right) / 2.0, 866.0],
        22.0,
        INK,
        Anchor::Middle,
        false,
        "cells along the longest side",
    );
    let color = style(AcceleratorKind::Grid).0;
    let line: Vec<[f64; 2]> = sweep.iter().map(|p| panel.at(f64::from(p.0), p.1 * 1e-6)).collect();
    svg.polyline(&line, color, "none");
    line.iter().for_each(|p| svg.dot(*p, color));
    if let Some((best, point)) = sweep.iter().zip(&line).min_by(|a, b| a.0.1.total_cmp(&b.0.1)) {
        let text = format!("best: {} cells, {:.2} µs", best.0, best.1);
        // Names are about 220 to 260 pixels wide, and must stay within the panel.
        let x = point[0].clamp(panel.left + 130.0, panel.right - 130.0);
        svg.label([x, point[1] + 38.0], 20.0, INK, Anchor::Middle, true, &text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_units_that_read_well() {
        let names: Vec<String> = (-8..=1).map(duration_name).collect();
        assert_eq!(
            names,
            [
                "10 ns", "100 ns", "1 µs", "10 µs", "100 µs", "1 ms", "10 ms", "100 ms", "1 s",
                "10 s"
            ]
        );
    }

    #[test]
    fn names_have_room_in_a_wide_font() {
        // Width of the second panel. (In DejaVu Sans Bold, the longest name takes 0.53 of the font
        // size per letter.)
        const UNITS: f64 = 100.0;
        let width = |kind: &AcceleratorKind| line_name(*kind, 0.25).len() as f64 * NAME_SIZE * 0.55;
        let widest = AcceleratorKind::ALL.iter().map(width).fold(0.0, f64::max);
        assert!(NAMES + widest < SWEEP - UNITS, "{widest}");
    }

    #[test]
    fn names_do_not_overlap() {
        let name = |y: f64| Name { end: [0.0, y], y, color: "", name: String::new() };
        let mut names = [name(100.0), name(100.0), name(105.0), name(300.0), name(99.0)];
        place(&mut names, 0.0, 310.0);
        assert!(names.windows(2).all(|w| w[1].y - w[0].y > 28.0), "{:?}", names.map(|n| n.y));
    }
}
