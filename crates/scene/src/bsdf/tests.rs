//! Tests every example of every material against the properties that all BSDFs must have.

use super::{Bsdf, Lobes, MicrofacetShape, fresnel};
use crate::material::{MaterialKind, ShadingPoint};
use crate::texture::TextureSet;
use snell_intersect::{SurfaceInteraction, UV_SETS};
use snell_math::statistics::{HemisphereCells, chi_squared_deviation, sidak_deviation};
use snell_math::{ColorMode, Rgb, SampledSpectrum, Vec2, Vec3, rng};

fn surface() -> SurfaceInteraction {
    SurfaceInteraction {
        uv: [Vec2::splat(0.3); UV_SETS],
        t: 1.0,
        ..SurfaceInteraction::plain(Vec3::ZERO, Vec3::Z)
    }
}

pub(super) fn bsdf(kind: &MaterialKind) -> Bsdf {
    bsdf_in(ColorMode::Rgb, kind)
}

pub(super) fn bsdf_in(mode: ColorMode, kind: &MaterialKind) -> Bsdf {
    let textures = TextureSet::default();
    kind.bsdf(&ShadingPoint {
        surface: &surface(),
        footprint: 0.0,
        textures: &textures,
        mode,
        outside_ior: 1.0,
    })
}

/// Directions to look from: both sides, straight and grazing.
fn views() -> Vec<Vec3> {
    [(0.0f32, 0.3f32), (0.7, 0.0), (1.2, 2.0), (1.5, 4.0), (2.2, 1.0), (3.0, 5.0)]
        .map(|(theta, phi)| {
            Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        })
        .to_vec()
}

/// Calls `check` with the name of each example, the example, its BSDF and each view.
fn for_each(mut check: impl FnMut(&str, &MaterialKind, &Bsdf, Vec3)) {
    for (i, kind) in MaterialKind::examples().iter().enumerate() {
        let bsdf = bsdf(kind);
        for wo in views() {
            check(&format!("{} (example {i}) from {wo}", kind.name()), kind, &bsdf, wo);
        }
    }
}

/// Index of refraction behind the surface divided by that on the side of `wo`, for materials that
/// refract.
fn relative_ior(kind: &MaterialKind, wo: Vec3) -> f32 {
    let ior = match kind {
        MaterialKind::Dielectric(d) => d.ior.at_line_d(),
        MaterialKind::OpenPbr(p)
            if p.transmission_weight.factor > 0.0 && !p.geometry_thin_walled =>
        {
            p.specular_ior.factor
        }
        _ => 1.0,
    };
    if wo.z > 0.0 { ior } else { 1.0 / ior }
}

/// The factor that turns refracted radiance into energy: it undoes the change of the radiance
/// scale.
fn energy_scale(kind: &MaterialKind, wo: Vec3, is_transmission: bool) -> f32 {
    if is_transmission { relative_ior(kind, wo).powi(2) } else { 1.0 }
}

/// True if light continues in a medium inside, which the BSDF does not cover.
fn has_walk(kind: &MaterialKind) -> bool {
    let MaterialKind::OpenPbr(p) = kind else { return false };
    p.subsurface_weight.factor > 0.0 && !p.geometry_thin_walled
}

/// True for materials whose layers or lobes are weighted by the viewer's direction alone, and for
/// fuzz, which is a fit of that form.
fn is_layered(kind: &MaterialKind) -> bool {
    match kind {
        MaterialKind::OpenPbr(p) => {
            p.coat_weight.factor > 0.0
                || has_walk(kind)
                || p.fuzz_weight.factor > 0.0
                || p.base_diffuse_roughness.factor > 0.0
                || p.specular_color.factor != Rgb::WHITE
        }
        MaterialKind::MetallicRoughness(m) => m.clearcoat.factor > 0.0,
        MaterialKind::CoatedConductor(_) | MaterialKind::Hair(_) => true,
        _ => false,
    }
}

