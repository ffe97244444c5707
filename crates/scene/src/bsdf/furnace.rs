//! The white furnace of every material, over a grid of its parameters with all corners: how much
//! of a uniform surrounding is seen.
//!
//! The bounds, with the reasons of those that are not [`LOSS`] and [`GAIN`], are in the table of
//! the user's page about light, which these tests read.

use super::tests::{bsdf, sobol};
use super::{Bsdf, Lobes, MicrofacetShape};
use crate::material::{
    CoatedConductor, CoatedDiffuse, ColorParam, Conductor, Dielectric, Diffuse, FuzzModel, Hair,
    MaterialKind, MetallicRoughness, Mirror, OpenPbr, Phong, Plastic,
};
use snell_math::{Rgb, Vec2, Vec3, rng};

/// The most light that a material may make out of nothing.
const GAIN: f64 = 1e-3;
/// Share of light that a white material may lose.
const LOSS: f64 = 5e-3;

const SHAPES: [MicrofacetShape; 2] = [MicrofacetShape::Ggx, MicrofacetShape::Beckmann];
/// Between the nodes of the tables, but for the ends.
const ROUGHNESSES: [f32; 8] = [0.0, 0.07, 0.14, 0.36, 0.53, 0.74, 0.84, 1.0];
const ANISOTROPIES: [f32; 7] = [0.0, 0.3, 0.6, 0.8, 0.9, 0.96, 1.0];
const INDICES: [f32; 10] = [0.3, 0.5, 0.75, 1.0, 1.05, 1.33, 1.5, 2.0, 3.0, 4.0];

/// Directions to look from on the upper side: several cosines, at these azimuths.
fn views(azimuths: &[f32]) -> impl Iterator<Item = Vec3> {
    [0.999f32, 0.7, 0.35, 0.1, 0.03].into_iter().flat_map(|z| {
        let r = (1.0 - z * z).sqrt();
        azimuths.iter().map(move |phi| Vec3::new(r * phi.cos(), r * phi.sin(), z))
    })
}

/// Share of a uniform surrounding that is seen, by `2^bits` points of Sobol's sequence.
fn seen(bsdf: &Bsdf, wo: Vec3, bits: u32) -> f64 {
    static POINTS: std::sync::LazyLock<Vec<[f32; 3]>> =
        std::sync::LazyLock::new(|| (0..1 << 16).map(sobol).collect());
    let (n, half) = (1usize << bits, 0.5 / (1u32 << bits) as f32);
    let (known, crossing) = (bsdf.seen(wo), bsdf.crossing_scale(wo));
    let of = |&[lobe, x, y]: &[f32; 3]| {
        let sample = bsdf.sample_from(&known, lobe + half, Vec2::new(x + half, y + half));
        sample.map_or(0.0, |s| {
            f64::from(s.weight[0] * if s.is_transmission { crossing } else { 1.0 })
        })
    };
    POINTS[..n].iter().map(of).sum::<f64>() / n as f64
}

/// The tests look at one of this many materials of a grid. With `SNELL_FURNACE=all` every one is,
/// which takes minutes.
fn stride() -> u32 {
    if std::env::var("SNELL_FURNACE").is_ok_and(|which| which == "all") { 1 } else { 7 }
}

/// The most that materials of a family lose and make, as the page for users says.
fn bounds(family: &str) -> (f64, f64) {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/user/scene-units-and-colour.md");
    let page = std::fs::read_to_string(page).expect("reads the page");
    let row = page.lines().find_map(|line| line.strip_prefix(&format!("| {family} | ")));
    let mut cells = row.unwrap_or_else(|| panic!("the page has no row of {family}")).split(" % | ");
    let mut share = || -> f64 { cells.next().expect("a cell").parse::<f64>().expect("a number") };
    (share() / 100.0, share() / 100.0)
}

/// What is seen of materials of one kind.
struct Furnace {
    name: String,
    /// The number of materials in the grid so far.
    offered: u32,
    points: u32,
    /// What is seen where it is not 1, and where that is.
    off: Vec<(f64, String)>,
}

