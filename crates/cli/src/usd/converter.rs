//! The converter as one program, which Python reads from standard input.

/// A module of the converter: its name, and its text.
macro_rules! modules {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../../../../python/snell/usd/", $name, ".py")))),*]
    };
}
/// The modules of the converter; the first is the package itself.
const MODULES: [(&str, &str); 21] = modules![
    "__init__",
    "_materialx",
    "_search",
    "_files",
    "_motion",
    "_context",
    "_primvars",
    "_polygons",
    "_subdivision",
    "_tiles",
    "_networks",
    "_materials",
    "_bindings",
    "_meshes",
    "_shapes",
    "_nurbs",
    "_curves",
    "_cameras",
    "_lights",
    "_tree",
    "__main__",
];
/// The program that Python runs first. It reads the rest from standard input, which stays open.
pub const BOOT: &str = "import sys; exec(sys.stdin.buffer.read(int(sys.argv[1])))";
/// The text that sets limits, installs a finder which loads the modules from their texts on import,
/// and runs the last module.
const START: &str = include_str!("start.py");

/// The text of the program. Its arguments are its own length in bytes, the name of the stage for
/// messages, and the arguments of `python3 -m snell.usd`.
pub fn program() -> String {
    let mut text = String::from("TEXTS = {\n");
    for (name, source) in MODULES {
        let module =
            if name == "__init__" { "snell_usd".into() } else { format!("snell_usd.{name}") };
        // A JSON string is a valid Python literal.
        text += &format!("{module:?}: {},\n", serde_json::Value::from(source));
    }
    text + "}\n" + START
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn every_module_of_the_converter_is_carried() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../python/snell/usd"));
        let mut found: Vec<String> = std::fs::read_dir(folder)
            .expect("the folder is there")
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "py"))
            .map(|path| {
                path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
            })
            .collect();
        found.sort();
        let mut carried: Vec<String> = MODULES.iter().map(|(name, _)| (*name).to_owned()).collect();
        carried.sort();
        assert_eq!(carried, found);
    }
}
