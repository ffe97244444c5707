//! Participating media.

use super::Builder;
use super::color;
use super::object::Object;
use super::value::Value;
use crate::scene::fault::Fault;
use crate::scene::scattering::{self, Coefficients};
use crate::{Input, Place, ReadError};
use snell_math::{DAffine3, DVec3, Rgb};
use snell_scene::MediumId;
use snell_scene::medium::{Grid, Homogeneous, ScalarGrid};
use std::collections::HashMap;
use std::rc::Rc;

/// The media of a scene.
#[derive(Debug, Default)]
pub struct Media {
    known: HashMap<*const Object, Option<MediumId>>,
    /// Media that are inside of something.
    pub inside: Vec<MediumId>,
}

/// A volume: the same everywhere, or on a grid.
enum Volume {
    Constant(Rgb),
    Grid(VolumeFile, DAffine3),
}

/// The content of a volume file.
#[derive(Debug, PartialEq)]
pub struct VolumeFile {
    size: [usize; 3],
    channels: usize,
    bounds: [DVec3; 2],
    values: Vec<f32>,
}

impl Builder<'_> {
    /// A medium; `None` for one that became clear air.
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
                self.note(owner.clone(), object.at, || format!("{owner} is not supported; it became clear air"));
                None
            }
        };
        for name in ["sample_emitters", "has_spectral_extinction", "majorant_resolution_factor", "method", "step_size"]
        {
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
                self.note(owner.clone(), phase.at, || format!("{owner}: light is scattered evenly instead"));
                0.0
            }
        };
        self.note_unused(&phase);
        Ok(g as f32)
    }

    /// Scale, and what it applies to: extinction and albedo, or absorption and scattering.
    fn homogeneous(&mut self, object: &Object, g: f32) -> Result<MediumId, Fault> {
        let scale = object.float_or("scale", 1.0)? as f32;
        if let Some((name, at)) = object.string("material")? {
            if let Some(Coefficients { sigma_a, sigma_s }) = scattering::named(name) {
                let plain = Homogeneous { sigma_a: sigma_a * scale, sigma_s: sigma_s * scale, emission: Rgb::BLACK, g };
                return Ok(self.scene.add_medium(plain));
            }
            let name = super::value::shortened(name);
            self.note("medium preset", at, || {
                format!("the medium \"{name}\" has no table here; sigma_t and albedo were used, or their defaults")
            });
        }
        if object.has("sigma_a") || object.has("sigma_s") {
            let sigma_a = self.volume_color(object, "sigma_a", 1.0)? * scale;
            let sigma_s = self.volume_color(object, "sigma_s", 1.0)? * scale;
            return Ok(self.scene.add_medium(Homogeneous { sigma_a, sigma_s, emission: Rgb::BLACK, g }));
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
        let albedo = self.volume_color(object, "albedo", 0.75)?;
        let name = if object.has("density") { "density" } else { "sigma_t" };
        let emission = self.volume_color(object, "emission", 0.0)?;
        Ok(match self.volume(object, name)? {
            None | Some(Volume::Constant(_)) => {
                let sigma_t = self.volume_color(object, name, 1.0)? * scale;
                let plain = Homogeneous::scattering(sigma_t, albedo, g);
                Some(self.scene.add_medium(Homogeneous { emission, ..plain }))
            }
            Some(Volume::Grid(file, world_from_grid)) => {
                let Some(density) = file.scalar() else { return Ok(None) };
                let sigma_s = albedo * scale;
                let sigma_a = Rgb::splat(scale) + sigma_s * -1.0;
                let grid = Grid { emission, ..Grid::new(sigma_a, sigma_s, g, density, world_from_grid) };
                Some(self.scene.add_medium(grid))
            }
        })
    }

    fn volume(&mut self, object: &Object, name: &str) -> Result<Option<Volume>, Fault> {
        if let Some(property) = object.get(name) {
            return match property.value {
                Value::Color(hue) => Ok(Some(Volume::Constant(color::factor(hue)))),
                Value::Float(x) => Ok(Some(Volume::Constant(Rgb::splat(x as f32)))),
                Value::Integer(x) => Ok(Some(Volume::Constant(Rgb::splat(x as f32)))),
                _ => Err(property.fault("this is neither a colour nor a number", "give one, or a volume")),
            };
        }
        let Some(volume) = self.child_named(object, name)? else { return Ok(None) };
        let read = match volume.kind.as_str() {
            "constvolume" => {
                let value = if volume.has("value") { "value" } else { "color" };
                Volume::Constant(self.constant(&volume, value)?.unwrap_or(Rgb::WHITE))
            }
            "gridvolume" => self.grid_volume(&volume)?,
            _ => {
                let owner = volume.owner();
                self.ignore_all(&volume);
                self.note(owner.clone(), volume.at, || format!("{owner} is not supported; 1 was used everywhere"));
                Volume::Constant(Rgb::WHITE)
            }
        };
        self.note_unused(&volume);
        Ok(Some(read))
    }

    fn grid_volume(&mut self, volume: &Object) -> Result<Volume, Fault> {
        let (name, at) = volume.file_name()?;
        let file = read_volume(&self.open(name, at)?)?;
        for name in ["raw", "filter_type", "wrap_mode", "accel", "max_value"] {
            volume.get(name);
        }
        let mut world_from_grid = self.world_from_file * volume.transform("to_world")?;
        if volume.bool_or("use_grid_bbox", self.version.starts_with("0."))? {
            let [low, high] = file.bounds;
            world_from_grid *= DAffine3::from_translation(low) * DAffine3::from_scale(high - low);
        }
        Ok(Volume::Grid(file, world_from_grid))
    }

    /// The medium around the camera is everywhere, unless it is the inside of something: then the renderer finds out.
    pub(super) fn camera_medium(&mut self, medium: Option<MediumId>) {
        self.scene.medium = medium.filter(|m| !self.media.inside.contains(m));
    }
}

