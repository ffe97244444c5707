//! The order in which the paths of a batch are shaded: sorted by material, so that shaders get full
//! batches.

use super::materials::matte_surfaces::MatteSurfaces;
use crate::compile::CompiledScene;
use crate::volume::Surroundings;
use snell_intersect::Hit;
use std::rc::Rc;

/// Sorts paths by material, reusing its buffers.
#[derive(Debug, Default)]
pub struct Order<'a> {
    matte: Option<Rc<MatteSurfaces<'a>>>,
    /// The paths in order.
    pub paths: Vec<u32>,
    /// The number of leading paths that are known to be on matte surfaces.
    pub matte_count: usize,
    /// As [`super::Batch::materials`].
    pub materials: Vec<u32>,
    /// Paths on surfaces that are not matte, or all, in the order of their numbers.
    surfaces: Vec<u32>,
    /// Paths without a hit.
    missed: Vec<u32>,
    /// The first position of each material.
    starts: Vec<u32>,
}

impl<'a> Order<'a> {
    /// For a scene with these matte surfaces.
    pub fn new(matte: Option<Rc<MatteSurfaces<'a>>>) -> Self {
        Self { matte, ..Self::default() }
    }

    /// Sorts paths by the material of these hits; misses come last. The paths of one sample stay in
    /// order, so that sums have one order.
    pub fn by_material(&mut self, scene: &CompiledScene, hits: &[Hit]) {
        self.matte_count = 0;
        self.paths.resize(hits.len(), 0);
        self.surfaces.clear();
        self.surfaces.extend(0..hits.len() as u32);
        self.sort_surfaces(scene, hits, 0);
    }

    /// Sorts paths of different samples, whose order does not affect any sum: first all on matte
    /// surfaces, then others by material, then those that leave the scene, then those that media
    /// scattered.
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
            // (Written to all three: branches on what rays hit are mispredicted.)
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
        // What leaves a dark scene finds nothing.
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

    /// Puts `self.surfaces` into the order, by material, from this place on.
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
        // Counting sort: first the number of each, then the position of the first of each.
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
