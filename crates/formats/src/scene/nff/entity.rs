//! View, background, lights and fills.

use super::Builder;
use crate::ReadError;
use crate::scene::tokens::{Token, Tokens};
use snell_math::{DVec3, Rgb, real};
use snell_scene::light::{Attenuation, Point};
use snell_scene::material::Phong;
use snell_scene::{Background, Camera, Material, MaterialId, Projection, WarningKind};
use std::f32::consts::PI;

/// Pictures with a side longer than this are refused, because they could not be rendered.
const LARGEST_SIDE: i64 = 65536;

impl Builder {
    /// Reads the rest of an entity after its keyword.
    pub fn read_entity(&mut self, tokens: &mut Tokens, keyword: &Token) -> Result<(), ReadError> {
        match &*keyword.text() {
            "v" => self.read_view(tokens, keyword),
            "b" => {
                tokens.set_usage("b red green blue");
                self.scene.background = Background::Color(tokens.color("the background")?);
                Ok(())
            }
            "l" => self.read_light(tokens),
            "f" => self.read_fill(tokens),
            "c" => self.read_cone(tokens, keyword),
            "s" => self.read_sphere(tokens),
            "p" => self.read_polygon(tokens, keyword, false),
            "pp" => self.read_polygon(tokens, keyword, true),
            // Assimp's writers and readers know these: solids, polygons with texture coordinates,
            // the fineness of spheres and the name of a picture.
            solid @ ("tet" | "oct" | "hex" | "dod" | "tpp") => {
                self.scene.warn(format!("`{solid}` of Assimp is left out"));
                skip_numbers(tokens);
                Ok(())
            }
            "tess" => {
                let message = "`tess` of Assimp was ignored: spheres and cones are exact";
                self.scene.warn_of(WarningKind::Choice, message);
                skip_numbers(tokens);
                Ok(())
            }
            "shader" => {
                tokens.set_usage("shader picture");
                let picture = tokens.expect("the name of a picture")?.quoted();
                self.warn_of_picture(&picture);
                Ok(())
            }
            _ => {
                let problem = format!("unknown entity {}", keyword.quoted());
                let remedy = "check the number of values of the entity before it; the entities are \
                    v, b, l, f, c, s, p, pp";
                Err(tokens.error(keyword, problem, remedy))
            }
        }
    }

    fn read_view(&mut self, tokens: &mut Tokens, keyword: &Token) -> Result<(), ReadError> {
        tokens.set_usage(
            "v from x y z at x y z up x y z angle degrees hither distance resolution width height",
        );
        word(tokens, "from")?;
        let eye = tokens.vector("the eye")?;
        word(tokens, "at")?;
        let at = tokens.vector("the point looked at")?;
        word(tokens, "up")?;
        let up = tokens.vector("the up vector")?;
        word(tokens, "angle")?;
        let token = tokens.peek();
        let angle = tokens.number("the angle of view")?;
        if let (false, Some(token)) = (angle > 0.0 && angle < 180.0, token) {
            let problem = format!("the angle of view is {angle} degrees");
            return Err(tokens.error(&token, problem, "use an angle above 0 and below 180"));
        }
        word(tokens, "hither")?;
        tokens.number("the distance of the hither plane")?;
        word(tokens, "resolution")?;
        let size = [side(tokens)?, side(tokens)?];
        let Some(towards) = (at - eye).try_normalize() else {
            let problem = "the view looks from a point at the same point";
            return Err(tokens.error(keyword, problem, "make `from` and `at` differ"));
        };
        self.scene.cameras = vec![self.camera(eye, towards, up, angle, size)];
        self.scene.settings.size = Some(size);
        Ok(())
    }

    fn camera(
        &mut self,
        eye: DVec3,
        towards: DVec3,
        up: DVec3,
        angle: f64,
        size: [u32; 2],
    ) -> Camera {
        let right = towards.cross(up).try_normalize().unwrap_or_else(|| {
            self.scene
                .warn("the view's up vector is parallel to its direction; another one was chosen");
            towards.any_orthonormal_vector()
        });
        // The angle spans from the centre of the top row to the centre of the bottom row: half a
        // pixel less on either side.
        let rows = f64::from(size[1]);
        let rows_between_centers = if rows > 1.0 { rows - 1.0 } else { rows };
        let tan = real::tan(angle.to_radians() / 2.0) * rows / rows_between_centers;
        Camera {
            name: "view".into(),
            eye,
            towards,
            up: right.cross(towards),
            projection: Projection::Perspective { tan_half_fov: [None, Some(tan)] },
            aperture_radius: 0.0,
            focus_distance: 1.0,
            resolution: Some(size),
            clip: None,
        }
    }

