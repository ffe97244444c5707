//! The page, built from `web/` and kept in `page/`, inside the binary.

/// A file of the page.
pub struct PageFile {
    /// The name of the file; empty for the page itself.
    pub name: &'static str,
    /// The media type of the file.
    pub media_type: &'static str,
    /// The content of the file.
    pub bytes: &'static [u8],
}

/// All files.
pub const FILES: &[PageFile] = &[
    PageFile {
        name: "",
        media_type: "text/html; charset=utf-8",
        bytes: include_bytes!("../page/index.html"),
    },
    PageFile {
        name: "app.js",
        media_type: "text/javascript; charset=utf-8",
        bytes: include_bytes!("../page/app.js"),
    },
    PageFile {
        name: "app.css",
        media_type: "text/css; charset=utf-8",
        bytes: include_bytes!("../page/app.css"),
    },
];

/// The file of this name.
pub fn file(name: &str) -> Option<&'static PageFile> {
    FILES.iter().find(|f| f.name == name)
}
