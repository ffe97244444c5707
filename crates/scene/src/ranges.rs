//! What numbers of a scene's declarations mean something: the table behind the errors for `-D` and
//! edits, and behind the warnings of readers ([`Scene::check_ranges`]).
//!
//! A declaration is looked at as `serde` writes it, so the table is about names: a new parameter is
//! one row.

use crate::graph::{Environment, Scene, WarningKind};
use crate::{Light, Material, Medium};
use serde::Serialize;
use serde_json::Value;
use snell_math::Rgb;

/// The most that a light may send, whatever its unit: brighter ones leave no room for what single
/// precision has to multiply it with, such as one over the density of a sample. (The sun's disk has
/// 2e7 W / (m² sr).)
pub const BRIGHTEST: f32 = 1e24;

/// The farthest that a camera may be from the origin: squares of distances have to be finite.
const FARTHEST: f64 = 1e18;

/// What values a number may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any.
    Any,
    /// From one to another, both included.
    Within(f64, f64),
    /// Between two, both excluded.
    Between(f64, f64),
    /// More than 0.
    Positive,
    /// Coordinates of a direction, or of several: not all 0.
    Direction,
}

use Range::{Any, Between, Direction, Positive, Within};

/// From nothing to all.
const SHARE: Range = Within(0.0, 1.0);
/// Of any amount.
pub const AMOUNT: Range = Within(0.0, f64::INFINITY);
/// Radiance, irradiance, intensity, emission.
pub const LIGHT: Range = Within(0.0, BRIGHTEST as f64);

/// The range of each parameter, by its name, after the name of its kind where others have the same
/// name for something else. What stands inside of a parameter (`factor`, places of lists) has its
/// range. Those of lights stand with each light.
const RANGES: &[(&str, Range)] = &[
    // Surfaces.
    ("emission", LIGHT),
    ("emission_luminance", LIGHT),
    ("emission_color", SHARE),
    ("alpha", SHARE),
    ("geometry_opacity", SHARE),
    ("mask", Any),
    ("scale", Any),
    ("rotation", Any),
    ("height", Any),
    ("channel", Within(0.0, 3.0)),
    ("priority", Any),
    ("roughness", SHARE),
    ("longitudinal_roughness", SHARE),
    ("azimuthal_roughness", SHARE),
    ("clearcoat_roughness", SHARE),
    ("base_diffuse_roughness", SHARE),
    ("specular_roughness", SHARE),
    ("specular_roughness_anisotropy", SHARE),
    ("coat_roughness", SHARE),
    ("coat_roughness_anisotropy", SHARE),
    ("fuzz_roughness", SHARE),
    ("anisotropy", Within(-1.0, 1.0)),
    ("transmission_scatter_anisotropy", Within(-1.0, 1.0)),
    ("subsurface_scatter_anisotropy", Within(-1.0, 1.0)),
    ("reflectance", SHARE),
    ("diffuse", SHARE),
    ("specular", SHARE),
    ("tint", SHARE),
    ("color", SHARE),
    ("metallic", SHARE),
    ("transmission", SHARE),
    ("clearcoat", SHARE),
    ("base_weight", SHARE),
    ("base_color", SHARE),
    ("base_metalness", SHARE),
    ("specular_weight", AMOUNT),
    ("specular_color", SHARE),
    ("metallic-roughness.specular_color", AMOUNT),
    ("transmission_weight", SHARE),
    ("transmission_color", SHARE),
    ("transmission_tint", SHARE),
    ("transmission_depth", AMOUNT),
    ("transmission_scatter", AMOUNT),
    ("transmission_dispersion_scale", SHARE),
    ("transmission_dispersion_abbe_number", Positive),
    ("subsurface_weight", SHARE),
    ("subsurface_color", SHARE),
    ("subsurface_radius", AMOUNT),
    ("subsurface_radius_scale", AMOUNT),
    ("coat_weight", SHARE),
    ("coat_color", SHARE),
    ("coat_darkening", SHARE),
    ("fuzz_weight", SHARE),
    ("fuzz_color", SHARE),
    ("thin_film_weight", SHARE),
    ("thin_film_thickness", AMOUNT),
    ("ior", Positive),
    ("metallic-roughness.ior", AMOUNT),
    ("specular_ior", Positive),
    ("coat_ior", Positive),
    ("thin_film_ior", Positive),
    ("absorption", AMOUNT),
    ("eumelanin", AMOUNT),
    ("pheomelanin", AMOUNT),
    ("scale_tilt", Within(-90.0, 90.0)),
    ("phong.ambient", AMOUNT),
    ("phong.diffuse", AMOUNT),
    ("phong.specular", AMOUNT),
    ("phong.reflection", AMOUNT),
    ("phong.transmission", AMOUNT),
    ("shininess", AMOUNT),
    // Media.
    ("sigma_a", AMOUNT),
    ("sigma_s", AMOUNT),
    ("g", Between(-1.0, 1.0)),
    ("base", Any),
    ("height-fog.up", Direction),
    ("scale_height", Any),
    ("lumps", Positive),
    ("raggedness", AMOUNT),
    ("seed", Any),
    ("resolution", Positive),
    ("world_from_grid", Any),
    ("world_from_cloud", Any),
    // Cameras.
    ("eye", Within(-FARTHEST, FARTHEST)),
    ("towards", Direction),
    ("up", Direction),
    ("tan_half_fov", Positive),
    ("half_size", Positive),
    ("focal_length", Any),
    ("principal_point", Any),
    ("skew", Any),
    ("size", Positive),
    ("max_angle", Within(f64::MIN_POSITIVE, std::f64::consts::TAU)),
    ("aperture_radius", AMOUNT),
    ("focus_distance", Positive),
];