impl Furnace {
    fn new(name: &str) -> Self {
        Self { name: name.into(), offered: 0, points: 0, off: Vec::new() }
    }

    /// Looks at a material, if it is one of those that are looked at, from both sides where `sides`
    /// is 2.
    fn look(&mut self, kind: &MaterialKind, sides: usize, label: impl Fn() -> String) {
        self.offered += 1;
        if !self.offered.is_multiple_of(stride()) {
            return;
        }
        let bsdf = bsdf(kind);
        // Along, across and between the tangents.
        let azimuths = [0.02, 0.7, 1.55];
        for view in views(if bsdf.has_tangent() { &azimuths } else { &azimuths[1..2] }) {
            for &side in &[1.0, -1.0][..sides] {
                let wo = Vec3::new(view.x, view.y, view.z * side);
                // What looks wrong by few points is looked at by many.
                let is_off = |share: f64| (share - 1.0).abs() > GAIN;
                let mut share = 1.0;
                for bits in [10, 13, 16] {
                    share = seen(&bsdf, wo, bits);
                    if !is_off(share) {
                        break;
                    }
                }
                self.points += 1;
                if is_off(share) {
                    self.off.push((share, format!("{} from {wo:.3}", label())));
                }
            }
        }
    }

    /// Prints the extremes, and checks them by the bounds in the page for users.
    fn check(mut self) {
        let (loss, gain) = bounds(&self.name);
        self.off.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = |is_such: &dyn Fn(f64) -> bool| {
            self.off.iter().filter(|(share, _)| is_such(*share)).count()
        };
        let (dark, bright) =
            (count(&|share| share < 1.0 - LOSS), count(&|share| share > 1.0 + GAIN));
        eprintln!(
            "{}: {} points of {} materials, {dark} lose more than {LOSS}, {bright} make more than \
             {GAIN}",
            self.name,
            self.points,
            self.offered / stride()
        );
        let n = self.off.len();
        for (i, (share, place)) in self.off.iter().enumerate() {
            if i < 4 || i + 4 >= n {
                eprintln!("  {share:.4} {place}");
            }
        }
        for (share, place) in self.off {
            assert!(share >= 1.0 - loss, "{} loses light: {share:.4} {place}", self.name);
            assert!(share <= 1.0 + gain, "{} makes light: {share:.4} {place}", self.name);
        }
    }
}

fn white() -> ColorParam {
    Rgb::WHITE.into()
}

#[test]
fn white_metals_of_any_roughness_and_anisotropy_keep_all_light() {
    for microfacets in SHAPES {
        for (name, anisotropies) in
            [("metal", &ANISOTROPIES[..1]), ("brushed metal (anisotropic)", &ANISOTROPIES[1..])]
        {
            let mut furnace = Furnace::new(name);
            let anisotropies = anisotropies.iter().flat_map(|&a| [a, -a]);
            for (a, r) in anisotropies.flat_map(|a| ROUGHNESSES.map(|r| (a, r))) {
                let metal = Conductor {
                    microfacets,
                    anisotropy: a.into(),
                    ..Conductor::color(Rgb::WHITE, r)
                };
                furnace.look(&metal.into(), 1, || {
                    format!("{microfacets:?} roughness {r} anisotropy {a}")
                });
            }
            furnace.check();
        }
    }
}

#[test]
fn clear_glass_of_any_index_and_roughness_keeps_all_light() {
    for microfacets in SHAPES {
        let mut furnace = Furnace::new(match microfacets {
            MicrofacetShape::Ggx => "glass",
            MicrofacetShape::Beckmann => "glass with facets of Beckmann",
        });
        for ior in INDICES {
            for r in ROUGHNESSES {
                let glass = Dielectric { microfacets, ..Dielectric::rough(ior, r) };
                furnace.look(&glass.into(), 2, || {
                    format!("{microfacets:?} index {ior} roughness {r}")
                });
            }
        }
        furnace.check();
    }
}

