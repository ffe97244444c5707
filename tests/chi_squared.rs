//! Samples have the claimed density, and the density integrates to the sampled share. This is
//! tested for every lobe over sweeps of its parameters, for phase functions, lamps, environments,
//! emissive media and the choice among many lights. Each family is judged as a whole at a
//! significance of 0.01 (Sidak).

use snell_intersect::SurfaceInteraction;
use snell_math::rng::uniform2;
use snell_math::statistics::{HemisphereCells, chi_squared_deviation, sidak_deviation};
use snell_math::{ColorMode, Rgb, Vec2, Vec3};
use snell_scene::TextureSet;
use snell_scene::bsdf::{Bsdf, Lobes, fresnel};
use snell_scene::material::{
    Conductor, Dielectric, MaterialKind, OpenPbr, ScalarParam, ShadingPoint,
};
use snell_scene::texture::surface_at;

const SIGNIFICANCE: f64 = 0.01;

/// Numbers of rings and sectors of the cells on each half of the sphere.
const RINGS: usize = 12;
const SECTORS: usize = 8;

/// The tests of one family, judged together by their worst deviation.
struct Family {
    name: &'static str,
    worst: (f64, String),
    tests: u32,
    start: std::time::Instant,
}

impl Family {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            worst: (f64::NEG_INFINITY, String::new()),
            tests: 0,
            start: std::time::Instant::now(),
        }
    }

    fn add(&mut self, what: impl FnOnce() -> String, found: &[u32], expected: &[f64]) {
        let deviation = chi_squared_deviation(found, expected);
        self.tests += 1;
        if deviation > self.worst.0 {
            self.worst = (deviation, what());
        }
    }

    fn judge(self) {
        let limit = sidak_deviation(SIGNIFICANCE, self.tests);
        let (deviation, what) = &self.worst;
        let seconds = self.start.elapsed().as_secs_f64();
        eprintln!(
            "{}: {} tests in {seconds:.1} s, the worst {deviation:.2} of at most {limit:.2} \
                standard deviations ({what})",
            self.name, self.tests
        );
        assert!(*deviation < limit, "{}: {what}: {deviation} exceeds {limit}", self.name);
    }
}

fn surface() -> SurfaceInteraction {
    SurfaceInteraction { dpdv: Vec3::Y, ..surface_at(Vec3::ZERO, Vec3::Z, Vec2::splat(0.3)) }
}

fn bsdf(kind: &MaterialKind) -> Bsdf {
    let textures = TextureSet::default();
    kind.bsdf(&ShadingPoint {
        surface: &surface(),
        footprint: 0.0,
        textures: &textures,
        mode: ColorMode::Rgb,
        outside_ior: 1.0,
    })
}

/// Outgoing directions: perpendicular, oblique, grazing, and from below.
fn views(count: usize) -> impl Iterator<Item = Vec3> {
    [(0.05f32, 0.3f32), (0.8, 0.0), (1.35, 2.0), (2.4, 1.0), (1.75, 5.0), (3.05, 0.5)]
        .into_iter()
        .take(count)
        .map(|(theta, phi)| {
            Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        })
}

/// Samples directions from a BSDF and compares them with its density, cell by cell.
fn check_bsdf(
    family: &mut Family,
    name: &str,
    kind: &MaterialKind,
    views_from: usize,
    eta: f32,
    key: u32,
) {
    const N: u32 = 12_000;
    let bsdf = bsdf(kind);
    for (number, wo) in views(views_from).enumerate() {
        let side = Vec3::new(0.0, 0.0, wo.z.signum());
        let relative = if wo.z > 0.0 { eta } else { 1.0 / eta };
        let halves =
            [fresnel::reflect(wo, side), fresnel::refract(wo, side, relative).unwrap_or(-wo)]
                .map(|axis| HemisphereCells::new(axis, RINGS, SECTORS));
        let mut expected: Vec<f64> =
            halves.iter().flat_map(|c| c.integrate(|w| bsdf.pdf(wo, w))).collect();
        let total: f64 = expected.iter().sum();
        assert!(total < 1.0 + 5e-4, "{name} from {wo}: the density adds up to {total}");
        let mut found = vec![0u32; expected.len()];
        let mut elsewhere = 0;
        for i in 0..N {
            let (u, lobe) =
                (uniform2([i, 61, key, number as u32]), uniform2([i, 62, key, number as u32]).x);
            match bsdf.sample(wo, lobe, u) {
                Some(s) if !s.is_delta => {
                    let half = usize::from(s.wi.z * wo.z < 0.0);
                    found[half * RINGS * SECTORS + halves[half].index(s.wi)] += 1;
                }
                _ => elsewhere += 1,
            }
        }
        // The last cell counts delta lobes and rejected directions.
        found.push(elsewhere);
        expected.push((1.0 - total).max(0.0));
        expected.iter_mut().for_each(|e| *e *= f64::from(N));
        family.add(|| format!("{name} from {wo}"), &found, &expected);
    }
}

fn sweep_glass(iors: &[f32], roughnesses: &[f32]) {
    let mut family = Family::new("rough glass");
    for (i, &ior) in (0..).zip(iors) {
        for (k, &roughness) in (0..).zip(roughnesses) {
            let kind = Dielectric::rough(ior, roughness).into();
            check_bsdf(
                &mut family,
                &format!("ior {ior}, roughness {roughness}"),
                &kind,
                4,
                ior,
                10 * i + k,
            );
        }
    }
    family.judge();
}

