//! Bounded XML parsing: input that would take the parser quadratic time is refused first.

use roxmltree::{Document, ParsingOptions};

/// Maximum number of attributes of an element: the parser compares each with all before it.
const MAX_ATTRIBUTES: usize = 256;
/// Maximum number of namespaces in a file: each element that declares one copies all that are in
/// scope. Mitsuba's scenes have none.
const MAX_NAMESPACES: usize = 64;

/// An error in a text, and its line and column, from 1.
pub struct Flaw {
    pub line: u32,
    pub column: u32,
    pub problem: String,
}

/// Parses a text that has at most `nodes_limit` elements, attributes and pieces of text.
pub fn parse(text: &str, nodes_limit: u32) -> Result<Document<'_>, Flaw> {
    if let Some(at) = crowded(text) {
        let before = &text[..at];
        let line = before.matches('\n').count() as u32 + 1;
        let column = before[before.rfind('\n').map_or(0, |i| i + 1)..].chars().count() as u32 + 1;
        let problem = format!(
            "an element has more than {MAX_ATTRIBUTES} attributes, or the file more than \
                {MAX_NAMESPACES} namespaces"
        );
        return Err(Flaw { line, column, problem });
    }
    let options = ParsingOptions { nodes_limit, ..ParsingOptions::default() };
    let parsed = crate::guard::guarded(|| Document::parse_with_options(text, options));
    let failed = || Flaw { line: 1, column: 1, problem: "the XML parser failed".into() };
    parsed.ok_or_else(failed)?.map_err(|error| {
        let place = error.pos();
        let message = error.to_string();
        // The place is reported as in all messages.
        let problem = message.replace(&format!(" at {place}"), "");
        Flaw { line: place.row, column: place.col, problem }
    })
}

/// Finds the first element with too many attributes, or the first namespace over the limit.
fn crowded(text: &str) -> Option<usize> {
    let mut namespaces = 0;
    let mut at = 0;
    while let Some(found) = text[at..].find('<') {
        let start = at + found;
        let rest = &text[start..];
        let past = |end: &str| rest.find(end).map_or(text.len(), |i| start + i + end.len());
        if rest.starts_with("<!--") {
            at = past("-->");
            continue;
        }
        if rest.starts_with("<![CDATA[") {
            at = past("]]>");
            continue;
        }
        let (mut quote, mut attributes, mut end) = (None, 0, rest.len());
        for (i, byte) in rest.bytes().enumerate() {
            match (quote, byte) {
                (None, b'"' | b'\'') => quote = Some(byte),
                (Some(open), _) if open == byte => quote = None,
                (None, b'=') => attributes += 1,
                (None, b'>') => {
                    end = i + 1;
                    break;
                }
                _ => {}
            }
        }
        namespaces += rest[..end].matches("xmlns").count();
        if attributes > MAX_ATTRIBUTES || namespaces > MAX_NAMESPACES {
            return Some(start);
        }
        at = start + end;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_attributes_are_refused_where_they_stand_and_many_elements_are_not() {
        let attributes = |n: usize| (0..n).map(|i| format!(" a{i}='>'")).collect::<String>();
        let text =
            format!("<scene>\n <!-- don't = > --> <![CDATA[<'=]]> <x{}/></scene>", attributes(257));
        let flaw = parse(&text, u32::MAX).expect_err("257 attributes");
        assert_eq!((flaw.line, flaw.column), (2, 37), "{}", flaw.problem);
        let text = format!("<scene>{}</scene>", format!("<x{}/>", attributes(256)).repeat(100));
        assert!(parse(&text, u32::MAX).is_ok());
        let text = format!("<scene>{}</scene>", "<x xmlns:a='b'/>".repeat(65));
        assert!(parse(&text, u32::MAX).is_err());
    }
}