#[test]
fn clear_glass_under_a_film_keeps_all_light() {
    let mut furnace = Furnace::new("glass under a thin film");
    for (ior, thickness) in
        [1.1, 1.5, 2.5].into_iter().flat_map(|i| [0.2, 0.5, 1.2].map(|t| (i, t)))
    {
        for r in ROUGHNESSES {
            let kind = OpenPbr {
                specular_roughness: r.into(),
                specular_ior: ior.into(),
                transmission_weight: 1.0.into(),
                thin_film_weight: 1.0.into(),
                thin_film_thickness: thickness.into(),
                ..OpenPbr::default()
            }
            .into();
            furnace.look(&kind, 2, || format!("index {ior} roughness {r} film {thickness}"));
        }
    }
    furnace.check();
}

#[test]
fn white_bodies_under_any_interface_keep_all_light() {
    let mut furnace = Furnace::new("plastic and coated diffuse");
    for (ior, r) in INDICES.into_iter().flat_map(|ior| ROUGHNESSES.map(|r| (ior, r))) {
        for microfacets in SHAPES {
            let plastic = Plastic { ior, microfacets, ..Plastic::new(white(), r) };
            let coated = CoatedDiffuse { ior, microfacets, ..CoatedDiffuse::new(white(), r) };
            let label = || format!("{microfacets:?} index {ior} roughness {r}");
            furnace.look(&plastic.into(), 1, label);
            furnace.look(&coated.into(), 1, label);
        }
    }
    furnace.check();
}

#[test]
fn white_metals_under_any_coat_keep_all_light() {
    let mut furnace = Furnace::new("coated metal");
    for (ior, r) in [1.0, 1.33, 1.5, 4.0].into_iter().flat_map(|ior| ROUGHNESSES.map(|r| (ior, r)))
    {
        for (below, anisotropy) in [(0.0, 0.0), (0.4, 0.0), (0.4, 0.8), (1.0, 0.0), (1.0, 0.8)] {
            let metal = Conductor::color(Rgb::WHITE, below);
            let conductor = Conductor { anisotropy: anisotropy.into(), ..metal };
            let kind = CoatedConductor { conductor, ior, roughness: r.into() };
            furnace.look(&kind.into(), 1, || {
                format!("index {ior} roughness {r} over {below}/{anisotropy}")
            });
        }
    }
    furnace.check();
}

#[test]
fn other_white_materials_keep_all_light() {
    let mut furnace = Furnace::new("diffuse, mirror, phong, metallic-roughness of glTF");
    furnace.look(&Diffuse::new(Rgb::WHITE).into(), 1, || "diffuse".into());
    furnace.look(&Mirror::new(Rgb::WHITE).into(), 1, || "mirror".into());
    furnace.look(&Phong::default().into(), 1, || "phong".into());
    for metallic in [0.0, 0.5, 1.0] {
        for roughness in ROUGHNESSES {
            for transmission in [0.0, 0.5, 1.0] {
                for clearcoat in [0.0, 0.5, 1.0] {
                    let kind = MetallicRoughness {
                        transmission: transmission.into(),
                        clearcoat: clearcoat.into(),
                        clearcoat_roughness: (1.0 - roughness).into(),
                        ..MetallicRoughness::new(Rgb::WHITE, metallic, roughness)
                    }
                    .into();
                    furnace.look(&kind, 1, || {
                        format!("{metallic} {roughness} {transmission} {clearcoat}")
                    });
                }
            }
        }
    }
    furnace.check();
}

#[test]
fn hair_without_pigment_makes_no_light() {
    let mut furnace = Furnace::new("hair without pigment");
    for rough in [0.1, 0.3, 0.6, 1.0] {
        for around in [0.1, 0.3, 0.6, 1.0] {
            for ior in [1.2, 1.55, 2.0] {
                let kind = Hair {
                    eumelanin: 0.0.into(),
                    longitudinal_roughness: rough.into(),
                    azimuthal_roughness: around.into(),
                    ior,
                    ..Hair::default()
                }
                .into();
                furnace.look(&kind, 1, || format!("{rough} {around} {ior}"));
            }
        }
    }
    furnace.check();
}

/// A value of a list by a random number.
fn one_of<T: Copy, const N: usize>(list: [T; N], u: u32) -> T {
    list[u as usize % N]
}

