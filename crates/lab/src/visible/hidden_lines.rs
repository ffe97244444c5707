//! Hidden lines by quantitative invisibility (Appel, The Notion of Quantitative Invisibility and
//! the Machine Rendering of Solids, ACM National Conference 1967).
//!
//! The *quantitative invisibility* of a point of an edge is the number of faces between it and the
//! eye; the point is visible if that is 0. Along an edge the number changes only where the edge
//! passes behind a *contour* or through a face. (A contour is a silhouette edge: both of its faces
//! are on one side of it in the picture, or it has only one face.) So one count and the crossings
//! determine the whole edge. Roberts (Machine Perception of Three-Dimensional Solids, 1963) tests
//! edges with solids instead, Galimberti and Montanari (An Algorithm for Hidden Line Elimination,
//! 1969) keep the set of hiding faces in place of its number, and Loutrel (A Solution to the
//! Hidden-Line Problem for Computer-Drawn Polyhedra, 1970) carries the number as Appel does.
//!
//! Appel carries the number also through vertices, from edge to edge. Here each edge has a separate
//! count, at the middle of its first segment, and another count after the edge has touched the
//! border of a face: an error then stays local, and surfaces need not be closed. Edges that cross
//! at a vertex, or coincide in the picture, are distinguished by the side of the line on which
//! points are, so that each crossing counts once. Lines in which faces intersect are not edges, and
//! are not drawn.

use super::facet::{Edge, Facet};
use super::{Characterization, NOTHING, Screen, Space, VisibleError};
use snell_intersect::AcceptAll;
use snell_intersect::World;
use snell_math::{DVec2, DVec3, Ray};
use std::collections::HashMap;

/// Points nearer by less than this, relative to the nearness, do not count as in front.
const EQUAL: f64 = 1e-9;

/// A line touches the border of a face if it is this close to it, relative to the nearness or in
/// pixels.
const TOUCH: f64 = 1e-6;

/// Segments shorter than this, in pixels, are not drawn.
const SHORTEST: f64 = 1e-6;

/// Two faces count as coplanar if the cosine of their angle is at least this.
const FLAT: f64 = 1.0 - 1e-9;

/// Maximum number of comparisons of edges with contours and faces.
const MOST_WORK: u64 = 1_000_000_000;

/// The arrangement of the faces at a line in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// A silhouette edge: all of its faces are on one side of it.
    Contour,
    /// An edge between two faces of different planes that are both seen from the same side.
    Crease,
    /// An edge between two coplanar faces, which is not a visible line of the surface.
    Flat,
}

/// A part of an edge along which the invisibility does not change.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    /// The ends in the picture, in pixels.
    pub ends: [DVec2; 2],
    /// The reciprocals of the depth at the ends.
    pub nearness: [f64; 2],
    /// The number of faces that hide this part; 0 if it is visible.
    pub invisibility: u32,
    /// The kind of the edge.
    pub kind: LineKind,
}

/// The operations of the algorithm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineWork {
    /// The number of edges in the picture.
    pub edges: u64,
    /// The number of contours among these edges.
    pub contours: u64,
    /// The number of comparisons between edges and the contours close to them in the picture.
    pub comparisons: u64,
    /// The number of crossings of edges behind contours.
    pub crossings: u64,
    /// The number of intersections of edges with faces.
    pub piercings: u64,
    /// The number of faces examined, to find those that an edge intersects and to count those in
    /// front of a point.
    pub faces: u64,
    /// The number of segments whose invisibility was counted: the first segment of each edge, and
    /// segments after the edge touched the border of a face.
    pub counts: u64,
}

/// The edges of a scene in the picture, each in visible and hidden segments.
#[derive(Clone, Debug)]
pub struct HiddenLines {
    /// The segments in the order of the edges, and for each edge in order from its first point.
    pub stretches: Vec<Stretch>,
    /// The numbers of operations.
    pub work: LineWork,
}

impl Stretch {
    /// The middle in the picture, and the reciprocal of the depth there.
    pub fn middle(&self) -> (DVec2, f64) {
        ((self.ends[0] + self.ends[1]) * 0.5, (self.nearness[0] + self.nearness[1]) * 0.5)
    }

