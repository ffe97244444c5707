//! `snell scenes`.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use snell_scene::builtin::BUILTINS;

/// Lists the built-in scenes.
pub fn run() -> Result<ExitCode, Failure> {
    let width = BUILTINS.iter().map(|b| b.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for builtin in BUILTINS {
        text += &format!("{:width$}  {}\n", builtin.name, builtin.description);
    }
    text += "\nRender one with `snell render NAME`.\n";
    standard_output::write(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}
