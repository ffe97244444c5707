//! Participating media.

use super::Builder;
use super::lexer::{Lexer, quoted};
use super::params::{Params, Type};
use super::spectrum::Role;
use crate::scene::fault::{Fault, Spot};
use crate::scene::nanovdb::Volumes;
use crate::scene::scattering;
use snell_math::{DAffine3, DVec3, Rgb};
use snell_scene::graph::MediumId;
use snell_scene::material::Interior;
use snell_scene::medium::{
    CellGrid, CellValue, Cloud, ColorGrid, Grid, Homogeneous, Medium, ScalarGrid,
    blackbody_luminance,
};
use snell_scene::texture::Wrap;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// The media of a scene.
#[derive(Debug, Default)]
pub struct Media {
    /// Media by name; `None` for one that became clear air.
    named: HashMap<String, Option<MediumId>>,
    /// Media that surfaces name before they are defined, with the ids that surfaces have in their
    /// place until the end of the file: from the largest downwards.
    awaited: HashMap<Rc<str>, MediumId>,
    /// Where `MediumInterface` names a medium that is not defined so far.
    unknown: Vec<(Rc<str>, Spot)>,
    /// The medium around the camera.
    pub around_camera: Option<Rc<str>>,
    /// Names of media that are the interior of some shape.
    inside: HashSet<Rc<str>>,
}

/// Absorption and scattering of media of version 3 by default.
const MEDIUM_OF_VERSION_3: (Rgb, Rgb) =
    (Rgb::new(0.0011, 0.0024, 0.014), Rgb::new(2.55, 3.21, 3.77));

/// The coefficients of a medium, without its density.
struct Coefficients {
    sigma_a: Rgb,
    sigma_s: Rgb,
    emission: Rgb,
    g: f32,
}

