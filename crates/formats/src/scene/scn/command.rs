//! The commands: their arguments and effects.

use super::Builder;
use super::file::File;
use crate::ReadError;
use crate::scene::tokens::Token;
use snell_intersect::AnyShape;
use snell_intersect::shape::{BoxShape, Cone, Cylinder, Disk, Sphere};
use snell_math::glam::DQuat;
use snell_math::{DAffine3, DVec3};
use snell_scene::{Geometry, WarningKind};

/// Every command and its syntax.
const USAGES: &[(&str, &str)] = &[
    ("ambient", "ambient r g b"),
    ("area_light", "area_light color(3) center(3) direction(3) radius ca la qa"),
    ("background", "background r g b"),
    ("begin", "begin material matrix(16, row by row)"),
    ("box", "box material corner(3) corner(3)"),
    ("camera", "camera eye(3) towards(3) up(3) xfov neardist fardist"),
    ("circle", "circle material center(3) normal(3) radius"),
    ("cone", "cone material center(3) radius height"),
    ("cylinder", "cylinder material center(3) radius height"),
    ("dir_light", "dir_light color(3) direction(3)"),
    ("end", "end"),
    ("include", "include file"),
    ("line", "line material point(3) point(3)"),
    ("material", "material ka(3) kd(3) ks(3) kt(3) e(3) n ir texture"),
    ("mesh", "mesh material file"),
    ("point_light", "point_light color(3) position(3) ca la qa"),
    ("rect_light", "rect_light color(3) center(3) axis1(3) axis2(3) length1 length2 ca la qa"),
    ("sphere", "sphere material center(3) radius"),
    ("spot_light", "spot_light color(3) position(3) direction(3) ca la qa cutoff dropoff"),
    ("tri", "tri material point(3) point(3) point(3)"),
];

/// Commands with a number as first argument: a file that starts with one is recognised.
pub const NUMERIC_KEYWORDS: &[&str] = &[
    "ambient",
    "area_light",
    "background",
    "begin",
    "box",
    "camera",
    "circle",
    "cone",
    "cylinder",
    "dir_light",
    "line",
    "material",
    "point_light",
    "rect_light",
    "sphere",
    "spot_light",
    "tri",
];

impl Builder {
    /// Reads the arguments of a command and executes it.
    pub fn read_command<'a>(
        &mut self,
        file: &mut File<'a>,
        keyword: &Token<'a>,
    ) -> Result<(), ReadError> {
        let text = keyword.text();
        let Some((_, usage)) = USAGES.iter().find(|(name, _)| *name == text) else {
            return Err(unknown(file, keyword));
        };
        file.tokens.set_usage(usage);
        match &*text {
            "ambient" => self.scene.ambient = self.color(file, "the ambient light")?,
            "background" => {
                let color = self.color(file, "the background")?;
                self.scene.background = snell_scene::Background::Color(color);
            }
            "camera" => self.read_camera(file)?,
            "material" => self.read_material(file)?,
            "dir_light" => self.read_directional_light(file)?,
            "point_light" => self.read_point_light(file)?,
            "spot_light" => self.read_spot_light(file)?,
            "area_light" => self.read_area_light(file)?,
            "rect_light" => self.read_rect_light(file)?,
            "begin" => self.begin_group(file, keyword)?,
            "end" => self.end_group(file, keyword)?,
            "include" => self.include(file, keyword)?,
            _ => self.read_surface(file, keyword)?,
        }
        Ok(())
    }

    /// Reads commands that have a material.
    fn read_surface(&mut self, file: &mut File, keyword: &Token) -> Result<(), ReadError> {
        let keyword = keyword.text();
        if keyword == "line" {
            return self.read_line(file);
        }
        let material = self.surface_material(file)?;
        let (place, shape): (DAffine3, AnyShape) = match &*keyword {
            "tri" => {
                let mut corners = [DVec3::ZERO; 3];
                for corner in &mut corners {
                    *corner = file.tokens.vector("a corner of the triangle")?;
                }
                self.add_triangle(file, corners, material);
                return Ok(());
            }
            "mesh" => {
                let (mesh, origin) = self.mesh(file)?;
                self.add_placed_surface(file, origin, Geometry::Mesh(mesh), material);
                return Ok(());
            }
            "box" => {
                let (a, b) = (
                    file.tokens.vector("a corner of the box")?,
                    file.tokens.vector("a corner of the box")?,
                );
                // Any two opposite corners are accepted.
                let shape = BoxShape { min: a.min(b), max: a.max(b) };
                let geometry = self.shapes.shared(shape.into());
                self.add_surface(file, geometry, material);
                return Ok(());
            }
            "sphere" => {
                let center = file.tokens.vector("the center of the sphere")?;
                let Some(radius) = self.size(file, "the radius of the sphere")? else {
                    return Ok(());
                };
                (DAffine3::from_translation(center), Sphere { radius }.into())
            }
            "circle" => {
                let center = file.tokens.vector("the center of the circle")?;
                let normal = file.tokens.direction("the normal of the circle")?;
                let Some(radius) = self.size(file, "the radius of the circle")? else {
                    return Ok(());
                };
                let rotation = DQuat::from_rotation_arc(DVec3::Z, normal);
                let place = DAffine3::from_rotation_translation(rotation, center);
                (place, Disk { radius, inner_radius: 0.0 }.into())
            }
            cylinder_or_cone => {
                let center = file.tokens.vector("the center of the solid")?;
                let radius = self.size(file, "the radius of the solid")?;
                let height = self.size(file, "the height of the solid")?;
                let (Some(radius), Some(height)) = (radius, height) else { return Ok(()) };
                let place = DAffine3::from_translation(center);
                if cylinder_or_cone == "cone" {
                    (place, Cone { radius, height }.into())
                } else {
                    (place, Cylinder { radius, height, caps: true }.into())
                }
            }
        };
        self.add_shape(file, place, shape, material);
        Ok(())
    }

    /// Reads `line`. A line is invisible, but the default camera frames it.
    fn read_line(&mut self, file: &mut File) -> Result<(), ReadError> {
        self.material_argument(file)?;
        for _ in 0..2 {
            let point = file.tokens.vector("an end of the line")?;
            let point = file.world_from_group().transform_point3(point);
            self.line_bounds = self.line_bounds.with_point(point);
        }
        self.scene.warn_of(WarningKind::Choice, "`line` has no surface and is not drawn");
        Ok(())
    }

    /// Reads a radius or height. `None` for 0, which makes nothing visible.
    fn size(&mut self, file: &mut File, what: &str) -> Result<Option<f64>, ReadError> {
        let token = file.tokens.peek();
        let size = file.tokens.number(what)?;
        if size > 0.0 {
            return Ok(Some(size));
        }
        match token {
            Some(token) if size < 0.0 => Err(file.tokens.error(
                &token,
                format!("{what} is negative ({size})"),
                "use a positive number",
            )),
            _ => {
                self.scene.warn(format!("{what} is 0: it is not visible"));
                Ok(None)
            }
        }
    }
}

fn unknown(file: &File, keyword: &Token) -> ReadError {
    let problem = format!("unknown command {}", keyword.quoted());
    let remedy = if keyword.text().starts_with("particle") {
        "remove it: particle systems belong to another assignment".to_string()
    } else {
        let names: Vec<_> = USAGES.iter().map(|(name, _)| *name).collect();
        format!(
            "check the number of arguments of the command before it; the commands are {}",
            names.join(", ")
        )
    };
    file.tokens.error(keyword, problem, remedy)
}