/// The first three dimensions of Sobol's sequence (direction numbers of Joe and Kuo, 2008).
pub(super) fn sobol(i: u32) -> [f32; 3] {
    let mut numbers = [[0u32; 32]; 3];
    for k in 0..32 {
        let shift = 31 - k;
        let m = |d: usize, back: usize| numbers[d][k - back] >> (31 - (k - back));
        let found = [
            1,
            if k == 0 { 1 } else { m(1, 1) << 1 ^ m(1, 1) },
            if k < 2 { [1, 3][k] } else { m(2, 1) << 1 ^ m(2, 2) << 2 ^ m(2, 2) },
        ];
        for (d, m) in found.into_iter().enumerate() {
            numbers[d][k] = m << shift;
        }
    }
    numbers.map(|v| {
        let bits = (0..32).filter(|k| i >> k & 1 == 1).fold(0, |x, k| x ^ v[k]);
        (bits >> 8) as f32 / (1u32 << 24) as f32
    })
}

/// The radiance that a BSDF shows towards `wo` if radiance 1 arrives from all directions, estimated
/// with the first `n` points of Sobol's sequence.
fn furnace(kind: &MaterialKind, bsdf: &Bsdf, wo: Vec3, n: u32) -> [f64; 3] {
    static POINTS: std::sync::LazyLock<Vec<[f32; 3]>> =
        std::sync::LazyLock::new(|| (0..1 << 17).map(sobol).collect());
    let half = 0.5 / n as f32;
    let mut sum = [0.0; 3];
    for &[lobe, x, y] in &POINTS[..n as usize] {
        if let Some(s) = bsdf.sample(wo, lobe + half, Vec2::new(x + half, y + half)) {
            let scale = energy_scale(kind, wo, s.is_transmission);
            for (sum, w) in sum.iter_mut().zip(s.weight.0) {
                *sum += f64::from(w * scale);
            }
        }
    }
    sum.map(|s| s / f64::from(n))
}

#[test]
fn opaque_bsdfs_bring_no_light_across() {
    for_each(|name, _, bsdf, wo| {
        for i in (0..200).filter(|_| bsdf.is_opaque()) {
            let wi = snell_math::sampling::uniform_sphere(rng::uniform2([i, 8, 8, 8]));
            assert!(wi.z * wo.z > 0.0 || bsdf.eval(wo, wi).is_black(), "{name}: {wi}");
        }
    });
}

#[test]
fn no_bsdf_makes_light() {
    for_each(|name, kind, bsdf, wo| {
        let albedo = furnace(kind, bsdf, wo, 1 << 15);
        assert!(albedo.iter().all(|&a| a <= 1.003), "{name}: {albedo:?}");
    });
}

#[test]
fn lossless_settings_lose_nothing() {
    use crate::material::{
        Conductor, Dielectric, Diffuse, MetallicRoughness, Mirror, Phong, Plastic,
    };
    let white = Rgb::WHITE;
    let lossless: Vec<MaterialKind> = vec![
        Diffuse::new(white).into(),
        Mirror::new(white).into(),
        Dielectric::smooth(1.5).into(),
        Dielectric::smooth(1.0).into(),
        Dielectric::smooth(0.7).into(),
        Conductor::color(white, 0.0).into(),
        Phong { reflection: white.into(), diffuse: Rgb::BLACK.into(), ..Phong::default() }.into(),
        Phong::default().into(),
        Plastic::new(white, 0.0).into(),
        Plastic::new(white, 0.5).into(),
        MetallicRoughness::new(white, 1.0, 0.0).into(),
        MetallicRoughness::new(white, 0.0, 0.0).into(),
        MetallicRoughness { transmission: 1.0.into(), ..MetallicRoughness::new(white, 0.0, 0.0) }
            .into(),
    ];
    for kind in lossless {
        let bsdf = bsdf(&kind);
        for wo in views() {
            let albedo = furnace(&kind, &bsdf, wo, 1 << 16);
            assert!(
                albedo.iter().all(|a| (a - 1.0).abs() < 1e-3),
                "{kind:?} from {wo}: {albedo:?}"
            );
        }
    }
}

