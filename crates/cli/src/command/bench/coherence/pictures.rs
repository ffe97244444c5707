//! Pictures made by each method, with flat shading and the shadows of one light.

use super::super::kinds::{First, even_bits};
use super::ways::{Way, seen_share};
use super::{Case, kinds};
use crate::command::bench::kinds::Kind;
use crate::failure::Failure;
use snell_formats::image::{WriteOptions, write_image};
use snell_intersect::Hit;
use snell_lab::coherence::{BeamTracer, Cone, ConeTracer, ConvexPolygon, PrimitiveId};
use snell_math::{DVec2, Ray, Vec2, Vec3};
use snell_scene::{Layer, LayeredImage};
use std::path::Path;

/// Value of the background.
const BACKGROUND: f32 = 0.6;

/// Share of the light that shadowed points still get.
const AMBIENT: f32 = 0.2;

/// Side of the regions of beams, in pixels.
const TILE: u32 = 16;

/// Writes a picture for each method into an existing folder.
pub fn write(
    folder: &Path,
    case: &Case,
    first: &[First],
    closest: &[(Way, Vec<Hit>)],
    occluded: &[(Way, Vec<bool>)],
) -> Result<(), Failure> {
    let shadow_rays = kinds::rays(Kind::Shadow, case.bench, first);
    for ((way, hits), (_, blocked)) in closest.iter().zip(occluded) {
        // The share of the light that each pixel sees. Only the pixels whose rays hit have shadow
        // rays.
        let mut cones = ConeTracer::new(case.world).map_err(|e| Failure::Scene(e.to_string()))?;
        let mut shadows = shadow_rays.iter().zip(blocked);
        let lit: Vec<f32> = first
            .iter()
            .map(|(ray, surface)| {
                let Some(surface) = surface else { return 1.0 };
                let Some((shadow_ray, blocked)) = shadows.next() else { return 1.0 };
                // A surface that faces away from the light is dark, so that it does not lighten its
                // neighbours in the pixel.
                let from_light = surface.position - case.bench.light;
                if surface.is_front_facing(ray.direction) != surface.is_front_facing(from_light) {
                    0.0
                } else if *way == Way::Cones {
                    seen_share(&mut cones, case, shadow_ray) as f32
                } else {
                    f32::from(u8::from(!blocked))
                }
            })
            .collect();
        let pixels = match way {
            Way::Beams => beams(case, first, &lit)?,
            Way::Cones => in_rows(case.side, |i| {
                let ray = &first[i].0;
                let hits = cones
                    .trace(&Cone::around(ray, 0.0, case.spreads[i].into()), [0.0, f64::INFINITY]);
                let covered = hits
                    .hits
                    .iter()
                    .map(|h| h.coverage as f32 * shade(case, ray, h.primitive, lit[i]));
                covered.sum::<f32>() + (1.0 - hits.opacity() as f32) * BACKGROUND
            }),
            _ => in_rows(case.side, |i| match hits[i] {
                hit if hit.is_hit() => shade(
                    case,
                    &first[i].0,
                    [hit.instance, hit.geometry, hit.primitive].into(),
                    lit[i],
                ),
                _ => BACKGROUND,
            }),
        };
        let path = folder.join(way.name()).with_extension("png");
        write_image(&path, &grey(case.side, &pixels), &WriteOptions::default())?;
    }
    Ok(())
}

fn grey(side: u32, pixels: &[f32]) -> LayeredImage {
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    let values = pixels.iter().flat_map(|&value| [value; 3]).collect();
    let layers = vec![Layer { name: String::new(), channels, values }];
    LayeredImage { width: side, height: side, layers, metadata: Vec::new() }
}

/// Values in row order. `of` gives the value of a pixel by its number in Morton order.
fn in_rows<T: Copy + Default>(side: u32, mut of: impl FnMut(usize) -> T) -> Vec<T> {
    let mut pixels = vec![T::default(); (side * side) as usize];
    for i in 0..pixels.len() {
        let (x, y) = (even_bits(i as u32), even_bits(i as u32 >> 1));
        pixels[(y * side + x) as usize] = of(i);
    }
    pixels
}

/// The exact mean over each pixel of what beams see. Shadows are those of the rays through the
/// pixel centres.
fn beams(case: &Case, first: &[First], lit: &[f32]) -> Result<Vec<f32>, Failure> {
    let mut tracer = BeamTracer::new(case.world).map_err(|e| Failure::Scene(e.to_string()))?;
    let side = case.side;
    let mut pixels = vec![0.0; (side * side) as usize];
    let lit = in_rows(side, |i| lit[i]);
    let rays = in_rows(side, |i| i);
    let tile = TILE.min(side);
    for corner in
        (0..side / tile).flat_map(|y| (0..side / tile).map(move |x| DVec2::new(x.into(), y.into())))
    {
        let low = corner * f64::from(tile);
        let region = ConvexPolygon::rectangle(low, low + f64::from(tile));
        tracer.visible(&case.view, &region, |piece| {
            let (from, to) = piece.polygon.extent();
            for y in from.y as u32..(to.y.ceil() as u32).min(side) {
                for x in from.x as u32..(to.x.ceil() as u32).min(side) {
                    let at = DVec2::new(x.into(), y.into());
                    let area = piece.polygon.area_in_rectangle(at, at + 1.0) as f32;
                    if area > 0.0 {
                        let pixel = (y * side + x) as usize;
                        let ray = &first[rays[pixel]].0;
                        let value =
                            piece.primitive.map_or(BACKGROUND, |p| shade(case, ray, p, lit[pixel]));
                        pixels[pixel] += area * value;
                    }
                }
            }
        });
    }
    Ok(pixels)
}

/// The shade of a triangle that sees the share `lit` of the light.
fn shade(
    case: &Case,
    ray: &Ray,
    PrimitiveId { instance, geometry, primitive }: PrimitiveId,
    lit: f32,
) -> f32 {
    let hit = Hit { t: 1.0, uv: Vec2::splat(1.0 / 3.0), instance, geometry, primitive };
    let surface = case.world.interaction(ray, &hit);
    let to_light: Vec3 = (case.bench.light - surface.position).normalize_or_zero();
    let normal = surface.geometric_normal;
    let normal = if surface.is_front_facing(ray.direction) { normal } else { -normal };
    AMBIENT + (1.0 - AMBIENT) * lit * normal.dot(to_light).max(0.0)
}
