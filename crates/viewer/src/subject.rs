//! What a scene shows, without the ground it stands on, the walls around it and the sky.
//!
//! The parts of the scene are boxes, turned as their nodes are. From the largest to the smallest,
//! a part is background if it bounds all others that are left: a flat one with all of them on one
//! side, none of which reaches beyond its edges, or one that has the camera and all of them inside.
//! Those that are not clearly larger than what is left in the end are parts of it after all.

use snell_math::{Bounds3d, DAffine3, DVec3};
use snell_scene::{NodeId, Scene};

/// Maximum number of parts. What is more is bounded by the boxes of nodes higher up.
const MAX_PARTS: usize = 20_000;
/// Maximum number of parts of the background.
const MAX_BACKGROUND: usize = 32;
/// The thickness of a flat part, divided by its smaller other side, is at most this.
const FLAT: f64 = 0.06;
/// The fraction of its extent by which the rest may reach beyond the background.
const SLACK: f64 = 0.1;
/// The background is larger than the subject by this factor.
const LARGER: f64 = 1.25;

/// The boxes of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Extents {
    /// The box around everything finite.
    pub bounds: Bounds3d,
    /// The box around the subject.
    pub subject: Bounds3d,
    /// Height of the ground under the subject, along the up direction.
    pub ground: Option<f64>,
}

/// A box in the world.
#[derive(Clone, Copy, Debug)]
struct Part {
    /// Its middle.
    center: DVec3,
    /// From the middle to the middle of three of its sides, the shortest last.
    half: [DVec3; 3],
    /// The box along the axes around it.
    bounds: Bounds3d,
}

impl Part {
    fn new(bounds: &Bounds3d, world_from_object: &DAffine3) -> Option<Self> {
        if bounds.is_empty() || !bounds.is_finite() {
            return None;
        }
        let center = world_from_object.transform_point3(bounds.center());
        let size = (bounds.max - bounds.min) / 2.0;
        let axis = |i: usize| world_from_object.matrix3.col(i) * size[i];
        let mut half = [axis(0), axis(1), axis(2)];
        let reach = half.iter().fold(DVec3::ZERO, |sum, axis| sum + axis.abs());
        half.sort_by(|a, b| b.length().total_cmp(&a.length()));
        let bounds = Bounds3d { min: center - reach, max: center + reach };
        bounds.is_finite().then_some(Self { center, half, bounds })
    }

    fn radius(&self) -> f64 {
        (self.bounds.max - self.bounds.min).length()
    }

    /// The direction that a flat part faces, to either side.
    fn facing(&self) -> Option<DVec3> {
        let [long, wide, thin] = self.half;
        if !(wide.length() > 0.0 && thin.length() <= FLAT * wide.length()) {
            return None;
        }
        long.cross(wide).try_normalize()
    }

    /// True if it is flat, and the box lies on one side of it and not beyond its edges.
    fn backs(&self, rest: &Bounds3d) -> bool {
        let Some(normal) = self.facing() else { return false };
        let (middle, size) = (rest.center() - self.center, (rest.max - rest.min) / 2.0);
        let reach = |direction: DVec3| direction.abs().dot(size);
        let is_aside =
            middle.dot(normal).abs() >= reach(normal) * (1.0 - 2.0 * SLACK) - self.half[2].length();
        let is_within = self.half[..2].iter().all(|side| {
            let direction = side.normalize();
            middle.dot(direction).abs() + reach(direction) * (1.0 - SLACK)
                <= side.length() * (1.0 + SLACK)
        });
        is_aside && is_within
    }

    /// True if it has both the box and the eye inside.
    fn surrounds(&self, rest: &Bounds3d, eye: Option<DVec3>) -> bool {
        let slack = (self.bounds.max - self.bounds.min) * 0.02;
        let is_inside = |low: DVec3, high: DVec3| {
            low.cmpge(self.bounds.min - slack).all() && high.cmple(self.bounds.max + slack).all()
        };
        eye.is_some_and(|eye| is_inside(eye, eye)) && is_inside(rest.min, rest.max)
    }

    /// True if it is larger than the subject: a flat one along both of its sides, another along all
    /// axes.
    fn is_larger_than(&self, subject: &Bounds3d) -> bool {
        let size = (subject.max - subject.min) / 2.0;
        let Some(_) = self.facing() else {
            return (self.bounds.max - self.bounds.min).cmpge(size * (2.0 * LARGER)).all();
        };
        let is_longer = |side: &DVec3| side.length() >= LARGER * side.normalize().abs().dot(size);
        self.half[..2].iter().all(is_longer)
    }
}

/// The boxes of a scene with this direction up, for its first view from `eye`. A scene without
/// anything finite has a box of two units.
pub fn extents(scene: &Scene, up: DVec3, eye: Option<DVec3>) -> Extents {
    let parts = parts(scene);
    let Some(bounds) = around(&parts) else {
        let unit = Bounds3d { min: DVec3::NEG_ONE, max: DVec3::ONE };
        return Extents { bounds: unit, subject: unit, ground: None };
    };
    let (subject, background) = separate(parts, eye);
    let up = up.try_normalize().unwrap_or(DVec3::Y);
    let lies_under = |part: &&Part| {
        let is_level = part.facing().is_some_and(|normal| normal.dot(up).abs() > 0.99);
        is_level && part.center.dot(up) <= subject.center().dot(up)
    };
    let height = |part: &Part| part.center.dot(up) + part.half[2].dot(up).abs();
    let ground = background.iter().filter(lies_under).map(height).reduce(f64::max);
    Extents { bounds, subject, ground }
}