/// The layered surface has too many parameters for a full grid: these are random points of it, half
/// of them corners.
fn layers(i: u32, has_film: bool) -> (OpenPbr, String) {
    let mut draws = (0..).flat_map(|k| rng::pcg4d([i, k, 17, 3]));
    let mut u = || draws.next().expect("endless") >> 8;
    let is_corner = u() % 2 == 0;
    let share = |u: u32| {
        if is_corner { one_of([0.0f32, 1.0], u) } else { one_of([0.0, 0.3, 0.5, 0.8, 1.0], u) }
    };
    let rare = |u: u32, v: u32| if v.is_multiple_of(3) { share(u) } else { 0.0 };
    let roughness = one_of(ROUGHNESSES, u());
    let (metal, clear, subsurface) = (rare(u(), u()), rare(u(), u()), rare(u(), u()));
    let (anisotropy, coat, fuzz) = (rare(u(), u()), rare(u(), u()), rare(u(), u()));
    let (coat_roughness, coat_anisotropy) = (one_of(ROUGHNESSES, u()), rare(u(), u()));
    let (diffuse_roughness, fuzz_roughness) = (share(u()), share(u()));
    let (ior, coat_ior) = (one_of([1.1, 1.5, 2.5, 4.0], u()), one_of([1.1, 1.6, 3.0], u()));
    let (specular, is_thin, film) =
        (one_of([1.0, 0.5, 0.0], u() / 2), u() % 3 == 0, rare(u(), u()));
    let darkening = share(u());
    let g = one_of([0.0, 0.9, -0.9], u());
    let surface = OpenPbr {
        base_color: white(),
        base_diffuse_roughness: diffuse_roughness.into(),
        base_metalness: metal.into(),
        specular_weight: if metal == 0.0 { specular } else { 1.0 }.into(),
        specular_roughness: roughness.into(),
        specular_roughness_anisotropy: anisotropy.into(),
        specular_ior: ior.into(),
        transmission_weight: clear.into(),
        subsurface_weight: subsurface.into(),
        subsurface_color: white(),
        subsurface_scatter_anisotropy: g.into(),
        coat_weight: coat.into(),
        coat_roughness: coat_roughness.into(),
        coat_roughness_anisotropy: coat_anisotropy.into(),
        coat_ior: coat_ior.into(),
        coat_darkening: darkening.into(),
        fuzz_weight: fuzz.into(),
        fuzz_roughness: fuzz_roughness.into(),
        thin_film_weight: if has_film { film } else { 0.0 }.into(),
        fuzz_model: if i.is_multiple_of(2) { FuzzModel::Flakes } else { FuzzModel::Charlie },
        geometry_thin_walled: is_thin,
        ..OpenPbr::default()
    };
    let label = format!(
        "#{i} roughness {roughness}/{anisotropy} metal {metal} clear {clear} subsurface \
         {subsurface} coat {coat} of {coat_roughness}/{coat_anisotropy} index {coat_ior} darkening \
         {darkening} fuzz {fuzz} of {fuzz_roughness} matte {diffuse_roughness} index {ior} \
         specular {specular} thin {is_thin} film {film}"
    );
    (surface, label)
}

fn look_at_layers(name: &str, has_film: bool) -> Furnace {
    let mut furnace = Furnace::new(name);
    for i in 0..400 {
        let (surface, label) = layers(i, has_film);
        if has_film != (surface.thin_film_weight.factor > 0.0) {
            continue;
        }
        let has_inside = !surface.geometry_thin_walled
            && surface.base_metalness.factor < 1.0
            && (surface.transmission_weight.factor > 0.0 || surface.subsurface_weight.factor > 0.0);
        furnace.look(&surface.into(), if has_inside { 2 } else { 1 }, || label.clone());
    }
    furnace
}

#[test]
fn white_layers_keep_all_light_at_random_settings() {
    look_at_layers("OpenPBR", false).check();
}

#[test]
fn white_layers_with_films_keep_all_light_at_random_settings() {
    look_at_layers("OpenPBR with a thin film", true).check();
}
