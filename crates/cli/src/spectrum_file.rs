//! Spectra from files: `-D material.NAME.PARAMETER.spectrum=FILE`.

use crate::failure::Failure;
use snell_formats::open::{self, NamedBy};
use std::path::Path;

/// Maximum size of a table in bytes.
const MOST_BYTES: u64 = 16 << 20;

/// Replaces the file name in a definition `key=FILE` of a spectrum by the file's table. Other
/// definitions are returned unchanged.
pub fn resolve(definition: &str) -> Result<String, Failure> {
    match definition.split_once('=') {
        Some((key, name)) if key.ends_with(".spectrum") && Path::new(name).exists() => {
            Ok(format!("{key}={}", table(name)?))
        }
        _ => Ok(definition.to_string()),
    }
}

/// The pairs of wavelength in nm and value in a file, one per line, separated by blanks or a comma,
/// as JSON. `#` starts a comment.
fn table(name: &str) -> Result<serde_json::Value, Failure> {
    let failed = |problem: String| Failure::Other(format!("{name}: {problem}"));
    let bytes = open::read(Path::new(name), NamedBy::User, MOST_BYTES)
        .map_err(|e| failed(e.to_string()))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| failed("this is not text; expected a table of numbers".into()))?;
    let mut pairs = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> =
            line.split([' ', '\t', ',', '\r']).filter(|w| !w.is_empty()).collect();
        if words.is_empty() {
            continue;
        }
        let numbers: Vec<f32> = words.iter().map_while(|w| w.parse().ok()).collect();
        let [wavelength, value] = numbers[..] else {
            let message = "expected a wavelength in nm and a value, such as 550 0.8";
            return Err(Failure::Usage(format!(
                "{name}:{number}: {message}, found \"{}\"",
                line.trim()
            )));
        };
        pairs.push(serde_json::json!([wavelength, value]));
    }
    Ok(pairs.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_become_tables_and_what_is_wrong_is_named_by_its_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("paint.spd");
        let definition = format!("material.0.reflectance.spectrum={}", file.display());
        assert_eq!(resolve(&definition).expect("no file yet"), definition);
        std::fs::write(&file, "# nm, share\n400 0.5\n700, 0.75 # red\n\n").expect("is written");
        assert_eq!(
            resolve(&definition).expect("a table"),
            "material.0.reflectance.spectrum=[[400.0,0.5],[700.0,0.75]]"
        );
        std::fs::write(&file, "400 0.1\n500\n").expect("is written");
        let error = resolve(&definition).expect_err("a line is short").to_string();
        assert!(error.contains("paint.spd:2: expected a wavelength"), "{error}");
        assert_eq!(resolve("ambient=[1,1,1]").expect("untouched"), "ambient=[1,1,1]");
    }
}