/// The box around the subject, and the parts of the background.
fn separate(mut parts: Vec<Part>, eye: Option<DVec3>) -> (Bounds3d, Vec<Part>) {
    parts.sort_by(|a, b| b.radius().total_cmp(&a.radius()));
    let mut background = Vec::new();
    let mut at = 0;
    // The boxes around the parts from each one on; those before it that stay are in `kept`.
    let mut smaller: Vec<Option<Bounds3d>> = vec![None; parts.len() + 1];
    for (i, part) in parts.iter().enumerate().rev() {
        smaller[i] = Some(smaller[i + 1].map_or(part.bounds, |b| b.union(&part.bounds)));
    }
    let mut kept: Option<Bounds3d> = None;
    while at < parts.len() && background.len() < MAX_BACKGROUND {
        let part = parts[at];
        let rest = [kept, smaller[at + 1]].into_iter().flatten().reduce(|a, b| a.union(&b));
        let Some(rest) = rest else { break };
        if part.backs(&rest) || part.surrounds(&rest, eye) {
            background.push(part);
        } else {
            kept = Some(kept.map_or(part.bounds, |kept| kept.union(&part.bounds)));
        }
        at += 1;
    }
    let left = [kept, smaller[at]].into_iter().flatten().reduce(|a, b| a.union(&b));
    let left = left.unwrap_or(parts[0].bounds);
    let (background, own): (Vec<Part>, Vec<Part>) =
        background.into_iter().partition(|part| part.is_larger_than(&left));
    (own.iter().fold(left, |subject, part| subject.union(&part.bounds)), background)
}

fn around(parts: &[Part]) -> Option<Bounds3d> {
    parts.iter().map(|part| part.bounds).reduce(|a, b| a.union(&b))
}

/// The finite surfaces of a scene.
fn parts(scene: &Scene) -> Vec<Part> {
    let Ok(of_nodes) = scene.node_bounds() else { return Vec::new() };
    let mut parts = Vec::new();
    let place = |id: NodeId| scene.nodes[id.index()].transform;
    let mut open = vec![(scene.root, place(scene.root))];
    while let Some((id, world_from_node)) = open.pop() {
        let node = &scene.nodes[id.index()];
        let count = node.surfaces.len() + node.children.len();
        if parts.len() + open.len() + count > MAX_PARTS {
            parts.extend(Part::new(&of_nodes[&id], &world_from_node));
            continue;
        }
        let own = node.surfaces.iter().map(|surface| surface.geometry.bounds());
        parts.extend(own.filter_map(|bounds| Part::new(&bounds, &world_from_node)));
        open.extend(node.children.iter().map(|&child| (child, world_from_node * place(child))));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::builtin::{BUILTINS, builtin};

    fn of(name: &str) -> (Scene, Extents) {
        let scene = builtin(name).expect("it is built in");
        let up = scene.settings.up.unwrap_or(DVec3::Y);
        let extents = extents(&scene, up, scene.cameras.first().map(|camera| camera.eye));
        (scene, extents)
    }

    #[test]
    fn ground_and_walls_are_not_the_subject() {
        for name in ["smoke", "teapot"] {
            let (_, extents) = of(name);
            let [subject, all] =
                [extents.subject, extents.bounds].map(|b| (b.max - b.min).length());
            assert!(subject < 0.8 * all, "{name}: {extents:?}");
            assert!(extents.ground.is_some_and(|height| height.abs() < 0.01), "{name}");
        }
    }

    #[test]
    fn every_scene_has_a_subject_within_its_bounds() {
        for known in BUILTINS {
            let (_, Extents { bounds, subject, .. }) = of(known.name);
            assert!(subject.is_finite() && !subject.is_empty(), "{}", known.name);
            assert!(
                subject.min.cmpge(bounds.min).all() && subject.max.cmple(bounds.max).all(),
                "{}",
                known.name
            );
        }
    }

    fn slab(center: [f64; 3], half: [f64; 3]) -> Part {
        let bounds = Bounds3d { min: -DVec3::from(half), max: DVec3::from(half) };
        let place = DAffine3::from_translation(DVec3::from(center));
        Part::new(&bounds, &place).expect("it is finite")
    }

    #[test]
    fn both_halves_of_a_folder_and_sheets_are_subjects() {
        let base = slab([0.0, 0.0, 0.0], [3.0, 0.05, 2.0]);
        let screen = slab([0.0, 1.5, -2.0], [3.0, 1.5, 0.05]);
        let (subject, background) = separate(vec![base, screen], None);
        assert!(background.is_empty());
        assert_eq!(subject, base.bounds.union(&screen.bounds));
        assert_eq!(separate(vec![base], None).0, base.bounds);
    }

    #[test]
    fn a_room_is_background_from_inside_and_a_case_is_not_from_outside() {
        let room = slab([0.0, 5.0, 0.0], [10.0, 5.0, 10.0]);
        let chair = slab([1.0, 1.0, 1.0], [0.5, 1.0, 0.5]);
        let inside = separate(vec![room, chair], Some(DVec3::new(4.0, 2.0, 4.0)));
        assert_eq!(inside.0, chair.bounds);
        let outside = separate(vec![room, chair], Some(DVec3::new(40.0, 2.0, 40.0)));
        assert_eq!(outside.0, room.bounds);
    }
}
