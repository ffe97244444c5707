//! Integrates the tables of albedos, and checks values that are interpolated between their nodes.

use super::anisotropic::{self, AZIMUTHS, CELL, RATIOS, WIDTHS};
use super::anisotropic::{azimuth_position, four_nodes, ratio_at, width_at};
use super::*;
use crate::bsdf::fresnel;

/// The index of refraction at a node; the first is 1.
fn ior_at(node: usize) -> f64 {
    let s = MOST_ROOT_F0 * (node as f64 / (INDICES - 1) as f64).powf(2.5);
    (1.0 + s) / (1.0 - s)
}

/// The roughness of a row; that of the first is close to 0.
fn row_roughness(row: usize) -> f32 {
    (row as f32 / (ROUGHNESSES - 1) as f32).max(LEAST_ROUGHNESS)
}

/// Fractions of light for one direction.
#[derive(Clone, Copy, Default)]
struct Shares {
    /// Reflected by facets that reflect everything, by facets of a dielectric seen from outside,
    /// and by facets of a dielectric seen from inside.
    mirror: f64,
    outside: f64,
    inside: f64,
    /// Transmitted by facets of a dielectric, from outside and from inside.
    into: f64,
    out: f64,
}

/// The cosine at which a typical visible facet is seen, also of surfaces that count as smooth.
fn facet_cosine(widths: Widths, w: Vec3) -> f32 {
    (f64::from(widths.spread(w)).hypot(f64::from(w.z)) as f32).min(1.0)
}

/// The direction that belongs to a node.
fn direction(widths: Widths, node: usize) -> Vec3 {
    let at = |mu: f64| Vec3::new((1.0 - mu * mu).max(0.0).sqrt() as f32, 0.0, mu as f32);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let reached =
            f64::from(position(widths, at(middle))) < node as f64 / (STEEPNESSES - 1) as f64;
        *(if reached { &mut low } else { &mut high }) = middle;
    }
    at(if node == 0 { 0.0 } else { high })
}

fn shares(facets: Microfacets, wo: Vec3, ior: f64, n: u32) -> Shares {
    let mut sum = Shares::default();
    let weight = |wi: Vec3| f64::from(facets.shadowing(wo, wi));
    for i in 0..n {
        // The points are a Fibonacci lattice, warped so that tilted facets, which lose light, are
        // sampled more densely.
        let x = (f64::from(i) + 0.5) / f64::from(n);
        let y = (f64::from(i) * 0.618_033_988_749_894_9 + 0.5).fract();
        let (v, density) = (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x));
        let m = facets.sample_visible_normal(wo, Vec2::new(y as f32, v as f32));
        let cos = wo.dot(m);
        let [from_outside, from_inside] =
            [ior as f32, 1.0 / ior as f32].map(|eta| f64::from(fresnel::dielectric(cos, eta)));
        let wi = fresnel::reflect(wo, m);
        if wi.z > 0.0 {
            let weight = weight(wi) * density;
            sum.mirror += weight;
            sum.outside += weight * from_outside;
            sum.inside += weight * from_inside;
        }
        for (sum, eta, reflectance) in
            [(&mut sum.into, ior, from_outside), (&mut sum.out, 1.0 / ior, from_inside)]
        {
            if let Some(wi) = fresnel::refract(wo, m, eta as f32).filter(|wi| wi.z < 0.0) {
                *sum += weight(Vec3::new(wi.x, wi.y, -wi.z)) * density * (1.0 - reflectance);
            }
        }
    }
    let n = f64::from(n);
    Shares {
        mirror: sum.mirror / n,
        outside: sum.outside / n,
        inside: sum.inside / n,
        into: sum.into / n,
        out: sum.out / n,
    }
}

/// The integral of `2 f mu` over the cosine `mu`, for a quantity `f` that is interpolated in
/// steepness.
fn average(alpha: f64, row: &[f64], reference: impl Fn(f64) -> f64) -> f64 {
    let steps = 20_000;
    let mut sum = 0.0;
    for i in 0..steps {
        let t = (f64::from(i) + 0.5) / f64::from(steps);
        let (mu, weight) = (t * t * t, 6.0 * t.powi(5) / f64::from(steps));
        let steepness = mu / (mu + alpha * (1.0 - mu * mu).sqrt());
        let x = 0.5 * (steepness.sqrt() + mu) * (STEEPNESSES - 1) as f64;
        let k = (x as usize).min(STEEPNESSES - 2);
        sum += weight * reference(mu) * (row[k] + (row[k + 1] - row[k]) * (x - k as f64));
    }
    sum
}

