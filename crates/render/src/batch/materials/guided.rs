//! The guided sampling of [`crate::integrator::guided`] in batches on Lambertian surfaces, with the
//! same bits.

use crate::batch::lights::{LightArrivals, Scatterers, Surfaces};
use crate::batch::vertices::CarriedLanes;
use crate::guiding::density::coordinates;
use crate::guiding::directional::{direction_from_square, square_from_direction};
use crate::guiding::parallax::{Parallax, from_anchor, to_place};
use crate::guiding::{Field, Known};
use crate::integrator::guided::mixed_pdf;
use crate::integrator::roulette::expected_survival;
use crate::lanes::{HitColors, LANES, ZERO, at, put};
use crate::light_sampler::Receivers;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::{Wide, mask_select, max};
use snell_math::{Vec2, Vec3, at_level, sampling};

/// The data of a guiding field at vertices, by lane. Unused lanes hold arbitrary values.
#[derive(Debug)]
pub struct GuidedLanes {
    /// The region of the field at each point.
    regions: [u32; LANES],
    /// 1 where the region is trained.
    is_known: [u32; LANES],
    /// The probability of sampling the BSDF instead of the field; 1 where the region is not
    /// trained.
    share: HitLanes,
    /// The coordinates of the points in the field.
    places: [[u32; LANES]; 3],
    /// The orientations of the surfaces; see [`Field::place`].
    faces: [u32; LANES],
    /// The parallax of each region, as the result of
    /// [`Parallax::parts`](crate::guiding::parallax::Parallax::parts).
    anchor: HitVectors,
    nearness: HitLanes,
    /// The shift of directions that the parallax gives at each point.
    shift: HitVectors,
    /// The points of the unit square that stand for directions.
    square: [HitLanes; 2],
    /// The coordinates of those points in the field.
    coordinates: [[u32; LANES]; 2],
    /// 1 for directions that were sampled from the field, 0 for those of the BSDF.
    is_drawn: [u32; LANES],
    /// The ratio of a direction's solid angle at the region's anchor to its solid angle at the
    /// point.
    larger: HitLanes,
    /// Density per steradian with which the field samples a direction.
    pdf: HitLanes,
    /// The expected contribution of a path of throughput 1; 0 where the region is not trained.
    brings: HitLanes,
    /// The values of [`crate::integrator::guided::GuidedBsdf::survival`].
    pub survival: HitLanes,
    pub expected: HitLanes,
}

/// The next directions of paths, by lane.
#[derive(Debug)]
pub struct Directions<'a> {
    pub wi: &'a mut HitVectors,
    pub origin: &'a mut HitVectors,
    /// Density per steradian.
    pub pdf: &'a mut HitLanes,
    /// 1 where there is a direction, 0 elsewhere.
    pub exists: &'a mut [u32; LANES],
    /// By channel: on input the reflectance, on output the weight of the direction.
    pub weight: &'a mut HitColors,
}

impl Default for GuidedLanes {
    fn default() -> Self {
        let (number, mark) = ([0.0; LANES], [0; LANES]);
        Self {
            regions: mark,
            is_known: mark,
            share: number,
            places: [mark; 3],
            faces: mark,
            anchor: ZERO,
            nearness: number,
            shift: ZERO,
            square: [number; 2],
            coordinates: [mark; 2],
            is_drawn: mark,
            larger: number,
            pdf: number,
            brings: number,
            survival: number,
            expected: number,
        }
    }
}

impl GuidedLanes {
    /// Looks up the field at the first `count` points.
    pub fn find(&mut self, field: &Field, receivers: &Receivers, count: usize, wide: Option<Wide>) {
        at_level!(
            wide,
            find_places,
            (
                field: &Field = field,
                position: &HitVectors = receivers.position,
                normal: &HitVectors = receivers.normal,
                places: &mut [[u32; LANES]; 3] = &mut self.places,
                faces: &mut [u32; LANES] = &mut self.faces,
            )
        );
        let atlas = field.atlas();
        (self.regions, self.is_known) = ([0; LANES], [0; LANES]);
        atlas.regions(&self.faces, &self.places, count, &mut self.regions);
        (self.share, self.brings) = ([1.0; LANES], [0.0; LANES]);
        for i in 0..count.min(LANES) {
            let brief = atlas.brief(self.regions[i]);
            let is_known = u32::from(brief.is_known());
            self.is_known[i] = is_known;
            self.share[i] = mask_select(is_known, brief.bsdf_share, 1.0);
            self.brings[i] = mask_select(is_known, brief.expected, 0.0);
            let (anchor, nearness) = brief.parallax.parts();
            put(&mut self.anchor, i, anchor);
            self.nearness[i] = nearness;
        }
        at_level!(
            wide,
            find_shifts,
            (guided: &mut GuidedLanes = self, position: &HitVectors = receivers.position)
        );
    }

