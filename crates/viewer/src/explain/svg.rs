//! A report as a drawing: the path tree, the convergence of the pixel, and the work of each
//! acceleration structure.

use super::text::{short, title};
use super::{Point, Report, TraceReport, VertexReport};
use snell_math::real;
use std::fmt::Write;

const WIDTH: f32 = 1120.0;
/// Left edge of the right column.
const RIGHT: f32 = 640.0;
const LINE: f32 = 20.0;
const MARGIN: f32 = 24.0;
/// Maximum number of vertices drawn.
const MOST_VERTICES: usize = 40;

/// Draws a report.
pub fn svg(report: &Report) -> String {
    let mut body = String::new();
    let tree = tree(&mut body, report);
    let right = right_column(&mut body, report);
    let height = tree.max(right) + MARGIN;
    let style = "text{font:13px system-ui,sans-serif;fill:#1c2430}.s{font-size:11px;\
                 fill:#5b6675}.h{font-size:16px;font-weight:600}\
                 .m{font-family:ui-monospace,monospace;font-size:12px}";
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" \
            viewBox=\"0 0 {WIDTH} {height}\">\n\
         <style>{style}</style>\n<rect width=\"100%\" height=\"100%\" \
         fill=\"#fbfcfd\"/>\n{body}</svg>\n"
    )
}

/// Text with XML's special characters escaped.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

fn text_at(out: &mut String, x: f32, y: f32, class: &str, text: &str) {
    let _ =
        writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\">{}</text>", escaped(text));
}

/// A linear colour, multiplied by `scale` and clamped to 1, as a CSS colour.
fn css(color: [f32; 3], scale: f32) -> String {
    let display = |c: f32| {
        let c = (c * scale).clamp(0.0, 1.0);
        let s = if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * real::powf(c, 1.0 / 2.4) - 0.055 };
        (s * 255.0).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", display(color[0]), display(color[1]), display(color[2]))
}

fn swatch(out: &mut String, x: f32, y: f32, size: f32, color: [f32; 3]) {
    let most = color.iter().fold(1.0_f32, |a, &b| a.max(b));
    let fill = css(color, 1.0 / most);
    let _ = writeln!(
        out,
        "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{size}\" height=\"{size}\" rx=\"2\" \
            fill=\"{fill}\" stroke=\"#8a94a3\" stroke-width=\"0.7\"/>"
    );
}

fn rgb(color: &[f32]) -> String {
    color.iter().map(|&c| short(c)).collect::<Vec<_>>().join("  ")
}

/// Draws the path tree; returns its lower edge.
fn tree(out: &mut String, report: &Report) -> f32 {
    let Report { pixel: [px, py], value, scene, tree, .. } = report;
    let mut y = MARGIN + 14.0;
    swatch(out, MARGIN, y - 17.0, 22.0, [value[0], value[1], value[2]]);
    text_at(out, MARGIN + 32.0, y, "h", &format!("Pixel {px},{py} of {scene}"));
    y += LINE;
    text_at(
        out,
        MARGIN + 32.0,
        y,
        "m",
        &format!("{}   after {} samples", rgb(&value[..3]), report.spp),
    );
    y += LINE * 1.8;
    text_at(out, MARGIN, y, "h", &format!("Sample {}", tree.number));
    y += LINE * 0.4;
    let mut ends = vec![0.0; tree.vertices.len()];
    for (number, vertex) in tree.vertices.iter().take(MOST_VERTICES).enumerate() {
        y += LINE * 1.1;
        let x = indent(vertex);
        ends[number] = y;
        if let Some(from) = vertex.parent.and_then(|p| ends.get(p as usize)) {
            let (left, top) = (x - 9.0, from + 5.0);
            let _ = writeln!(
                out,
                "<path d=\"M{left:.1} {top:.1}V{:.1}H{:.1}\" fill=\"none\" stroke=\"#b7c0cc\"/>",
                y - 4.0,
                x - 2.0
            );
        }
        text_at(out, x, y, "", &title(number, vertex));
        y += LINE * 0.8;
        text_at(out, x + 16.0, y, "s", &format!("throughput {}", rgb(&vertex.throughput)));
        y = contributions(out, vertex, x + 16.0, y);
    }
    if tree.vertices.len() > MOST_VERTICES {
        y += LINE;
        text_at(
            out,
            MARGIN,
            y,
            "s",
            &format!("and {} more vertices", tree.vertices.len() - MOST_VERTICES),
        );
    }
    y += LINE * 1.4;
    swatch(out, MARGIN, y - 11.0, 13.0, tree.sum);
    text_at(out, MARGIN + 20.0, y, "m", &format!("= {}", rgb(&tree.sum)));
    y
}

fn indent(vertex: &VertexReport) -> f32 {
    MARGIN + 12.0 * vertex.depth.min(16) as f32
}

fn contributions(out: &mut String, vertex: &VertexReport, x: f32, mut y: f32) -> f32 {
    let found = |what: &str, weight: f32| {
        if weight == 1.0 { what.to_string() } else { format!("{what}, weight {weight:.3}") }
    };
    let own = [
        (vertex.glow, "from media on the way".to_string()),
        (vertex.by_photons, format!("from photons: {}", vertex.photons)),
        (vertex.found, found("found here", vertex.found_weight)),
    ];
    let of_lights = vertex.lights.iter().map(|light| {
        let fate = if light.is_blocked { "hidden" } else { "seen" };
        (light.brought, format!("{}: {fate}, weight {:.3}", light.source, light.weight))
    });
    let own = own.into_iter().filter(|(light, _)| *light != [0.0; 3]);
    for (light, what) in own.chain(of_lights) {
        y += LINE * 0.85;
        swatch(out, x, y - 10.0, 11.0, light);
        text_at(out, x + 17.0, y, "m", &format!("+ {}", rgb(&light)));
        text_at(out, x + 220.0, y, "s", &what);
    }
    y
}

