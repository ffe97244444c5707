//! Pictures of the methods: the triangles that each saw, and its work per pixel.

use crate::command::bench::plot::{FAINT, INK, Svg};
use crate::failure::Failure;
use snell_formats::image::{WriteOptions, write_image};
use snell_lab::visible::{HiddenLines, LineKind, Method, Screen, Stretch};
use snell_math::real;
use snell_math::rng;
use snell_scene::{Layer, LayeredImage};
use std::path::Path;

/// Writes the visible triangles of a method, and its work per pixel.
pub fn surfaces(
    folder: &Path,
    method: Method,
    screen: &Screen,
    items: &[u32],
    cost: Option<&[u32]>,
) -> Result<(), Failure> {
    let name = method.name();
    let colors = items.iter().map(|&item| color(screen, item));
    write(&folder.join(format!("{name}.png")), screen, colors)?;
    if let Some(cost) = cost {
        // The brightest colour stands for the maximum of all pixels but the highest thousandth.
        let mut sorted = cost.to_vec();
        sorted.sort_unstable();
        let most = sorted
            .get(sorted.len().saturating_sub(1 + sorted.len() / 1000))
            .copied()
            .unwrap_or(0)
            .max(1);
        let heats = cost.iter().map(|&n| heat(n as f32 / most as f32));
        write(&folder.join(format!("{name}-work.png")), screen, heats)?;
    }
    Ok(())
}

fn write(
    path: &Path,
    screen: &Screen,
    colors: impl Iterator<Item = [f32; 3]>,
) -> Result<(), Failure> {
    let [width, height] = screen.size();
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    let layers = vec![Layer { name: String::new(), channels, values: colors.flatten().collect() }];
    let image = LayeredImage { width, height, layers, metadata: Vec::new() };
    Ok(write_image(path, &image, &WriteOptions::default())?)
}

/// A colour for each triangle, the same for all methods; nearly white for the background.
fn color(screen: &Screen, item: u32) -> [f32; 3] {
    match screen.primitive(item) {
        None => [0.9; 3],
        Some(id) => {
            let [r, g, b, _] = rng::pcg4d([id.instance, id.geometry, id.primitive, 1]);
            [r, g, b].map(|bits| linear(0.15 + 0.75 * rng::to_unit(bits)))
        }
    }
}

/// A colour for a value from 0 to 1, from black over red and yellow to white.
fn heat(x: f32) -> [f32; 3] {
    [0.0, 1.0, 2.0].map(|start| linear((3.0 * x - start).clamp(0.0, 1.0)))
}

/// The approximate linear light of a display value.
fn linear(value: f32) -> f32 {
    real::powf(value, 2.2)
}

/// Writes the visible lines, contours thicker than others, and the hidden lines faintly.
pub fn lines(folder: &Path, screen: &Screen, found: &HiddenLines) -> Result<(), Failure> {
    let [width, height] = screen.size().map(f64::from);
    let mut svg = Svg::new(width, height);
    let of = |is_wanted: fn(&Stretch) -> bool| {
        let wanted = found.stretches.iter().filter(move |s| is_wanted(s));
        wanted.map(|s| s.ends.map(|p| p.to_array()))
    };
    svg.lines(of(|s| s.invisibility > 0 && s.kind != LineKind::Flat), FAINT, 0.5);
    svg.lines(of(|s| s.invisibility == 0 && s.kind == LineKind::Crease), INK, 0.5);
    svg.lines(of(|s| s.invisibility == 0 && s.kind == LineKind::Contour), INK, 1.0);
    let path = folder.join(format!("{}.svg", HiddenLines::NAME));
    Ok(snell_formats::atomic::write(&path, svg.finish().as_bytes())?)
}