/// The fraction of a uniform surrounding that is seen, integrated without random numbers.
fn integrated_furnace(kind: &MaterialKind, bsdf: &Bsdf, wo: Vec3) -> f64 {
    let scale = |is_transmission| f64::from(energy_scale(kind, wo, is_transmission));
    let [above, below] = halves(wo, relative_ior(kind, wo), 6, 4);
    let spread =
        |cells: HemisphereCells| cells.integrate(|wi| bsdf.eval(wo, wi)[0]).iter().sum::<f64>();
    let sharp = bsdf.specular_branches(wo).into_iter().flatten();
    let sharp: f64 = sharp.map(|b| f64::from(b.weight[0]) * scale(b.is_transmission)).sum();
    sharp + spread(above) + if bsdf.is_opaque() { 0.0 } else { spread(below) * scale(true) }
}

const SHAPES: [MicrofacetShape; 2] = [MicrofacetShape::Ggx, MicrofacetShape::Beckmann];

/// Checks lossless settings at twenty roughnesses and ten angles, from either side if `sides` is 2:
/// they must keep all light but a thousandth.
fn lossless_at_every_roughness_and_angle(
    name: &str,
    sides: usize,
    kind: impl Fn(f32) -> MaterialKind,
    seen: impl Fn(&MaterialKind, &Bsdf, Vec3) -> f64,
) {
    keeps_all_light_but(1e-3, name, sides, kind, seen);
}

/// Does what [`lossless_at_every_roughness_and_angle`] does, with `share` as the fraction that may
/// be lost.
fn keeps_all_light_but(
    share: f64,
    name: &str,
    sides: usize,
    kind: impl Fn(f32) -> MaterialKind,
    seen: impl Fn(&MaterialKind, &Bsdf, Vec3) -> f64,
) {
    let mut worst = (0.0, String::new());
    for r in 1..=20 {
        let roughness = r as f32 * 0.05;
        let kind = kind(roughness);
        let bsdf = bsdf(&kind);
        for angle in 0..10 {
            for side in 0..sides {
                let theta = (angle as f32 * 9.5 + 2.0).to_radians();
                let wo =
                    Vec3::new(theta.sin(), 0.0, if side == 0 { theta.cos() } else { -theta.cos() });
                let off = seen(&kind, &bsdf, wo) - 1.0;
                if off.abs() > worst.0 {
                    worst = (off.abs(), format!("{off:+.5} at roughness {roughness} from {wo}"));
                }
            }
        }
    }
    eprintln!("{name}: at most {}", worst.1);
    assert!(worst.0 < share, "{name}: {}", worst.1);
}

#[test]
fn white_metals_lose_nothing_at_any_roughness() {
    use crate::material::Conductor;
    for microfacets in SHAPES {
        let kind = |r| Conductor { microfacets, ..Conductor::color(Rgb::WHITE, r) }.into();
        lossless_at_every_roughness_and_angle(
            &format!("metal {microfacets:?}"),
            1,
            kind,
            integrated_furnace,
        );
    }
}

/// Integrates with random numbers, because at grazing angles the refraction of rough glass has
/// ridges that are too sharp for quadrature.
fn clear_dielectrics_lose_next_to_nothing(iors: &[f32], n: u32) {
    use crate::material::Dielectric;
    for &ior in iors {
        let seen = |kind: &MaterialKind, bsdf: &Bsdf, wo| furnace(kind, bsdf, wo, n)[0];
        for microfacets in SHAPES {
            let kind = |r| Dielectric { microfacets, ..Dielectric::rough(ior, r) }.into();
            // With Beckmann's distribution the error here is up to 0.0012, and 0.0008 with four
            // times as many points.
            let share = if microfacets == MicrofacetShape::Ggx { 1e-3 } else { 1.5e-3 };
            keeps_all_light_but(share, &format!("glass of {ior} {microfacets:?}"), 2, kind, seen);
        }
    }
}

#[test]
fn clear_dielectrics_lose_nothing_at_any_roughness() {
    clear_dielectrics_lose_next_to_nothing(&[1.5], 1 << 15);
}

#[test]
#[ignore = "takes a minute"]
fn clear_dielectrics_of_several_indices_lose_nothing_at_any_roughness() {
    clear_dielectrics_lose_next_to_nothing(&[1.33, 1.5, 2.4], 1 << 17);
}

#[test]
fn white_plastics_lose_nothing_at_any_roughness() {
    use crate::material::Plastic;
    for microfacets in SHAPES {
        let kind = |r| Plastic { microfacets, ..Plastic::new(Rgb::WHITE, r) }.into();
        lossless_at_every_roughness_and_angle(
            &format!("plastic {microfacets:?}"),
            1,
            kind,
            integrated_furnace,
        );
    }
}

