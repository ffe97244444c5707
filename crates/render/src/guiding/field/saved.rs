//! A finished field as it is stored and sent. The atlas is laid out again.

use super::{Atlas, Cell, Density, FACES, Field, MAX_CELLS, MAX_DEPTH, Node, Parallax};
use serde::{Deserialize, Serialize};
use snell_math::Vec3;

/// A finished field.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedField {
    origin: [f32; 3],
    scale: f32,
    /// For each node, the first of its two halves, or its region.
    nodes: Vec<Result<u32, u32>>,
    cells: Vec<SavedCell>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct SavedCell {
    density: Option<Density>,
    bsdf_share: f32,
    expected: f32,
    /// The anchor of the parallax, and its nearness.
    parallax: ([f32; 3], f32),
}

impl Field {
    /// The field as it is stored.
    pub fn saved(&self) -> SavedField {
        let node = |node: &Node| match *node {
            Node::Halves { first } => Ok(first),
            Node::Region(region) => Err(region),
        };
        let cell = |cell: &Cell| {
            let (anchor, nearness) = cell.parallax.parts();
            SavedCell {
                density: cell.density.clone(),
                bsdf_share: cell.bsdf_share,
                expected: cell.expected,
                parallax: (anchor.to_array(), nearness),
            }
        };
        SavedField {
            origin: self.origin.to_array(),
            scale: self.scale,
            nodes: self.nodes.iter().map(node).collect(),
            cells: self.cells.iter().map(cell).collect(),
        }
    }

    /// The field that was stored; `None` if it cannot be one.
    pub fn of_saved(saved: SavedField) -> Option<Self> {
        if !saved.is_valid() {
            return None;
        }
        let node = |node: &Result<u32, u32>| match *node {
            Ok(first) => Node::Halves { first },
            Err(region) => Node::Region(region),
        };
        let cell = |cell: SavedCell| Cell {
            density: cell.density,
            bsdf_share: cell.bsdf_share,
            expected: cell.expected,
            parallax: Parallax::from_parts(Vec3::from(cell.parallax.0), cell.parallax.1),
            ..Cell::new()
        };
        let mut field = Self {
            origin: Vec3::from(saved.origin),
            scale: saved.scale,
            nodes: saved.nodes.iter().map(node).collect(),
            atlas: Atlas::default(),
            cells: saved.cells.into_iter().map(cell).collect(),
            is_learning: false,
        };
        field.lay_out();
        Some(field)
    }
}

impl SavedField {
    fn is_valid(&self) -> bool {
        let finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
        let is_cell = |cell: &SavedCell| {
            (0.0..=1.0).contains(&cell.bsdf_share)
                && finite(&[cell.expected, cell.parallax.1])
                && finite(&cell.parallax.0)
                && cell.density.as_ref().is_none_or(Density::is_valid)
        };
        finite(&self.origin)
            && self.scale.is_finite()
            && (FACES..=2 * MAX_CELLS).contains(&self.cells.len())
            && self.nodes.len() >= FACES
            && self.cells.iter().all(is_cell)
            && self.are_trees()
    }

    /// True if the nodes are trees: each node but the roots is a half of one node before it.
    fn are_trees(&self) -> bool {
        let mut depths: Vec<Option<u32>> = vec![None; self.nodes.len()];
        depths[..FACES].fill(Some(0));
        (0..self.nodes.len()).all(|number| {
            let Some(depth) = depths[number] else { return false };
            match self.nodes[number] {
                Err(region) => (region as usize) < self.cells.len(),
                Ok(first) => {
                    let first = first as usize;
                    let Some(halves) = depths.get_mut(first..first.saturating_add(2)) else {
                        return false;
                    };
                    let are_new = first > number && halves.iter().all(Option::is_none);
                    halves.fill(Some(depth + 1));
                    are_new && depth < MAX_DEPTH
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::learnt;
    use super::*;

    #[test]
    fn a_field_is_the_same_after_it_was_stored() {
        let field = learnt();
        let again = Field::of_saved(field.saved()).expect("it is valid");
        assert!(again.known_regions() > 4 && again.known_regions() == field.known_regions());
        for i in 0..2000u32 {
            let u = |k| snell_math::rng::uniform2([i, k, 5, 5]);
            let position = Vec3::new(u(0).x * 2.0 - 1.0, 0.0, u(0).y * 2.0 - 1.0);
            let direction = snell_math::sampling::uniform_sphere(u(1));
            let [a, b] = [&field, &again].map(|field| field.cell(position, Vec3::Y));
            assert_eq!(a.bsdf_share, b.bsdf_share);
            let pdf = |cell: &Cell| cell.guide(position).map(|guide| guide.pdf(direction));
            assert_eq!(pdf(a), pdf(b));
            let sample = |cell: &Cell| cell.guide(position).map(|g| g.sample(u(2).x, u(3)));
            assert_eq!(sample(a), sample(b));
        }
    }

    #[test]
    fn what_is_no_field_is_refused() {
        let saved = learnt().saved();
        let is_refused = |change: &dyn Fn(&mut SavedField)| {
            let mut other = saved.clone();
            change(&mut other);
            Field::of_saved(other).is_none()
        };
        assert!(!is_refused(&|_| {}));
        assert!(is_refused(&|f| f.scale = f32::NAN));
        assert!(is_refused(&|f| f.nodes[2] = Ok(0)));
        assert!(is_refused(&|f| f.nodes[2] = Err(u32::MAX)));
        assert!(is_refused(&|f| f.nodes[0] = Ok(u32::MAX)));
        assert!(is_refused(&|f| f.nodes.truncate(3)));
        assert!(is_refused(&|f| f.cells.truncate(7)));
        let inner = saved.nodes.iter().position(Result::is_ok).expect("some node is halved");
        let last = saved.nodes.len() - 1;
        assert!(is_refused(&|f| f.nodes[last] = saved.nodes[inner]), "a node with two parents");
    }
}
