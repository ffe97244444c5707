//! How plain surfaces scatter light, asked for all vertices of one material together: the same bits
//! as [`super::surfaces`] finds one by one.

use super::lanes::{
    BLACK, CarriedLanes, HitColors, LANES, ZERO, at, at_level_by_color, put, put_color,
};
use super::lights::horizon;
use super::plain_surfaces::Frames;
use super::surfaces::{Bounces, Scattered};
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::{Bits, Wide, mask_select, mask_select_vector};
use snell_math::{ColorModel, at_level};
use snell_scene::bsdf::{MANY, ManyAnswers, ManyBsdf, ManyPoint, ManyQuestions};

/// Vertices that are worked on together. Arrays are by lane; those of other lanes hold anything.
#[derive(Debug)]
pub struct Together<'a> {
    color: ColorModel,
    /// How each scatters; `None` for other lanes.
    bsdfs: [Option<&'a ManyBsdf>; LANES],
    is_any: bool,
    /// 0 for other lanes.
    has: [u32; LANES],
    /// The normal of the plane that light is reflected above or refracted below, and its cosine
    /// with where the path comes from.
    horizon: HitVectors,
    side: HitLanes,
    /// As [`ManyPoint`].
    palette: [HitColors; 3],
    alpha: HitLanes,
    metalness: HitLanes,
    /// In the frames of the surfaces: where the path comes from, and where the light comes from.
    wo: HitVectors,
    wi: HitVectors,
    found: Box<Found>,
}

/// As [`ManyAnswers`], by lane.
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

/// Surfaces and where they are seen from.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    pub frames: &'a Frames,
    /// Normals of the surfaces themselves.
    pub flat: &'a HitVectors,
    /// Directions to where the paths come from.
    pub wo: &'a HitVectors,
    /// See [`super::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

