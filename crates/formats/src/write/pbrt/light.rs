//! Lights that are not surfaces.

use super::{File, point, rgb, transform};
use snell_math::{DAffine3, DMat3, DVec3};
use snell_scene::Light;
use snell_scene::light::{Attenuation, Directional, Disk, Point, Rectangle, Spot, SpotFalloff};
use std::f64::consts::PI;

impl File<'_, '_> {
    pub fn lights(&mut self) {
        let scene = self.scene;
        for (i, light) in scene.lights.iter().enumerate() {
            self.light(i, light);
        }
    }

    fn check_attenuation(&mut self, i: usize, attenuation: &Attenuation) {
        if *attenuation != Attenuation::INVERSE_SQUARE {
            self.output
                .lose(format!("light {i}: it now fades by the inverse square of the distance"));
        }
    }

    fn light(&mut self, i: usize, light: &Light) {
        match light {
            Light::Directional(Directional { direction, irradiance }) => self.line(format!(
                "LightSource \"distant\" \"rgb L\" {} \"point3 from\" [ 0 0 0 ] \"point3 to\" {}",
                rgb(*irradiance),
                point(*direction)
            )),
            Light::Point(Point { position, intensity, attenuation, body_radius }) => {
                self.check_attenuation(i, attenuation);
                if *body_radius > 0.0 {
                    self.output.lose(format!("light {i}: the surface around it now casts shadows"));
                }
                self.line(format!(
                    "LightSource \"point\" \"rgb I\" {} \"point3 from\" {}",
                    rgb(*intensity),
                    point(*position)
                ));
            }
            Light::Spot(Spot { position, direction, intensity, attenuation, falloff }) => {
                self.check_attenuation(i, attenuation);
                let (inner, outer) = match *falloff {
                    SpotFalloff::Step { inner, outer } => (inner, outer),
                    SpotFalloff::Smooth { inner, outer } => {
                        self.output.lose(format!("light {i}: its edge fades by another curve"));
                        (inner, outer)
                    }
                    SpotFalloff::Power { cutoff, .. } => {
                        self.output.lose(format!("light {i}: its edge fades by another curve"));
                        (0.0, cutoff)
                    }
                };
                self.line(format!(
                    "LightSource \"spot\" \"rgb I\" {} \"point3 from\" {} \"point3 to\" {} \"float \
                        coneangle\" [ {} ] \
                     \"float conedeltaangle\" [ {} ]",
                    rgb(*intensity),
                    point(*position),
                    point(*position + *direction),
                    outer.to_degrees(),
                    (outer - inner).to_degrees()
                ));
            }
            Light::Disk(Disk { position, direction, radius, emission, attenuation })
                if *radius > 0.0 =>
            {
                self.check_attenuation(i, attenuation);
                let x = direction.any_orthonormal_vector();
                let place = DAffine3 {
                    matrix3: DMat3::from_cols(x, direction.cross(x), *direction),
                    translation: *position,
                };
                let radiance = *emission * (2.0 / (PI * radius * radius)) as f32;
                self.panel(
                    i,
                    &place,
                    radiance,
                    &format!("Shape \"disk\" \"float radius\" [ {radius} ]"),
                );
            }
            Light::Rectangle(Rectangle { center, axes, lengths, emission, attenuation })
                if lengths[0] * lengths[1] > 0.0 =>
            {
                self.check_attenuation(i, attenuation);
                let place = DAffine3 {
                    matrix3: DMat3::from_cols(axes[0], axes[1], axes[0].cross(axes[1])),
                    translation: *center,
                };
                let radiance = *emission * (2.0 / (lengths[0] * lengths[1])) as f32;
                let [x, y] = lengths.map(|l| l * 0.5);
                let corners: Vec<_> = [[-x, -y], [x, -y], [x, y], [-x, y]]
                    .iter()
                    .map(|[x, y]| DVec3::new(*x, *y, 0.0))
                    .map(|p| format!("{} {} {}", p.x, p.y, p.z))
                    .collect();
                let shape = format!(
                    "Shape \"trianglemesh\" \"point3 P\" [ {} ] \"integer indices\" [ 0 1 2 0 2 3 \
                        ]",
                    corners.join("  ")
                );
                self.panel(i, &place, radiance, &shape);
            }
            // A format handles only the lights listed here, so a new kind of light is left out
            // until it is added.
            _ => self.output.lose(format!("light {i}: a {} light is left out", light.name())),
        }
    }

    /// An invisible light as a black surface that emits.
    fn panel(&mut self, i: usize, place: &DAffine3, radiance: snell_math::Rgb, shape: &str) {
        self.output.lose(format!("light {i}: its surface is now visible"));
        let place = transform(place);
        self.line(format!(
            "AttributeBegin\n  {place}\n  Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n  \
                AreaLightSource \"diffuse\" \"rgb L\" {}\n  {shape}\nAttributeEnd",
            rgb(radiance)
        ));
    }
}
