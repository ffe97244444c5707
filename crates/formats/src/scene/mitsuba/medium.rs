//! Participating media.

use super::Builder;
use super::color;
use super::object::Object;
use super::value::{Value, shortened};
use crate::scene::fault::Fault;
use crate::scene::scattering::{self, Coefficients};
use crate::{Input, Place, ReadError};
use snell_math::{DAffine3, DVec3, Rgb};
use snell_scene::MediumId;
use snell_scene::medium::{ColorGrid, Grid, Homogeneous, ScalarGrid};
use snell_scene::texture::Wrap;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

/// The media of a scene.
#[derive(Debug, Default)]
pub struct Media {
    known: HashMap<*const Object, Option<MediumId>>,
    /// Media that are the interior of some shape.
    pub inside: Vec<MediumId>,
}

/// A constant or gridded volume.
enum Volume {
    Constant(Rgb),
    Grid(VolumeFile, DAffine3),
}

impl Volume {
    /// The transform from the grid's unit cube to the world.
    fn place(&self) -> Option<&DAffine3> {
        match self {
            Self::Constant(_) => None,
            Self::Grid(_, place) => Some(place),
        }
    }

    /// The same volume with a grid in this box, of this size if one is given.
    fn in_box(self, place: DAffine3, size: Option<[usize; 3]>) -> Self {
        match self {
            Self::Grid(file, own) if !is_same_box(&own, &place) => {
                Self::Grid(file.resampled(own.inverse() * place, size), place)
            }
            other => other,
        }
    }

    /// The memory of the values and of the grid that is made of them.
    fn bytes(&self) -> u64 {
        match self {
            Self::Constant(_) => 0,
            Self::Grid(file, _) => 8 * file.values.len() as u64,
        }
    }

    /// True if the values are per cell of a grid.
    fn has_cells_of(&self, file: &VolumeFile) -> bool {
        match self {
            Self::Constant(_) => true,
            Self::Grid(own, _) => own.size == file.size,
        }
    }

    /// The colour of a cell of the volume's grid.
    fn color(&self, cell: usize) -> Rgb {
        match self {
            Self::Constant(color) => *color,
            Self::Grid(file, _) => file.color(cell),
        }
    }
}

/// True if two boxes are the same but for rounding.
fn is_same_box(a: &DAffine3, b: &DAffine3) -> bool {
    a.abs_diff_eq(*b, 1e-9 * a.matrix3.x_axis.length().max(1e-300))
}

/// How many cells of a resampled grid a cell becomes along each axis, up to this many cells.
const FINER: f64 = 4.0;
const FINE_CELLS: f64 = 96.0;
/// Maximum number of cells of a resampled grid along each axis.
const MAX_CELLS: f64 = 256.0;

/// The content of a volume file.
#[derive(Debug, PartialEq)]
pub struct VolumeFile {
    size: [usize; 3],
    channels: usize,
    bounds: [DVec3; 2],
    values: Vec<f32>,
    /// True if values are not interpolated between cells.
    is_stepped: bool,
    /// What the outermost cells are interpolated with.
    wrap: Wrap,
}

