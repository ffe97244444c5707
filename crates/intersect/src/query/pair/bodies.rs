//! A point of each connected surface: where surfaces do not meet, one point of each says which are
//! inside others.

use super::scene::{PairMesh, PairScene};
use snell_math::{DVec3, DisjointSets};

impl PairMesh {
    /// A corner of each set of triangles that are joined at corners. Corners at equal positions are
    /// one.
    pub fn body_points(&self) -> Vec<DVec3> {
        // Both signs of zero are one position.
        let bits = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let corners = self.triangles.iter().enumerate();
        let mut keys: Vec<([u64; 3], u32)> =
            corners.flat_map(|(i, t)| t.iter().map(move |p| (bits(p), i as u32))).collect();
        keys.sort_unstable();
        let mut sets = DisjointSets::new(self.len());
        for pair in keys.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            sets.join(pair[0].1, pair[1].1);
        }
        let is_root = |&i: &usize| sets.root(i as u32) as usize == i;
        let roots = (0..self.len()).filter(is_root).collect::<Vec<_>>();
        roots.into_iter().map(|i| self.triangles[i][0] + self.origin).collect()
    }
}

impl PairScene {
    /// A point of each body of each part, in the coordinates of the scene.
    pub fn body_points(&self) -> Vec<DVec3> {
        let of = |part: &super::scene::Part| {
            let map = part.map;
            part.mesh.body_points().into_iter().map(move |p| map.transform_point3(p))
        };
        self.parts.iter().flat_map(of).collect()
    }
}
