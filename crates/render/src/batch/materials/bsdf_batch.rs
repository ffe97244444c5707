//! Batches of BSDFs: all vertices of one material are evaluated together, with the same bits as
//! [`super::general`] computes one by one.

use super::general::{Bounces, Scattered};
use crate::batch::lights::horizon;
use crate::batch::plain_surfaces::Frames;
use crate::batch::vertices::CarriedLanes;
use crate::lanes::{BLACK, HitColors, LANES, ZERO, at, at_level_by_color, put, put_color};
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::{Bits, Wide, mask_select, mask_select_vector};
use snell_math::{ColorModel, at_level};
use snell_scene::bsdf::{BATCH, BatchBsdf, BatchInputs, BatchOutputs, BatchPoint, LobeSpectra};

/// The BSDFs of vertices. Arrays are by lane; lanes that were not added hold arbitrary values.
#[derive(Debug)]
pub struct BsdfBatch<'a> {
    color: ColorModel,
    /// The BSDF of each lane; `None` for lanes that were not added.
    bsdfs: [Option<&'a BatchBsdf>; LANES],
    is_any: bool,
    /// 1 for lanes that were added, 0 for others.
    has: [u32; LANES],
    /// The normal of the plane above which light is reflected and below which it is refracted.
    horizon: HitVectors,
    /// The cosine between `horizon` and the outgoing direction.
    side: HitLanes,
    /// The columns of [`BatchPoint`].
    spectra: LobeSpectra<HitColors>,
    alpha: HitLanes,
    metalness: HitLanes,
    /// Outgoing and incident directions in the frames of the surfaces.
    wo: HitVectors,
    wi: HitVectors,
    found: Box<Found>,
}

/// The columns of [`BatchOutputs`], by lane.
#[derive(Debug)]
struct Found {
    value: HitColors,
    pdf: HitLanes,
    weight: HitColors,
    drawn: HitVectors,
    drawn_pdf: HitLanes,
    is_delta: [u32; LANES],
    is_transmission: [u32; LANES],
    crossing: HitLanes,
    exists: [u32; LANES],
}

/// Surfaces with the directions from which they are seen.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    pub frames: &'a Frames,
    /// Geometric normals.
    pub flat: &'a HitVectors,
    /// Directions towards the origins of the rays.
    pub wo: &'a HitVectors,
    /// See [`crate::integrator::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

impl BsdfBatch<'_> {
    /// An empty batch for paths of this colour model.
    pub fn new(color: ColorModel) -> Self {
        let (number, mark) = ([0.0; LANES], [0; LANES]);
        Self {
            color,
            bsdfs: [None; LANES],
            is_any: false,
            has: mark,
            horizon: ZERO,
            side: number,
            spectra: LobeSpectra { base: BLACK, specular: BLACK, other: BLACK },
            alpha: number,
            metalness: number,
            wo: ZERO,
            wi: ZERO,
            found: Box::new(Found {
                value: BLACK,
                pdf: number,
                weight: BLACK,
                drawn: ZERO,
                drawn_pdf: number,
                is_delta: mark,
                is_transmission: mark,
                crossing: number,
                exists: mark,
            }),
        }
    }
}

impl<'a> BsdfBatch<'a> {
    /// Removes all lanes.
    pub fn clear(&mut self) {
        (self.bsdfs, self.is_any, self.has) = ([None; LANES], false, [0; LANES]);
    }

    /// Adds a lane with this BSDF and the BSDF's values at the lane's point.
    pub fn put(&mut self, lane: usize, bsdf: &'a BatchBsdf, at: &BatchPoint) {
        put_color(&mut self.spectra.base, lane, at.spectra.base);
        if self.color == ColorModel::Spectral {
            put_color(&mut self.spectra.specular, lane, at.spectra.specular);
            put_color(&mut self.spectra.other, lane, at.spectra.other);
        }
        (self.alpha[lane], self.metalness[lane]) = (at.alpha, at.metalness);
        (self.bsdfs[lane], self.is_any, self.has[lane]) = (Some(bsdf), true, 1);
    }

    /// True if this lane was added.
    pub fn has(&self, lane: usize) -> bool {
        self.has[lane] != 0
    }

    /// Computes what does not depend on the lights, and the normals on the side of the paths
    /// (`facing`).
    pub fn prepare(&mut self, seen: &Seen, facing: &mut HitVectors, wide: Option<Wide>) {
        if !self.is_any {
            return;
        }
        at_level!(
            wide,
            prepare,
            (
                seen: &Seen<'_> = seen,
                to: &mut BsdfBatch<'_> = self,
                facing: &mut HitVectors = facing
            )
        );
    }