impl Builder<'_> {
    /// Converts a medium; `None` if it became clear air.
    pub(super) fn medium(&mut self, object: &Rc<Object>) -> Result<Option<MediumId>, Fault> {
        if let Some(known) = self.media.known.get(&Rc::as_ptr(object)) {
            return Ok(*known);
        }
        self.enter(object)?;
        let g = self.asymmetry(object)?;
        let medium = match object.kind.as_str() {
            "homogeneous" => Some(self.homogeneous(object, g)?),
            "heterogeneous" => self.heterogeneous(object, g)?,
            _ => {
                let owner = object.owner();
                self.ignore_all(object);
                self.note(owner.clone(), object.at, || {
                    format!("{owner} is not supported; it became clear air")
                });
                None
            }
        };
        for name in [
            "sample_emitters",
            "has_spectral_extinction",
            "majorant_resolution_factor",
            "method",
            "step_size",
        ] {
            object.get(name);
        }
        self.leave();
        self.note_unused(object);
        self.media.known.insert(Rc::as_ptr(object), medium);
        Ok(medium)
    }

    /// The mean cosine of the phase function.
    fn asymmetry(&mut self, object: &Object) -> Result<f32, Fault> {
        let Some(phase) = self.inner(object, |o| o.class == "phase")? else { return Ok(0.0) };
        let g = match phase.kind.as_str() {
            "isotropic" => 0.0,
            "hg" => phase.float_within("g", 0.8, [-1.0, 1.0])?,
            _ => {
                let owner = phase.owner();
                self.ignore_all(&phase);
                self.note(owner.clone(), phase.at, || {
                    format!("{owner}: light is scattered isotropically instead")
                });
                0.0
            }
        };
        self.note_unused(&phase);
        Ok(g as f32)
    }

    /// A homogeneous medium: `scale` applies to extinction, or to absorption and scattering.
    fn homogeneous(&mut self, object: &Object, g: f32) -> Result<MediumId, Fault> {
        let scale = object.float_or("scale", 1.0)? as f32;
        if let Some((name, at)) = object.string("material")? {
            if let Some(Coefficients { sigma_a, sigma_s }) = scattering::named(name) {
                let plain = Homogeneous {
                    sigma_a: sigma_a * scale,
                    sigma_s: sigma_s * scale,
                    emission: Rgb::BLACK,
                    g,
                };
                return Ok(self.scene.add_medium(plain));
            }
            let name = super::value::shortened(name);
            self.note("medium preset", at, || {
                format!(
                    "the medium \"{name}\" has no table here; sigma_t and albedo were used, or \
                    their defaults"
                )
            });
        }
        if object.has("sigma_a") || object.has("sigma_s") {
            let sigma_a = self.volume_color(object, "sigma_a", 1.0)? * scale;
            let sigma_s = self.volume_color(object, "sigma_s", 1.0)? * scale;
            return Ok(self.scene.add_medium(Homogeneous {
                sigma_a,
                sigma_s,
                emission: Rgb::BLACK,
                g,
            }));
        }
        let sigma_t = self.volume_color(object, "sigma_t", 1.0)? * scale;
        let albedo = self.volume_color(object, "albedo", 0.75)?;
        Ok(self.scene.add_medium(Homogeneous::scattering(sigma_t, albedo, g)))
    }

    fn volume_color(&mut self, object: &Object, name: &str, default: f32) -> Result<Rgb, Fault> {
        Ok(match self.volume(object, name)? {
            None => Rgb::splat(default),
            Some(Volume::Constant(color)) => color,
            Some(Volume::Grid(file, _)) => {
                let owner = object.owner();
                self.note(format!("{owner} grid {name}"), object.at, || {
                    format!("{owner}: a grid as \"{name}\"; its mean was used instead")
                });
                file.mean()
            }
        })
    }

    fn heterogeneous(&mut self, object: &Object, g: f32) -> Result<Option<MediumId>, Fault> {
        let scale = object.float_or("scale", 1.0)? as f32;
        let name = if object.has("density") { "density" } else { "sigma_t" };
        let extinction = self.volume(object, name)?.unwrap_or(Volume::Constant(Rgb::WHITE));
        let albedo = self.volume(object, "albedo")?.unwrap_or(Volume::Constant(Rgb::splat(0.75)));
        let emission = self.volume(object, "emission")?.unwrap_or(Volume::Constant(Rgb::BLACK));
        let is_old = self.version.starts_with("0.");
        if let (
            Volume::Constant(sigma_t),
            Volume::Constant(albedo),
            Volume::Constant(emission),
            true,
        ) = (&extinction, &albedo, &emission, is_old)
        {
            let plain = Homogeneous::scattering(*sigma_t * scale, *albedo, g);
            return Ok(Some(self.scene.add_medium(Homogeneous { emission: *emission, ..plain })));
        }
        // The medium fills the box of its extinction, which is that of a constant too, except in
        // version 0.6.
        let first = [&extinction, &albedo, &emission].into_iter().find_map(Volume::place);
        let place = match (extinction.place(), first) {
            (Some(place), _) => *place,
            (None, Some(place)) if is_old => *place,
            _ => self.box_of_constant(object, name)?,
        };
        let cells = match &extinction {
            Volume::Grid(file, _) if file.is_colored() => Some(file.size),
            _ => None,
        };
        let (albedo, emission) = (albedo.in_box(place, cells), emission.in_box(place, cells));
        for volume in [&albedo, &emission] {
            self.main.charge(volume.bytes(), "the grids of a medium")?;
        }
        let scattering = |a: f32| a.clamp(0.0, 1.0);
        let absorption = |a: f32| 1.0 - a.clamp(0.0, 1.0);
        let whole = ScalarGrid::new([1; 3], vec![1.0]);
        let (density, sigma_a, sigma_s) = match &extinction {
            Volume::Grid(file, _) if file.is_colored() && albedo.has_cells_of(file) => {
                let of = |share: fn(f32) -> f32| {
                    let color = |cell, sigma_t| sigma_t * albedo.color(cell).map(share);
                    (Rgb::splat(scale), file.colors(color))
                };
                (whole, of(absorption), of(scattering))
            }
            _ => {
                let (sigma_t, density) = match &extinction {
                    Volume::Constant(color) => (*color * scale, whole),
                    Volume::Grid(file, _) => (Rgb::splat(scale), file.scalar()),
                };
                if matches!(&extinction, Volume::Grid(file, _) if file.is_colored()) {
                    let owner = object.owner();
                    self.note(format!("{owner} sizes"), object.at, || {
                        format!(
                            "{owner}: a coloured \"{name}\" beside an albedo on another grid; \
                            it became grey"
                        )
                    });
                }
                let of = |share: fn(f32) -> f32| match &albedo {
                    Volume::Constant(albedo) => (sigma_t * albedo.map(share), None),
                    Volume::Grid(file, _) => (sigma_t, file.colors(|_, color| color.map(share))),
                };
                (density, of(absorption), of(scattering))
            }
        };
        let Some(density) = density else { return Ok(None) };
        let ((sigma_a, sigma_a_tint), (sigma_s, sigma_s_tint)) = (sigma_a, sigma_s);
        let (emission, emission_tint) = match &emission {
            Volume::Constant(emission) => (*emission, None),
            Volume::Grid(file, _) => (Rgb::WHITE, file.colors(|_, color| color)),
        };
        let plain = Grid::new(sigma_a, sigma_s, g, density, place);
        let grid = Grid { emission, emission_tint, sigma_a_tint, sigma_s_tint, ..plain };
        Ok(Some(self.scene.add_medium(grid)))
    }

    /// The transform from the unit cube to the box that a heterogeneous medium of constant
    /// extinction fills (`Volume::update_bbox` of Mitsuba).
    fn box_of_constant(&self, object: &Object, name: &str) -> Result<DAffine3, Fault> {
        let place = match self.child_named(object, name)? {
            Some(volume) => volume.transform("to_world")?,
            None => DAffine3::IDENTITY,
        };
        let place = self.world_from_file * place;
        let corners = (0..8).map(|i| {
            let [x, y, z] = [1, 2, 4].map(|bit| f64::from(u8::from(i & bit != 0)));
            place.transform_point3(DVec3::new(x, y, z))
        });
        let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
        Ok(DAffine3::from_translation(low) * DAffine3::from_scale(high - low))
    }

    fn volume(&mut self, object: &Object, name: &str) -> Result<Option<Volume>, Fault> {
        if let Some(property) = object.get(name) {
            return match property.value {
                Value::Color(hue) => Ok(Some(Volume::Constant(color::factor(hue)))),
                Value::Float(x) => Ok(Some(Volume::Constant(Rgb::splat(x as f32)))),
                Value::Integer(x) => Ok(Some(Volume::Constant(Rgb::splat(x as f32)))),
                _ => Err(property
                    .fault("this is neither a colour nor a number", "give one, or a volume")),
            };
        }
        let Some(volume) = self.child_named(object, name)? else { return Ok(None) };
        let read = match volume.kind.as_str() {
            "constvolume" => {
                // It bounds a heterogeneous medium whose extinction it is.
                volume.get("to_world");
                let value = if volume.has("value") { "value" } else { "color" };
                Volume::Constant(self.constant(&volume, value)?.unwrap_or(Rgb::WHITE))
            }
            "gridvolume" => self.grid_volume(&volume)?,
            _ => {
                let owner = volume.owner();
                self.ignore_all(&volume);
                self.note(owner.clone(), volume.at, || {
                    format!("{owner} is not supported; 1 was used everywhere")
                });
                Volume::Constant(Rgb::WHITE)
            }
        };
        self.note_unused(&volume);
        Ok(Some(read))
    }

    fn grid_volume(&mut self, volume: &Object) -> Result<Volume, Fault> {
        let (name, at) = volume.file_name()?;
        let mut file = read_volume(&self.open(name, at)?)?;
        for name in ["raw", "accel", "max_value"] {
            volume.get(name);
        }
        file.is_stepped = volume.string("filter_type")?.is_some_and(|(text, _)| text == "nearest");
        // Media have no part outside of the box, so only its outermost half cells are wrapped.
        let wrap = volume.string("wrap_mode")?;
        file.wrap = match wrap.map_or("clamp", |(text, _)| text) {
            "clamp" => Wrap::Clamp,
            "repeat" => Wrap::Repeat,
            "mirror" => Wrap::Mirror,
            other => {
                let at = wrap.map_or(volume.at, |(_, at)| at);
                let problem = format!("the wrap_mode \"{}\"", shortened(other));
                return Err(Fault::new(at, problem, "write clamp, repeat or mirror"));
            }
        };
        let mut world_from_grid = self.world_from_file * volume.transform("to_world")?;
        if volume.bool_or("use_grid_bbox", self.version.starts_with("0."))? {
            let [low, high] = file.bounds;
            world_from_grid *= DAffine3::from_translation(low) * DAffine3::from_scale(high - low);
        }
        Ok(Volume::Grid(file, world_from_grid))
    }

    /// Makes the medium around the camera that of the whole scene, unless the medium is also an
    /// interior: then the renderer determines where the camera is.
    pub(super) fn camera_medium(&mut self, medium: Option<MediumId>) {
        self.scene.medium = medium.filter(|m| !self.media.inside.contains(m));
    }
}