    /// The length in pixels.
    pub fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// True if a ray from the eye hits something before the middle of this part.
    pub fn is_occluded(&self, screen: &Screen, world: &World) -> bool {
        let (place, near) = self.middle();
        let eye = screen.view.apex().unwrap_or_default();
        // In units of the ray's direction, the depth of the point is the reciprocal of its
        // nearness.
        let ray = Ray::new(eye.as_vec3(), screen.view.direction(place).as_vec3());
        world.occluded_one(&Ray { t_max: (BEFORE / near) as f32, ..ray }, &AcceptAll)
    }

    /// True if some face certainly hides the middle of this part: the middle is more than
    /// `tolerance` pixels inside the face's outline, and behind the face by more than a ray's
    /// tolerance. Examines all faces.
    pub fn is_surely_hidden(&self, screen: &Screen, tolerance: f64) -> bool {
        let (place, near) = self.middle();
        screen
            .facets
            .iter()
            .any(|f| f.nearness.at(place) * BEFORE > near && f.inside(place) > tolerance)
    }
}

/// A ray to a point of an edge ends at this fraction of the distance.
const BEFORE: f64 = 1.0 - 1e-4;

/// An edge in the picture, with its faces.
struct Line {
    ends: [DVec3; 2],
    /// The facets that have this edge.
    faces: Vec<u32>,
    kind: LineKind,
    /// The range of the edge's parameter that is in the picture, from 0 to 1.
    range: [f64; 2],
    /// The number of faces to the left of the line minus the number to its right, looking from the
    /// smaller to the greater end. The invisibility behind the line changes by this.
    change: i32,
}

/// A point of a line where its invisibility changes.
struct Event {
    at: f64,
    change: i32,
    /// True if the line touches the border of a face here, so that rounding decides on which side
    /// it passes, and the number must be counted again.
    is_touch: bool,
}

impl HiddenLines {
    /// The name of the method on the command line.
    pub const NAME: &str = "quantitative-invisibility";

    /// The characterization of the method.
    pub const CHARACTERIZATION: Characterization = Characterization {
        space: Space::Object,
        sorts: "x, y: cells of the picture; along each edge: crossings with contours; z: at each \
            crossing",
        coherence: "along edges (invisibility changes at contours only)",
        source: "Appel 1967; Roberts 1963, Galimberti and Montanari 1969, Loutrel 1970",
        cost: None,
    };

    /// Finds the visible parts of all edges. The time grows with the number of edges and contours
    /// in the same parts of the picture.
    pub fn new(screen: &Screen) -> Result<Self, VisibleError> {
        let lines = lines(screen);
        let mut cells = Cells::new(screen, &lines);
        let mut work =
            LineWork { edges: lines.len() as u64, contours: cells.contours, ..LineWork::default() };
        let mut stretches = Vec::new();
        for line in &lines {
            cells.near(line);
            let mut events = crossings(line, &lines, &cells.lines_met, &mut work);
            piercings(screen, line, &cells.faces_met, &mut events, &mut work);
            events.retain(|e| e.at > line.range[0] && e.at < line.range[1]);
            events.sort_by(|a, b| a.at.total_cmp(&b.at));
            divide(screen, line, &events, &cells.faces_met, &mut stretches, &mut work);
            if work.comparisons + work.faces > MOST_WORK {
                let what = "comparisons of edges with contours and faces";
                return Err(VisibleError::TooMuchWork { what, limit: MOST_WORK });
            }
        }
        Ok(Self { stretches, work })
    }
}

