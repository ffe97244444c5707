//! Messages that may be lost: a closed terminal, a reader that is gone or a full disk are no reason
//! to end, as they are for the macros of the standard library that have these names. And warnings,
//! as text and as JSON.

use serde_json::{Value, json};
use snell_formats::error::one_line;
use snell_scene::Warning;

macro_rules! eprintln {
    ($($message:tt)*) => {{
        let _ = ::std::io::Write::write_all(&mut ::std::io::stderr(), format!("{}\n", format_args!($($message)*)).as_bytes());
    }};
}

macro_rules! println {
    ($($message:tt)*) => {{
        let _ = ::std::io::Write::write_all(&mut ::std::io::stdout(), format!("{}\n", format_args!($($message)*)).as_bytes());
    }};
}

/// A warning as one line, with the number of times if there are several.
pub fn counted(warning: &Warning) -> String {
    let message = one_line(&warning.message).to_string();
    Warning { message, ..warning.clone() }.to_string()
}

/// Warnings as `--json` and `--stats` have them.
pub fn as_json(warnings: &[Warning]) -> Value {
    warnings.iter().map(|w| json!({ "message": w.message, "count": w.count })).collect()
}