/// Measured indices, directions and pictures, which are looked at where they are read.
const TABLES: &[&str] = &["measured", "table", "slide"];

impl Range {
    /// That of a parameter of a kind; `None` for names that are in no table.
    fn of(kind: Kind, name: &str) -> Option<Self> {
        if kind.family == "light" {
            return Light::ranges_of(kind.name).iter().find(|row| row.0 == name).map(|row| row.1);
        }
        let mine = |row: &&(&str, Self)| row.0.split_once('.') == Some((kind.name, name));
        RANGES
            .iter()
            .find(mine)
            .or_else(|| RANGES.iter().find(|row| row.0 == name))
            .map(|row| row.1)
    }

    /// With a texture on it a factor may exceed what a constant may.
    fn of_factor(self) -> Self {
        match self {
            Within(least, most) if most < f64::from(BRIGHTEST) => Within(least, f64::INFINITY),
            other => other,
        }
    }

    fn contains(self, x: f64) -> bool {
        match self {
            Any | Direction => true,
            Within(least, most) => least <= x && x <= most,
            Between(least, most) => least < x && x < most,
            Positive => x > 0.0,
        }
    }

    /// In words.
    fn expected(self) -> String {
        match self {
            Any => "any number".into(),
            Within(0.0, f64::INFINITY) => "0 or more".into(),
            Within(f64::MIN_POSITIVE, most) => format!("more than 0, and at most {most:.4}"),
            Within(least, most) if most == std::f64::consts::PI => {
                format!("{least} to {most:.4}, in radians")
            }
            Within(least, most) => format!("{} to {}", shown(least), shown(most)),
            Between(least, most) => format!("more than {least} and less than {most}"),
            Positive => "more than 0".into(),
            Direction => "a direction, not all zeros".into(),
        }
    }
}

/// A number as people write it.
fn shown(x: f64) -> String {
    // Single precision is what most of them were given in.
    let short = x as f32;
    let is_plain = x == 0.0 || (1e-4..1e7).contains(&x.abs());
    if is_plain { format!("{short}") } else { format!("{short:e}") }
}

/// The first number at or below `path` in a declaration, as `serde` writes it, that means nothing:
/// what is wrong, in words.
pub fn problem_at(declaration: &Value, path: &[&str]) -> Option<String> {
    let mut search = Search { wanted: path, problem: None, unknown: Vec::new() };
    search.walk(declaration, Kind::default(), Any, &mut Vec::new());
    search.problem
}

/// A kind of thing, and what it is one of.
#[derive(Clone, Copy, Default)]
struct Kind<'a> {
    family: &'a str,
    name: &'a str,
}

impl<'a> Kind<'a> {
    /// The kind that a declaration says it is.
    fn of(fields: &'a serde_json::Map<String, Value>) -> Option<Self> {
        let families = ["material", "medium", "light", "projection"];
        families
            .into_iter()
            .find_map(|family| Some(Self { family, name: fields.get(family)?.as_str()? }))
    }
}

struct Search<'a> {
    /// Where in the declaration.
    wanted: &'a [&'a str],
    problem: Option<String>,
    /// Names of numbers without a range.
    unknown: Vec<String>,
}