/// All edges with their faces. Coincident edges are merged, whatever their mesh.
fn lines(screen: &Screen) -> Vec<Line> {
    let mut number: HashMap<[u64; 6], usize> = HashMap::new();
    let mut lines: Vec<Line> = Vec::new();
    let size = DVec2::new(screen.size[0].into(), screen.size[1].into());
    for (item, facet) in screen.facets.iter().enumerate() {
        let corners = facet.corners();
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            // The ends are ordered, so that both faces find the same line.
            let (a, b) = if (a.x, a.y) < (b.x, b.y) { (a, b) } else { (b, a) };
            let key = [a.x, a.y, a.z, b.x, b.y, b.z].map(f64::to_bits);
            let found = *number.entry(key).or_insert_with(|| {
                lines.push(Line {
                    ends: [a, b],
                    faces: Vec::new(),
                    kind: LineKind::Flat,
                    range: [0.0, 1.0],
                    change: 0,
                });
                lines.len() - 1
            });
            lines[found].faces.push(item as u32);
        }
    }
    for line in &mut lines {
        line.describe(screen);
    }
    lines.iter_mut().for_each(|line| line.range = range_within(line, size));
    lines.retain(|line| line.range[0] < line.range[1]);
    lines
}

/// The part of a line in the picture (Liang and Barsky, A New Concept and Method for Line Clipping,
/// 1984).
fn range_within(line: &Line, size: DVec2) -> [f64; 2] {
    let [a, b] = line.ends.map(|p| p.truncate());
    let mut range = [0.0f64, 1.0f64];
    for axis in 0..2 {
        for (at_a, at_b) in [(a[axis], b[axis]), (size[axis] - a[axis], size[axis] - b[axis])] {
            let crossing = at_a / (at_a - at_b);
            if at_a < 0.0 && at_b < 0.0 {
                return [1.0, 0.0];
            } else if at_a < 0.0 {
                range[0] = range[0].max(crossing);
            } else if at_b < 0.0 {
                range[1] = range[1].min(crossing);
            }
        }
    }
    range
}

impl Line {
    fn describe(&mut self, screen: &Screen) {
        let edge = self.edge();
        let is_left = |item: &u32| {
            let facet = &screen.facets[*item as usize];
            let middle = facet.corners().iter().map(|c| c.truncate()).sum::<DVec2>()
                / facet.corners().len() as f64;
            edge.inside(middle) > 0.0
        };
        let left = self.faces.iter().filter(|f| is_left(f)).count() as i32;
        self.change = 2 * left - self.faces.len() as i32;
        let normal = |item: u32| {
            let [a, b, c] =
                screen.triangles[screen.facets[item as usize].triangle as usize].corners;
            (b - a).cross(c - a).normalize_or_zero()
        };
        let is_flat =
            || self.faces.iter().all(|&f| normal(f).dot(normal(self.faces[0])).abs() > FLAT);
        self.kind = match self.change {
            0 if is_flat() => LineKind::Flat,
            0 => LineKind::Crease,
            _ => LineKind::Contour,
        };
    }

    fn edge(&self) -> Edge {
        Edge::new(self.ends[0].truncate(), self.ends[1].truncate())
    }

    fn place(&self, at: f64) -> DVec2 {
        self.ends[0].truncate().lerp(self.ends[1].truncate(), at)
    }

    /// Nearness is linear along the picture of a line.
    fn nearness(&self, at: f64) -> f64 {
        self.ends[0].z + (self.ends[1].z - self.ends[0].z) * at
    }

    fn shares_end(&self, other: &Self) -> bool {
        self.ends.iter().any(|e| other.ends.contains(e))
    }
}

/// The points where a line passes behind contours.
fn crossings(line: &Line, lines: &[Line], met: &[u32], work: &mut LineWork) -> Vec<Event> {
    let mut events = Vec::new();
    let own = line.edge();
    let [from, to] = line.ends.map(|p| p.truncate());
    for &index in met {
        let contour = &lines[index as usize];
        if line.shares_end(contour) {
            continue;
        }
        work.comparisons += 1;
        let ends = contour.ends.map(|p| p.truncate());
        let [is_a, is_b] = ends.map(|p| own.holds(p));
        if is_a == is_b {
            continue;
        }
        // Along the line, the signed distance from the contour changes its sign.
        let across = ends[1] - ends[0];
        let (at_from, at_to) = (across.perp_dot(from - ends[0]), across.perp_dot(to - ends[0]));
        let at = at_from / (at_from - at_to);
        if !(at > 0.0 && at < 1.0) {
            continue;
        }
        let place = line.place(at);
        let along = (place - ends[0]).dot(across) / across.length_squared();
        let (near, own_near) = (contour.nearness(along.clamp(0.0, 1.0)), line.nearness(at));
        if near < own_near * (1.0 - TOUCH) {
            continue;
        }
        work.crossings += 1;
        // A line that goes from right to left of the contour passes behind the surface on the left.
        let goes_left = at_from < at_to;
        let change = if goes_left { contour.change } else { -contour.change };
        events.push(Event { at, change, is_touch: near < own_near * (1.0 + TOUCH) });
    }
    events
}