    /// Evaluates the BSDFs for the directions `wi` to the lights, and samples them with the random
    /// numbers `u_lobe` for lobes and `u` for directions.
    pub fn evaluate(
        &mut self,
        frames: &Frames,
        wi: &HitVectors,
        (u_lobe, u): (&HitLanes, &[HitLanes; 2]),
        wide: Option<Wide>,
    ) {
        if !self.is_any {
            return;
        }
        at_level!(
            wide,
            turn,
            (frames: &Frames = frames, from: &HitVectors = wi, to: &mut HitVectors = &mut self.wi)
        );
        let mut outputs = BatchOutputs::default();
        for block in 0..LANES / BATCH {
            let inputs = BatchInputs {
                is_active: &[0; BATCH],
                spectra: self
                    .spectra
                    .each_ref()
                    .map(|colors| colors.each_ref().map(|channel| lanes_of(channel, block))),
                color: self.color,
                alpha: lanes_of(&self.alpha, block),
                metalness: lanes_of(&self.metalness, block),
                wo: blocks(&self.wo, block),
                wi: blocks(&self.wi, block),
                u_lobe: lanes_of(u_lobe, block),
                u: [lanes_of(&u[0], block), lanes_of(&u[1], block)],
            };
            let bsdfs = &self.bsdfs[block * BATCH..][..BATCH];
            let mut is_done = [false; BATCH];
            for (first, bsdf) in bsdfs.iter().enumerate() {
                let Some(bsdf) = bsdf.filter(|_| !is_done[first]) else { continue };
                let mut of = [0; BATCH];
                for (i, other) in bsdfs.iter().enumerate() {
                    if other.is_some_and(|other| std::ptr::eq(other, bsdf)) {
                        (is_done[i], of[i]) = (true, 1);
                    }
                }
                bsdf.evaluate(&BatchInputs { is_active: &of, ..inputs }, &mut outputs, wide);
                self.found.take(block, &of, &outputs, (self.color, wide));
            }
        }
    }

    /// Writes BSDF values and samples, in world space, to the lanes that were added.
    pub fn write(
        &self,
        (frames, wi): (&Frames, &HitVectors),
        carried: &CarriedLanes,
        (scattered, bounces): (&mut Scattered, &mut Bounces),
        wide: Option<Wide>,
    ) {
        if !self.is_any {
            return;
        }
        at_level_by_color!(
            wide,
            self.color,
            write,
            (
                from: &BsdfBatch<'_> = self,
                frames: &Frames = frames,
                wi: &HitVectors = wi,
                carried: &CarriedLanes = carried,
                scattered: &mut Scattered = scattered,
                bounces: &mut Bounces = bounces,
            )
        );
    }
}

impl Found {
    /// Stores the results of the lanes of a block that are marked in `of`.
    fn take(
        &mut self,
        block: usize,
        of: &[u32; BATCH],
        outputs: &BatchOutputs,
        (color, wide): (ColorModel, Option<Wide>),
    ) {
        at_level_by_color!(
            wide,
            color,
            take,
            (
                block: usize = block,
                of: &[u32; BATCH] = of,
                outputs: &BatchOutputs = outputs,
                to: &mut Found = self
            )
        );
    }
}

/// The part of an array over lanes that belongs to a block.
#[inline(always)]
fn lanes_of<T>(of: &[T; LANES], block: usize) -> &[T; BATCH] {
    &of.as_chunks().0[block]
}

#[inline(always)]
fn lanes_of_mut<T>(of: &mut [T; LANES], block: usize) -> &mut [T; BATCH] {
    &mut of.as_chunks_mut().0[block]
}

#[inline(always)]
fn blocks(of: &HitVectors, block: usize) -> [&[f32; BATCH]; 3] {
    [lanes_of(&of[0], block), lanes_of(&of[1], block), lanes_of(&of[2], block)]
}

#[inline(always)]
fn prepare(seen: &Seen, to: &mut BsdfBatch, facing: &mut HitVectors) {
    for i in 0..LANES {
        let (frame, wo) = (seen.frames.at(i), at(seen.wo, i));
        let horizon = horizon(at(seen.flat, i), frame.z, at(seen.lift, i));
        put(&mut to.horizon, i, horizon);
        to.side[i] = horizon.dot(wo);
        let local = frame.to_local(wo);
        put(&mut to.wo, i, local);
        let normal = if local.z < 0.0 { -frame.z } else { frame.z };
        let kept = at(facing, i);
        put(facing, i, mask_select_vector(to.has[i], normal, kept));
    }
}

