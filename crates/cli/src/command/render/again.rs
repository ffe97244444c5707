//! Pictures that are made again from their receipts.

use super::output::{Output, Target};
use super::receipt;
use super::stage::Stage;
use super::{Merged, Options, Session, frames, load};
use crate::failure::Failure;
use crate::{interrupt, scene_source};
use snell_math::simd::Level;
use snell_persist::Receipt;
use snell_scene::Scene;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// The scene that a receipt names: the file beside `picture`, or else in the current folder.
pub fn named_scene(receipt: &Receipt, picture: &Path) -> PathBuf {
    let named = PathBuf::from(&receipt.scene);
    let beside = picture.parent().unwrap_or(Path::new("")).join(&named);
    if beside.exists() { beside } else { named }
}

/// The options of a receipt, and its scene at `path`.
///
/// # Errors
/// If the scene, or a file that it names, is not the one of the receipt.
pub fn scene_of(of: &Receipt, path: &Path) -> Result<(Options, Scene), Failure> {
    let render_options = receipt::options_of(path, &of.arguments)?.recording_sources();
    let scene = match path.exists() || scene_source::is_builtin(path) {
        true => load(&render_options)?,
        false => {
            return Err(Failure::Usage(format!(
                "{}: the scene of the picture is not there; name it with --scene",
                path.display()
            )));
        }
    };
    let found = receipt::scene_sha256(&render_options);
    if found != of.scene_sha256 {
        return Err(Failure::Usage(format!(
            "{}: this scene, or a file that it names, is not the one of the picture (SHA-256 {}, \
             and {} in the receipt); name that with --scene",
            path.display(),
            &found[..16],
            of.scene_sha256.get(..16).unwrap_or_default()
        )));
    }
    Ok((render_options, scene))
}

/// Writes one picture again, of a film that is rendered elsewhere: that with the number of its
/// receipt.
pub fn one(options: &Options, scene: Scene, merged: &Merged) -> Result<(), Failure> {
    interrupt::end_at_once("interrupted: the picture was not checked");
    let stage = &mut Stage::new(scene, options)?;
    let frames = frames::all(options, stage)?;
    let number = merged.receipt.picture;
    let Some(frame) = frames.get(number as usize) else {
        let problem = format!("the scene has {} pictures, not {}", frames.len(), number + 1);
        return Err(Failure::Other(problem));
    };
    let simd = Level::from_env().map_err(Failure::Usage)?;
    let settings = options.settings(&stage.scene, &stage.camera(options)?, simd)?;
    let tonemap = options.tonemap(&stage.scene)?;
    let shot = frames::shot(stage, frame, options, &settings.build)?;
    let output = Output::plan(options)?;
    let path = output.path(OsStr::new("again"));
    let mut session = Session {
        options,
        simd,
        output,
        denoiser: None,
        tonemap,
        load_seconds: 0.0,
        stem: OsString::new(),
        estimated_memory_bytes: 0,
        has_begun: true,
        merged: Some(merged),
        receipt: merged.receipt.clone(),
        number,
    };
    session.take(&stage.scene, shot, Target::File(&path)).map(drop)
}