impl Builder<'_> {
    /// Reads `MakeNamedMedium "name" "string type" "homogeneous" ...`.
    pub(super) fn make_named_medium(&mut self, params: Params) -> Result<(), Fault> {
        let name = params.owner.strip_prefix("MakeNamedMedium \"").unwrap_or_default();
        let name = name.strip_suffix('"').unwrap_or(name).to_string();
        let Some(kind) = params.string("type")?.map(str::to_string) else {
            return Err(params
                .fault("there is no type", "add \"string type\" [ \"homogeneous\" ] or the like"));
        };
        let params = params.of(format!("Medium {}", quoted(kind.as_bytes())));
        let medium: Option<Medium> = match kind.as_str() {
            "homogeneous" => {
                let preset = self.preset(&params)?;
                let Coefficients { sigma_a, sigma_s, emission, g } =
                    self.coefficients(&params, preset)?;
                Some(Homogeneous { sigma_a, sigma_s, emission, g }.into())
            }
            "uniformgrid" => Some(self.grid(&params, (Rgb::WHITE, Rgb::WHITE))?.into()),
            // The name of version 3, where colours are those of a preset.
            "heterogeneous" => {
                self.is_v3 = true;
                let preset = match params.get("preset") {
                    Some(_) => self.preset(&params)?,
                    None => MEDIUM_OF_VERSION_3,
                };
                Some(self.grid(&params, preset)?.into())
            }
            "rgbgrid" => Some(self.rgb_grid(&params)?.into()),
            "nanovdb" => Some(self.nanovdb(&params)?.into()),
            "cloud" => Some(self.cloud(&params)?.into()),
            _ => None,
        };
        if medium.is_none() {
            let what = params.owner.clone();
            self.note(what.clone(), params.at, || {
                format!("{what} is not supported; it became clear air")
            });
        } else {
            self.note_unused(&params);
        }
        let id = medium.map(|medium| self.scene.add_medium(medium));
        self.media.named.insert(name, id);
        Ok(())
    }

    /// Reads absorption, scattering and emission; emission is proportional to absorption.
    fn coefficients(
        &mut self,
        params: &Params,
        default: (Rgb, Rgb),
    ) -> Result<Coefficients, Fault> {
        let mut color = |name: &str, default: Rgb, role: Role| -> Result<Rgb, Fault> {
            let kinds = [Type::Rgb, Type::Spectrum, Type::Blackbody, Type::Xyz];
            match params.typed(name, &kinds)? {
                Some(param) => self.color(param, role),
                None => Ok(default),
            }
        };
        let (sigma_a, sigma_s) = (
            color("sigma_a", default.0, Role::Factor)?,
            color("sigma_s", default.1, Role::Factor)?,
        );
        let le = color("Le", Rgb::BLACK, Role::Light)?;
        let scale = params.float_or("scale", 1.0)? as f32;
        let le_scale = match params.floats("Lescale")? {
            [] => 1.0,
            [one] => *one as f32,
            // A number for each cell; see `grid`.
            _ => 1.0,
        };
        let sigma_a = sigma_a * scale;
        let g = params.float_or("g", 0.0)? as f32;
        Ok(Coefficients { sigma_a, sigma_s: sigma_s * scale, emission: sigma_a * le * le_scale, g })
    }

    /// A grid of densities, for these coefficients of absorption and scattering where the file has
    /// none.
    fn grid(&mut self, params: &Params, default: (Rgb, Rgb)) -> Result<Grid, Fault> {
        let Coefficients { sigma_a, sigma_s, emission, g } = self.coefficients(params, default)?;
        let size = cells(params)?;
        let density: Vec<f32> = params.floats("density")?.iter().map(|d| *d as f32).collect();
        let found = density.len();
        let Some(density) = fading(ScalarGrid::new(size, density)) else {
            let problem =
                format!("{found} densities for a grid of {} x {} x {}", size[0], size[1], size[2]);
            return Err(params.fault(problem, "give one for each cell in \"float density\""));
        };
        let scales: Vec<f32> = params.floats("Lescale")?.iter().map(|l| *l as f32).collect();
        let world_from_grid = self.world_from_box(params)?;
        let grid = Grid { emission, ..Grid::new(sigma_a, sigma_s, g, density, world_from_grid) };
        let kelvin: Vec<f32> = params.floats("temperature")?.iter().map(|t| *t as f32).collect();
        if kelvin.is_empty() {
            // Emission is proportional to absorption, so the density counts too.
            let glow = (scales.len() > 1)
                .then(|| grid.density.values().iter().zip(&scales).map(|(d, l)| d * l).collect());
            let emission_scale =
                glow.and_then(|glow: Vec<f32>| fading(ScalarGrid::new(size, glow))).map(Arc::new);
            return Ok(Grid { emission_scale, ..grid });
        }
        let found = kelvin.len();
        let Some(kelvin) = ScalarGrid::new(size, kelvin) else {
            let problem = format!(
                "{found} temperatures for a grid of {} x {} x {}",
                size[0], size[1], size[2]
            );
            return Err(params.fault(problem, "give one for each cell in \"float temperature\""));
        };
        let one = scales.first().copied().unwrap_or(1.0);
        hot(params, grid, &kelvin, |cell| scales.get(cell).copied().unwrap_or(one))
    }

    /// A grid from a file.
    fn nanovdb(&mut self, params: &Params) -> Result<Grid, Fault> {
        let Some((name, at)) = self.file_name(params, "filename")? else {
            return Err(params.fault("there is no file name", "add \"string filename\""));
        };
        let input = self.open(name, at)?;
        let volumes = Volumes::of(&input)?;
        let density = params.string("gridname")?.unwrap_or("density");
        let Some(volume) = volumes.volume(density)? else {
            let names =
                volumes.names().map(|name| quoted(name.as_bytes())).collect::<Vec<_>>().join(", ");
            let problem =
                format!("the file has no grid {}; it has {names}", quoted(density.as_bytes()));
            return Err(Fault::new(at, problem, "give one of them as \"string gridname\""));
        };
        let Coefficients { sigma_a, sigma_s, g, .. } =
            self.coefficients(params, (Rgb::WHITE, Rgb::WHITE))?;
        let kelvin = volumes.volume(params.string("temperaturename")?.unwrap_or("temperature"))?;
        let kelvin = kelvin.map(|kelvin| kelvin.over(&volume));
        let world_from_grid =
            self.world_from_file * self.placement(params.at) * volume.world_from_grid;
        let grid = Grid::new(sigma_a, sigma_s, g, volume.grid, world_from_grid);
        let scale = params.float_or("Lescale", params.float_or("LeScale", 1.0)?)? as f32;
        match kelvin {
            Some(kelvin) => hot(params, grid, &kelvin, |_| scale),
            None => Ok(grid),
        }
    }

    /// Coefficients for each cell and colour.
    fn rgb_grid(&mut self, params: &Params) -> Result<Grid, Fault> {
        let size = cells(params)?;
        let scale = params.float_or("scale", 1.0)? as f32;
        let le_scale = params.float_or("Lescale", params.float_or("LeScale", 1.0)?)? as f32;
        let list = |name: &str| -> Result<Vec<Rgb>, Fault> {
            let numbers = params.typed(name, &[Type::Rgb])?.map_or(&[][..], |p| p.numbers());
            Ok(numbers
                .chunks_exact(3)
                .map(|c| Rgb::new(c[0] as f32, c[1] as f32, c[2] as f32))
                .collect())
        };
        let (absorbed, scattered, mut emitted) = (list("sigma_a")?, list("sigma_s")?, list("Le")?);
        if absorbed.is_empty() && scattered.is_empty() {
            let remedy = "give one for each cell in \"rgb sigma_a\" or \"rgb sigma_s\"";
            return Err(params.fault("a grid without colours", remedy));
        }
        // Emission is proportional to absorption.
        for (light, absorbed) in emitted.iter_mut().zip(&absorbed) {
            *light = *light * *absorbed;
        }
        let tint = |name: &str, values: Vec<Rgb>, scale: f32| {
            if values.is_empty() {
                return Ok((Rgb::splat(scale), None));
            }
            let largest = values.iter().map(|c| c.r.max(c.g).max(c.b)).fold(0.0, f32::max);
            let share = if largest > 0.0 && largest.is_finite() { largest } else { 1.0 };
            let found = values.len();
            let shares = values.into_iter().map(|c| c * (1.0 / share)).collect();
            let Some(grid) = fading(ColorGrid::new(size, shares)) else {
                let problem = format!(
                    "{found} colours for a grid of {} x {} x {}",
                    size[0], size[1], size[2]
                );
                return Err(
                    params.fault(problem, format!("give one for each cell in \"rgb {name}\""))
                );
            };
            Ok((Rgb::splat(share * scale), Some(Arc::new(grid))))
        };
        // Missing grids are 1 everywhere, except for emission.
        let emits = !emitted.is_empty();
        let (emission, emission_tint) = tint("Le", emitted, le_scale * scale)?;
        let (sigma_a, sigma_a_tint) = tint("sigma_a", absorbed, scale)?;
        let (sigma_s, sigma_s_tint) = tint("sigma_s", scattered, scale)?;
        let g = params.float_or("g", 0.0)? as f32;
        let whole = ScalarGrid::new([1; 3], vec![1.0]).unwrap_or_default();
        Ok(Grid {
            emission: if emits { emission } else { Rgb::BLACK },
            sigma_a_tint,
            sigma_s_tint,
            emission_tint,
            ..Grid::new(sigma_a, sigma_s, g, whole, self.world_from_box(params)?)
        })
    }

    /// Absorption and scattering of the preset that the file names; whole milk by default.
    fn preset(&mut self, params: &Params) -> Result<(Rgb, Rgb), Fault> {
        let name = params.string("preset")?.unwrap_or_default();
        let known = scattering::named(if name.is_empty() { "wholemilk" } else { name });
        if known.is_none() {
            let name = quoted(name.as_bytes());
            self.note(format!("medium preset {name}"), params.at, || {
                format!("the medium {name} has no table here; milk was used instead")
            });
        }
        let known = known.or_else(|| scattering::named("wholemilk"));
        Ok(known.map_or((Rgb::BLACK, Rgb::WHITE), |k| (k.sigma_a, k.sigma_s)))
    }

    /// The transform from the unit cube to the box between `p0` and `p1` in the world.
    fn world_from_box(&mut self, params: &Params) -> Result<DAffine3, Fault> {
        let (p0, p1) =
            (params.point("p0")?.unwrap_or(DVec3::ZERO), params.point("p1")?.unwrap_or(DVec3::ONE));
        let box_of_medium = DAffine3::from_translation(p0) * DAffine3::from_scale(p1 - p0);
        Ok(self.world_from_file * self.placement(params.at) * box_of_medium)
    }

    fn cloud(&mut self, params: &Params) -> Result<Cloud, Fault> {
        let Coefficients { sigma_a, sigma_s, g, .. } =
            self.coefficients(params, (Rgb::WHITE, Rgb::WHITE))?;
        let density = params.float_or("density", 1.0)? as f32;
        let frequency = params.float_or("frequency", 5.0)?.clamp(1.0, 100.0) as f32;
        params.get("wispiness");
        self.note("cloud", params.at, || {
            "a cloud with different noise than pbrt's: its shape differs".into()
        });
        Ok(Cloud {
            sigma_a: sigma_a * density,
            g,
            lumps: 1.0 / frequency,
            world_from_cloud: self.world_from_box(params)?,
            ..Cloud::new(DVec3::ZERO, DVec3::ONE, sigma_s * density, 0)
        })
    }

    /// Reads `MediumInterface "inside" "outside"`. As in pbrt-v4, the media may be defined later.
    pub(super) fn medium_interface(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (inside, at) = lexer.expect_string("the name of the medium inside")?;
        let (outside, outside_at) = if lexer.string_follows() {
            lexer.expect_string("the name of the medium outside")?
        } else {
            (inside, at)
        };
        self.state.media = [inside.into(), outside.into()];
        for (name, at) in self.state.media.iter().zip([at, outside_at]) {
            if !name.is_empty() && !self.media.named.contains_key(&**name) {
                self.media.unknown.push((name.clone(), at));
            }
        }
        Ok(())
    }

    /// The interior of a surface in the current media; `None` if it bounds no medium.
    pub(super) fn interior(&mut self) -> Option<Interior> {
        let [inside, outside] = &self.state.media;
        if inside == outside {
            return None;
        }
        if inside.is_empty() {
            return Some(Interior::default());
        }
        if !self.media.inside.contains(inside) {
            self.media.inside.insert(inside.clone());
        }
        let medium = self.media.named.get(&**inside).copied().unwrap_or_else(|| {
            let next = MediumId(u32::MAX - self.media.awaited.len() as u32);
            Some(*self.media.awaited.entry(inside.clone()).or_insert(next))
        });
        Some(Interior { medium, ..Interior::default() })
    }

    /// Gives surfaces the media that were defined after them, warns of media that are not defined
    /// at all, and makes the medium around the camera that of the whole scene, unless the medium is
    /// also an interior: then the renderer determines where the camera is.
    pub(super) fn finish_media(&mut self) {
        for (name, at) in std::mem::take(&mut self.media.unknown) {
            if self.media.named.contains_key(&*name) {
                continue;
            }
            let name = quoted(name.as_bytes());
            self.note(format!("no medium {name}"), at, || {
                format!(
                    "there is no medium {name} in the scene; it is empty: define it with \
                    MakeNamedMedium"
                )
            });
        }
        let named = |name: &Rc<str>| self.media.named.get(&**name).copied().flatten();
        let defined: HashMap<MediumId, Option<MediumId>> =
            self.media.awaited.iter().map(|(name, id)| (*id, named(name))).collect();
        for interior in self.scene.materials.iter_mut().filter_map(|m| m.interior.as_mut()) {
            if let Some(medium) = interior.medium.and_then(|id| defined.get(&id)) {
                interior.medium = *medium;
            }
        }
        if let Some(name) = &self.media.around_camera
            && !self.media.inside.contains(name)
        {
            self.scene.medium = named(name);
        }
    }
}

