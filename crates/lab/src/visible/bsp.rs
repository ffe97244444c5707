//! Priority by a tree of planes, built once for the scene and used for any eye (Schumacker, Brand,
//! Gilliland and Sharp, Study for Applying Computer-Generated Images to Visual Simulation, 1969;
//! Fuchs, Kedem and Naylor, On Visible Surface Generation by A Priori Tree Structures, SIGGRAPH
//! 1980).
//!
//! Each node divides space by the plane of a polygon, which stays at the node together with all
//! other polygons in that plane; polygons across the plane are cut. As seen from the eye, polygons
//! on the far side of the plane can never hide those on the plane, nor can those hide polygons on
//! the near side. So a traversal of the tree, far side first, gives a painting order; near side
//! first, it allows filling only empty pixels (Gordon and Chen, Front-to-Back Display of BSP Trees,
//! IEEE Computer Graphics and Applications 1991).
//!
//! Planes of polygons alone divide convex meshes badly, so large sets may also be divided by
//! axis-aligned planes without polygons, as Schumacker did between clusters of polygons.

use super::canvas::{Canvas, Seen};
use super::facet::{Facet, Nearness};
use super::pieces::{self, CutNode, Divider, Drawn, WHOLE};
use super::screen::Triangle;
use super::{NOTHING, Screen, VisibleError};
use snell_math::plane::{Plane, Side};
use snell_math::{DVec2, DVec3, rng};

/// Distances below this, relative to the coordinates of plane and polygon, count as zero.
const TOLERANCE: f64 = 1e-12;

/// Number of polygons whose planes are tried.
const CANDIDATES: usize = 6;
/// Number of polygons on which each plane is tried.
const SAMPLE: usize = 48;

/// The size of a set from which on it may be divided by an axis-aligned plane.
const LARGE: usize = 32;

/// The cost of a cut, in units of the difference between the numbers of polygons on both sides.
const CUT_COST: f64 = 6.0;

/// The maximum number of parts of a tree: `min(MOST_PARTS[0] n + MOST_PARTS[1], MOST_PARTS[2])` for
/// `n` triangles.
const MOST_PARTS: [u64; 3] = [40, 2_000_000, 16_000_000];

/// The index that stands for no child.
const EMPTY: u32 = u32::MAX;

/// A part of a triangle in space.
#[derive(Clone, Debug)]
struct Part {
    triangle: u32,
    /// The index of the part's last cut.
    cuts: u32,
    polygon: Vec<DVec3>,
}

#[derive(Debug)]
struct Node {
    plane: Plane,
    /// The triangle that defines the plane; [`NOTHING`] for an axis-aligned plane.
    triangle: u32,
    /// The range of parts on the plane in [`Tree::on`], as first and end, in ascending order of
    /// their triangles.
    on: [u32; 2],
    /// The subtrees behind and in front of the plane.
    children: [u32; 2],
}

/// The tree of a scene. It does not depend on the eye.
#[derive(Debug, Default)]
pub struct Tree {
    nodes: Vec<Node>,
    /// Triangle and last cut of each part.
    on: Vec<(u32, u32)>,
    /// Cuts by the planes of nodes; the `true` side is in front of the plane.
    cuts: Vec<CutNode<u32>>,
    /// The origin relative to which planes are given.
    centre: DVec3,
    depth: u32,
}

impl Tree {
    /// Builds the tree of all triangles of the world, visible or not.
    pub(super) fn build(screen: &Screen) -> Result<Self, VisibleError> {
        let centre = centre(&screen.triangles);
        let mut tree =
            Self { nodes: Vec::new(), on: Vec::new(), cuts: Vec::new(), centre, depth: 0 };
        let part = |(i, t): (usize, &Triangle)| {
            let polygon = t.corners.map(|c| c - centre).to_vec();
            Part { triangle: i as u32, cuts: WHOLE, polygon }
        };
        // Triangles without a plane are never visible.
        let parts: Vec<Part> = screen
            .triangles
            .iter()
            .enumerate()
            .map(part)
            .filter(|p| plane_of(&p.polygon).is_some())
            .collect();
        let most = (MOST_PARTS[0] * parts.len() as u64 + MOST_PARTS[1]).min(MOST_PARTS[2]);
        // The sets still to be divided, each with the reference to set for its node, and its depth.
        let mut todo = vec![(parts, None::<(usize, usize)>, 1)];
        while let Some((set, place, depth)) = todo.pop() {
            if set.is_empty() {
                continue;
            }
            let index = tree.nodes.len();
            if let Some((parent, child)) = place {
                tree.nodes[parent].children[child] = index as u32;
            }
            tree.depth = tree.depth.max(depth);
            let [back, front] = tree.divide(screen, set);
            if (tree.on.len() + tree.cuts.len()) as u64 > most {
                return Err(VisibleError::TooMuchWork {
                    what: "parts of polygons in the tree",
                    limit: most,
                });
            }
            todo.push((back, Some((index, 0)), depth + 1));
            todo.push((front, Some((index, 1)), depth + 1));
        }
        Ok(tree)
    }

