//! Messages that may be lost: a closed terminal, a reader that is gone or a full disk are no reason
//! to end, as they are for the macros of the standard library that have these names. And warnings,
//! as text and as JSON.

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

/// A warning as one line, with the number of times if there are several.
pub fn counted(warning: &Warning) -> String {
    let message = one_line(&warning.message);
    match warning.count {
        1 => message.to_string(),
        count => format!("{message} ({count} times)"),
    }
}

/// Warnings as `--json` and `--stats` have them.
pub fn as_json(warnings: &[Warning]) -> Value {
    warnings.iter().map(|w| json!({ "message": w.message, "count": w.count })).collect()
}