impl VolumeFile {
    /// The size of the grid and its values, if it holds one number for each cell.
    pub fn numbers(&self) -> Option<([usize; 3], &[f32])> {
        (self.channels == 1).then_some((self.size, &self.values[..]))
    }

    /// A grid of numbers in the unit cube.
    #[cfg(test)]
    pub fn of_numbers(size: [usize; 3], values: Vec<f32>) -> Self {
        let bounds = [DVec3::ZERO, DVec3::ONE];
        Self { size, channels: 1, bounds, values, is_stepped: false, wrap: Wrap::Clamp }
    }

    fn mean(&self) -> Rgb {
        let cells = (self.values.len() / self.channels).max(1) as f64;
        let channel = |c: usize| {
            let c = c.min(self.channels - 1);
            let sum: f64 =
                self.values.iter().skip(c).step_by(self.channels).map(|v| f64::from(*v)).sum();
            (sum / cells) as f32
        };
        Rgb::new(channel(0), channel(1), channel(2))
    }

    /// True if the cells have colours, not numbers.
    fn is_colored(&self) -> bool {
        self.channels >= 3
    }

    /// The colour of a cell.
    fn color(&self, cell: usize) -> Rgb {
        let channel = |c: usize| {
            let at = cell * self.channels + c.min(self.channels - 1);
            self.values.get(at).copied().unwrap_or(0.0)
        };
        Rgb::new(channel(0), channel(1), channel(2))
    }

