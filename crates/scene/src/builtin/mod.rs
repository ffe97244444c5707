//! Scenes that come with the program.

use crate::graph::Scene;

/// A built-in scene.
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// Name on the command line.
    pub name: &'static str,
    /// One line about it.
    pub description: &'static str,
    /// Makes the scene.
    pub make: fn() -> Scene,
}

/// All built-in scenes.
pub const BUILTINS: &[Builtin] = &[];

/// The built-in scene of this name.
pub fn builtin(name: &str) -> Option<Scene> {
    BUILTINS.iter().find(|b| b.name == name).map(|b| (b.make)())
}
