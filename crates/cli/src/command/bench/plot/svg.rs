//! The few elements of SVG that a plot needs.

use std::fmt::Write;

/// The text of an SVG picture.
pub struct Svg {
    text: String,
}

/// The position of text relative to its point.
#[derive(Clone, Copy)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Svg {
    pub fn new(width: f64, height: f64) -> Self {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="Helvetica, Arial, 'DejaVu Sans', sans-serif"><rect width="{width}" height="{height}" fill="#ffffff"/>"##
        );
        Self { text }
    }

    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], color: &str, width: f64) {
        let ([x1, y1], [x2, y2]) = (from, to);
        let _ = write!(
            self.text,
            r#"<line x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}" stroke="{color}" stroke-width="{width}"/>"#
        );
    }

    /// Draws many lines of one style, as one path.
    pub fn lines(&mut self, lines: impl Iterator<Item = [[f64; 2]; 2]>, color: &str, width: f64) {
        let mut path = String::new();
        for [[x1, y1], [x2, y2]] in lines {
            let _ = write!(path, "M{x1:.2} {y1:.2}L{x2:.2} {y2:.2}");
        }
        let _ = write!(
            self.text,
            r#"<path d="{path}" fill="none" stroke="{color}" stroke-width="{width}" stroke-linecap="round"/>"#
        );
    }

    pub fn polyline(&mut self, points: &[[f64; 2]], color: &str, dash: &str) {
        let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = write!(
            self.text,
            r#"<polyline points="{}" fill="none" stroke="{color}" stroke-width="3" stroke-linejoin="round" stroke-dasharray="{dash}"/>"#,
            points.join(" ")
        );
    }

    pub fn dot(&mut self, [x, y]: [f64; 2], color: &str) {
        let _ = write!(
            self.text,
            r##"<circle cx="{x:.1}" cy="{y:.1}" r="5" fill="{color}" stroke="#ffffff" stroke-width="1.5"/>"##
        );
    }

    pub fn label(
        &mut self,
        [x, y]: [f64; 2],
        size: f64,
        color: &str,
        anchor: Anchor,
        bold: bool,
        text: &str,
    ) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let weight = if bold { "bold" } else { "normal" };
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        let _ = write!(
            self.text,
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" fill="{color}" text-anchor="{anchor}" font-weight="{weight}">{text}</text>"#
        );
    }

    pub fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }
}
