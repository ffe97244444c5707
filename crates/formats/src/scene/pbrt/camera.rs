//! Cameras.

use super::Builder;
use super::options::{Crop, is_kind};
use super::params::Params;
use crate::scene::fault::Fault;
use snell_math::{DAffine3, DVec3, real};
use snell_scene::camera::Intrinsics;
use snell_scene::{Camera, Projection};

/// A camera in the scene's world.
pub struct Built {
    /// The camera.
    pub camera: Camera,
    /// Transform from the file's world to the scene's: a mirror if the camera would otherwise show
    /// a mirrored picture.
    pub world_from_file: DAffine3,
}

/// The screen window on the plane at distance 1, in camera space: x from and to, y from and to.
#[derive(Clone, Copy, Debug)]
struct Screen {
    x: [f64; 2],
    y: [f64; 2],
    /// False if the window follows from the aspect ratio.
    is_given: bool,
}

impl Screen {
    fn read(params: &Params, size: [u32; 2]) -> Result<Self, Fault> {
        let [w, h] = size.map(f64::from);
        let ratio = params.float("frameaspectratio")?;
        let aspect = ratio.unwrap_or(w / h);
        if aspect.is_nan() || aspect <= 0.0 {
            return Err(
                params.fault(format!("a frame aspect ratio of {aspect}"), "give a positive number")
            );
        }
        match *params.floats("screenwindow")? {
            [] => {
                let [x, y] = if aspect > 1.0 { [aspect, 1.0] } else { [1.0, 1.0 / aspect] };
                Ok(Self { x: [-x, x], y: [-y, y], is_given: ratio.is_some() })
            }
            [x0, x1, y0, y1] if x1 > x0 && y1 > y0 => {
                Ok(Self { x: [x0, x1], y: [y0, y1], is_given: true })
            }
            _ => Err(params
                .fault("the screen window is not x from, x to, y from, y to", "give four numbers")),
        }
    }

    /// The part of the window that a part of the film shows.
    fn cropped(self, crop: Crop, size: [u32; 2]) -> Self {
        let [w, h] = size.map(f64::from);
        let ([left, top], [width, height]) = (crop.offset.map(f64::from), crop.size.map(f64::from));
        let x = |column: f64| self.x[0] + (self.x[1] - self.x[0]) * column / w;
        let y = |row: f64| self.y[1] - (self.y[1] - self.y[0]) * row / h;
        let (x, y) = ([x(left), x(left + width)], [y(top + height), y(top)]);
        Self { x, y, is_given: true }
    }

    fn is_centred(&self) -> bool {
        self.x[0] == -self.x[1] && self.y[0] == -self.y[1]
    }

    /// Half-extents of the window times a factor; `None` for an extent that follows from the aspect
    /// ratio.
    fn half_extents(&self, factor: f64, size: [u32; 2]) -> [Option<f64>; 2] {
        let [x, y] = [self.x, self.y].map(|[from, to]| Some((to - from) * 0.5 * factor));
        match size {
            _ if self.is_given => [x, y],
            [w, h] if w > h => [None, y],
            _ => [x, None],
        }
    }
}