    /// Replaces directions sampled from BSDFs by directions sampled from the mixture of BSDF and
    /// field. `choice`, `quad` and `u` are independent random numbers.
    pub fn mix(
        &mut self,
        field: &Field,
        surfaces: &Surfaces,
        (choice, quad, u): (&HitLanes, &HitLanes, &[HitLanes; 2]),
        directions: &mut Directions,
        wide: Option<Wide>,
    ) {
        for (i, &choice) in choice.iter().enumerate() {
            self.is_drawn[i] = self.is_known[i] & u32::from(choice >= self.share[i]);
        }
        field.atlas().points(&self.regions, quad, u, &self.is_drawn, &mut self.square);
        at_level!(
            wide,
            turn,
            (
                guided: &mut GuidedLanes = self,
                surfaces: &Surfaces<'_> = surfaces,
                directions: &mut Directions<'_> = directions,
            )
        );
        let is_known = self.is_known;
        self.look_up(field, &is_known);
        at_level!(
            wide,
            weigh,
            (guided: &GuidedLanes = self, directions: &mut Directions<'_> = directions)
        );
    }

    /// Applies to light samples the MIS weight that the density of the mixture gives.
    pub fn weigh_lights(
        &mut self,
        field: &Field,
        arrivals: &mut LightArrivals,
        wide: Option<Wide>,
    ) {
        at_level!(
            wide,
            find_coordinates,
            (guided: &mut GuidedLanes = self, directions: &HitVectors = arrivals.directions())
        );
        self.look_up(field, &arrivals.exists);
        at_level!(
            wide,
            weigh_lights,
            (guided: &GuidedLanes = self, arrivals: &mut LightArrivals = arrivals)
        );
    }

    /// Computes the survival weights of Russian roulette for paths on surfaces of this reflectance.
    pub fn play(&mut self, carried: &CarriedLanes, reflectance: &HitColors, wide: Option<Wide>) {
        at_level!(
            wide,
            play,
            (
                guided: &mut GuidedLanes = self,
                carried: &CarriedLanes = carried,
                reflectance: &HitColors = reflectance,
            )
        );
    }

    /// Computes the densities of the directions at [`Self::coordinates`], in lanes where
    /// `is_wanted` is 1.
    fn look_up(&mut self, field: &Field, is_wanted: &[u32; LANES]) {
        field.atlas().pdfs(&self.regions, &self.coordinates, is_wanted, &mut self.pdf);
        for (pdf, larger) in self.pdf.iter_mut().zip(&self.larger) {
            *pdf *= larger;
        }
    }

    /// Density of a direction in the mixture of BSDF and field of a lane, given the density of the
    /// BSDF.
    pub fn mixed_pdf(
        &self,
        field: Option<&Field>,
        lane: usize,
        position: Vec3,
        wi: Vec3,
        bsdf_pdf: f32,
    ) -> f32 {
        let guide =
            field.zip(self.known(lane)).and_then(|(field, known)| field.guide(known, position));
        guide.map_or(bsdf_pdf, |guide| mixed_pdf(self.share[lane], bsdf_pdf, guide.pdf(wi)))
    }

    /// The region of a lane, if it is trained.
    pub fn known(&self, lane: usize) -> Option<Known> {
        (self.is_known[lane] != 0).then_some(Known(self.regions[lane]))
    }
}

#[inline(always)]
fn find_places(
    field: &Field,
    position: &HitVectors,
    normal: &HitVectors,
    places: &mut [[u32; LANES]; 3],
    faces: &mut [u32; LANES],
) {
    for i in 0..LANES {
        let (place, face) = field.place(at(position, i), at(normal, i));
        (places[0][i], places[1][i], places[2][i]) = (place[0], place[1], place[2]);
        faces[i] = face as u32;
    }
}

#[inline(always)]
fn find_shifts(guided: &mut GuidedLanes, position: &HitVectors) {
    for i in 0..LANES {
        let parallax = Parallax::from_parts(at(&guided.anchor, i), guided.nearness[i]);
        put(&mut guided.shift, i, parallax.shift(at(position, i)));
    }
}

#[inline(always)]
fn find_coordinates(guided: &mut GuidedLanes, directions: &HitVectors) {
    let [x, y] = &mut guided.coordinates;
    for i in 0..LANES {
        let (seen, larger) = from_anchor(at(directions, i), at(&guided.shift, i));
        [x[i], y[i]] = coordinates(square_from_direction(seen));
        guided.larger[i] = larger;
    }
}

/// Computes directions from points of the square in lanes that sample the field, then the
/// coordinates of all directions.
#[inline(always)]
fn turn(guided: &mut GuidedLanes, surfaces: &Surfaces, to: &mut Directions) {
    for i in 0..LANES {
        let is_drawn = guided.is_drawn[i];
        let drawn = direction_from_square(Vec2::new(guided.square[0][i], guided.square[1][i]));
        let drawn = to_place(drawn, at(&guided.shift, i));
        let (share, is_seen) = surfaces.share(i, drawn);
        let origin = surfaces.ray_origin(i, drawn);
        for axis in 0..3 {
            to.wi[axis][i] = mask_select(is_drawn, drawn[axis], to.wi[axis][i]);
            to.origin[axis][i] = mask_select(is_drawn, origin[axis], to.origin[axis][i]);
        }
        to.pdf[i] = mask_select(is_drawn, share, to.pdf[i]);
        to.exists[i] = mask_select(is_drawn, u32::from(is_seen), to.exists[i]);
    }
    find_coordinates(guided, to.wi);
}

/// Replaces densities of BSDFs by those of the mixtures, and reflectances by weights.
#[inline(always)]
fn weigh(guided: &GuidedLanes, to: &mut Directions) {
    for i in 0..LANES {
        let (share, bsdf_pdf) = (guided.share[i], to.pdf[i]);
        let (is_known, is_drawn) = (guided.is_known[i], guided.is_drawn[i] != 0);
        let pdf = mixed_pdf(share, bsdf_pdf, guided.pdf[i]);
        let (ratio, inverse) = (bsdf_pdf / pdf, 1.0 / pdf);
        for channel in 0..3 {
            let reflectance = to.weight[channel][i];
            let weight =
                if is_drawn { reflectance * bsdf_pdf * inverse } else { reflectance * ratio };
            to.weight[channel][i] = mask_select(is_known, weight, reflectance);
        }
        to.pdf[i] = mask_select(is_known, pdf, bsdf_pdf);
        let is_possible = !is_drawn | (pdf > 0.0);
        to.exists[i] &= u32::from(is_possible);
    }
}

/// Applies [`crate::integrator::guided::GuidedBsdf::survival`] in every lane.
#[inline(always)]
fn play(guided: &mut GuidedLanes, carried: &CarriedLanes, reflectance: &HitColors) {
    for i in 0..LANES {
        let largest = |v: &HitColors| max(max(v[0][i], v[1][i]), v[2][i]);
        let (throughput, albedo) = (largest(&carried.throughput), largest(reflectance));
        let expected = throughput * guided.brings[i];
        let (survival, first) = expected_survival(expected, carried.marks[i].expected().get());
        let is_known = expected > 0.0;
        guided.survival[i] = if is_known { survival } else { albedo };
        guided.expected[i] = if is_known { first } else { carried.marks[i].expected().get() };
    }
}

#[inline(always)]
fn weigh_lights(guided: &GuidedLanes, arrivals: &mut LightArrivals) {
    for i in 0..LANES {
        let (share, density) = (guided.share[i], arrivals.density[i]);
        let pdf = mixed_pdf(share, arrivals.share[i], guided.pdf[i]);
        let weight = sampling::power_heuristic(density, pdf);
        let counts = guided.is_known[i] & (arrivals.is_delta[i] ^ 1);
        arrivals.weight[i] = mask_select(counts, weight, arrivals.weight[i]);
        arrivals.scale[i] = mask_select(counts, weight / density, arrivals.scale[i]);
    }
}
