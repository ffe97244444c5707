//! Lights that are not surfaces.

use super::environment::direction_of_square;
use super::{File, point, rgb, transform};
use crate::write::picture::encoded;
use snell_math::{DAffine3, DMat3, DVec3, Rgb, real};
use snell_scene::light::{
    Attenuation, Directional, Disk, Point, Profile, Projector, Rectangle, Spot, SpotFalloff,
};
use snell_scene::{Image, Light};
use std::f64::consts::PI;

impl File<'_, '_> {
    pub fn lights(&mut self) {
        let scene = self.scene;
        for (i, light) in scene.lights.iter().enumerate() {
            self.light(i, light);
        }
    }

    /// The factor on a light at a place that fades by the inverse square of the distance in pbrt,
    /// so that it is as bright as before at the middle of the scene.
    fn fading(&mut self, i: usize, position: DVec3, attenuation: &Attenuation) -> f32 {
        if *attenuation == Attenuation::INVERSE_SQUARE {
            return 1.0;
        }
        self.output.lose(format!(
            "light {i}: it now fades by the inverse square of the distance, as bright as before at \
                the middle of the scene"
        ));
        let distance = (self.middle - position).length() as f32;
        let factor = attenuation.at(distance) * distance * distance;
        if factor > 0.0 && factor.is_finite() { factor } else { 1.0 }
    }

    fn light(&mut self, i: usize, light: &Light) {
        match light {
            Light::Directional(Directional { direction, irradiance }) => self.line(format!(
                "LightSource \"distant\" \"rgb L\" {} \"point3 from\" [ 0 0 0 ] \"point3 to\" {}",
                rgb(*irradiance),
                point(*direction)
            )),
            Light::Point(Point { position, intensity, attenuation, body_radius }) => {
                let intensity = *intensity * self.fading(i, *position, attenuation);
                if *body_radius > 0.0 {
                    self.output.lose(format!("light {i}: the surface around it now casts shadows"));
                }
                self.line(format!(
                    "LightSource \"point\" \"rgb I\" {} \"point3 from\" {}",
                    rgb(intensity),
                    point(*position)
                ));
            }
            Light::Spot(Spot { position, direction, intensity, attenuation, falloff }) => {
                let intensity = *intensity * self.fading(i, *position, attenuation);
                let (inner, outer) = match *falloff {
                    SpotFalloff::Step { inner, outer } => (inner, outer),
                    SpotFalloff::Smooth { inner, outer } | SpotFalloff::Fourth { inner, outer } => {
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
                    rgb(intensity),
                    point(*position),
                    point(*position + *direction),
                    outer.to_degrees(),
                    (outer - inner).to_degrees()
                ));
            }
            Light::Disk(Disk { position, direction, radius, emission, attenuation })
                if *radius > 0.0 =>
            {
                let factor = self.fading(i, *position, attenuation);
                let x = direction.any_orthonormal_vector();
                let place = DAffine3 {
                    matrix3: DMat3::from_cols(x, direction.cross(x), *direction),
                    translation: *position,
                };
                let radiance = *emission * (factor * (2.0 / (PI * radius * radius)) as f32);
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
                let factor = self.fading(i, *center, attenuation);
                let place = DAffine3 {
                    matrix3: DMat3::from_cols(axes[0], axes[1], axes[0].cross(axes[1])),
                    translation: *center,
                };
                let radiance = *emission * (factor * (2.0 / (lengths[0] * lengths[1])) as f32);
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
            Light::Profile(profile) => self.profile(i, profile),
            Light::Projector(projector) => self.projector(i, projector),
            // A format handles only the lights listed here, so a new kind of light is left out
            // until it is added.
            _ => self.output.lose(format!("light {i}: a {} light is left out", light.name())),
        }
    }

    /// A light with a table of intensities, as a picture of grey directions.
    fn profile(&mut self, i: usize, profile: &Profile) {
        const SIDE: u32 = 256;
        let is_grey = |c: Rgb| {
            let least = c.r.min(c.g).min(c.b);
            c.max_element() - least <= 1e-3 * c.max_element()
        };
        let (mut values, mut is_colored) = (Vec::with_capacity((SIDE * SIDE) as usize), false);
        for y in 0..SIDE {
            for x in 0..SIDE {
                let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE);
                let color = profile.table.at(direction_of_square(at(x), at(y)));
                is_colored |= !is_grey(color);
                values.push((color.r + color.g + color.b) / 3.0);
            }
        }
        if is_colored {
            self.output
                .lose(format!("light {i}: its colours, which differ by direction, are grey"));
        }
        let image = Image::from_f32(SIDE, SIDE, 1, values);
        let name = self.output.file(&format!("light-{i}.exr"), encoded(&image).0);
        // pbrt exchanges y and z of the light's own coordinates.
        let axes = profile.world_from_light * DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
        let place = transform(&DAffine3 { matrix3: axes, translation: profile.position });
        self.line(format!(
            "AttributeBegin\n  {place}\n  LightSource \"goniometric\" \"rgb I\" {} \"string \
                filename\" [ \"{name}\" ]\nAttributeEnd",
            rgb(profile.scale)
        ));
    }

    /// A light that projects a picture, with the light's colour in the picture.
    fn projector(&mut self, i: usize, projector: &Projector) {
        let slide = &projector.slide;
        let (size, half) = (slide.size(), slide.half_size());
        // The picture's sides are in proportion to those of the projection.
        let most = size[0].max(size[1]).clamp(1, 2048);
        let side =
            |part: f64| ((f64::from(most) * part / half.max_element()).round() as u32).max(1);
        let [w, h] = match f64::from(size[0]) * half.y == f64::from(size[1]) * half.x {
            true => size,
            false => [side(half.x), side(half.y)],
        };
        let mut values = Vec::with_capacity(3 * (w * h) as usize);
        for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
            let place = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let direction =
                DVec3::new(place(x, w) * half.x, -place(y, h) * half.y, 1.0).normalize();
            let spread =
                if projector.even { real::powi(direction.z, 3).recip() as f32 } else { 1.0 };
            values.extend((slide.at(direction) * projector.scale * spread).to_array());
        }
        let image = encoded(&Image::from_f32(w, h, 3, values)).0;
        let name = self.output.file(&format!("light-{i}.exr"), image);
        let place = transform(&DAffine3 {
            matrix3: projector.world_from_light,
            translation: projector.position,
        });
        let fov = 2.0 * real::atan(half.min_element()).to_degrees();
        self.line(format!(
            "AttributeBegin\n  {place}\n  LightSource \"projection\" \"float fov\" [ {fov} ] \
                \"string filename\" [ \"{name}\" ]\nAttributeEnd"
        ));
    }

    /// An invisible light as a black surface that emits.
    fn panel(&mut self, i: usize, place: &DAffine3, radiance: Rgb, shape: &str) {
        self.output.lose(format!("light {i}: its surface is now visible"));
        let place = transform(place);
        self.line(format!(
            "AttributeBegin\n  {place}\n  Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n  \
                AreaLightSource \"diffuse\" \"rgb L\" {}\n  {shape}\nAttributeEnd",
            rgb(radiance)
        ));
    }
}