impl Search<'_> {
    fn walk(&mut self, value: &Value, kind: Kind, range: Range, place: &mut Vec<String>) {
        match value {
            Value::Number(number) => {
                let x = number.as_f64().unwrap_or(f64::NAN);
                if !range.contains(x) {
                    self.report(
                        place,
                        &format!("{} is not possible, expected {}", shown(x), range.expected()),
                    );
                }
            }
            Value::Array(items) => {
                let is_zero = |item: &Value| item.as_f64() == Some(0.0);
                if range == Direction && !items.is_empty() && items.iter().all(is_zero) {
                    self.report(place, &format!("expected {}", range.expected()));
                }
                if !items.is_empty() && items.iter().all(Value::is_null) {
                    self.report(place, "expected at least one number");
                }
                for (i, item) in items.iter().enumerate() {
                    place.push(i.to_string());
                    self.walk(item, kind, range, place);
                    place.pop();
                }
            }
            Value::Object(fields) => {
                // The name of the kind stands beside its parameters.
                let kind = Kind::of(fields).unwrap_or(kind);
                let textured = fields.get("texture").is_some_and(|t| !t.is_null());
                for (name, item) in
                    fields.iter().filter(|(name, _)| !TABLES.contains(&name.as_str()))
                {
                    let inner = match name.as_str() {
                        "texture" | "spectrum"
                            if !item.is_object() || fields.contains_key("factor") =>
                        {
                            Any
                        }
                        "factor" if textured => range.of_factor(),
                        "factor" | "kind" | "spectrum" | "interior" | "medium" => range,
                        _ => Range::of(kind, name).unwrap_or_else(|| {
                            if item.is_number() || item.is_array() {
                                self.unknown.push(format!("{}.{name}", kind.name));
                            }
                            range
                        }),
                    };
                    place.push(name.clone());
                    self.walk(item, kind, inner, place);
                    place.pop();
                }
            }
            Value::Null | Value::Bool(_) | Value::String(_) => {}
        }
    }

    fn report(&mut self, place: &[String], problem: &str) {
        let steps = place.iter().filter(|step| *step != "kind");
        let mut wanted = self.wanted.iter().filter(|step| **step != "kind");
        let is_wanted = steps.clone().zip(wanted.by_ref()).all(|(a, b)| a == b);
        if is_wanted && self.problem.is_none() {
            let place: Vec<&str> = steps.map(String::as_str).collect();
            self.problem = Some(format!("{}: {problem}", place.join(".")));
        }
    }
}

impl Scene {
    /// Warns of numbers of materials, lights, media and cameras that mean nothing, such as a
    /// roughness of 7, which counts as the nearest that means something, or as nothing.
    pub fn check_ranges(&mut self) {
        fn look<T: Serialize>(
            what: &str,
            items: &[T],
            name: impl Fn(&T) -> &str,
            problems: &mut Vec<String>,
        ) {
            for (i, item) in items.iter().enumerate() {
                let problem =
                    serde_json::to_value(item).ok().and_then(|tree| problem_at(&tree, &[]));
                let name = name(item);
                let called = if name.is_empty() { String::new() } else { format!(" (\"{name}\")") };
                problems.extend(problem.map(|problem| format!("{what} {i}{called}: {problem}")));
            }
        }
        let mut problems = Vec::new();
        look("material", &self.materials, |m| &m.name, &mut problems);
        look("camera", &self.cameras, |c| &c.name, &mut problems);
        look("light", &self.lights, |_| "", &mut problems);
        let bare = |medium: &Medium| match medium {
            Medium::Grid(_) => None,
            other => Some(other.clone()),
        };
        let bare: Vec<Medium> = self.media.iter().filter_map(bare).collect();
        look("medium", &bare, |_| "", &mut problems);
        for problem in problems {
            self.warn(problem);
        }
    }

