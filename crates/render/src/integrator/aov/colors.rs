//! Preview colours of AOV values.

use snell_math::{Rgb, real, rng};

/// Value number `i`, or 0 if there are fewer values.
pub fn value(values: &[f32], i: usize) -> f32 {
    values.get(i).copied().unwrap_or(0.0)
}

/// Three values as red, green and blue.
pub fn color(values: &[f32], _scene_radius: f32) -> Rgb {
    Rgb::new(value(values, 0), value(values, 1), value(values, 2))
}

/// A unit vector as a colour; the zero vector is black.
pub fn direction(values: &[f32], scene_radius: f32) -> Rgb {
    let Rgb { r, g, b } = color(values, scene_radius);
    if (r, g, b) == (0.0, 0.0, 0.0) {
        Rgb::BLACK
    } else {
        Rgb::new(r * 0.5 + 0.5, g * 0.5 + 0.5, b * 0.5 + 0.5)
    }
}

/// Two coordinates as red and green, which repeat after 1.
pub fn coordinates(values: &[f32], _scene_radius: f32) -> Rgb {
    Rgb::new(value(values, 0).rem_euclid(1.0), value(values, 1).rem_euclid(1.0), 0.0)
}

/// An id as one of many colours; a negative id is black.
pub fn id(values: &[f32], _scene_radius: f32) -> Rgb {
    let id = value(values, 0);
    if id < 0.0 {
        return Rgb::BLACK;
    }
    let [r, g, b, _] = rng::pcg4d([id as u32, 1, 2, 3]).map(|h| rng::to_unit(h) * 0.8 + 0.1);
    Rgb::new(r, g, b)
}

/// A count on a logarithmic heat map, on which 0 is black and `2^most` is white.
pub fn count(values: &[f32], most: f32) -> Rgb {
    heat((real::log2(1.0 + value(values, 0).max(0.0)) / most).min(1.0))
}

/// A heat map of increasing brightness from 0 to 1: black, blue, magenta, orange, white.
pub fn heat(x: f32) -> Rgb {
    const STOPS: [[f32; 3]; 5] = [
        [0.0, 0.0, 0.02],
        [0.08, 0.02, 0.4],
        [0.6, 0.05, 0.35],
        [0.98, 0.45, 0.05],
        [1.0, 1.0, 0.85],
    ];
    let p = x * 4.0;
    let i = (p as usize).min(3);
    let t = p - i as f32;
    let c = |k: usize| STOPS[i][k] * (1.0 - t) + STOPS[i + 1][k] * t;
    Rgb::new(c(0), c(1), c(2))
}
