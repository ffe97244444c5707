//! Passes the linker the arguments that an extension module needs. They matter on macOS, where the
//! symbols of the interpreter are found only when the module is loaded.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