    /// Makes a node. Returns the sets behind and in front of its plane.
    fn divide(&mut self, screen: &Screen, set: Vec<Part>) -> [Vec<Part>; 2] {
        let (plane, chosen) = choose(screen, self.centre, &set);
        let node = self.nodes.len() as u32;
        let mut sides = [Vec::new(), Vec::new()];
        let (mut on, count) = (Vec::new(), set.len());
        for (i, part) in set.into_iter().enumerate() {
            let side = if chosen == Some(i) { Side::On } else { plane.side(&part.polygon) };
            match side {
                // An axis-aligned plane holds no polygons.
                Side::On if chosen.is_some() => on.push((part.triangle, part.cuts)),
                Side::On | Side::Front => sides[1].push(part),
                Side::Back => sides[0].push(part),
                Side::Across => {
                    for (side, sign) in [(0, -1.0), (1, 1.0)] {
                        let mut polygon = Vec::with_capacity(part.polygon.len() + 1);
                        plane.cut(&part.polygon, sign, &mut polygon);
                        self.cuts.push(CutNode {
                            before: part.cuts,
                            divider: node,
                            side: side == 1,
                        });
                        let cuts = self.cuts.len() as u32 - 1;
                        sides[side].push(Part { triangle: part.triangle, cuts, polygon });
                    }
                }
            }
        }
        debug_assert!(chosen.is_some() || sides.iter().all(|s| s.len() < count));
        on.sort_unstable();
        let first = self.on.len() as u32;
        self.on.extend(on);
        let triangle = chosen.map_or(NOTHING, |_| plane.triangle);
        let on = [first, self.on.len() as u32];
        self.nodes.push(Node { plane: plane.plane, triangle, on, children: [EMPTY; 2] });
        sides
    }

    /// The numbers of nodes, parts and cuts, and the depth of the tree.
    pub fn statistics(&self) -> [u64; 4] {
        [
            self.nodes.len() as u64,
            self.on.len() as u64,
            self.cuts.len() as u64 / 2,
            self.depth.into(),
        ]
    }

    /// Size in bytes.
    pub fn memory(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.on[..]) + size_of_val(&self.cuts[..])
    }
}

/// A plane, and the triangle that defines it.
#[derive(Clone, Copy)]
struct Candidate {
    plane: Plane,
    triangle: u32,
}

impl Candidate {
    fn side(&self, polygon: &[DVec3]) -> Side {
        side_of(&self.plane, polygon)
    }

    fn cut(&self, polygon: &[DVec3], sign: f64, out: &mut Vec<DVec3>) {
        self.plane.cut(polygon, sign, out);
    }
}

/// The side on which a polygon lies, up to rounding.
fn side_of(plane: &Plane, polygon: &[DVec3]) -> Side {
    let reach =
        polygon.iter().fold(plane.offset.abs(), |reach, p| reach.max(p.abs().max_element()));
    plane.side(polygon, reach * TOLERANCE)
}

