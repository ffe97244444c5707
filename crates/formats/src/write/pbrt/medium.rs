//! Media in pbrt's terms.

use super::{rgb, transform};
use crate::write::Output;
use snell_math::{ColorMode, DVec3, Rgb};
use snell_scene::medium::{Grid, Medium};
use snell_scene::texture::Wrap;

/// Density of cells that only emit, relative to the highest density.
const THIN: f32 = 1e-3;

/// The directives that define a medium, if pbrt supports it.
pub fn medium(output: &mut Output, number: usize, medium: &Medium) -> Option<String> {
    let coefficients = |sigma_a: Rgb, sigma_s: Rgb, g: f32| {
        format!(
            "\"rgb sigma_a\" {} \"rgb sigma_s\" {} \"float g\" [ {g} ]",
            rgb(sigma_a),
            rgb(sigma_s)
        )
    };
    // pbrt emits in proportion to absorption.
    let mut emission = |emission: Rgb, sigma_a: Rgb| {
        let share = |e: f32, a: f32| if a > 0.0 { e / a } else { 0.0 };
        if (emission.r > 0.0 && sigma_a.r <= 0.0)
            || (emission.g > 0.0 && sigma_a.g <= 0.0)
            || (emission.b > 0.0 && sigma_a.b <= 0.0)
        {
            output.lose(format!("medium {number}: emission where nothing is absorbed is left out"));
        }
        match emission.is_black() {
            true => String::new(),
            false => {
                let le = Rgb::new(
                    share(emission.r, sigma_a.r),
                    share(emission.g, sigma_a.g),
                    share(emission.b, sigma_a.b),
                );
                format!(" \"rgb Le\" {}", rgb(le))
            }
        }
    };
    match medium {
        Medium::Homogeneous(m) => Some(format!(
            "MakeNamedMedium \"medium-{number}\" \"string type\" [ \"homogeneous\" ] {}{}\n",
            coefficients(m.sigma_a, m.sigma_s, m.g),
            emission(m.emission, m.sigma_a)
        )),
        Medium::Grid(grid)
            if [&grid.sigma_a_tint, &grid.sigma_s_tint, &grid.emission_tint]
                .iter()
                .any(|t| t.is_some()) =>
        {
            if grid.temperature.is_some() {
                output.lose(format!("medium {number}: its temperature is left out"));
            }
            Some(colors(output, number, grid))
        }
        Medium::Grid(grid) => {
            let light = emission(grid.emission, grid.sigma_a);
            if grid.temperature.is_some() {
                output.lose(format!("medium {number}: its temperature is left out"));
            }
            if grid.density.is_stepped() {
                output.lose(format!("medium {number}: it is interpolated between its cells"));
            }
            note_border(output, number, grid.density.wrap());
            let [nx, ny, nz] = grid.density.size();
            let (densities, is_changed) = densities(grid);
            if is_changed {
                output.lose(format!(
                    "medium {number}: where it emits without absorbing, it absorbs a thousandth \
                        of its densest place, as pbrt \
                     emits where it absorbs"
                ));
            }
            let glow = grid.emission_scale.as_deref().map(|scale| {
                let share = |(d, s): (&f32, &f32)| if *s > 0.0 { s / d } else { 0.0 };
                let values: Vec<f32> = densities.iter().zip(scale.values()).map(share).collect();
                format!(" \"float Lescale\" [ {} ]", joined(&values))
            });
            Some(format!(
                "AttributeBegin\n  {}\n  MakeNamedMedium \"medium-{number}\" \"string type\" [ \
                    \"uniformgrid\" ] {}{light} \
                 \"integer nx\" [ {nx} ] \"integer ny\" [ {ny} ] \"integer nz\" [ {nz} ] \"float \
                 density\" [ {} ]{}\nAttributeEnd\n",
                transform(&grid.world_from_grid),
                coefficients(grid.sigma_a, grid.sigma_s, grid.g),
                joined(&densities),
                glow.unwrap_or_default()
            ))
        }
        Medium::HeightFog(_) | Medium::Cloud(_) => {
            output.lose(format!("medium {number}: {} became clear air", medium.name()));
            let clear = coefficients(Rgb::BLACK, Rgb::BLACK, 0.0);
            Some(format!(
                "MakeNamedMedium \"medium-{number}\" \"string type\" [ \"homogeneous\" ] {clear}\n"
            ))
        }
    }
}

