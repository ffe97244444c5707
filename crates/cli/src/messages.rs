//! Messages that may be lost: a closed terminal, a closed pipe or a full disk does not end the
//! program, unlike with the standard library's macros of the same names. Also formats warnings, as
//! text and as JSON.

use serde_json::{Value, json};
use snell_formats::error::one_line;
use snell_scene::Warning;

macro_rules! eprintln {
    ($($message:tt)*) => {{
        let line = format!("{}\n", format_args!($($message)*));
        let _ = ::std::io::Write::write_all(&mut ::std::io::stderr(), line.as_bytes());
    }};
}

macro_rules! println {
    ($($message:tt)*) => {{
        let line = format!("{}\n", format_args!($($message)*));
        let _ = ::std::io::Write::write_all(&mut ::std::io::stdout(), line.as_bytes());
    }};
}

/// A warning as one line, with its count if above 1.
pub fn counted(warning: &Warning) -> String {
    let message = one_line(&warning.message).to_string();
    Warning { message, ..warning.clone() }.to_string()
}

/// Warnings in the JSON of `--json` and `--stats`.
pub fn as_json(warnings: &[Warning]) -> Value {
    warnings.iter().map(|w| json!({ "message": w.message, "count": w.count })).collect()
}