#[test]
fn white_layers_lose_nothing_at_any_roughness() {
    use crate::material::OpenPbr;
    let white = || crate::material::ColorParam::from(Rgb::WHITE);
    let plain = |r: f32| OpenPbr {
        base_color: white(),
        specular_roughness: r.into(),
        ..OpenPbr::default()
    };
    let all: [&dyn Fn(f32) -> OpenPbr; 8] = [
        &plain,
        &|r| OpenPbr {
            base_diffuse_roughness: 1.0.into(),
            specular_weight: 2.0.into(),
            ..plain(r)
        },
        &|r| OpenPbr { coat_weight: 1.0.into(), coat_roughness: r.into(), ..plain(0.5) },
        &|r| OpenPbr {
            coat_weight: 0.7.into(),
            base_metalness: 0.5.into(),
            fuzz_weight: 1.0.into(),
            ..plain(r)
        },
        &|r| OpenPbr { fuzz_weight: 0.8.into(), fuzz_roughness: r.into(), ..plain(0.3) },
        &|r| OpenPbr { transmission_weight: 1.0.into(), geometry_thin_walled: true, ..plain(r) },
        &|r| OpenPbr {
            subsurface_weight: 0.6.into(),
            subsurface_color: white(),
            geometry_thin_walled: true,
            ..plain(r)
        },
        &|r| OpenPbr {
            subsurface_weight: 0.6.into(),
            subsurface_color: white(),
            coat_weight: 1.0.into(),
            ..plain(r)
        },
    ];
    let names =
        ["plain", "rough matte", "coat", "mixture", "fuzz", "pane", "leaf", "wax under a coat"];
    for (name, surface) in names.into_iter().zip(all) {
        lossless_at_every_roughness_and_angle(name, 1, |r| surface(r).into(), integrated_furnace);
    }
}

#[test]
fn nothing_is_lost_on_a_walk_through_a_glass_ball() {
    use crate::material::Dielectric;
    let glass = bsdf(&Dielectric::smooth(1.5).into());
    for seed in 0..2000u32 {
        let u = |bounce: u32| rng::uniform2([seed, bounce, 5, 1]);
        // Follows light in a ball by its normals alone: inside, each chord meets the surface at the
        // angle at which it left.
        let (mut wo, mut throughput) = (fresnel_view(u(100).x), SampledSpectrum::ONE);
        for bounce in 0..200 {
            let s = glass.sample(wo, u(bounce).x, u(bounce + 1000)).expect("glass absorbs nothing");
            throughput *= s.weight;
            if s.wi.z > 0.0 {
                break;
            }
            wo = Vec3::new(-s.wi.x, s.wi.y, s.wi.z);
        }
        assert!((throughput[0] - 1.0).abs() < 1e-4, "{throughput:?}");
    }
}