/// The points where a line intersects faces.
fn piercings(
    screen: &Screen,
    line: &Line,
    met: &[u32],
    events: &mut Vec<Event>,
    work: &mut LineWork,
) {
    work.faces += met.len() as u64;
    for &item in met {
        let facet = &screen.facets[item as usize];
        if touches(facet, line) {
            continue;
        }
        let ahead = [0, 1].map(|i| line.ends[i].z - facet.nearness.at(line.ends[i].truncate()));
        let at = ahead[0] / (ahead[0] - ahead[1]);
        let is_level = |i: usize| ahead[i].abs() <= EQUAL * line.ends[i].z + facet.slack;
        if (ahead[0] > 0.0) == (ahead[1] > 0.0)
            || !(at > 0.0 && at < 1.0)
            || is_level(0)
            || is_level(1)
        {
            continue;
        }
        let inside = facet.inside(line.place(at));
        if inside > -TOUCH {
            work.piercings += 1;
            events.push(Event {
                at,
                change: if ahead[0] > 0.0 { 1 } else { -1 },
                is_touch: inside < TOUCH,
            });
        }
    }
}

/// True if a face has the line as an edge or one of the line's ends as a corner, so that the face
/// cannot hide the line there.
fn touches(facet: &Facet, line: &Line) -> bool {
    facet.corners().iter().any(|c| line.ends.contains(c))
}

/// Divides a line into segments.
fn divide(
    screen: &Screen,
    line: &Line,
    events: &[Event],
    faces: &[u32],
    out: &mut Vec<Stretch>,
    work: &mut LineWork,
) {
    let length = line.ends[0].truncate().distance(line.ends[1].truncate());
    let (mut from, mut number, mut is_unknown) = (line.range[0], 0i32, true);
    let start = out.len();
    for i in 0..=events.len() {
        let to = events.get(i).map_or(line.range[1], |e| e.at);
        if (to - from) * length > SHORTEST {
            if is_unknown || number < 0 {
                number = count(screen, line, (from + to) * 0.5, faces, work);
                work.counts += 1;
                is_unknown = false;
            }
            let stretch = Stretch {
                ends: [line.place(from), line.place(to)],
                nearness: [line.nearness(from), line.nearness(to)],
                invisibility: number.max(0) as u32,
                kind: line.kind,
            };
            match out.get_mut(start..).and_then(|own| own.last_mut()) {
                Some(last) if last.invisibility == stretch.invisibility => {
                    (last.ends[1], last.nearness[1]) = (stretch.ends[1], stretch.nearness[1]);
                }
                _ => out.push(stretch),
            }
        }
        if let Some(event) = events.get(i) {
            number += event.change;
            is_unknown |= event.is_touch;
            from = to;
        }
    }
}

/// The number of faces in front of a point of a line.
fn count(screen: &Screen, line: &Line, at: f64, faces: &[u32], work: &mut LineWork) -> i32 {
    let (place, near) = (line.place(at), line.nearness(at));
    work.faces += faces.len() as u64;
    let hides = |item: &&u32| {
        let facet = &screen.facets[**item as usize];
        let is_ahead = facet.nearness.at(place) > near * (1.0 + EQUAL) + facet.slack;
        is_ahead && !line.faces.contains(item) && facet.edges().iter().all(|edge| edge.holds(place))
    };
    faces.iter().filter(hides).count() as i32
}

