//! Sources of scenes: files, standard input, and built-in ones.

use crate::failure::Failure;
use crate::{spectrum_file, usd};
use snell_formats::image::read_environment;
use snell_formats::{Input, ReadOptions};
use snell_scene::builtin::{BUILTINS, builtin};
use snell_scene::overrides::nearest;
use snell_scene::{Image, Scene};
use std::ffi::OsString;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// Loads the scene named on the command line: a file, `-` for standard input, or a built-in scene.
/// A file takes precedence over a built-in name.
pub fn load(path: &Path, options: &ReadOptions) -> Result<Scene, Failure> {
    if path == Path::new("-") {
        let mut bytes = Vec::new();
        std::io::stdin()
            .take(options.limits.file_bytes + 1)
            .read_to_end(&mut bytes)
            .map_err(|e| Failure::Other(format!("standard input: cannot read: {e}")))?;
        if bytes.len() as u64 > options.limits.file_bytes {
            let limit = options.limits.file_bytes;
            return Err(Failure::Other(format!(
                "standard input: more than the limit of {limit} bytes; split the scene"
            )));
        }
        return Ok(snell_formats::read_scene_bytes(
            "standard input",
            bytes,
            Path::new("."),
            options,
        )?);
    }
    if !path.exists()
        && let Some(name) = path.to_str()
    {
        if let Some(scene) = builtin(name) {
            return Ok(scene);
        }
        let names: Vec<_> = BUILTINS.iter().map(|b| b.name).collect();
        if !name.contains(['/', '\\', '.']) {
            let hint =
                nearest(name, &names).map(|n| format!("did you mean {n}? ")).unwrap_or_default();
            return Err(Failure::Scene(format!(
                "{name}: neither a file nor a built-in scene; {hint}`snell scenes` lists the \
                    built-in ones"
            )));
        }
    }
    if path.exists() && usd::is_usd(path) {
        return usd::load(path, options);
    }
    Ok(snell_formats::read_scene(path, options)?)
}

/// True if a name that is no file is that of a built-in scene.
pub fn is_builtin(path: &Path) -> bool {
    path.to_str().is_some_and(|name| BUILTINS.iter().any(|known| known.name == name))
}

/// The definitions of `-D` that may be parameters of the file: the keys of the scene graph have
/// dots.
pub fn parameters(define: &[String]) -> Vec<(String, String)> {
    let pairs = define.iter().filter_map(|definition| definition.split_once('='));
    let plain = pairs.filter(|(key, _)| !key.contains('.'));
    plain.map(|(key, value)| (key.to_string(), value.to_string())).collect()
}

/// True if all definitions of `-D` are parameters of the file, which have done their work when it
/// was read.
pub fn are_parameters(scene: &Scene, define: &[String]) -> bool {
    define.iter().all(|d| scene.takes_parameter(d.split('=').next().unwrap_or_default()))
}

/// Applies the definitions of `-D` that are not parameters of the file.
pub fn apply(scene: &mut Scene, define: &[String]) -> Result<(), Failure> {
    for definition in define {
        if scene.takes_parameter(definition.split('=').next().unwrap_or_default()) {
            continue;
        }
        let definition = spectrum_file::resolve(definition)?;
        snell_scene::overrides::apply_with(scene, &definition, &picture)?;
    }
    Ok(())
}

/// Opens a picture that a definition names.
fn picture(name: &str) -> Result<Arc<Image>, String> {
    let input = Input::open(Path::new(name), &ReadOptions::default());
    let image = input.and_then(|input| read_environment(&input)).map_err(|e| e.to_string())?;
    Ok(Arc::new(image))
}

/// The stem of the default output file.
pub fn stem(path: &Path, scene: &Scene) -> OsString {
    if path == Path::new("-") {
        // The scene's name may contain a path out of the folder, so slashes are replaced.
        let name = scene.name.replace([' ', '/', '\\', '\0'], "-");
        return if name.is_empty() { "scene".into() } else { name.into() };
    }
    path.file_stem().map_or_else(|| "scene".into(), Into::into)
}