/// Appends a [table](Table) to `bytes`: rows of albedos with their means, for each index of
/// refraction.
fn encode(planes: &[&Vec<Vec<f64>>], bytes: &mut Vec<u8>) {
    for row in 0..ROUGHNESSES {
        for number in 0..ROW {
            for plane in planes {
                let x = plane[row][number];
                let x = if number == STEEPNESSES { x.ln() / f64::from(DEEPEST) } else { x };
                bytes.extend(((x.clamp(0.0, 1.0) * 65535.0).round() as u16).to_le_bytes());
            }
        }
    }
}

/// The values at the nodes moved so that straight lines between them deviate from a curve equally
/// to both sides, where it bends evenly: the line between values of the curve itself is off by an
/// eighth of the second difference in the middle.
fn balanced(row: &[f64]) -> Vec<f64> {
    let bend = |i: usize| row[i - 1] - 2.0 * row[i] + row[i + 1];
    let moved = |(i, &value): (usize, &f64)| {
        if i < 2 || i + 2 >= row.len() {
            return value;
        }
        let bends = [bend(i - 1), bend(i), bend(i + 1)];
        let least = bends.into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
        if bends.iter().all(|bend| bend * least > 0.0) { value - least / 16.0 } else { value }
    };
    row.iter().enumerate().map(moved).collect()
}

/// The four quantities for one index of refraction, as rows of albedos with their means.
fn integrate(shape: MicrofacetShape, ior: f64) -> [Vec<Vec<f64>>; 4] {
    let mut planes: [Vec<Vec<f64>>; 4] = Default::default();
    for r in 0..ROUGHNESSES {
        let alpha = f64::from(row_roughness(r)).powi(2);
        let widths = Widths::from_alphas(alpha as f32, alpha as f32);
        let most = MOST * range(shape);
        let mut rows: [Vec<f64>; 4] = Default::default();
        for k in 0..STEEPNESSES {
            let wo = direction(widths, k);
            let s = shares(shape.of_widths(widths), wo, ior, 1 << 13);
            let reference = f64::from(fresnel::dielectric(facet_cosine(widths, wo), ior as f32));
            let ratio = if reference > 0.0 {
                s.outside / reference / f64::from(most)
            } else {
                1.0 / f64::from(most)
            };
            let values = [1.0 - s.mirror, ratio, 1.0 - s.outside - s.into, 1.0 - s.inside - s.out];
            for (row, value) in rows.iter_mut().zip(values) {
                row.push(value);
            }
        }
        let reference = |mu: f64| {
            let wo = Vec3::new((1.0 - mu * mu).sqrt() as f32, 0.0, mu as f32);
            f64::from(most * fresnel::dielectric(facet_cosine(widths, wo), ior as f32))
        };
        for (i, (plane, row)) in planes.iter_mut().zip(rows).enumerate() {
            let mut row = balanced(&row);
            row.push(if i == 1 {
                average(alpha, &row, reference)
            } else {
                average(alpha, &row, |_| 1.0) / f64::from(mean_reference(alpha as f32))
            });
            plane.push(row);
        }
    }
    planes
}

/// Appends the tables of one microfacet distribution to `bytes`.
fn tables(shape: MicrofacetShape, bytes: &mut Vec<u8>) {
    let mut planes: Vec<_> = (0..INDICES).map(|_| None).collect();
    std::thread::scope(|scope| {
        for chunk in planes.chunks_mut(8).enumerate() {
            scope.spawn(move || {
                for (i, plane) in chunk.1.iter_mut().enumerate() {
                    *plane = Some(integrate(shape, ior_at(chunk.0 * 8 + i)));
                }
            });
        }
    });
    let planes: Vec<_> = planes.into_iter().flatten().collect();
    encode(&[&planes[0][0]; FACETS.indices], bytes);
    for quantity in 1..4 {
        encode(&planes.iter().map(|quantities| &quantities[quantity]).collect::<Vec<_>>(), bytes);
    }
}