    /// Brings light that is too bright to be computed with ([`BRIGHTEST`]), and light below
    /// nothing, to what can be: with a warning for each. What readers do with every scene.
    pub fn limit_light(&mut self) {
        let mut told = Vec::new();
        let mut limit = |what: &dyn Fn() -> String, light: &mut Rgb| {
            let before = *light;
            *light = light.map(|x| if x.is_nan() { x } else { x.clamp(0.0, BRIGHTEST) });
            let largest = before.r.max(before.g).max(before.b);
            if largest > BRIGHTEST {
                told.push(format!(
                    "{} is {largest:e}, and {BRIGHTEST:e} is the most that is computed with",
                    what()
                ));
            }
            let smallest = before.r.min(before.g).min(before.b);
            if smallest < 0.0 {
                told.push(format!("{} is below zero: {smallest}; it counts as 0", what()));
            }
        };
        for (i, Material { name, emission, .. }) in self.materials.iter_mut().enumerate() {
            limit(&|| format!("the emission of material {i} (\"{name}\")"), &mut emission.factor);
        }
        for (i, light) in self.lights.iter_mut().enumerate() {
            limit(&|| format!("the brightness of light {i}"), light.color_mut());
        }
        match &mut self.environment {
            Some(Environment::Constant(radiance)) => {
                limit(&|| "the environment's radiance".into(), radiance)
            }
            Some(Environment::Image { scale, .. }) => {
                limit(&|| "the factor on the environment".into(), scale)
            }
            None => {}
        }
        limit(&|| "the ambient light".into(), &mut self.ambient);
        for problem in told {
            self.warn_of(WarningKind::Changed, problem);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::MaterialKind;
    use crate::{Camera, Projection};
    use snell_math::DVec3;

    fn unknown<T: Serialize>(item: &T) -> Vec<String> {
        let mut search = Search { wanted: &[], problem: None, unknown: Vec::new() };
        let tree = serde_json::to_value(item).expect("declarations are JSON");
        search.walk(&tree, Kind::default(), Any, &mut Vec::new());
        assert_eq!(search.problem, None, "an example is out of range: {tree}");
        search.unknown
    }

    #[test]
    fn every_number_of_every_declaration_has_a_range_and_the_examples_are_within_theirs() {
        let mut names: Vec<String> = Vec::new();
        names.extend(
            MaterialKind::examples().into_iter().flat_map(|kind| unknown(&Material::new("", kind))),
        );
        names.extend(Light::examples().iter().flat_map(unknown));
        names.extend(Medium::examples().iter().flat_map(unknown));
        let camera =
            |projection| Camera::from_direction(DVec3::ZERO, DVec3::X, DVec3::Y, projection);
        names.extend(Projection::examples().into_iter().flat_map(|p| unknown(&camera(p))));
        names.sort();
        names.dedup();
        assert!(names.is_empty(), "add these to the table of ranges: {names:?}");
    }

    #[test]
    fn every_row_of_the_table_is_the_range_of_something() {
        let mut text = String::new();
        let mut add =
            |item: serde_json::Result<String>| text += &item.expect("declarations are JSON");
        MaterialKind::examples()
            .iter()
            .for_each(|kind| add(serde_json::to_string(&Material::new("", kind.clone()))));
        Medium::examples().iter().for_each(|medium| add(serde_json::to_string(medium)));
        Projection::examples().into_iter().for_each(|projection| {
            add(serde_json::to_string(&Camera::from_direction(
                DVec3::ZERO,
                DVec3::X,
                DVec3::Y,
                projection,
            )));
        });
        for (row, _) in RANGES {
            let name = row.split_once('.').map_or(*row, |(_, name)| name);
            let inside = [
                "scale",
                "height",
                "channel",
                "mask",
                "rotation",
                "priority",
                "emission_luminance",
                "emission_color",
            ];
            assert!(
                text.contains(&format!("\"{name}\"")) || inside.contains(&name),
                "nothing is called {name}"
            );
        }
        for kind in Light::NAMES {
            let of_kind: Vec<_> =
                Light::examples().into_iter().filter(|light| light.name() == *kind).collect();
            let text = serde_json::to_string(&of_kind).expect("declarations are JSON");
            for (name, _) in Light::ranges_of(kind) {
                assert!(text.contains(&format!("\"{name}\"")), "no {kind} light has a {name}");
            }
        }
    }

    #[test]
    fn light_is_brought_to_what_can_be_computed_with() {
        let mut scene = Scene::new("bright");
        let mut lamp = Material::new("lamp", MaterialKind::Black(crate::material::Black {}));
        lamp.emission.factor = Rgb::new(3e38, -2.0, 1.0);
        scene.add_material(lamp);
        scene.environment = Some(Environment::Constant(Rgb::splat(f32::INFINITY)));
        scene.limit_light();
        assert_eq!(scene.materials[0].emission.factor, Rgb::new(BRIGHTEST, 0.0, 1.0));
        let Some(Environment::Constant(color)) = scene.environment else { panic!("no sky") };
        assert_eq!(color, Rgb::splat(BRIGHTEST));
        let told: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
        assert_eq!(told.len(), 3, "{told:?}");
        assert!(told[0].contains("material 0 (\"lamp\")"), "{told:?}");
    }

    #[test]
    fn a_texture_makes_factors_free_but_not_negative() {
        let at = |json: &str| problem_at(&serde_json::from_str(json).expect("it is JSON"), &[]);
        assert!(at(r#"{"roughness":{"factor":3,"texture":null}}"#).is_some());
        assert_eq!(at(r#"{"roughness":{"factor":3,"texture":[0,1]}}"#), None);
        assert!(at(r#"{"roughness":{"factor":-3,"texture":[0,1]}}"#).is_some());
    }
}
