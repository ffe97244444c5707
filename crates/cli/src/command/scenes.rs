//! `snell scenes`.

use crate::failure::Failure;
use snell_scene::builtin::BUILTINS;
use std::process::ExitCode;

/// Lists the built-in scenes.
pub fn run() -> Result<ExitCode, Failure> {
    let width = BUILTINS.iter().map(|b| b.name.len()).max().unwrap_or(0);
    for builtin in BUILTINS {
        println!("{:width$}  {}", builtin.name, builtin.description);
    }
    println!("\nRender one with `snell render NAME`.");
    Ok(ExitCode::SUCCESS)
}