#[test]
#[ignore = "writes the tables"]
fn write_tables() {
    let mut bytes = Vec::new();
    for shape in [MicrofacetShape::Ggx, MicrofacetShape::Beckmann] {
        tables(shape, &mut bytes);
    }
    std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/energy/tables.bin"), bytes)
        .expect("writes the tables");
}

/// Index of refraction at a node of the anisotropic tables. For the first, which is close to 1, the
/// quotient of reflectances is still defined.
fn anisotropic_ior_at(node: usize) -> f64 {
    let s = MOST_ROOT_F0 * (node as f64 / (anisotropic::INDICES - 1) as f64).powf(2.5);
    (1.0 + s.max(2e-4)) / (1.0 - s.max(2e-4))
}

/// The cosine of the azimuth at a node: the inverse of the position along azimuths.
fn azimuth_at(widths: Widths, node: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let position = azimuth_position(widths, (middle * middle) as f32);
        let reached = f64::from(position) < node as f64 / (AZIMUTHS - 1) as f64;
        *(if reached { &mut low } else { &mut high }) = middle;
    }
    if node == 0 { 0.0 } else { high }
}

/// The direction of this cosine and of this cosine of the azimuth.
fn direction_at(mu: f64, along: f64) -> Vec3 {
    let sin = (1.0 - mu * mu).max(0.0).sqrt();
    let across = (1.0 - along * along).max(0.0).sqrt();
    Vec3::new((sin * along) as f32, (sin * across) as f32, mu as f32)
}

/// The direction of a node of the anisotropic tables.
fn anisotropic_direction(widths: Widths, along: f64, node: usize) -> Vec3 {
    let goal = node as f64 / (anisotropic::STEEPNESSES - 1) as f64;
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let reached = f64::from(position(widths, direction_at(middle, along))) < goal;
        *(if reached { &mut low } else { &mut high }) = middle;
    }
    // Along the surface widths are in the limit only.
    direction_at(if node == 0 { 1e-5 } else { high }, along)
}

/// The mean over directions, weighted by the cosine, of a quantity that is interpolated between the
/// nodes of a cell as [`anisotropic`] does, times a reference.
fn mean_of_cell(widths: Widths, cell: &[f64], reference: impl Fn(Vec3) -> f64) -> f64 {
    let (steps, turns) = (160, 96);
    let mut sum = 0.0;
    for i in 0..turns {
        let along = ((f64::from(i) + 0.5) / f64::from(turns) * std::f64::consts::FRAC_PI_2).cos();
        let position_along = azimuth_position(widths, (along * along) as f32);
        let (first, by_azimuth) = four_nodes(position_along, AZIMUTHS);
        for k in 0..steps {
            let u = (f64::from(k) + 0.5) / f64::from(steps);
            let (w, weight) = (direction_at(u * u * u, along), 6.0 * u.powi(5));
            let (node, by_steepness) = four_nodes(position(widths, w), anisotropic::STEEPNESSES);
            for (j, by_azimuth) in by_azimuth.into_iter().enumerate() {
                for (l, by_steepness) in by_steepness.into_iter().enumerate() {
                    let at = (first + j) * anisotropic::STEEPNESSES + node + l;
                    let weight = weight * f64::from(by_azimuth * by_steepness);
                    sum += weight * cell[at] * reference(w);
                }
            }
        }
    }
    sum / f64::from(steps * turns)
}

/// The cell of two widths, for each quantity of [`Shares`] and index of refraction.
fn cells(shape: MicrofacetShape, widths: Widths, iors: &[f64]) -> Vec<[Vec<f64>; 4]> {
    let mut cells = vec![<[Vec<f64>; 4]>::default(); iors.len()];
    for azimuth in 0..AZIMUTHS {
        let along = azimuth_at(widths, azimuth);
        for node in 0..anisotropic::STEEPNESSES {
            let wo = anisotropic_direction(widths, along, node);
            for (cell, &ior) in cells.iter_mut().zip(iors) {
                let s = shares(shape.of_widths(widths), wo, ior, 1 << 11);
                let reference =
                    f64::from(fresnel::dielectric(facet_cosine(widths, wo), ior as f32));
                let ratio = s.outside / reference / f64::from(MOST);
                let values =
                    [1.0 - s.mirror, ratio, 1.0 - s.outside - s.into, 1.0 - s.inside - s.out];
                for (cell, value) in cell.iter_mut().zip(values) {
                    cell.push(value.clamp(0.0, 1.0));
                }
            }
        }
    }
    for (cell, &ior) in cells.iter_mut().zip(iors) {
        for (quantity, cell) in cell.iter_mut().enumerate() {
            let reference = |w: Vec3| {
                f64::from(MOST * fresnel::dielectric(facet_cosine(widths, w), ior as f32))
            };
            cell.push(if quantity == 1 {
                mean_of_cell(widths, cell, reference)
            } else {
                mean_of_cell(widths, cell, |_| 1.0) / f64::from(mean_reference(widths.x))
            });
        }
    }
    cells
}