/// A point in the middle of most of the scene: the median of the corners on each axis, which a few
/// distant corners do not affect.
fn centre(triangles: &[Triangle]) -> DVec3 {
    let median = |axis: usize| {
        let mut all: Vec<f64> = triangles.iter().map(|t| t.corners[0][axis]).collect();
        let middle = all.len() / 2;
        if all.is_empty() { 0.0 } else { *all.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    DVec3::new(median(0), median(1), median(2))
}

/// The plane of a polygon, from its first corners.
fn plane_of(corners: &[DVec3]) -> Option<Plane> {
    let (a, b, c) = (*corners.first()?, *corners.get(1)?, *corners.get(2)?);
    let normal = (b - a).cross(c - a).try_normalize()?;
    Some(Plane { normal, offset: normal.dot((a + b + c) / 3.0) })
}

/// The plane of a triangle of the world, which all its parts share.
fn plane_of_triangle(screen: &Screen, centre: DVec3, triangle: u32) -> Option<Plane> {
    plane_of(&screen.triangles[triangle as usize].corners.map(|c| c - centre))
}

/// A plane that divides a set well, and the index of the part that defines it; `None` for an
/// axis-aligned plane, which leaves a smaller set on either side.
fn choose(screen: &Screen, centre: DVec3, set: &[Part]) -> (Candidate, Option<usize>) {
    let count = set.len();
    let pick = |k: usize, of: usize| {
        (k * count / of + rng::hash32((k + count) as u32) as usize % count) % count
    };
    let sample: Vec<&Part> = (0..SAMPLE.min(count))
        .map(|k| if count <= SAMPLE { &set[k] } else { &set[pick(k, SAMPLE)] })
        .collect();
    let score = |candidate: &Candidate| {
        let (mut sides, mut cuts) = ([0.0f64; 2], 0.0);
        for part in &sample {
            match candidate.side(&part.polygon) {
                Side::On => {}
                Side::Back => sides[0] += 1.0,
                Side::Front => sides[1] += 1.0,
                Side::Across => cuts += 1.0,
            }
        }
        (sides[0] - sides[1]).abs() + CUT_COST * cuts
    };
    let mut best: Option<(f64, Candidate, Option<usize>)> = None;
    let consider = |candidate: Candidate,
                    part: Option<usize>,
                    best: &mut Option<(f64, Candidate, Option<usize>)>| {
        let score = score(&candidate);
        if best.as_ref().is_none_or(|b| score < b.0) {
            *best = Some((score, candidate, part));
        }
    };
    for k in 0..CANDIDATES.min(count) {
        let i = if count <= CANDIDATES { k } else { pick(k, CANDIDATES) };
        if let Some(plane) = plane_of_triangle(screen, centre, set[i].triangle) {
            consider(Candidate { plane, triangle: set[i].triangle }, Some(i), &mut best);
        }
    }
    if count > LARGE {
        for axis in DVec3::AXES {
            let mut middles: Vec<f64> = sample
                .iter()
                .map(|part| {
                    part.polygon.iter().map(|p| axis.dot(*p)).sum::<f64>()
                        / part.polygon.len() as f64
                })
                .collect();
            middles.sort_by(f64::total_cmp);
            let plane = Plane { normal: axis, offset: middles[middles.len() / 2] };
            let (mut behind, mut before) = (0, 0);
            for part in set {
                let side = side_of(&plane, &part.polygon);
                behind += usize::from(matches!(side, Side::Back | Side::Across));
                before += usize::from(side != Side::Back);
            }
            if behind < count && before < count {
                consider(Candidate { plane, triangle: NOTHING }, None, &mut best);
            }
        }
    }
    let (_, candidate, part) = best.expect("every part has the plane of its triangle");
    (candidate, part)
}

/// The planes of the tree as seen from the eye.
struct Sight<'a> {
    screen: &'a Screen,
    tree: &'a Tree,
    eye: DVec3,
}

impl Sight<'_> {
    /// True if the eye is in front of the plane of a node.
    fn is_eye_before(&self, node: &Node) -> bool {
        node.plane.distance(&self.eye) > 0.0
    }

    /// The cut at the plane of a node, as a cut of the picture: the front side is nearer than the
    /// plane if the eye is in front of the plane.
    fn cut(&self, node: u32, is_before: bool) -> (Divider, bool) {
        let (divider, true_is_before) = self.divider(node);
        (divider, is_before == true_is_before)
    }

    /// The divider at the plane of a node, and whether the divider's `true` side is in front of the
    /// plane.
    fn divider(&self, node: u32) -> (Divider, bool) {
        let node = &self.tree.nodes[node as usize];
        if node.triangle != NOTHING
            && let Some(facet) = self.screen.facet_of(node.triangle)
        {
            let item = self.screen.item(self.screen.triangles[node.triangle as usize].id);
            return (Divider::Plane(facet.nearness, item), self.is_eye_before(node));
        }
        // On the ray of a place, the plane is where normal . direction / nearness equals the
        // distance of the plane from the eye.
        let middle = DVec2::new(self.screen.size[0].into(), self.screen.size[1].into()) * 0.5;
        let along = |p: DVec2| node.plane.normal.dot(self.screen.view.direction(p));
        let value = along(middle);
        let slope = DVec2::new(along(middle + DVec2::X) - value, along(middle + DVec2::Y) - value);
        let distance = -node.plane.distance(&self.eye);
        let scale = node.plane.offset.abs() + self.eye.length();
        if distance.abs() <= 1e-14 * scale {
            let line = Nearness { anchor: middle, slope, value };
            return (Divider::EdgeOn(line, line.slack(middle * 2.0)), true);
        }
        let nearness =
            Nearness { anchor: middle, slope: slope / distance, value: value / distance };
        (Divider::Plane(nearness, NOTHING), self.is_eye_before(node))
    }
}

/// Rows with links that skip filled pixels.
struct Mask {
    width: usize,
    /// For each row and each column of it (and one column beyond), a link to the right that skips
    /// only filled pixels. An empty pixel links to itself.
    next: Vec<u32>,
}