    /// A colour for each cell, computed from its index and its colour.
    fn colors(&self, change: impl Fn(usize, Rgb) -> Rgb) -> Option<Arc<ColorGrid>> {
        let cells = self.values.len() / self.channels;
        ColorGrid::new(self.size, (0..cells).map(|cell| change(cell, self.color(cell))).collect())
            .map(|grid| Arc::new(grid.stepped(self.is_stepped).wrapped(self.wrap)))
    }

    /// The grid in another box, given the transform from its unit cube to that of this one. Its
    /// cells are finer, so that what was interpolated stays so.
    fn resampled(&self, own_from_box: DAffine3, size: Option<[usize; 3]>) -> Self {
        let cells = DVec3::from(self.size.map(|n| n as f64));
        let size = size.unwrap_or_else(|| {
            [0, 1, 2].map(|axis| {
                let crossed = (own_from_box.matrix3.col(axis).abs() * cells).element_sum();
                let finer = (FINER * crossed).min(FINE_CELLS).max(crossed);
                // (A singular transform gives a number that is none, which becomes 1.)
                finer.ceil().clamp(1.0, MAX_CELLS) as usize
            })
        });
        let [x, y, z] = size;
        let mut values = Vec::with_capacity(x * y * z * self.channels);
        for cell in 0..x * y * z {
            let cell = [cell % x, cell / x % y, cell / (x * y)];
            let middle = [0, 1, 2].map(|axis| (cell[axis] as f64 + 0.5) / size[axis] as f64);
            self.lookup(own_from_box.transform_point3(middle.into()), &mut values);
        }
        Self { size, values, wrap: Wrap::Clamp, ..*self }
    }

