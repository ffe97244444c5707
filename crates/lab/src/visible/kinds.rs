//! The list of methods, each characterized in the terms of Sutherland, Sproull and Schumacker
//! (1974).

/// A method that finds visible surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// A ray for each pixel, tested with every triangle.
    RayCastingAll,
    /// A ray for each pixel, traced through the bounding volume hierarchy.
    RayCasting,
    /// A depth buffer with the nearest facet so far at each pixel.
    ZBuffer,
    /// A depth buffer of one row.
    ScanLineZ,
    /// Rows divided into sample spans.
    ScanLine,
    /// Painting from back to front, after five tests.
    DepthSort,
    /// Painting from back to front, in the order of a tree of planes.
    Bsp,
    /// Filling from front to back, in the order of a tree of planes.
    BspFrontToBack,
    /// Windows divided until they are simple.
    Warnock,
    /// Polygons cut by polygons.
    WeilerAtherton,
}

/// Where a method decides visibility.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// Visibility is decided in object space, to the precision of numbers.
    Object,
    /// Visibility is decided in image space, to the precision of pixels.
    Image,
    /// Priority is decided in object space, and visibility by overpainting (*list / priority*).
    ListPriority,
}

impl Space {
    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Object => "object space",
            Self::Image => "image space",
            Self::ListPriority => "a list by priority",
        }
    }
}

/// A method in the terms of the 1974 paper.
#[derive(Clone, Copy, Debug)]
pub struct Characterization {
    /// The space in which visibility is decided.
    pub space: Space,
    /// What the method sorts, in which order, and how.
    pub sorts: &'static str,
    /// The kind of coherence that the method exploits.
    pub coherence: &'static str,
    /// The authors and years of the sources.
    pub source: &'static str,
    /// The meaning of work per pixel; `None` if it is undefined.
    pub cost: Option<&'static str>,
}

impl Method {
    /// All methods, in the order of tables.
    pub const ALL: [Self; 10] = [
        Self::RayCastingAll,
        Self::RayCasting,
        Self::ZBuffer,
        Self::ScanLineZ,
        Self::ScanLine,
        Self::DepthSort,
        Self::Bsp,
        Self::BspFrontToBack,
        Self::Warnock,
        Self::WeilerAtherton,
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::RayCastingAll => "ray-casting-all",
            Self::RayCasting => "ray-casting",
            Self::ZBuffer => "z-buffer",
            Self::ScanLineZ => "scan-line-z",
            Self::ScanLine => "scan-line",
            Self::DepthSort => "depth-sort",
            Self::Bsp => "bsp",
            Self::BspFrontToBack => "bsp-front-to-back",
            Self::Warnock => "warnock",
            Self::WeilerAtherton => "weiler-atherton",
        }
    }

    /// The characterization of the method.
    pub fn characterization(self) -> Characterization {
        match self {
            Self::RayCastingAll => Characterization {
                space: Space::Image,
                sorts: "z: least of all, for each pixel",
                coherence: "none",
                source: "Appel 1968",
                cost: None,
            },
            Self::RayCasting => Characterization {
                space: Space::Image,
                sorts: "x, y and z together: tree of boxes once for the scene, then nearest box \
                    first for each pixel",
                coherence: "of objects (boxes), and of neighbouring rays",
                source: "Appel 1968; Rubin and Whitted 1980",
                cost: None,
            },
            Self::ZBuffer => Characterization {
                space: Space::Image,
                sorts: "z: least so far, for each pixel",
                coherence: "along a row of a polygon (depth is linear)",
                source: "Catmull 1974; Strasser 1974",
                cost: Some("polygons at a pixel"),
            },
            Self::ScanLineZ => Characterization {
                space: Space::Image,
                sorts: "y: buckets; z: least so far, for each pixel of a row",
                coherence: "from row to row (active polygons)",
                source: "Wylie, Romney, Evans and Erdahl 1967; Myers 1975",
                cost: Some("polygons at a pixel"),
            },
            Self::ScanLine => Characterization {
                space: Space::Image,
                sorts: "y: buckets; x: insertion, from the order of the row above; z: at both ends \
                    of a span, then by halving",
                coherence: "from row to row (order, and what was visible), and along the row \
                    (spans)",
                source: "Watkins 1970",
                cost: Some("comparisons, at the left end of their span"),
            },
            Self::DepthSort => Characterization {
                space: Space::ListPriority,
                sorts: "z: farthest points, then five tests of pairs; x, y: by painting",
                coherence: "of polygons (planes and extents)",
                source: "Newell, Newell and Sancha 1972",
                cost: Some("paintings of a pixel"),
            },
            Self::Bsp => Characterization {
                space: Space::ListPriority,
                sorts: "x, y and z together: tree of planes once for the scene, walked once for an \
                    eye; x, y: by painting",
                coherence: "of the scene from picture to picture (the tree)",
                source: "Schumacker 1969; Fuchs, Kedem and Naylor 1980",
                cost: Some("paintings of a pixel"),
            },
            Self::BspFrontToBack => Characterization {
                space: Space::ListPriority,
                sorts: "as bsp, nearest first; x, y: what is still empty in a row",
                coherence: "of the scene from picture to picture, and along the row (filled \
                    stretches are skipped)",
                source: "Gordon and Chen 1991",
                cost: Some("visits of a pixel until it is filled"),
            },
            Self::Warnock => Characterization {
                space: Space::Image,
                sorts: "x and y together: four parts at a time; z: against surrounding polygons",
                coherence: "of areas (large windows are done at once)",
                source: "Warnock 1969",
                cost: Some("windows around a pixel"),
            },
            Self::WeilerAtherton => Characterization {
                space: Space::Object,
                sorts: "z: nearest box first; x, y: polygons cut by polygons",
                coherence: "of areas, exactly",
                source: "Weiler and Atherton 1977; Heckbert and Hanrahan 1984",
                cost: Some("visible pieces around a pixel"),
            },
        }
    }
}
