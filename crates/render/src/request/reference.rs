//! Texts generated from the declarations of settings: the reference page `docs/user/settings.md`,
//! and the types of Python's keywords, `python/snell/_settings.py`.

use super::{Form, Heading, Request, Setting};

const PAGE: &str = "# Settings of a render

What `snell render` and `snell.render` can be asked for beside the scene, as the renderer declares
it; `cargo xtask parameters` writes this page. An option is given as `--spp 64`, a keyword as
`spp=64`. What is left out comes from the scene's file, or else has the default in the last column.
";

/// The reference page in Markdown.
pub fn page() -> String {
    let section = |heading: Heading| {
        let rows = Request::SETTINGS.iter().filter(|setting| setting.heading == heading).map(row);
        let title = heading.text();
        format!(
            "## {title}\n\n| option | keyword | what it is | default |\n|---|---|---|---|\n{}",
            rows.collect::<String>()
        )
    };
    format!("{PAGE}\n{}", Heading::ALL.map(section).join("\n"))
}

fn row(setting: &Setting) -> String {
    let value = match setting.form {
        Form::Flag => String::new(),
        Form::OptionalValue => format!("[={}]", setting.value_name),
        _ => format!(" {}", setting.value_name),
    };
    let mut option = format!("`--{}{value}`", setting.option());
    if let Some(letter) = setting.short {
        option += &format!(", `-{letter}`");
    }
    if let Some(alias) = setting.alias {
        option += &format!(", `--{alias}`");
    }
    let default = match (setting.default)() {
        name if (setting.choices)().contains(&name) => format!("`{name}`"),
        text => text.into(),
    };
    let names: Vec<String> = (setting.choices)().iter().map(|name| format!("`{name}`")).collect();
    let choices = if names.is_empty() { String::new() } else { format!(": {}", names.join(", ")) };
    let text = format!("{}{choices}. {}", setting.statement(), setting.details());
    let cells = [option, format!("`{}`", setting.name), text.trim().into(), default];
    format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

/// The parameters of `snell.render` that may be given by position. Its signature names them.
const POSITIONAL: [&str; 3] = ["integrator", "spp", "size"];

const MODULE: &str = "\"\"\"Types of the settings of a render, as the renderer declares them.

`cargo xtask parameters` writes this file.
\"\"\"

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence


class RenderSettings(TypedDict, total=False):
    \"\"\"Keywords of :func:`snell.render`. ``None`` is as if they were left out.\"\"\"
";

/// The source of the Python module that has the types of the keywords.
pub fn python_types() -> String {
    let fields = Request::SETTINGS.iter().filter(|setting| !POSITIONAL.contains(&setting.name));
    let field = |setting: &Setting| {
        let text = wrapped(&format!("{}.", setting.summary()), 88).join("\n    ");
        let text = if text.contains('\n') { format!("{text}\n    ") } else { text };
        format!("\n    {}: {} | None\n    \"\"\"{text}\"\"\"\n", setting.name, setting.python)
    };
    MODULE.to_string() + &fields.map(field).collect::<String>()
}

/// Breaks a text into lines of at most `width` characters.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        let line = &mut lines[last];
        if line.is_empty() || line.chars().count() + 1 + word.chars().count() <= width {
            *line += if line.is_empty() { "" } else { " " };
            *line += word;
        } else {
            lines.push(word.to_string());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_has_a_text_and_its_own_option() {
        let mut options = Vec::new();
        for setting in Request::SETTINGS {
            assert!(!setting.doc.trim().is_empty(), "{}", setting.name);
            assert!(!setting.summary().contains('['), "{}", setting.summary());
            options.push(setting.option());
        }
        let count = options.len();
        options.sort();
        options.dedup();
        assert_eq!(options.len(), count);
    }
}
