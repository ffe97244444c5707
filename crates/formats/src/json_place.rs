//! Finds line and column of a value in JSON text.

use serde_json::value::RawValue;
use std::borrow::Cow;
use std::collections::HashMap;

/// Returns line and column, both from 1, of the value that a JSON pointer names, or of the
/// innermost existing value around it. `None` if the text is not JSON.
pub fn line_and_column(text: &[u8], pointer: &str) -> Option<(usize, usize)> {
    let text = std::str::from_utf8(text).ok()?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut value: &str = serde_json::from_str::<&RawValue>(text).ok()?.get();
    for step in pointer.split('/').skip(1) {
        let Some(inner) = descend(value, &step.replace("~1", "/").replace("~0", "~")) else {
            break;
        };
        value = inner;
    }
    // Values are slices of the text.
    let before = &text[..value.as_ptr() as usize - text.as_ptr() as usize];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    Some((line, column))
}

/// The text of a property's or an element's value.
fn descend<'a>(value: &'a str, step: &str) -> Option<&'a str> {
    if value.starts_with('{') {
        let properties: HashMap<Cow<str>, &RawValue> = serde_json::from_str(value).ok()?;
        return properties.get(step).map(|inner| inner.get());
    }
    let elements: Vec<&RawValue> = serde_json::from_str(value).ok()?;
    elements.get(step.parse::<usize>().ok()?).map(|inner| inner.get())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_their_paths() {
        let text = "{\n \"a\": [1,\n  {\"b/c\": \"\u{e9}\", \"d\\u0065\": null}],\n \"e\": true}";
        let place = |pointer| line_and_column(text.as_bytes(), pointer);
        assert_eq!(place(""), Some((1, 1)));
        assert_eq!(place("/a"), Some((2, 7)));
        assert_eq!(place("/a/0"), Some((2, 8)));
        assert_eq!(place("/a/1/b~1c"), Some((3, 11)));
        assert_eq!(place("/a/1/de"), Some((3, 27)));
        assert_eq!(place("/a/1/missing/x"), Some((3, 3)), "the innermost that is there");
        assert_eq!(place("/e"), Some((4, 7)));
        assert_eq!(line_and_column(b"glTF\x02", "/a"), None);
    }
}