    fn read_light(&mut self, tokens: &mut Tokens) -> Result<(), ReadError> {
        tokens.set_usage("l x y z [red green blue]");
        let position = tokens.vector("the position of the light")?;
        // Entities start with a letter, so a number can only be a colour.
        let has_color = tokens.number_follows();
        let color = if has_color {
            Some(tokens.color("the color of the light")?.map(|x| x.max(0.0)))
        } else {
            None
        };
        self.lights.push((position, color));
        Ok(())
    }

    /// Adds the lights, once their number is known.
    pub fn finish_lights(&mut self) {
        let default = Rgb::splat(1.0 / (self.lights.len().max(1) as f32).sqrt());
        for &(position, color) in &self.lights {
            let intensity = color.unwrap_or(default) * PI;
            let attenuation = Attenuation::NONE;
            self.scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
        }
    }

    fn read_fill(&mut self, tokens: &mut Tokens) -> Result<(), ReadError> {
        tokens.set_usage("f red green blue Kd Ks shine T index_of_refraction");
        let values = tokens.numbers::<8>("a value of the fill")?;
        if let Some(picture) = picture_name(tokens) {
            self.warn_of_picture(&picture.quoted());
        }
        let scene = &mut self.scene;
        let id = *self.fills.entry(values.map(f64::to_bits)).or_insert_with(|| {
            let name = format!("fill {}", scene.materials.len());
            scene.add_material(Material::new(name, fill(values)))
        });
        self.fill = Some(id);
        Ok(())
    }

    fn warn_of_picture(&mut self, picture: &str) {
        self.scene.warn(format!(
            "the picture {picture} of a fill is left out: the fill has its colour alone"
        ));
    }

    /// The current material; matte white before the first fill.
    pub fn current_fill(&mut self) -> MaterialId {
        *self.fill.get_or_insert_with(|| {
            self.scene.warn("an object comes before the first `f`; it got a white matte material");
            self.scene.add_material(Material::new(
                "default",
                fill([1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0]),
            ))
        })
    }
}

/// Takes the name of a picture that Assimp's files have after the values of a fill, on its line.
fn picture_name<'a>(tokens: &mut Tokens<'a>) -> Option<Token<'a>> {
    let token = tokens.peek_on_line()?;
    let text = token.text();
    let is_entity = ["v", "b", "l", "f", "c", "s", "p", "pp"].contains(&&*text);
    let is_name = !is_entity && text.contains(|c: char| c.is_ascii_alphabetic());
    if is_name && !tokens.number_follows() { tokens.take() } else { None }
}

fn skip_numbers(tokens: &mut Tokens) {
    while tokens.number_follows() {
        tokens.take();
    }
}

fn fill(values: [f64; 8]) -> Phong {
    let [r, g, b, kd, ks, shine, t, ior] = values.map(|x| x.max(0.0) as f32);
    let color = Rgb::new(r, g, b);
    Phong {
        ambient: color.into(),
        diffuse: (color * kd).into(),
        specular: (color * ks).into(),
        reflection: (color * ks).into(),
        transmission: Rgb::splat(t).into(),
        shininess: shine,
        // Opaque fills have index 0 in the databases.
        ior: if ior > 0.0 { ior } else { 1.0 },
    }
}

fn word(tokens: &mut Tokens, expected: &str) -> Result<(), ReadError> {
    let quoted = format!("`{expected}`");
    let token = tokens.expect(&quoted)?;
    if token.text() == expected { Ok(()) } else { Err(tokens.unexpected(&token, &quoted)) }
}

fn side(tokens: &mut Tokens) -> Result<u32, ReadError> {
    let token = tokens.peek();
    let side = tokens.integer("a side of the picture")?;
    match token {
        Some(token) if !(1..=LARGEST_SIDE).contains(&side) => {
            let problem = format!("a side of the picture is {side} pixels");
            Err(tokens.error(&token, problem, format!("use 1 to {LARGEST_SIDE}")))
        }
        _ => Ok(side as u32),
    }
}
