//! The order in which the paths of a batch are shaded. They are sorted by material, so that shaders
//! get full batches.

use super::materials::matte_surfaces::MatteSurfaces;
use crate::compile::CompiledScene;
use crate::volume::Surroundings;
use snell_intersect::Hit;
use std::rc::Rc;

/// Sorts paths by material and reuses its buffers from batch to batch.
#[derive(Debug, Default)]
pub struct Order<'a> {
    matte: Option<Rc<MatteSurfaces<'a>>>,
    /// The numbers of the paths in the order in which they are shaded.
    pub paths: Vec<u32>,
    /// The number of paths at the front of [`Self::paths`] that are on matte surfaces.
    pub matte_count: usize,
    /// See [`super::Batch::materials`].
    pub materials: Vec<u32>,
    /// The paths that [`Self::sort_surfaces`] sorts, in the order of their numbers.
    surfaces: Vec<u32>,
    /// The paths without a hit.
    missed: Vec<u32>,
    /// Buffer of the counting sort: the first position of each material.
    starts: Vec<u32>,
}

impl<'a> Order<'a> {
    /// Makes the order for a scene with these matte surfaces.
    pub fn new(matte: Option<Rc<MatteSurfaces<'a>>>) -> Self {
        Self { matte, ..Self::default() }
    }

    /// Sorts paths by the material of these hits; misses come last. Paths on the same material stay
    /// in order, so that sums of a sample's light always have the same order.
    pub fn by_material(&mut self, scene: &CompiledScene, hits: &[Hit]) {
        self.matte_count = 0;
        self.paths.resize(hits.len(), 0);
        self.surfaces.clear();
        self.surfaces.extend(0..hits.len() as u32);
        self.sort_surfaces(scene, hits, 0);
    }

    /// Sorts paths of different samples, whose order does not affect any sum: first paths on matte
    /// surfaces, then other surfaces by material, then paths that leave the scene, then paths that
    /// media have scattered.
    pub fn matte_first(
        &mut self,
        scene: &CompiledScene,
        hits: &[Hit],
        media: Option<&Surroundings>,
    ) {
        let count = hits.len();
        let [matte, surfaces, missed] = [&mut self.paths, &mut self.surfaces, &mut self.missed]
            .map(|list| {
                list.resize(count, 0);
                &mut list[..count]
            });
        let mut counts = [0; 3];
        for (path, hit) in (0..).zip(hits) {
            let is_matte = self.matte.as_ref().is_some_and(|surfaces| surfaces.has(scene, hit));
            let is_missed = !hit.is_hit();
            // Each path is written to all three lists and counted in one, because branches on what
            // rays hit are mispredicted.
            (matte[counts[0]], surfaces[counts[1]], missed[counts[2]]) = (path, path, path);
            counts[0] += usize::from(is_matte);
            counts[1] += usize::from(!is_matte & !is_missed);
            counts[2] += usize::from(is_missed);
        }
        self.matte_count = counts[0];
        self.surfaces.truncate(counts[1]);
        self.missed.truncate(counts[2]);
        self.sort_surfaces(scene, hits, counts[0]);
        if self.missed.is_empty() {
            return;
        }
        // Paths that leave a dark scene find no light and need not be shaded.
        if media.is_none() && scene.is_dark_outside() {
            return self.paths.truncate(count - counts[2]);
        }
        self.materials.resize(count, 0);
        for &path in &self.missed {
            self.materials[path as usize] = scene.materials.len() as u32;
        }
        let last = &mut self.paths[count - counts[2]..];
        let Some(media) = media else { return last.copy_from_slice(&self.missed) };
        let is_scattered = |path: &&u32| media.scattered[**path as usize].is_some();
        let (scattered, leaving): (Vec<u32>, Vec<u32>) = self.missed.iter().partition(is_scattered);
        let (first, second) = last.split_at_mut(leaving.len());
        first.copy_from_slice(&leaving);
        second.copy_from_slice(&scattered);
    }

    /// Sorts `self.surfaces` by material into `self.paths`, from position `from` on.
    fn sort_surfaces(&mut self, scene: &CompiledScene, hits: &[Hit], from: usize) {
        let surfaces = &self.surfaces;
        if surfaces.is_empty() {
            return;
        }
        let last = scene.materials.len();
        let key = |hit: &Hit| if hit.is_hit() { scene.material_id(hit).index() } else { last };
        self.materials.resize(hits.len(), 0);
        for &path in surfaces {
            self.materials[path as usize] = key(&hits[path as usize]) as u32;
        }
        let (keys, order) = (&self.materials, &mut self.paths[from..][..surfaces.len()]);
        if last > surfaces.len() {
            order.copy_from_slice(surfaces);
            order.sort_by_key(|&path| keys[path as usize]);
            return;
        }
        // Counting sort: counts the paths of each material, then finds the first position of each
        // material.
        self.starts.clear();
        self.starts.resize(last + 2, 0);
        surfaces.iter().for_each(|&path| self.starts[keys[path as usize] as usize + 1] += 1);
        (0..=last).for_each(|key| self.starts[key + 1] += self.starts[key]);
        for &path in surfaces {
            let at = &mut self.starts[keys[path as usize] as usize];
            order[*at as usize] = path;
            *at += 1;
        }
    }
}
