//! All on which a picture depends.

use crate::guiding::Guiding;
use crate::integrator::aov::Aov;
use crate::integrator::light_part::LightSource;
use crate::sampler::SamplerKind;
use crate::settings::{CausticsMode, Crop, LightGroup, Settings};
use snell_math::Rgb;
use std::fmt::Display;

/// One thing on which the picture depends: what it is, such as `--seed`, and its value.
pub type Fact = (String, String);

/// The fact that names the picture of an animation.
pub const FRAME: &str = "the frame";

/// How the camera moves while the shutter is open.
const CAMERA_MOTION: &str = "the motion of the camera";

/// What may differ between the pictures of one animation.
pub(super) const OF_FRAME: [&str; 2] = [FRAME, CAMERA_MOTION];

/// A fact with this value; `None` if there is none.
pub fn fact(name: &str, value: Option<impl Display>) -> Option<Fact> {
    value.map(|value| (name.into(), value.to_string()))
}

/// Everything in the settings on which the bits of the picture depend, with the names and values of
/// the command's options.
pub fn facts(settings: &Settings) -> Vec<Fact> {
    // Every field is named here, so that a new one is not forgotten.
    let Settings {
        size,
        crop,
        spp,
        noise,
        noise_floor,
        progressive: _,
        seed,
        sampler,
        later_cameras,
        filter,
        pixel_position,
        sensor,
        integrator,
        color,
        max_depth,
        roulette_depth,
        shadows,
        terminator,
        light_strategy,
        light_sampler,
        guiding,
        caustics,
        photons,
        fill,
        ao_distance,
        clamp,
        light_groups,
        aovs,
        tile_order: _,
        build: _,
    } = settings;
    let mut facts = Vec::new();
    let mut add = |name: &str, value: &dyn Display| facts.extend(fact(name, Some(value)));
    add("--size", &format_args!("{}x{}", size[0], size[1]));
    if let Some(Crop { min, max }) = crop {
        add("--crop", &format_args!("{},{},{},{}", min[0], min[1], max[0], max[1]));
    }
    // Points of a set depend on the size of the set, and pixels are judged by their error at the
    // last sample too.
    match (noise, sampler) {
        (Some(_), _) | (None, SamplerKind::Stratified) => add("--spp", spp),
        (None, SamplerKind::Sobol | SamplerKind::ZSobol) => {
            add("--spp (as the next power of two)", &spp.next_power_of_two());
        }
        (None, SamplerKind::Independent) => {}
    }
    if let Some(noise) = noise {
        add("--noise", noise);
        add("the floor of --noise by --exposure", noise_floor);
    }
    add("--seed", seed);
    add("--sampler", &sampler.name());
    if !later_cameras.is_empty() {
        add(CAMERA_MOTION, &format_args!("{later_cameras:?}"));
    }
    add("--filter", &filter.name());
    if let Some([x, y]) = pixel_position {
        add("the position in the pixel", &format_args!("{x},{y}"));
    }
    if let Some(sensor) = sensor {
        add("the sensor", sensor);
    }
    add("--integrator", &integrator.name());
    add("--color", &color.name());
    add("--max-depth", max_depth);
    if let Some(depth) = roulette_depth {
        add("--roulette-depth", depth);
    }
    add("--shadows", &shadows.name());
    add("--terminator", &terminator.name());
    add("--light-samples", &light_strategy.name());
    add("--light-sampler", &light_sampler.name());
    if let Some(Guiding { passes, photons }) = guiding {
        let photons = match *photons {
            Guiding::PHOTONS => String::new(),
            photons => format!(" ({photons} photons)"),
        };
        add("--guiding", &format_args!("{passes}{photons}"));
    }
    if *caustics != CausticsMode::Off {
        add("--caustics", &caustics.name());
        if let Some(photons) = photons {
            add("--photons", photons);
        }
    }
    if *fill != Rgb::BLACK {
        let [r, g, b] = fill.to_array();
        add("the light from everywhere", &format_args!("{r},{g},{b}"));
    }
    if let Some(distance) = ao_distance {
        add("--ao-distance", distance);
    }
    if let Some(clamp) = clamp {
        add("--clamp", clamp);
    }
    if !light_groups.is_empty() {
        add("--light-group", &texts(light_groups, " --light-group ", group));
    }
    // Light groups bring further layers, which have no names on the command line.
    let named: Vec<Aov> = aovs.iter().copied().filter(|aov| Aov::ALL.contains(aov)).collect();
    if !named.is_empty() {
        add("--aov", &texts(&named, ",", |aov| aov.name().into()));
    }
    facts
}

/// The texts of some things, with a separator between them.
fn texts<T>(things: &[T], separator: &str, text: impl Fn(&T) -> String) -> String {
    things.iter().map(text).collect::<Vec<_>>().join(separator)
}

/// A light group as the option says it, but for materials, which have numbers here.
fn group(LightGroup { name, sources }: &LightGroup) -> String {
    let source = |source: &LightSource| match source {
        LightSource::Light(number) => number.to_string(),
        LightSource::Material(id) => format!("material {}", id.index()),
        LightSource::Environment => "environment".into(),
        LightSource::Medium => "medium".into(),
    };
    format!("{name}={}", texts(sources, ",", source))
}
