//! The receipts of pictures: what `snell verify` needs to render parts of them again.

use crate::camera::Camera as PyCamera;
use crate::graph::{Purpose, graph};
use crate::origins::ID_AOVS;
use crate::render::Task;
use crate::settings::Keywords;
use pyo3::prelude::*;
use snell_formats::scene::snell::text;
use snell_math::DVec3;
use snell_persist::{Receipt, camera_definitions};
use snell_render::{Denoise, Film, Request, memory};
use std::time::Duration;

/// The scene is hashed as the file that `Scene.save` writes. So many of its bytes take a second.
const HASHED_PER_SECOND: f64 = 2e8;

/// The hash may take this share of the time of the render, or this time.
const SHARE: f64 = 0.05;
const BRIEF: Duration = Duration::from_millis(5);

/// The options of `snell render` that give the picture of a task from the scene's file; `None` if
/// there are none: if the scene is moved near zero, or if layers have the ids of Python's objects.
pub fn arguments(task: &Task, keywords: &Keywords<'_, '_>) -> PyResult<Option<Vec<String>>> {
    let Task { prepared, camera, request, .. } = task;
    let shutter: Option<[f64; 2]> = keywords.get("shutter", "two times, (open, close)")?;
    let has_ids = request.aovs.iter().flatten().any(|aov| ID_AOVS.contains(aov));
    if prepared.moved_by != DVec3::ZERO || has_ids {
        return Ok(None);
    }
    let denoise = request.denoise.as_ref().map(|_| Denoise::Found);
    let request = Request { denoise, bvh_cache: None, simd: None, ..request.clone() };
    let mut all = request.arguments();
    let cameras = &prepared.scene.cameras;
    match keywords.any("camera")? {
        Some(given) if given.is_instance_of::<PyCamera>() => {
            let Some(first) = cameras.first() else { return Ok(None) };
            let definitions = camera_definitions(0, first, camera, false);
            all.extend(definitions.iter().map(|definition| format!("--define={definition}")));
        }
        Some(_) => {
            let Some(number) = cameras.iter().position(|known| known == camera) else {
                return Ok(None);
            };
            all.push(format!("--camera={number}"));
        }
        None => {}
    }
    if let Some([open, close]) = shutter {
        all.extend(["--at=0".into(), format!("--shutter={open}..{close}")]);
    }
    if let Some(name) = keywords.get::<String>("tonemap", "a name")? {
        all.push(format!("--tonemap={name}"));
    }
    Ok(Some(all))
}

/// The receipt of a film that was rendered in this time; `None` if the scene is so large that its
/// hash would take long beside that, or if the picture shows things that move without their motion.
pub fn of_film(task: &Task, arguments: &[String], film: &Film, seconds: f64) -> Option<Receipt> {
    let Task { prepared, contents, .. } = task;
    let hashed = || {
        let scene = graph(contents, Purpose::File).ok()?;
        let is_still = scene.motion.is_some() && !arguments.iter().any(|a| a.starts_with("--at="));
        let cost = memory::of_scene(&scene) as f64 / HASHED_PER_SECOND;
        if is_still || cost > BRIEF.as_secs_f64().max(SHARE * seconds) {
            return None;
        }
        Some(Receipt::hash_of_file(text(&scene).ok()?.as_bytes()))
    };
    let hash = match prepared.file_hash.get() {
        Some(known) => known.clone(),
        None => {
            let hash = hashed()?;
            prepared.file_hash.get_or_init(|| hash).clone()
        }
    };
    let name = format!("{}.snell", prepared.scene.name);
    Some(Receipt::new(name, hash, arguments.to_vec()).of_film(film))
}