    /// Adds the channels at a point, of which the unit cube is filled by the grid.
    fn lookup(&self, point: DVec3, values: &mut Vec<f32>) {
        let shift = if self.is_stepped { 0.0 } else { 0.5 };
        let place = [0, 1, 2].map(|axis| point[axis] * self.size[axis] as f64 - shift);
        let first = place.map(f64::floor);
        // Of both cells along each axis: the index and the weight.
        let taps = [0, 1, 2].map(|axis| {
            let along = if self.is_stepped { 0.0 } else { place[axis] - first[axis] };
            [(0, 1.0 - along), (1, along)].map(|(next, weight)| {
                (
                    self.wrapped((first[axis] as i64).saturating_add(next), self.size[axis] as i64),
                    weight,
                )
            })
        });
        for channel in 0..self.channels {
            let mut sum = 0.0;
            for corner in 0..8 {
                let [x, y, z] = [0, 1, 2].map(|axis| taps[axis][corner >> axis & 1]);
                let weight = x.1 * y.1 * z.1;
                if weight > 0.0 {
                    let cell = x.0 + self.size[0] * (y.0 + self.size[1] * z.0);
                    sum += weight * f64::from(self.values[cell * self.channels + channel]);
                }
            }
            values.push(sum as f32);
        }
    }

    /// The cell that one along an axis stands for, of `count`.
    fn wrapped(&self, index: i64, count: i64) -> usize {
        let inside = match self.wrap {
            Wrap::Repeat => index.rem_euclid(count),
            Wrap::Mirror => {
                let there = index.rem_euclid(2 * count);
                there.min(2 * count - 1 - there)
            }
            _ => index.clamp(0, count - 1),
        };
        inside as usize
    }

    /// A number for each cell: the mean of the channels.
    fn scalar(&self) -> Option<ScalarGrid> {
        let mean = |cell: &[f32]| cell.iter().sum::<f32>() / self.channels as f32;
        ScalarGrid::new(self.size, self.values.chunks_exact(self.channels).map(mean).collect())
            .map(|grid| grid.stepped(self.is_stepped).wrapped(self.wrap))
    }
}

