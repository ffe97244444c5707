//! Messages that may be lost: a closed terminal, a reader that is gone or a full disk are no reason
//! to end, as they are for the macros of the standard library that have these names.

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
