//! Warnings about numbers of a scene that are out of range ([`Scene::check_ranges`]), for readers.
//! The ranges are declared with the parameters ([`snell_math::declare!`]).

use crate::graph::{Environment, Scene, WarningKind};
use crate::{Material, Texture};
use snell_math::Rgb;
use snell_math::parameters::{Range, Value, problem_at};

/// Maximum radiance, irradiance or intensity of a light. Brighter values would leave single
/// precision no headroom for further factors, such as the inverse density of a sample. (The sun's
/// disk has 2e7 W / (m² sr).)
pub const BRIGHTEST: f32 = 1e24;

/// Maximum distance of a camera from the origin, since squares of distances must be finite.
pub(crate) const FARTHEST: f64 = 1e18;

/// The range of radiance, irradiance, intensity and emission.
pub(crate) const LIGHT: Range = Range::Within(0.0, BRIGHTEST as f64);

impl Scene {
    /// Warns about out-of-range numbers of materials, patterns, lights, media and cameras, such as
    /// a roughness of 7. The renderer clamps such a number to its range or ignores it.
    pub fn check_ranges(&mut self) {
        fn look<'a, T: Value + 'a>(
            what: &str,
            items: impl Iterator<Item = (usize, &'a T)>,
            name: impl Fn(&T) -> &str,
            problems: &mut Vec<String>,
        ) {
            for (i, item) in items {
                let name = name(item);
                let called = if name.is_empty() { String::new() } else { format!(" (\"{name}\")") };
                let problem = problem_at(item, &[]);
                problems.extend(problem.map(|problem| format!("{what} {i}{called}: {problem}")));
            }
        }
        let mut problems = Vec::new();
        let patterns = self.textures.iter().map(Texture::as_pattern).enumerate();
        look("material", self.materials.iter().enumerate(), |m| &m.name, &mut problems);
        look("camera", self.cameras.iter().enumerate(), |c| &c.name, &mut problems);
        look("light", self.lights.iter().enumerate(), |_| "", &mut problems);
        look("medium", self.media.iter().enumerate(), |_| "", &mut problems);
        look("texture", patterns.filter_map(|(i, p)| Some((i, p?))), |_| "", &mut problems);
        for problem in problems {
            self.warn(problem);
        }
    }

    /// Clamps light that is negative, or too bright to compute with ([`BRIGHTEST`]), and adds a
    /// warning for each. Readers call it for every scene.
    pub fn limit_light(&mut self) {
        let mut problems = Vec::new();
        let mut limit = |what: &dyn Fn() -> String, light: &mut Rgb| {
            let before = *light;
            *light = light.map(|x| if x.is_nan() { x } else { x.clamp(0.0, BRIGHTEST) });
            let largest = before.r.max(before.g).max(before.b);
            if largest > BRIGHTEST {
                problems.push(format!(
                    "{} is {largest:e}, and {BRIGHTEST:e} is the most that is computed with",
                    what()
                ));
            }
            let smallest = before.r.min(before.g).min(before.b);
            if smallest < 0.0 {
                problems.push(format!("{} is below zero: {smallest}; it counts as 0", what()));
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
        for problem in problems {
            self.warn_of(WarningKind::Changed, problem);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Dielectric, MaterialKind, ScalarParam};
    use crate::{Camera, Light, Medium, Projection, TextureId};
    use snell_math::DVec3;

    #[test]
    fn examples_are_within_their_ranges() {
        for kind in MaterialKind::examples() {
            assert_eq!(problem_at(&Material::new("", kind.clone()), &[]), None, "{kind:?}");
        }
        for light in Light::examples() {
            assert_eq!(problem_at(&light, &[]), None, "{light:?}");
        }
        for medium in Medium::examples() {
            assert_eq!(problem_at(&medium, &[]), None, "{medium:?}");
        }
        for pattern in crate::texture::Pattern::examples() {
            assert_eq!(problem_at(&pattern, &[]), None, "{pattern:?}");
        }
        for projection in Projection::examples() {
            let camera = Camera::from_direction(DVec3::ZERO, DVec3::X, DVec3::Y, projection);
            assert_eq!(problem_at(&camera, &[]), None, "{camera:?}");
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
        let warnings: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
        assert_eq!(warnings.len(), 3, "{warnings:?}");
        assert!(warnings[0].contains("material 0 (\"lamp\")"), "{warnings:?}");
    }

    #[test]
    fn a_texture_makes_factors_free_but_not_negative() {
        let at = |factor, texture| {
            let roughness = ScalarParam { factor, texture };
            problem_at(&Dielectric { roughness, ..Dielectric::smooth(1.5) }, &["roughness"])
        };
        assert!(at(3.0, None).is_some());
        assert_eq!(at(3.0, Some((TextureId(0), 1))), None);
        assert!(at(-3.0, Some((TextureId(0), 1))).is_some());
    }
}