#[test]
fn rough_glass_is_sampled_by_its_density() {
    sweep_glass(&[1.1, 1.5, 2.4], &[0.2, 0.5, 1.0]);
}

#[test]
#[ignore = "takes a minute"]
fn rough_glass_is_sampled_by_its_density_in_fine_steps() {
    sweep_glass(&[1.05, 1.1, 1.33, 1.5, 1.8, 2.4], &[0.15, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0]);
}

#[test]
fn metals_are_sampled_by_their_density() {
    let mut family = Family::new("metals");
    for k in 0..5 {
        let roughness = 0.15 + 0.2 * k as f32;
        let kind = Conductor::color(Rgb::new(0.9, 0.6, 0.3), roughness).into();
        check_bsdf(&mut family, &format!("roughness {roughness}"), &kind, 3, 1.0, 100 + k);
    }
    family.judge();
}

/// A parameter of `open-pbr`, the function that sets it, and a function that sets the kind of
/// surface.
type Sweep = (&'static str, fn(&mut OpenPbr, f32), fn(&mut OpenPbr));

fn scalar(x: f32) -> ScalarParam {
    x.into()
}

/// The swept parameters, each from 0 to 1, with their kind of surface.
const SWEEPS: [Sweep; 17] = [
    ("base_diffuse_roughness", |p, x| p.base_diffuse_roughness = scalar(x), |_| {}),
    ("base_metalness", |p, x| p.base_metalness = scalar(x), |_| {}),
    ("specular_weight", |p, x| p.specular_weight = scalar(x), |_| {}),
    ("specular_roughness", |p, x| p.specular_roughness = scalar(0.2 + 0.8 * x), |_| {}),
    (
        "specular_roughness of metal",
        |p, x| p.specular_roughness = scalar(0.2 + 0.8 * x),
        |p| p.base_metalness = scalar(1.0),
    ),
    (
        "specular_roughness_anisotropy",
        |p, x| p.specular_roughness_anisotropy = scalar(0.8 * x),
        |p| {
            p.base_metalness = scalar(1.0);
            p.specular_roughness = scalar(0.6);
        },
    ),
    ("specular_ior", |p, x| p.specular_ior = scalar(1.1 + 1.4 * x), |_| {}),
    (
        "transmission_weight",
        |p, x| p.transmission_weight = scalar(x),
        |p| p.specular_roughness = scalar(0.5),
    ),
    (
        "transmission of a thin wall",
        |p, x| p.transmission_weight = scalar(x),
        |p| {
            p.geometry_thin_walled = true;
            p.specular_roughness = scalar(0.5);
        },
    ),
    (
        "subsurface of a thin wall",
        |p, x| p.subsurface_scatter_anisotropy = scalar(2.0 * x - 1.0),
        |p| {
            p.geometry_thin_walled = true;
            p.subsurface_weight = scalar(1.0);
        },
    ),
    ("subsurface_weight", |p, x| p.subsurface_weight = scalar(x), |_| {}),
    ("coat_weight", |p, x| p.coat_weight = scalar(x), |p| p.coat_roughness = scalar(0.3)),
    (
        "coat_roughness",
        |p, x| p.coat_roughness = scalar(0.2 + 0.8 * x),
        |p| p.coat_weight = scalar(1.0),
    ),
    (
        "coat_roughness_anisotropy",
        |p, x| p.coat_roughness_anisotropy = scalar(0.8 * x),
        |p| {
            p.coat_weight = scalar(1.0);
            p.coat_roughness = scalar(0.6);
        },
    ),
    ("fuzz_weight", |p, x| p.fuzz_weight = scalar(x), |_| {}),
    ("fuzz_roughness", |p, x| p.fuzz_roughness = scalar(x), |p| p.fuzz_weight = scalar(1.0)),
    (
        "thin_film_thickness",
        |p, x| p.thin_film_thickness = scalar(x),
        |p| p.thin_film_weight = scalar(1.0),
    ),
];

/// All sweeps with this many steps each, from this many outgoing directions.
fn sweep_open_pbr(steps: u32, views_from: usize) {
    let mut family = Family::new("open-pbr");
    for (number, (name, set, prepare)) in (0..).zip(SWEEPS) {
        for step in 0..steps {
            let x = step as f32 / (steps - 1) as f32;
            let mut surface =
                OpenPbr { base_color: Rgb::new(0.8, 0.5, 0.2).into(), ..OpenPbr::default() };
            prepare(&mut surface);
            set(&mut surface, x);
            let passes = surface.transmission_weight.factor > 0.0 && !surface.geometry_thin_walled;
            let eta = if passes { surface.specular_ior.factor } else { 1.0 };
            let kind = MaterialKind::from(surface);
            check_bsdf(
                &mut family,
                &format!("{name} at {x}"),
                &kind,
                views_from,
                eta,
                1000 + 64 * number + step,
            );
        }
    }
    family.judge();
}

#[test]
fn every_parameter_of_open_pbr_keeps_sampling_and_density_together() {
    sweep_open_pbr(3, 2);
}

#[test]
#[ignore = "takes a minute"]
fn every_parameter_of_open_pbr_keeps_sampling_and_density_together_in_fine_steps() {
    sweep_open_pbr(11, 6);
}