/// Reads a volume: `VOL`, version 3, single-precision numbers on a grid, x first.
pub fn read_volume(input: &Input) -> Result<VolumeFile, ReadError> {
    const HEADER: usize = 48;
    let bytes = &input.bytes;
    let error = |at: usize, problem: String| {
        input.error(Place::Byte(at as u64), problem, "export the volume again")
    };
    if bytes.len() < HEADER || &bytes[..3] != b"VOL" || bytes[3] != 3 {
        return Err(error(0, "this is not a volume of Mitsuba (version 3)".into()));
    }
    let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
    if i32::from_le_bytes(word(4)) != 1 {
        return Err(error(4, "its numbers are not single-precision ones".into()));
    }
    let mut counts = [0usize; 4];
    for (i, count) in counts.iter_mut().enumerate() {
        let found = i32::from_le_bytes(word(8 + 4 * i));
        *count = usize::try_from(found)
            .ok()
            .filter(|c| *c > 0)
            .ok_or_else(|| error(8 + 4 * i, format!("a grid with {found} cells or channels")))?;
    }
    let [x, y, z, channels] = counts;
    let total = [x, y, z, channels].iter().try_fold(1usize, |a, b| a.checked_mul(*b));
    let needed = total.and_then(|n| n.checked_mul(4)).and_then(|n| n.checked_add(HEADER));
    if needed.is_none_or(|needed| needed > bytes.len()) {
        let problem = format!(
            "{x} x {y} x {z} cells of {channels} channels do not fit into {} bytes",
            bytes.len()
        );
        return Err(error(8, problem));
    }
    let corner = |at: usize| {
        let c = |i: usize| f64::from(f32::from_le_bytes(word(at + 4 * i)));
        DVec3::new(c(0), c(1), c(2))
    };
    let numbers = bytes[HEADER..].chunks_exact(4).take(total.unwrap_or(0));
    let values = numbers.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let (size, bounds) = ([x, y, z], [corner(24), corner(36)]);
    Ok(VolumeFile { size, channels, bounds, values, is_stepped: false, wrap: Wrap::Clamp })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;

    fn bytes(size: [i32; 3], values: &[f32]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        for n in [1, size[0], size[1], size[2], 1] {
            bytes.extend(n.to_le_bytes());
        }
        for x in [0.0f32, 0.0, 0.0, 2.0, 1.0, 1.0].iter().chain(values) {
            bytes.extend(x.to_le_bytes());
        }
        bytes
    }

    /// A volume of many channels, in the unit cube.
    fn colored(size: [i32; 3], channels: i32, values: &[f32]) -> Vec<u8> {
        let mut all = bytes(size, values);
        all[20..24].copy_from_slice(&channels.to_le_bytes());
        all
    }

    #[test]
    fn the_filter_of_a_grid_and_its_way_to_wrap_are_kept() {
        use snell_scene::medium::Medium;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let bytes = colored([2, 1, 1], 1, &[2.0, 4.0]);
        std::fs::write(folder.path().join("density"), bytes).expect("the folder is writable");
        for (filter, wrap, is_stepped, expected) in [
            ("trilinear", "clamp", false, Wrap::Clamp),
            ("nearest", "mirror", true, Wrap::Mirror),
            ("trilinear", "repeat", false, Wrap::Repeat),
        ] {
            let text = format!(
                "<scene version='3.0.0'><shape type='cube'><medium type='heterogeneous' \
                    name='interior'><volume type='gridvolume' name='sigma_t'>\
                <string name='filename' value='density'/>\
                <string name='filter_type' value='{filter}'/>\
                <string name='wrap_mode' value='{wrap}'/></volume></medium></shape></scene>"
            );
            let path = folder.path().join("a.xml");
            std::fs::write(&path, text).expect("the folder is writable");
            let scene =
                crate::read_scene(&path, &ReadOptions::default()).expect("nothing is wrong");
            let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
            let density = &grid.density;
            assert_eq!((density.is_stepped(), density.wrap()), (is_stepped, expected));
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        }
    }

    #[test]
    fn a_medium_fills_the_box_of_its_extinction() {
        use snell_math::ColorMode;
        use snell_scene::medium::Medium;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = colored([2, 1, 1], 1, &[0.25, 0.75]);
        std::fs::write(folder.path().join("albedo"), file).expect("the folder is writable");
        let read = |version: &str| {
            let text = format!(
                "<scene version='{version}'><shape type='cube'><medium type='heterogeneous' \
                    name='interior'><float name='sigma_t' value='2'/><volume type='gridvolume' \
                    name='albedo'><string name='filename' value='albedo'/><boolean \
                    name='use_grid_bbox' value='false'/><transform name='to_world'>\
                    <translate x='-.5'/><scale x='2' y='1' z='1'/></transform></volume></medium>\
                    </shape></scene>"
            );
            let path = folder.path().join("a.xml");
            std::fs::write(&path, text).expect("the folder is writable");
            let scene =
                crate::read_scene(&path, &ReadOptions::default()).expect("nothing is wrong");
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
            let scattered = [-0.9f32, 0.125, 0.25, 0.375, 0.75].map(|x| {
                grid.properties(snell_math::Vec3::new(x, 0.5, 0.5), ColorMode::Rgb).sigma_s[0]
            });
            scattered.map(|s| (s * 1000.0).round() / 1000.0)
        };
        // The albedo is 0.25 at -0.5 and 0.75 at 0.5.
        assert_eq!(read("3.0.0"), [0.0, 1.125, 1.25, 1.375, 1.5]);
        assert_eq!(read("0.6.0")[0], 0.5);
    }

    #[test]
    fn albedos_and_extinctions_on_grids_count_cell_by_cell() {
        use snell_math::{ColorMode, Vec3};
        use snell_scene::medium::Medium;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let files = [
            ("density", colored([2, 1, 1], 1, &[2.0, 4.0])),
            ("colors", colored([2, 1, 1], 3, &[2.0, 1.0, 4.0, 1.0, 0.0, 8.0])),
            ("albedo", colored([2, 1, 1], 3, &[0.5, 0.25, 1.0, 0.0, 2.0, 0.125])),
            ("coarse", colored([1, 1, 1], 3, &[0.5, 0.25, 1.0])),
        ];
        for (name, bytes) in files {
            std::fs::write(folder.path().join(name), bytes).expect("the folder is writable");
        }
        let read = |sigma_t: &str, albedo: &str| {
            let volume = |name: &str, value: &str| match value.parse::<f32>() {
                Ok(_) => format!("<float name=\"{name}\" value=\"{value}\"/>"),
                Err(_) => format!(
                    "<volume type=\"gridvolume\" name=\"{name}\"><string name=\"filename\" \
                        value=\"{value}\"/></volume>"
                ),
            };
            let text = format!(
                "<scene version=\"3.0.0\"><shape type=\"cube\"><medium type=\"heterogeneous\" \
                    name=\"interior\">\
                 <float name=\"scale\" value=\"2\"/>{}{}</medium></shape></scene>",
                volume("sigma_t", sigma_t),
                volume("albedo", albedo)
            );
            let path = folder.path().join("a.xml");
            std::fs::write(&path, text).expect("the folder is writable");
            let scene =
                crate::read_scene(&path, &ReadOptions::default()).expect("nothing is wrong");
            let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
            let at = |x: f32| {
                let p = grid
                    .world_from_grid
                    .transform_point3(DVec3::new(f64::from(x), 0.5, 0.5))
                    .as_vec3();
                let m = grid.properties(p, ColorMode::Rgb);
                [m.sigma_a, m.sigma_s].map(|s| Vec3::new(s[0], s[1], s[2]))
            };
            ([at(0.25), at(0.75)].concat(), scene.warnings.len())
        };
        let close = |found: (Vec<Vec3>, usize), expected: [[f32; 3]; 4], warnings: usize| {
            let expected = expected.map(Vec3::from_array);
            assert!(
                found.0.iter().zip(expected).all(|(a, b)| a.abs_diff_eq(b, 1e-4)),
                "{found:?} is not {expected:?}"
            );
            assert_eq!(found.1, warnings);
        };
        let half = |a: [f32; 3], b: [f32; 3]| [a, a, b, b];
        close(read("density", "0.5"), half([2.0; 3], [4.0; 3]), 0);
        close(
            read("density", "albedo"),
            [[2.0, 3.0, 0.0], [2.0, 1.0, 4.0], [8.0, 0.0, 7.0], [0.0, 8.0, 1.0]],
            0,
        );
        close(
            read("3", "albedo"),
            [[3.0, 4.5, 0.0], [3.0, 1.5, 6.0], [6.0, 0.0, 5.25], [0.0, 6.0, 0.75]],
            0,
        );
        close(read("colors", "0.5"), half([2.0, 1.0, 4.0], [1.0, 0.0, 8.0]), 0);
        close(
            read("colors", "albedo"),
            [[2.0, 1.5, 0.0], [2.0, 0.5, 8.0], [2.0, 0.0, 14.0], [0.0, 0.0, 2.0]],
            0,
        );
        // The grids differ: the extinction becomes grey.
        assert_eq!(read("colors", "coarse").1, 1);
    }

    fn read(bytes: Vec<u8>) -> Result<VolumeFile, String> {
        let input =
            Input::from_bytes("a.vol", bytes, std::path::Path::new("."), &ReadOptions::default());
        read_volume(&input).map_err(|e| e.to_string())
    }

    #[test]
    fn volumes_have_their_cells_and_damaged_ones_are_errors() {
        let volume = read(bytes([2, 1, 1], &[1.0, 3.0])).expect("a volume");
        assert_eq!((volume.size, volume.mean().r, volume.bounds[1].x), ([2, 1, 1], 2.0, 2.0));
        for (damaged, part) in [
            (b"VOL\x02".to_vec(), "not a volume"),
            (bytes([2, 1, 1], &[1.0]), "do not fit"),
            (bytes([0, 1, 1], &[]), "0 cells"),
            (bytes([i32::MAX, i32::MAX, i32::MAX], &[]), "do not fit"),
        ] {
            let message = read(damaged).expect_err("damaged");
            assert!(message.contains(part), "{message}");
        }
    }
}