fn fresnel_view(u: f32) -> Vec3 {
    let cos = 0.01 + 0.98 * u;
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

#[test]
fn samples_agree_with_value_and_density() {
    for_each(|name, _, bsdf, wo| {
        for i in 0..400u32 {
            let (u, lobe) = (rng::uniform2([i, 11, 3, 0]), rng::uniform2([i, 12, 3, 0]).x);
            let Some(s) = bsdf.sample(wo, lobe, u) else { continue };
            assert!((s.wi.length() - 1.0).abs() < 1e-4, "{name}: {s:?}");
            assert!(
                s.weight.is_finite() && s.weight.0.iter().all(|&w| w >= 0.0) && s.pdf.is_finite(),
                "{name}: {s:?}"
            );
            assert_eq!(s.is_transmission, s.wi.z * wo.z < 0.0, "{name}: {s:?}");
            assert_eq!(s.is_delta, s.pdf == 0.0, "{name}: {s:?}");
            assert!(!bsdf.is_delta() || s.is_delta, "{name}: a delta BSDF gave {s:?}");
            if s.is_delta {
                continue;
            }
            let pdf = bsdf.pdf(wo, s.wi);
            // Sharp lobes amplify the rounding of the direction.
            assert!((pdf - s.pdf).abs() <= 0.02 * s.pdf, "{name}: pdf {pdf} but {s:?}");
            let weight = bsdf.eval(wo, s.wi) / pdf;
            for (a, b) in weight.0.iter().zip(s.weight.0) {
                assert!((a - b).abs() <= 0.02 * b + 1e-5, "{name}: weight {weight:?} but {s:?}");
            }
        }
    });
}

#[test]
fn values_are_reciprocal() {
    for_each(|name, kind, bsdf, wo| {
        if is_layered(kind) {
            return;
        }
        for i in 0..200u32 {
            let wi = snell_math::sampling::uniform_sphere(rng::uniform2([i, 21, 3, 0]));
            let is_transmission = wi.z * wo.z < 0.0;
            let (there, back) = (bsdf.eval(wo, wi) / wi.z.abs(), bsdf.eval(wi, wo) / wo.z.abs());
            // Radiance is reciprocal after division by the squared index of refraction on its side.
            let scale = energy_scale(kind, wo, is_transmission);
            for (a, b) in there.0.iter().map(|a| a * scale).zip(back.0) {
                assert!(
                    (a - b).abs() <= 5e-3 * a.abs().max(b.abs()) + 1e-5,
                    "{name} to {wi}: {there:?}, back {back:?}"
                );
            }
        }
    });
}

#[test]
fn both_sides_of_opaque_materials_look_alike() {
    for_each(|name, kind, bsdf, wo| {
        if relative_ior(kind, wo) != 1.0
            || has_walk(kind)
            || matches!(kind, MaterialKind::Dielectric(_))
        {
            return;
        }
        let flip = |v: Vec3| Vec3::new(v.x, v.y, -v.z);
        for i in 0..50u32 {
            let wi = snell_math::sampling::uniform_sphere(rng::uniform2([i, 31, 3, 0]));
            assert_eq!(bsdf.eval(wo, wi), bsdf.eval(flip(wo), flip(wi)), "{name}");
            assert_eq!(bsdf.pdf(wo, wi), bsdf.pdf(flip(wo), flip(wi)), "{name}");
        }
    });
}

#[test]
fn directions_in_the_surface_are_harmless() {
    for kind in MaterialKind::examples() {
        let bsdf = bsdf(&kind);
        for wo in [Vec3::X, Vec3::new(1.0, 0.0, 1e-20), Vec3::new(-1.0, 0.0, -1e-6), Vec3::Z] {
            for i in 0..100u32 {
                let (u, lobe) = (rng::uniform2([i, 41, 3, 0]), rng::uniform2([i, 42, 3, 0]).x);
                if let Some(s) = bsdf.sample(wo, lobe, if i == 0 { Vec2::ZERO } else { u }) {
                    assert!(
                        s.weight.is_finite() && s.weight.0.iter().all(|&w| w >= 0.0),
                        "{kind:?} {wo} {s:?}"
                    );
                }
                let wi = snell_math::sampling::uniform_sphere(u);
                for wi in [wi, Vec3::Y, -wo, wo, Vec3::new(-wo.x, -wo.y, wo.z)] {
                    let (value, pdf) = (bsdf.eval(wo, wi), bsdf.pdf(wo, wi));
                    assert!(
                        value.is_finite() && value.0.iter().all(|&v| v >= 0.0),
                        "{kind:?} {wo} {wi} {value:?}"
                    );
                    assert!(pdf.is_finite() && pdf >= 0.0, "{kind:?} {wo} {wi} {pdf}");
                }
            }
            assert!(
                bsdf.specular_branches(wo)
                    .iter()
                    .flatten()
                    .all(|b| b.weight.is_finite() && b.wi.is_finite())
            );
            assert!(bsdf.albedo(wo).is_finite() && bsdf.ambient(wo).is_finite());
        }
    }
}

/// Cells about the mirror direction, and about the direction into which a smooth surface of this
/// relative index would refract light, where lobes are sharp.
fn halves(wo: Vec3, eta: f32, rings: usize, sectors: usize) -> [HemisphereCells; 2] {
    let side = Vec3::new(0.0, 0.0, wo.z.signum());
    [fresnel::reflect(wo, side), fresnel::refract(wo, side, eta).unwrap_or(-wo)]
        .map(|axis| HemisphereCells::new(axis, rings, sectors))
}

#[test]
fn samples_are_distributed_by_their_density() {
    let mut tests = 0;
    let mut worst = (f64::NEG_INFINITY, String::new());
    for_each(|name, kind, bsdf, wo| {
        if bsdf.is_delta() {
            return;
        }
        const CELLS: usize = 20 * 8;
        let halves = halves(wo, relative_ior(kind, wo), 20, 8);
        let mut expected: Vec<f64> =
            halves.iter().flat_map(|c| c.integrate(|w| bsdf.pdf(wo, w))).collect();
        let total: f64 = expected.iter().sum();
        assert!(total <= 1.0 + 5e-4, "{name}: density adds up to {total}");
        let n = 40_000u32;
        let mut found = vec![0u32; expected.len()];
        let mut elsewhere = 0;
        for i in 0..n {
            let (u, lobe) = (rng::uniform2([i, 51, 3, 0]), rng::uniform2([i, 52, 3, 0]).x);
            match bsdf.sample(wo, lobe, u) {
                Some(s) if !s.is_delta => {
                    let half = usize::from(s.wi.z * wo.z < 0.0);
                    found[half * CELLS + halves[half].index(s.wi)] += 1;
                }
                _ => elsewhere += 1,
            }
        }
        found.push(elsewhere);
        expected.push((1.0 - total).max(0.0));
        expected.iter_mut().for_each(|e| *e *= f64::from(n));
        let z = chi_squared_deviation(&found, &expected);
        tests += 1;
        if z > worst.0 {
            worst = (z, format!("{name}: total {total}"));
        }
    });
    let limit = sidak_deviation(0.01, tests);
    assert!(
        tests > 100 && worst.0 < limit,
        "{tests} tests, the worst {worst:?}, but at most {limit}"
    );
}

#[test]
fn phong_keeps_the_classic_formula() {
    use crate::material::Phong;
    let grey = |x| Rgb::splat(x).into();
    let phong = bsdf(
        &Phong {
            ambient: grey(0.2),
            diffuse: grey(0.9),
            specular: grey(0.8),
            reflection: grey(0.8),
            shininess: 3.0,
            ..Phong::default()
        }
        .into(),
    );
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let wi = Vec3::new(-0.28, 0.0, 0.96);
    // The expected value is V.R with R = 2 (N.L) N - L.
    let r = Vec3::new(0.28, 0.0, 0.96);
    let expected = 0.9 * 0.96 + 0.8 * wo.dot(r).powi(3);
    assert!((phong.eval_classic(wo, wi)[0] - expected).abs() < 1e-5);
    assert_eq!(phong.eval_classic(wo, -wi), SampledSpectrum::ZERO);
    assert_eq!(phong.ambient(wo)[0], 0.2);
    let [mirror, through] = phong.specular_branches(wo);
    assert_eq!(mirror.map(|b| (b.wi, b.weight[0])), Some((Vec3::new(-0.6, 0.0, 0.8), 0.8)));
    assert_eq!(through, None);
}

#[test]
fn phong_refracts_without_fresnel_and_drops_total_reflection() {
    use crate::material::Phong;
    let glass = bsdf(
        &Phong {
            diffuse: Rgb::BLACK.into(),
            transmission: Rgb::splat(0.7).into(),
            ior: 1.5,
            ..Phong::default()
        }
        .into(),
    );
    let [_, through] = glass.specular_branches(Vec3::new(0.6, 0.0, 0.8));
    let through = through.expect("enters");
    assert!((through.wi.x + 0.4).abs() < 1e-6 && through.wi.z < 0.0 && through.weight[0] == 0.7);
    let [_, inside] = glass.specular_branches(Vec3::new(0.8, 0.0, -0.6));
    assert_eq!(inside, None, "beyond the critical angle");
    let air = bsdf(&Phong { transmission: Rgb::WHITE.into(), ..Phong::default() }.into());
    let wo = Vec3::new(0.6, 0.0, -0.8);
    assert_eq!(air.specular_branches(wo)[1].map(|b| b.wi), Some(-wo));
}