#[inline(always)]
fn turn(frames: &Frames, from: &HitVectors, to: &mut HitVectors) {
    for i in 0..LANES {
        put(to, i, frames.at(i).to_local(at(from, i)));
    }
}

#[inline(always)]
fn take<const CHANNELS: usize>(
    block: usize,
    of: &[u32; BATCH],
    outputs: &BatchOutputs,
    to: &mut Found,
) {
    for channel in 0..CHANNELS {
        take_marked(of, &outputs.value[channel], lanes_of_mut(&mut to.value[channel], block));
        take_marked(of, &outputs.weight[channel], lanes_of_mut(&mut to.weight[channel], block));
    }
    for axis in 0..3 {
        take_marked(of, &outputs.drawn[axis], lanes_of_mut(&mut to.drawn[axis], block));
    }
    take_marked(of, &outputs.pdf, lanes_of_mut(&mut to.pdf, block));
    take_marked(of, &outputs.drawn_pdf, lanes_of_mut(&mut to.drawn_pdf, block));
    take_marked(of, &outputs.is_delta, lanes_of_mut(&mut to.is_delta, block));
    take_marked(of, &outputs.is_transmission, lanes_of_mut(&mut to.is_transmission, block));
    take_marked(of, &outputs.crossing, lanes_of_mut(&mut to.crossing, block));
    take_marked(of, &outputs.exists, lanes_of_mut(&mut to.exists, block));
}

#[inline(always)]
fn take_marked<T: Bits>(of: &[u32; BATCH], from: &[T; BATCH], to: &mut [T; BATCH]) {
    for i in 0..BATCH {
        to[i] = mask_select(of[i], from[i], to[i]);
    }
}

#[inline(always)]
fn write<const CHANNELS: usize>(
    from: &BsdfBatch,
    frames: &Frames,
    wi: &HitVectors,
    carried: &CarriedLanes,
    scattered: &mut Scattered,
    bounces: &mut Bounces,
) {
    let found = &from.found;
    for i in 0..LANES {
        let (has, horizon, side) = (from.has[i], at(&from.horizon, i), from.side[i]);
        // A direction counts only if the shading frame and the geometry agree on whether light goes
        // through.
        let sides = side * horizon.dot(at(wi, i));
        let goes_through = from.wo[2][i] * from.wi[2][i] < 0.0;
        // The condition is turned into bits. As a condition that is used at several places it would
        // become branches, with everything in between duplicated on both sides.
        let is_seen = u32::from((goes_through & (sides < 0.0)) | (!goes_through & (sides > 0.0)));
        let drawn = frames.at(i).from_local(at(&found.drawn, i));
        let scale = 1.0 / drawn.length();
        let next = drawn * scale;
        let sides = side * horizon.dot(next);
        let is_transmission = found.is_transmission[i] != 0;
        let agrees = (is_transmission & (sides < 0.0)) | (!is_transmission & (sides > 0.0));
        let exists = (scale > 0.0) & (scale < f32::INFINITY) & agrees;
        for axis in 0..3 {
            bounces.wi[axis][i] = mask_select(has, next[axis], bounces.wi[axis][i]);
        }
        for channel in 0..CHANNELS {
            let value = mask_select(is_seen, found.value[channel][i], 0.0);
            scattered.value[channel][i] = mask_select(has, value, scattered.value[channel][i]);
            bounces.weight[channel][i] =
                mask_select(has, found.weight[channel][i], bounces.weight[channel][i]);
        }
        let pdf = mask_select(is_seen, found.pdf[i], 0.0);
        scattered.pdf[i] = mask_select(has, pdf, scattered.pdf[i]);
        bounces.pdf[i] = mask_select(has, found.drawn_pdf[i], bounces.pdf[i]);
        let eta_scale = carried.eta_scale[i] * found.crossing[i];
        bounces.eta_scale[i] = mask_select(has, eta_scale, bounces.eta_scale[i]);
        bounces.expected[i] =
            mask_select(has, carried.marks[i].expected().get(), bounces.expected[i]);
        bounces.is_delta[i] = mask_select(has, found.is_delta[i], bounces.is_delta[i]);
        let exists = found.exists[i] & u32::from(exists);
        bounces.exists[i] = mask_select(has, exists, bounces.exists[i]);
    }
}