impl Mask {
    fn new([width, height]: [u32; 2]) -> Self {
        let next = (0..height).flat_map(|_| 0..=width).collect();
        Self { width: width as usize + 1, next }
    }

    /// The first empty column from `x` on.
    fn empty_from(&mut self, x: u32, y: u32) -> u32 {
        let row = &mut self.next[y as usize * self.width..][..self.width];
        let mut end = x;
        while row[end as usize] != end {
            end = row[end as usize];
        }
        // This shortens the path for the next search.
        let mut at = x;
        while at != end {
            at = std::mem::replace(&mut row[at as usize], end);
        }
        end
    }

    fn fill(&mut self, x: u32, y: u32) {
        self.next[y as usize * self.width + x as usize] = x + 1;
    }

    /// Paints empty pixels only. Returns the number of pixels.
    fn paint(&mut self, screen: &Screen, canvas: &mut Canvas, part: &Drawn) -> u64 {
        let facet = &screen.facets[part.item as usize];
        let [columns, rows] = part.window(facet);
        let mut written = 0;
        for y in rows {
            let [first, end] = facet.span(y);
            let end = end.min(columns.end);
            let mut x = first.max(columns.start);
            while x < end {
                x = self.empty_from(x, y);
                if x < end {
                    let pixel = canvas.pixel(x, y);
                    canvas.charge(pixel);
                    if part.holds(facet, x, y) {
                        canvas.items[pixel] = part.item;
                        self.fill(x, y);
                        written += 1;
                    }
                    x += 1;
                }
            }
        }
        written
    }
}

/// A remaining step: the subtree of a node, or the polygons on its plane.
enum Step {
    Below(u32),
    On(u32),
}

/// Traverses the tree and paints, from back to front or from front to back.
pub(super) fn run(screen: &Screen, tree: &Tree, from_front: bool, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut mask = from_front.then(|| Mask::new(screen.size));
    let eye = screen.view.apex().unwrap_or_default() - tree.centre;
    let sight = Sight { screen, tree, eye };
    let (mut nodes, mut parts, mut written) = (0, 0, 0);
    let mut cuts = Vec::new();
    let mut todo = vec![Step::Below(if tree.nodes.is_empty() { EMPTY } else { 0 })];
    while let Some(step) = todo.pop() {
        match step {
            Step::Below(EMPTY) => {}
            Step::Below(index) => {
                nodes += 1;
                let node = &tree.nodes[index as usize];
                let near = usize::from(sight.is_eye_before(node));
                let [first, second] = if from_front { [near, 1 - near] } else { [1 - near, near] };
                todo.push(Step::Below(node.children[second]));
                todo.push(Step::On(index));
                todo.push(Step::Below(node.children[first]));
            }
            Step::On(index) => {
                let [first, end] = tree.nodes[index as usize].on.map(|i| i as usize);
                for i in 0..end - first {
                    // Of coincident polygons, the one with the lowest number is visible.
                    let (triangle, last) =
                        tree.on[if from_front { first + i } else { end - 1 - i }];
                    let Some(facet) = screen.facet_of(triangle).filter(|f| f.has_pixels()) else {
                        continue;
                    };
                    cuts.clear();
                    cuts.extend(
                        pieces::chain(&tree.cuts, last).map(|(node, side)| sight.cut(node, side)),
                    );
                    let Some(extent) = extent(screen, facet, &cuts) else { continue };
                    parts += 1;
                    let item = screen.item(screen.triangles[triangle as usize].id);
                    let part = Drawn { item, extent, cuts: &cuts };
                    written += match &mut mask {
                        None => part.paint(screen, &mut canvas),
                        Some(mask) => mask.paint(screen, &mut canvas, &part),
                    };
                }
            }
        }
    }
    let [_, _, cuts, depth] = tree.statistics();
    let memory = tree.memory() + mask.map_or(0, |m| size_of_val(&m.next[..]));
    let work = vec![
        ("nodes", nodes),
        ("depth", depth),
        ("cuts", cuts),
        ("painted", parts),
        ("written", written),
    ];
    canvas.seen(work, memory)
}

/// Bounds on the pixels of a part; `None` if it has no pixels.
fn extent(screen: &Screen, facet: &Facet, cuts: &[(Divider, bool)]) -> Option<(DVec2, DVec2)> {
    let size = DVec2::new(screen.size[0].into(), screen.size[1].into());
    let mut outline = pieces::whole(facet, size);
    for (divider, side) in cuts {
        outline = pieces::clipped(&outline, facet, divider, *side, size);
    }
    (outline.len() > 2).then(|| pieces::extent(&outline))
}
