//! `include/snell.h` is what the sources say.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("the options");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for name in ["error", "scene"] {
        builder = builder.with_src(folder.join(format!("src/{name}.rs")));
    }
    let mut made = Vec::new();
    builder.generate().expect("a header").write(&mut made);
    let path = folder.join("include/snell.h");
    if std::env::var_os("SNELL_HEADER").is_some_and(|wish| wish == "write") {
        std::fs::write(&path, &made).expect("the header can be written");
    }
    let kept = std::fs::read(&path).unwrap_or_default();
    assert!(
        made == kept,
        "crates/capi/include/snell.h is out of date; write it with: SNELL_HEADER=write cargo test \
            -p snell-capi"
    );
}