impl VolumeFile {
    fn mean(&self) -> Rgb {
        let cells = (self.values.len() / self.channels).max(1) as f64;
        let channel = |c: usize| {
            let c = c.min(self.channels - 1);
            let sum: f64 = self.values.iter().skip(c).step_by(self.channels).map(|v| f64::from(*v)).sum();
            (sum / cells) as f32
        };
        Rgb::new(channel(0), channel(1), channel(2))
    }

    /// One number for each cell: the mean of the channels.
    fn scalar(&self) -> Option<ScalarGrid> {
        let mean = |cell: &[f32]| cell.iter().sum::<f32>() / self.channels as f32;
        ScalarGrid::new(self.size, self.values.chunks_exact(self.channels).map(mean).collect())
    }
}

/// Reads a volume: `VOL`, version 3, single-precision numbers on a grid, x first.
fn read_volume(input: &Input) -> Result<VolumeFile, ReadError> {
    const HEADER: usize = 48;
    let bytes = &input.bytes;
    let error = |at: usize, problem: String| input.error(Place::Byte(at as u64), problem, "export the volume again");
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
        let problem = format!("{x} x {y} x {z} cells of {channels} channels do not fit into {} bytes", bytes.len());
        return Err(error(8, problem));
    }
    let corner = |at: usize| {
        let c = |i: usize| f64::from(f32::from_le_bytes(word(at + 4 * i)));
        DVec3::new(c(0), c(1), c(2))
    };
    let numbers = bytes[HEADER..].chunks_exact(4).take(total.unwrap_or(0));
    let values = numbers.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Ok(VolumeFile { size: [x, y, z], channels, bounds: [corner(24), corner(36)], values })
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

    fn read(bytes: Vec<u8>) -> Result<VolumeFile, String> {
        let input = Input::from_bytes("a.vol", bytes, std::path::Path::new("."), &ReadOptions::default());
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