/// Builds a camera at `file_from_camera`.
pub fn build(
    builder: &mut Builder,
    params: &Params,
    file_from_camera: DAffine3,
    size: [u32; 2],
    crop: Option<Crop>,
) -> Result<Built, Fault> {
    let whole = Screen::read(params, size)?;
    let sees_all_around = is_kind(params, "spherical") || is_kind(params, "environment");
    if crop.is_some() && sees_all_around {
        builder.note("crop", params.at, || {
            "the crop of the film was ignored: this camera shows all directions".into()
        });
    }
    let crop = crop.filter(|_| !sees_all_around);
    let screen = crop.map_or(whole, |crop| whole.cropped(crop, size));
    let film = size.map(f64::from);
    let size = crop.map_or(size, |crop| crop.size);
    let mut own = Axes { right: DVec3::X, up: DVec3::Y, towards: DVec3::Z, shift: DVec3::ZERO };
    let scale = file_from_camera.transform_vector3(DVec3::Z).length();
    let projection = if is_kind(params, "orthographic") {
        let middle = |[from, to]: [f64; 2]| (from + to) * 0.5;
        own.shift = DVec3::new(middle(screen.x), middle(screen.y), 0.0);
        Projection::Orthographic { half_size: screen.half_extents(scale, size) }
    } else if sees_all_around {
        let mapping = params.string("mapping")?.unwrap_or("equalarea");
        if mapping == "equirectangular" || is_kind(params, "environment") {
            // In camera space, the middle of pbrt's picture is -x and its right is -z.
            (own.right, own.towards) = (DVec3::NEG_Z, DVec3::NEG_X);
            Projection::Panoramic
        } else {
            Projection::EqualArea
        }
    } else {
        let behind_lenses = match is_kind(params, "realistic") {
            true => builder.tan_behind_lenses(params, film)?,
            false => None,
        };
        perspective(builder, params, &screen, size, behind_lenses)?
    };
    let lens = params.float_or("lensradius", 0.0)?;
    let focus = params.float_or("focaldistance", 1e6)?;
    let mut built = own.place(file_from_camera, projection);
    if lens > 0.0 && focus > 0.0 {
        built.camera = built.camera.with_lens(lens * scale, focus * scale);
    }
    built.camera.resolution = Some(size);
    Ok(built)
}

/// `behind_lenses` is the tangent of half of the field of view, in place of that of `fov`.
fn perspective(
    builder: &mut Builder,
    params: &Params,
    screen: &Screen,
    size: [u32; 2],
    behind_lenses: Option<f64>,
) -> Result<Projection, Fault> {
    if is_kind(params, "realistic") {
        let names = ["aperturediameter", "aperture", "simpleweighting"];
        builder.note_ignored(params, &names, "the camera has no lenses");
    } else if !is_kind(params, "perspective") && params.owner.starts_with("Camera") {
        let owner = params.owner.clone();
        builder.note(owner.clone(), params.at, || {
            format!("{owner}: a perspective camera was used instead")
        });
    }
    let half = params.float("halffov")?.map(|h| 2.0 * h);
    let fov = params.float("fov")?.or(half).unwrap_or(90.0);
    if !(fov > 0.0 && fov < 180.0) {
        return Err(
            params.fault(format!("a field of view of {fov} degrees"), "give one between 0 and 180")
        );
    }
    let tan = behind_lenses.unwrap_or_else(|| real::tan((fov * 0.5).to_radians()));
    if screen.is_centred() {
        return Ok(Projection::Perspective { tan_half_fov: screen.half_extents(tan, size) });
    }
    let ([x0, x1], [y0, y1], [w, h]) = (screen.x, screen.y, size.map(f64::from));
    Ok(Projection::Intrinsics(Intrinsics::new(
        [w / ((x1 - x0) * tan), h / ((y1 - y0) * tan)],
        [-x0 * w / (x1 - x0), y1 * h / (y1 - y0)],
        size,
    )))
}

/// The axes of a picture in camera space.
struct Axes {
    right: DVec3,
    up: DVec3,
    towards: DVec3,
    shift: DVec3,
}

impl Axes {
    fn place(&self, file_from_camera: DAffine3, projection: Projection) -> Built {
        let [right, up, towards] = [self.right, self.up, self.towards]
            .map(|axis| file_from_camera.transform_vector3(axis));
        let is_mirrored = towards.cross(up).dot(right) < 0.0;
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let world_from_file = if is_mirrored { mirror } else { DAffine3::IDENTITY };
        let eye = world_from_file.transform_point3(file_from_camera.transform_point3(self.shift));
        let [up, towards] = [up, towards].map(|axis| world_from_file.transform_vector3(axis));
        Built { camera: Camera::from_direction(eye, towards, up, projection), world_from_file }
    }
}
