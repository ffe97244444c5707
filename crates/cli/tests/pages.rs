//! The pages and types that are made from declarations in the source are up to date. With
//! `SNELL_PARAMETERS=write`, which `cargo xtask parameters` sets, they are written instead.

use snell_render::request;
use std::path::Path;

/// All files that are made from declarations, by their places in the repository.
fn files() -> Vec<(String, String)> {
    let families = snell_scene::families::reference();
    let pages = families.into_iter().map(|(name, text)| (format!("docs/user/{name}"), text));
    let others = [
        ("docs/user/settings.md", request::page()),
        ("docs/user/parameters/integrators.md", request::integrators_page()),
        ("docs/user/parameters/samplers.md", request::samplers_page()),
        ("docs/user/parameters/formats.md", snell_formats::reference::formats_page()),
        ("python/snell/_settings.py", request::python_types()),
    ];
    pages.chain(others.map(|(name, text)| (name.to_string(), text))).collect()
}

#[test]
fn the_reference_is_what_the_declarations_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let is_wish = std::env::var_os("SNELL_PARAMETERS").is_some_and(|wish| wish == "write");
    for (name, text) in files() {
        let path = root.join(&name);
        if is_wish {
            std::fs::write(&path, &text).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        let there = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(there == text, "{name} is stale: run cargo xtask parameters");
    }
}