/// A grid that fades to nothing over the outer halves of its outermost cells, as pbrt's
/// `SampledGrid` does.
fn fading<T: CellValue>(grid: Option<CellGrid<T>>) -> Option<CellGrid<T>> {
    grid.map(|grid| grid.wrapped(Wrap::Black))
}

/// A grid that emits by its temperatures. Hot cells emit in proportion to absorption, as a black
/// body whose maximum radiance is 1, times a scale.
fn hot(
    params: &Params,
    grid: Grid,
    kelvin: &ScalarGrid,
    scale: impl Fn(usize) -> f32,
) -> Result<Grid, Fault> {
    // Colder cells do not emit.
    const COLDEST: f64 = 100.0;
    let offset =
        params.float_or("temperatureoffset", params.float_or("temperaturecutoff", 0.0)?)?;
    let factor = params.float_or("temperaturescale", 1.0)?;
    let glowing = |t: &f32| {
        Some((f64::from(*t) - offset) * factor).filter(|t| *t > COLDEST).unwrap_or(0.0) as f32
    };
    let kelvin: Vec<f32> = kelvin.values().iter().map(glowing).collect();
    let glow = |(cell, (density, kelvin)): (usize, (&f32, &f32))| {
        density * scale(cell) * blackbody_luminance(*kelvin)
    };
    let glow: Vec<f32> = grid.density.values().iter().zip(&kelvin).enumerate().map(glow).collect();
    let density = &grid.density;
    let of = |values| {
        ScalarGrid::new(density.size(), values).map(|made| Arc::new(made.wrapped(density.wrap())))
    };
    Ok(Grid { emission: grid.sigma_a, emission_scale: of(glow), temperature: of(kelvin), ..grid })
}

/// Cells along x, y and z.
fn cells(params: &Params) -> Result<[usize; 3], Fault> {
    let mut size = [1; 3];
    for (cells, name) in size.iter_mut().zip(["nx", "ny", "nz"]) {
        let count = params.integer(name)?.unwrap_or(1);
        *cells = usize::try_from(count).ok().filter(|n| *n > 0).ok_or_else(|| {
            params.fault(
                format!("{name} is {count}, but a grid has at least one cell"),
                "write a whole number above 0",
            )
        })?;
    }
    Ok(size)
}