/// The cells of all widths.
fn all_cells(shape: MicrofacetShape, iors: &[f64]) -> Vec<Vec<[Vec<f64>; 4]>> {
    let all: Vec<_> = (0..WIDTHS * RATIOS).collect();
    std::thread::scope(|scope| {
        let threads: Vec<_> = all
            .chunks(all.len().div_ceil(4))
            .map(|some| {
                scope.spawn(move || -> Vec<_> {
                    some.iter()
                        .map(|at| {
                            let (x, ratio) = (width_at(at / RATIOS), ratio_at(at % RATIOS));
                            cells(shape, Widths { x, y: ratio * x }, iors)
                        })
                        .collect()
                })
            })
            .collect();
        threads.into_iter().flat_map(|t| t.join().expect("no panic")).collect()
    })
}

#[test]
#[ignore = "writes the tables"]
fn write_anisotropic_tables() {
    let iors: Vec<_> = (0..anisotropic::INDICES).map(anisotropic_ior_at).collect();
    let ggx = all_cells(MicrofacetShape::Ggx, &iors);
    let beckmann = all_cells(MicrofacetShape::Beckmann, &[1.5]);
    let mut numbers = Vec::new();
    let mut write = |table: &[Vec<[Vec<f64>; 4]>], quantity: usize, indices: usize| {
        for cell in table {
            for number in 0..CELL {
                for plane in &cell[..indices] {
                    let x = plane[quantity][number];
                    let is_mean = number == CELL - 1;
                    let x = if is_mean { x.ln() / f64::from(DEEPEST) } else { x };
                    numbers.push((x.clamp(0.0, 1.0) * 65535.0).round() as u16);
                }
            }
        }
    };
    write(&ggx, 0, 1);
    write(&beckmann, 0, 1);
    for quantity in 1..4 {
        write(&ggx, quantity, anisotropic::INDICES);
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/energy/anisotropic.bin");
    std::fs::write(path, anisotropic::pack(numbers)).expect("writes the tables");
}

fn agree_with_fine_integrals(shape: MicrofacetShape) {
    let mut errors: [Vec<f64>; 4] = Default::default();
    for seed in 0..400u32 {
        let [a, b] = [1, 2].map(|k| snell_math::rng::uniform2([seed, k, 7, 7]));
        let facets = shape.of_roughness(0.032 + 0.968 * a.x);
        let mu = if seed % 2 == 0 { a.y } else { a.y * a.y * a.y };
        let wo = Vec3::new((1.0 - mu * mu).sqrt(), 0.0, mu);
        let ior = 1.05 + 2.0 * b.x * b.x;
        let s = shares(facets, wo, f64::from(ior), 1 << 12);
        let found = [
            FacetLoss::new(facets).towards(wo),
            DielectricReflection::new(facets, ior).towards(wo),
            DielectricLoss::new(facets, ior).towards(wo),
            DielectricLoss::new(facets, 1.0 / ior).towards(wo),
        ];
        let values = [1.0 - s.mirror, s.outside, 1.0 - s.outside - s.into, 1.0 - s.inside - s.out];
        for ((errors, found), value) in errors.iter_mut().zip(found).zip(values) {
            errors.push((f64::from(found) - value).abs());
        }
    }
    for (i, errors) in errors.iter_mut().enumerate() {
        errors.sort_by(f64::total_cmp);
        let [most, worst] = [errors[395], errors[399]];
        assert!(most < 2e-3 && worst < 1e-2, "{shape:?} {i}: {most} {worst}");
    }
}

#[test]
fn the_tables_agree_with_fine_integrals_between_their_nodes() {
    agree_with_fine_integrals(MicrofacetShape::Ggx);
    agree_with_fine_integrals(MicrofacetShape::Beckmann);
}
