//! A report as text for a terminal.

use super::{Report, SampleReport, VertexReport};
use snell_math::real;
use std::fmt::Write;

/// Maximum number of path classes shown.
const MOST_CLASSES: usize = 8;

/// The report as lines of text.
pub fn text(report: &Report) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write(&mut out, report);
    out
}

fn write(out: &mut String, report: &Report) -> std::fmt::Result {
    let Report {
        pixel: [x, y], size: [width, height], value, error, spp, scene, integrator, ..
    } = report;
    writeln!(
        out,
        "Pixel {x},{y} of {scene}, {width}x{height} pixels, {integrator}, {spp} samples"
    )?;
    writeln!(out, "  value     {}", rgb(&value[..3]))?;
    if *spp > 1 {
        writeln!(out, "  error  ±  {}", rgb(error))?;
    }
    if !report.classes.is_empty() {
        writeln!(out, "\nIts light, by the path from the eye (E) to the light (L):")?;
        writeln!(out, "D diffuse, G glossy, S mirror, T through a surface, V in a medium")?;
        for class in report.classes.iter().take(MOST_CLASSES) {
            writeln!(
                out,
                "  {:<9} {:>5.1} %  {}",
                class.way,
                class.share * 100.0,
                rgb(&class.value)
            )?;
        }
        let rest = &report.classes[MOST_CLASSES.min(report.classes.len())..];
        if !rest.is_empty() {
            let share: f32 = rest.iter().map(|c| c.share).sum();
            writeln!(out, "  {} more  {:>5.1} %", rest.len(), share * 100.0)?;
        }
    }
    write_tree(out, &report.tree)?;
    if !report.traces.is_empty() {
        writeln!(out, "\nTraversal of each acceleration structure by the camera ray:")?;
        writeln!(out, "  {:<20} {:>8} {:>8} {:>10}", "", "nodes", "cells", "primitives")?;
        for j in &report.traces {
            writeln!(
                out,
                "  {:<20} {:>8} {:>8} {:>10}",
                j.accelerator, j.nodes, j.cells, j.primitives
            )?;
        }
    }
    Ok(())
}

fn write_tree(out: &mut String, tree: &SampleReport) -> std::fmt::Result {
    writeln!(out, "\nSample {} and its contributions:", tree.number)?;
    for (number, vertex) in tree.vertices.iter().enumerate() {
        let indent = "  ".repeat(vertex.depth as usize + 1);
        writeln!(out, "{indent}{}", title(number, vertex))?;
        writeln!(out, "{indent}    throughput {}", rgb(&vertex.throughput))?;
        let of_photons = match vertex.photons {
            1 => "from 1 photon".to_string(),
            photons => format!("from {photons} photons"),
        };
        for (what, light) in [
            ("from media on the way", vertex.glow),
            (&*of_photons, vertex.by_photons),
            ("light found here", vertex.found),
        ] {
            if light != [0.0; 3] {
                let weight = if what.starts_with("light") && vertex.found_weight != 1.0 {
                    format!(", weight {:.3}", vertex.found_weight)
                } else {
                    String::new()
                };
                writeln!(out, "{indent}  + {}  {what}{weight}", rgb(&light))?;
            }
        }
        for light in &vertex.lights {
            let (source, weight) = (&light.source, light.weight);
            let fate = if light.is_blocked { "hidden" } else { "seen" };
            writeln!(
                out,
                "{indent}  + {}  from {source}: {fate}, weight {weight:.3}",
                rgb(&light.brought)
            )?;
        }
    }
    writeln!(out, "  = {}", rgb(&tree.sum))
}

/// Describes a vertex in one line.
pub(super) fn title(number: usize, vertex: &VertexReport) -> String {
    let how = match &vertex.lobe {
        None => "camera".to_string(),
        Some(lobe) => lobe.clone(),
    };
    let what = match vertex.what.as_str() {
        "surface" => {
            let name =
                if vertex.material.is_empty() { "unnamed material" } else { &vertex.material };
            let of = if vertex.object.is_empty() {
                String::new()
            } else {
                format!(" of {}", vertex.object)
            };
            format!("{name}{of}")
        }
        "medium" => "scattered in a medium".into(),
        "escaped" => "left the scene".into(),
        _ => "absorbed by media".into(),
    };
    let distance = vertex.distance.map_or(String::new(), |d| format!(", {} away", short(d)));
    let from = vertex.parent.map_or(String::new(), |p| format!(" from {}", p + 1));
    format!("{}: {how}{from} → {what}{distance}", number + 1)
}

/// A number with four significant digits, or three with an exponent.
pub(super) fn short(x: f32) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let digits = (3 - real::log10(x.abs()).floor() as i32).clamp(0, 7) as usize;
    if x.abs() < 1e-4 || x.abs() >= 1e6 { format!("{x:.2e}") } else { format!("{x:.digits$}") }
}

fn rgb(color: &[f32]) -> String {
    color.iter().map(|&c| format!("{:<8} ", short(c))).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_short() {
        let written: Vec<String> = [0.0, 1.0, 0.123456, 1234.6, 1e-9, 3e7].map(short).to_vec();
        assert_eq!(written, ["0", "1.000", "0.1235", "1235", "1.00e-9", "3.00e7"]);
    }
}