/// Notes a loss unless the grid fades over the outer halves of its outermost cells, as all of
/// pbrt's do.
fn note_border(output: &mut Output, number: usize, wrap: Wrap) {
    if wrap != Wrap::Black {
        output.lose(format!("medium {number}: its grid fades in the outer halves of its cells"));
    }
}

/// A grid whose colours differ between cells.
fn colors(output: &mut Output, number: usize, grid: &Grid) -> String {
    let tints = [&grid.sigma_a_tint, &grid.sigma_s_tint].into_iter().flatten();
    tints.for_each(|tint| note_border(output, number, tint.wrap()));
    let size = grid.size();
    let plain = Grid { temperature: None, ..grid.clone() };
    let middle = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let (mut absorbed, mut scattered, mut emitted) = (Vec::new(), Vec::new(), Vec::new());
    let mut is_lost = false;
    for i in 0..size.iter().product::<usize>() {
        let (x, y, z) = (i % size[0], i / size[0] % size[1], i / size[0] / size[1]);
        let middle = DVec3::new(middle(x, size[0]), middle(y, size[1]), middle(z, size[2]));
        let at = plain
            .properties(grid.world_from_grid.transform_point3(middle).as_vec3(), ColorMode::Rgb);
        absorbed.extend_from_slice(&at.sigma_a.0[..3]);
        scattered.extend_from_slice(&at.sigma_s.0[..3]);
        // pbrt emits in proportion to absorption.
        for (e, a) in at.emission.0[..3].iter().zip(&at.sigma_a.0[..3]) {
            emitted.push(if *a > 0.0 { e / a } else { 0.0 });
            is_lost |= *e > 0.0 && *a <= 0.0;
        }
    }
    if is_lost {
        output.lose(format!("medium {number}: emission where nothing is absorbed is left out"));
    }
    let light = if grid.emission.is_black() {
        String::new()
    } else {
        format!(" \"rgb Le\" [ {} ]", joined(&emitted))
    };
    let [nx, ny, nz] = size;
    format!(
        "AttributeBegin\n  {}\n  MakeNamedMedium \"medium-{number}\" \"string type\" [ \"rgbgrid\" \
            ] \"float g\" [ {} ] \
         \"integer nx\" [ {nx} ] \"integer ny\" [ {ny} ] \"integer nz\" [ {nz} ] \"rgb sigma_a\" [ \
         {} ] \"rgb sigma_s\" [ {} ]{light}\n\
         AttributeEnd\n",
        transform(&grid.world_from_grid),
        grid.g,
        joined(&absorbed),
        joined(&scattered),
    )
}

/// The densities of a grid, raised so that every emitting cell has some; true if that changed any.
fn densities(grid: &Grid) -> (Vec<f32>, bool) {
    let mut densities = grid.density.values().to_vec();
    let Some(scale) = grid.emission_scale.as_deref().filter(|_| !grid.emission.is_black()) else {
        return (densities, false);
    };
    let highest = densities.iter().copied().fold(0.0, f32::max);
    let least = if highest > 0.0 { highest * THIN } else { THIN };
    let mut is_changed = false;
    for (density, _) in
        densities.iter_mut().zip(scale.values()).filter(|(d, s)| **d < least && **s > 0.0)
    {
        (*density, is_changed) = (least, true);
    }
    (densities, is_changed)
}

fn joined(values: &[f32]) -> String {
    values.iter().map(f32::to_string).collect::<Vec<_>>().join(" ")
}