/// Draws path classes, convergence and structures; returns the lower edge.
fn right_column(out: &mut String, report: &Report) -> f32 {
    let mut y = MARGIN + 14.0;
    text_at(out, RIGHT, y, "h", "Where its light comes from");
    y += 6.0;
    for class in report.classes.iter().take(8) {
        y += LINE;
        text_at(out, RIGHT, y, "m", &class.way);
        let width = 250.0 * class.share.clamp(0.0, 1.0);
        let _ = writeln!(
            out,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"12\" fill=\"#4a7fb5\"/>",
            RIGHT + 90.0,
            y - 10.0
        );
        text_at(out, RIGHT + 96.0 + width, y, "s", &format!("{:.1} %", class.share * 100.0));
    }
    y += LINE;
    text_at(
        out,
        RIGHT,
        y,
        "s",
        "E eye, D diffuse, G glossy, S mirror, T through, V medium, L light",
    );
    y += LINE * 2.0;
    text_at(out, RIGHT, y, "h", "As the samples come in");
    y = plot(out, &report.convergence, y + 14.0);
    if !report.traces.is_empty() {
        y += LINE * 2.0;
        text_at(out, RIGHT, y, "h", "Traversal of each structure by the camera ray");
        y = traces(out, &report.traces, y + 6.0);
    }
    y
}

/// Plots mean and error against the number of samples, on a logarithmic axis.
fn plot(out: &mut String, points: &[Point], top: f32) -> f32 {
    let (left, width, height) = (RIGHT + 44.0, 400.0, 170.0);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return top };
    let most = points
        .iter()
        .flat_map(|p| p.value)
        .fold(0.0_f32, |a, b| if b.is_finite() { a.max(b) } else { a });
    let ceiling =
        most.min(3.0 * last.value.iter().fold(0.0_f32, |a, &b| a.max(b))).max(1e-6) * 1.08;
    let log = |n: u32| real::ln(n.max(1) as f32);
    let span = (log(last.samples) - log(first.samples)).max(1e-6);
    let x = |p: &Point| left + width * (log(p.samples) - log(first.samples)) / span;
    let y = |v: f32| top + height * (1.0 - (v / ceiling).clamp(0.0, 1.0));
    let _ = writeln!(
        out,
        "<rect x=\"{left}\" y=\"{top:.1}\" width=\"{width}\" height=\"{height}\" fill=\"#fff\" \
            stroke=\"#c9d1db\"/>"
    );
    for (c, color) in ["#c0392b", "#2e8b57", "#2f6fb5"].into_iter().enumerate() {
        let line = |f: &dyn Fn(&Point) -> f32| -> Vec<String> {
            points.iter().map(|p| format!("{:.1},{:.1}", x(p), y(f(p)))).collect()
        };
        let upper = line(&|p| p.value[c] + p.error[c]);
        let mut lower = line(&|p| p.value[c] - p.error[c]);
        lower.reverse();
        let _ = writeln!(
            out,
            "<polygon points=\"{} {}\" fill=\"{color}\" fill-opacity=\"0.13\"/>\n<polyline \
                points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"/>",
            upper.join(" "),
            lower.join(" "),
            line(&|p| p.value[c]).join(" ")
        );
    }
    for v in [0.0, ceiling * 0.5, ceiling] {
        text_at(out, RIGHT, y(v) + 4.0, "s", &short(v));
    }
    let bottom = top + height + 15.0;
    text_at(out, left, bottom, "s", &first.samples.to_string());
    text_at(out, left + width - 70.0, bottom, "s", &format!("{} samples", last.samples));
    bottom
}

/// Draws a bar of work for each structure on a logarithmic scale; the longest bar is that of the
/// most work.
fn traces(out: &mut String, traces: &[TraceReport], mut y: f32) -> f32 {
    let work = |j: &TraceReport| f64::from(j.nodes) + f64::from(j.cells) + f64::from(j.primitives);
    let most = real::ln_1p(traces.iter().map(work).fold(2.0, f64::max));
    for trace in traces {
        y += LINE;
        text_at(out, RIGHT, y, "", &trace.accelerator);
        let all = work(trace).max(1e-9);
        let length = 200.0 * real::ln_1p(all) / most;
        let mut x = f64::from(RIGHT) + 132.0;
        for (part, color) in
            [(trace.nodes, "#4a7fb5"), (trace.cells, "#58a68c"), (trace.primitives, "#d08a3c")]
        {
            let width = length * f64::from(part) / all;
            let _ = writeln!(
                out,
                "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"12\" \
                    fill=\"{color}\"/>",
                y - 10.0
            );
            x += width;
        }
        let numbers =
            format!("{} nodes, {} cells, {} tests", trace.nodes, trace.cells, trace.primitives);
        text_at(out, x as f32 + 8.0, y, "s", &numbers);
    }
    y
}