impl Together<'_> {
    /// No lanes, for paths of this model of colour.
    pub fn new(color: ColorModel) -> Self {
        let (number, mark) = ([0.0; LANES], [0; LANES]);
        Self {
            color,
            bsdfs: [None; LANES],
            is_any: false,
            has: mark,
            horizon: ZERO,
            side: number,
            palette: [BLACK; 3],
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

impl<'a> Together<'a> {
    /// Forgets all lanes.
    pub fn clear(&mut self) {
        (self.bsdfs, self.is_any, self.has) = ([None; LANES], false, [0; LANES]);
    }

    /// Takes a lane that scatters like this, and is this at its point.
    pub fn put(&mut self, lane: usize, bsdf: &'a ManyBsdf, at: &ManyPoint) {
        let spectra = if self.color == ColorModel::Rgb { 1 } else { at.palette.len() };
        for (to, color) in self.palette.iter_mut().zip(at.palette).take(spectra) {
            put_color(to, lane, color);
        }
        (self.alpha[lane], self.metalness[lane]) = (at.alpha, at.metalness);
        (self.bsdfs[lane], self.is_any, self.has[lane]) = (Some(bsdf), true, 1);
    }

    /// True if this lane was taken.
    pub fn has(&self, lane: usize) -> bool {
        self.has[lane] != 0
    }

    /// Works out what is known before lights are, and the normals on the side where the paths come
    /// from.
    pub fn look(&mut self, seen: &Seen, facing: &mut HitVectors, wide: Option<Wide>) {
        if !self.is_any {
            return;
        }
        at_level!(wide, look, (seen: &Seen<'_> = seen, to: &mut Together<'_> = self, facing: &mut HitVectors = facing));
    }

    /// Asks the surfaces how they scatter light from where it comes, and draws where the paths go
    /// on, with these numbers for lobes and directions.
    pub fn scatter(
        &mut self,
        frames: &Frames,
        wi: &HitVectors,
        (u_lobe, u): (&HitLanes, &[HitLanes; 2]),
        wide: Option<Wide>,
    ) {
        if !self.is_any {
            return;
        }
        at_level!(wide, turn, (frames: &Frames = frames, from: &HitVectors = wi, to: &mut HitVectors = &mut self.wi));
        let mut answers = ManyAnswers::default();
        for block in 0..LANES / MANY {
            let questions = ManyQuestions {
                is_asked: &[0; MANY],
                palette: self
                    .palette
                    .each_ref()
                    .map(|colors| colors.each_ref().map(|channel| many(channel, block))),
                color: self.color,
                alpha: many(&self.alpha, block),
                metalness: many(&self.metalness, block),
                wo: blocks(&self.wo, block),
                wi: blocks(&self.wi, block),
                u_lobe: many(u_lobe, block),
                u: [many(&u[0], block), many(&u[1], block)],
            };
            let bsdfs = &self.bsdfs[block * MANY..][..MANY];
            let mut is_asked = [false; MANY];
            for (first, bsdf) in bsdfs.iter().enumerate() {
                let Some(bsdf) = bsdf.filter(|_| !is_asked[first]) else { continue };
                let mut of = [0; MANY];
                for (i, other) in bsdfs.iter().enumerate() {
                    if other.is_some_and(|other| std::ptr::eq(other, bsdf)) {
                        (is_asked[i], of[i]) = (true, 1);
                    }
                }
                bsdf.answer(&ManyQuestions { is_asked: &of, ..questions }, &mut answers, wide);
                self.found.take(block, &of, &answers, (self.color, wide));
            }
        }
    }

    /// Says what was found: how the light is scattered from where it comes in the world, and where
    /// the paths go on.
    pub fn tell(
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
            tell,
            (
                from: &Together<'_> = self,
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
    /// Takes what was answered for the lanes of a block that are marked.
    fn take(
        &mut self,
        block: usize,
        of: &[u32; MANY],
        answers: &ManyAnswers,
        (color, wide): (ColorModel, Option<Wide>),
    ) {
        at_level_by_color!(
            wide,
            color,
            take,
            (block: usize = block, of: &[u32; MANY] = of, answers: &ManyAnswers = answers, to: &mut Found = self)
        );
    }
}

/// The lanes of a block.
#[inline(always)]
fn many<T>(of: &[T; LANES], block: usize) -> &[T; MANY] {
    &of.as_chunks().0[block]
}

#[inline(always)]
fn many_mut<T>(of: &mut [T; LANES], block: usize) -> &mut [T; MANY] {
    &mut of.as_chunks_mut().0[block]
}

#[inline(always)]
fn blocks(of: &HitVectors, block: usize) -> [&[f32; MANY]; 3] {
    [many(&of[0], block), many(&of[1], block), many(&of[2], block)]
}

#[inline(always)]
fn look(seen: &Seen, to: &mut Together, facing: &mut HitVectors) {
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
    of: &[u32; MANY],
    answers: &ManyAnswers,
    to: &mut Found,
) {
    for channel in 0..CHANNELS {
        take_marked(of, &answers.value[channel], many_mut(&mut to.value[channel], block));
        take_marked(of, &answers.weight[channel], many_mut(&mut to.weight[channel], block));
    }
    for axis in 0..3 {
        take_marked(of, &answers.drawn[axis], many_mut(&mut to.drawn[axis], block));
    }
    take_marked(of, &answers.pdf, many_mut(&mut to.pdf, block));
    take_marked(of, &answers.drawn_pdf, many_mut(&mut to.drawn_pdf, block));
    take_marked(of, &answers.is_delta, many_mut(&mut to.is_delta, block));
    take_marked(of, &answers.is_transmission, many_mut(&mut to.is_transmission, block));
    take_marked(of, &answers.crossing, many_mut(&mut to.crossing, block));
    take_marked(of, &answers.exists, many_mut(&mut to.exists, block));
}

#[inline(always)]
fn take_marked<T: Bits>(of: &[u32; MANY], from: &[T; MANY], to: &mut [T; MANY]) {
    for i in 0..MANY {
        to[i] = mask_select(of[i], from[i], to[i]);
    }
}

#[inline(always)]
fn tell<const CHANNELS: usize>(
    from: &Together,
    frames: &Frames,
    wi: &HitVectors,
    carried: &CarriedLanes,
    scattered: &mut Scattered,
    bounces: &mut Bounces,
) {
    let found = &from.found;
    for i in 0..LANES {
        let (has, horizon, side) = (from.has[i], at(&from.horizon, i), from.side[i]);
        // Shading and geometry must agree on whether light goes through.
        let sides = side * horizon.dot(at(wi, i));
        let goes_through = from.wo[2][i] * from.wi[2][i] < 0.0;
        // (Bits, for the same condition at several places would become branches, with everything in
        // between on both sides.)
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