/// Side of a cell, in pixels.
const CELL: f64 = 16.0;

/// Contours and faces by the cells of the picture that they overlap.
struct Cells {
    columns: usize,
    rows: usize,
    contours: u64,
    lines: Vec<Vec<u32>>,
    faces: Vec<Vec<u32>>,
    /// For each contour the last line that visited it, so that each is visited once per line.
    line_seen: Vec<u32>,
    /// For each face the last line that visited it.
    face_seen: Vec<u32>,
    turn: u32,
    /// The contours in the cells of the last line.
    lines_met: Vec<u32>,
    /// The faces in the cells of the last line.
    faces_met: Vec<u32>,
}

impl Cells {
    fn new(screen: &Screen, all: &[Line]) -> Self {
        let [columns, rows] = screen.size.map(|n| (f64::from(n) / CELL).ceil().max(1.0) as usize);
        let mut cells = Self {
            columns,
            rows,
            contours: 0,
            lines: vec![Vec::new(); columns * rows],
            faces: vec![Vec::new(); columns * rows],
            line_seen: vec![NOTHING; all.len()],
            face_seen: vec![NOTHING; screen.facets.len()],
            turn: 0,
            lines_met: Vec::new(),
            faces_met: Vec::new(),
        };
        for (i, line) in all.iter().enumerate().filter(|(_, line)| line.kind == LineKind::Contour) {
            cells.contours += 1;
            let on = cells.of_line(line);
            on.into_iter().for_each(|cell| cells.lines[cell].push(i as u32));
        }
        for (i, facet) in screen.facets.iter().enumerate() {
            let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            let places = facet.corners().iter().map(|c| c.truncate());
            let (low, high) = places.fold(start, |(low, high), p| (low.min(p), high.max(p)));
            let on = cells.within(low, high, |_, _| true);
            on.into_iter().for_each(|cell| cells.faces[cell].push(i as u32));
        }
        cells
    }

    /// The cells of a rectangle that satisfy a condition.
    fn within(
        &self,
        low: DVec2,
        high: DVec2,
        is_wanted: impl Fn(DVec2, DVec2) -> bool,
    ) -> Vec<usize> {
        let bound =
            |x: f64, count: usize| (x / CELL).floor().clamp(0.0, count as f64 - 1.0) as usize;
        let mut all = Vec::new();
        for row in bound(low.y - 1e-6, self.rows)..=bound(high.y + 1e-6, self.rows) {
            for column in bound(low.x - 1e-6, self.columns)..=bound(high.x + 1e-6, self.columns) {
                let corner = DVec2::new(column as f64, row as f64) * CELL;
                if is_wanted(corner - 1e-6, corner + CELL + 1e-6) {
                    all.push(row * self.columns + column);
                }
            }
        }
        all
    }

    /// The cells that a line crosses. Cells at the border stand for everything beyond.
    fn of_line(&self, line: &Line) -> Vec<usize> {
        let [a, b] = line.ends.map(|p| p.truncate());
        let edge = line.edge();
        let is_inner = |low: DVec2, high: DVec2| {
            low.x > 0.0
                && low.y > 0.0
                && high.x < self.columns as f64 * CELL
                && high.y < self.rows as f64 * CELL
        };
        self.within(a.min(b), a.max(b), |low, high| {
            let sides = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
                .map(|p| edge.holds(p));
            !is_inner(low, high) || sides.iter().any(|s| *s != sides[0])
        })
    }

    /// Collects contours and faces that a line may cross.
    fn near(&mut self, line: &Line) {
        self.lines_met.clear();
        self.faces_met.clear();
        for cell in self.of_line(line) {
            for &i in &self.lines[cell] {
                if std::mem::replace(&mut self.line_seen[i as usize], self.turn) != self.turn {
                    self.lines_met.push(i);
                }
            }
            for &i in &self.faces[cell] {
                if std::mem::replace(&mut self.face_seen[i as usize], self.turn) != self.turn {
                    self.faces_met.push(i);
                }
            }
        }
        self.turn += 1;
    }
}
