//! Tells the linker what an extension module needs where that is not what it does anyway: on macOS,
//! that the interpreter has what is missing.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
