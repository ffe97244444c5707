//! A photon map: where photons of one pass ended, or where they left points in media, in a hash
//! grid.

use crate::integrator::light_part::LightSource;
use snell_math::{Bounds3, SampledSpectrum, Vec3, rng};

/// A photon at the surface where it ended, or at a point of its way through a medium.
#[derive(Clone, Copy, Debug)]
pub struct Landed {
    /// The point.
    pub position: Vec3,
    /// Unit direction towards which the photon came from.
    pub direction: Vec3,
    /// The number of surfaces that have scattered it.
    pub bounces: u32,
    /// Its power in W; in a medium, its power times the length for which the point stands.
    pub flux: SampledSpectrum,
    /// The random number in `[0, 1)` that chose its wavelengths; 0 in RGB mode.
    pub hue: f32,
    /// Its time, from 0 to 1; 0 if nothing moves.
    pub time: f32,
    /// The lamp that has sent it.
    pub source: LightSource,
    /// The [tag](crate::volume::Walker::medium_tag) of the medium; 0 on a surface.
    pub medium: u16,
}

/// A photon as it is kept: 24 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
struct Photon {
    position: [f32; 3],
    /// The direction on the octahedron in twice twelve bits, and the number of bounces in eight.
    way: u32,
    /// The power: the upper halves of `f32`.
    flux: [u16; 4],
}

const _: () = assert!(size_of::<Photon>() == 24);

/// What a map keeps besides [`Photon`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// True if photons have wavelengths.
    pub hues: bool,
    /// True if photons have times.
    pub times: bool,
    /// True if photons know their lamps.
    pub sources: bool,
    /// True if photons know their media.
    pub media: bool,
}

/// The photons of one pass.
#[derive(Debug, Default)]
pub struct PhotonMap {
    photons: Vec<Photon>,
    hues: Vec<u16>,
    times: Vec<u16>,
    sources: Vec<LightSource>,
    media: Vec<u16>,
    /// The first photon of each bucket, and the number of photons at the end.
    starts: Vec<u32>,
    /// A bit for every cell, by its hash: set if photons may be within the radius of some point of
    /// the cell. Most points of most scenes are in cells without.
    touched: Vec<u64>,
    /// A box that holds all points within the radius of some photon.
    bounds: Bounds3,
    /// The radius within which photons are gathered.
    pub radius: f32,
    /// 1 over the side of a cell.
    scale: f32,
}

/// Bits of [`PhotonMap::touched`] for each photon, each of which touches eight cells at most.
const BITS: usize = 32;

/// Steps of a number in `[0, 1)` that is kept in 16 bits.
const STEPS: f32 = 65536.0;
/// Steps of a coordinate on the octahedron.
const WAYS: f32 = 4095.0;

impl PhotonMap {
    /// The map of these photons, in this order, for gathering within a radius.
    pub fn new(landed: &[Landed], radius: f32, kept: Kept) -> Self {
        let buckets = landed.len().next_power_of_two().max(64);
        let bits = (landed.len() * BITS).next_power_of_two().max(64);
        let mut map = Self { radius, scale: 0.5 / radius, ..Self::default() };
        let bucket_of: Vec<u32> = landed
            .iter()
            .map(|photon| bucket(cell(photon.position * map.scale), buckets) as u32)
            .collect();
        let all = Bounds3::of(landed.iter().map(|photon| photon.position));
        let margin = Vec3::splat(1.001 * radius);
        map.bounds = Bounds3 { min: all.min - margin, max: all.max + margin };
        map.touched = vec![0; bits / 64];
        for photon in landed {
            let first = cell(photon.position * map.scale - 0.5);
            for corner in 0..8 {
                let bit = bucket(beside(first, corner), bits);
                map.touched[bit / 64] |= 1 << (bit % 64);
            }
        }
        map.starts = vec![0; buckets + 1];
        for &bucket in &bucket_of {
            map.starts[bucket as usize + 1] += 1;
        }
        for i in 0..buckets {
            map.starts[i + 1] += map.starts[i];
        }
        let mut next = map.starts.clone();
        let mut order = vec![0u32; landed.len()];
        for (i, &bucket) in (0..).zip(&bucket_of) {
            let at = &mut next[bucket as usize];
            order[*at as usize] = i;
            *at += 1;
        }
        let sorted = || order.iter().map(|&i| &landed[i as usize]);
        map.photons = sorted().map(Photon::of).collect();
        let of_unit = |x: f32| (x * STEPS) as u16;
        if kept.hues {
            map.hues = sorted().map(|photon| of_unit(photon.hue)).collect();
        }
        if kept.times {
            map.times = sorted().map(|photon| of_unit(photon.time)).collect();
        }
        if kept.sources {
            map.sources = sorted().map(|photon| photon.source).collect();
        }
        if kept.media {
            map.media = sorted().map(|photon| photon.medium).collect();
        }
        map
    }

    /// The number of photons.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// Memory in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.photons.len() * size_of::<Photon>()
            + (self.hues.len() + self.times.len() + self.media.len()) * size_of::<u16>()
            + self.sources.len() * size_of::<LightSource>()
            + self.starts.len() * size_of::<u32>()
            + self.touched.len() * size_of::<u64>()
    }

    /// False if there are no photons within the radius of a point. Most points of most scenes are
    /// sorted out here.
    #[inline]
    pub fn may_be_near(&self, point: Vec3) -> bool {
        if self.photons.is_empty() || !self.bounds.contains(point) {
            return false;
        }
        let bit = bucket(cell(point * self.scale), self.touched.len() * 64);
        self.touched[bit / 64] >> (bit % 64) & 1 != 0
    }

    /// The ranges of photons of the buckets that hold all photons within the radius of a point, and
    /// others. No photon is in two of them.
    pub fn near(&self, point: Vec3) -> Nearby {
        let mut ranges = [[0; 2]; 8];
        if !self.may_be_near(point) {
            return Nearby { ranges, count: 0 };
        }
        let buckets = self.starts.len() - 1;
        let first = cell(point * self.scale - 0.5);
        let mut count = 0;
        for corner in 0..8u8 {
            let bucket = bucket(beside(first, corner), buckets);
            let range = [self.starts[bucket], self.starts[bucket + 1]];
            // Two cells may share a bucket.
            if range[0] < range[1] && !ranges[..count].contains(&range) {
                ranges[count] = range;
                count += 1;
            }
        }
        Nearby { ranges, count }
    }

    /// The position of a photon.
    #[inline]
    pub fn position(&self, photon: u32) -> Vec3 {
        self.photons[photon as usize].position.into()
    }

    /// The unit direction towards which a photon came from, and the number of its bounces.
    #[inline]
    pub fn way(&self, photon: u32) -> (Vec3, u32) {
        let way = self.photons[photon as usize].way;
        (unfolded([way >> 20, way >> 8 & 0xfff]), way & 0xff)
    }

    /// The power of a photon in W, in media times a length.
    #[inline]
    pub fn flux(&self, photon: u32) -> SampledSpectrum {
        let flux = self.photons[photon as usize].flux;
        SampledSpectrum(flux.map(|half| f32::from_bits(u32::from(half) << 16)))
    }

    /// The random number that chose the wavelengths of a photon.
    #[inline]
    pub fn hue(&self, photon: u32) -> f32 {
        (f32::from(self.hues[photon as usize]) + 0.5) / STEPS
    }

    /// The time of a photon; `None` if nothing moves.
    #[inline]
    pub fn time(&self, photon: u32) -> Option<f32> {
        self.times.get(photon as usize).map(|&time| (f32::from(time) + 0.5) / STEPS)
    }

    /// The lamp that has sent a photon, if that is kept.
    #[inline]
    pub fn source(&self, photon: u32) -> Option<LightSource> {
        self.sources.get(photon as usize).copied()
    }

    /// The tag of the medium of a photon.
    #[inline]
    pub fn medium(&self, photon: u32) -> u16 {
        self.media[photon as usize]
    }
}

/// Ranges of photons near a point.
#[derive(Clone, Copy, Debug)]
pub struct Nearby {
    ranges: [[u32; 2]; 8],
    count: usize,
}

impl Nearby {
    /// The numbers of the photons.
    pub fn photons(&self) -> impl Iterator<Item = u32> {
        self.ranges[..self.count].iter().flat_map(|&[first, end]| first..end)
    }
}

impl Photon {
    fn of(landed: &Landed) -> Self {
        let [x, y] = folded(landed.direction);
        // Rounded to nearest, so that sums keep their mean.
        let half = |x: f32| (x.to_bits().saturating_add(0x8000) >> 16) as u16;
        Self {
            position: landed.position.to_array(),
            way: x << 20 | y << 8 | landed.bounces.min(0xff),
            flux: landed.flux.0.map(half),
        }
    }
}

/// A unit vector as a point of the unfolded octahedron, in twelve bits each.
fn folded(v: Vec3) -> [u32; 2] {
    let scale = 1.0 / (v.x.abs() + v.y.abs() + v.z.abs());
    let (x, y) = (v.x * scale, v.y * scale);
    let side = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    let [x, y] = match v.z < 0.0 {
        true => [(1.0 - y.abs()) * side(x), (1.0 - x.abs()) * side(y)],
        false => [x, y],
    };
    [x, y].map(|x| ((x * 0.5 + 0.5) * WAYS + 0.5) as u32 & 0xfff)
}

/// Undoes [`folded`].
#[inline]
fn unfolded(bits: [u32; 2]) -> Vec3 {
    let [x, y] = bits.map(|bits| bits as f32 * (2.0 / WAYS) - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let under = (-z).max(0.0);
    let inward = |x: f32| if x < 0.0 { x + under } else { x - under };
    Vec3::new(inward(x), inward(y), z).normalize_or(Vec3::Z)
}

/// The cell that holds a point, in units of cells.
#[inline]
fn cell(point: Vec3) -> [i32; 3] {
    // (Rounded down without a call of a function.)
    point.to_array().map(|x| (x as i32).wrapping_sub(i32::from(x < x as i32 as f32)))
}

/// A cell of a block of eight, by its number; 0 is the first.
#[inline]
fn beside(first: [i32; 3], corner: u8) -> [i32; 3] {
    let step = |axis: usize| i32::from(corner >> axis & 1);
    [0, 1, 2].map(|axis| first[axis].wrapping_add(step(axis)))
}

/// The bucket of a cell.
#[inline]
fn bucket([x, y, z]: [i32; 3], buckets: usize) -> usize {
    let mixed = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ (z as u32).wrapping_mul(0xc2b2_ae3d);
    rng::hash32(mixed) as usize & (buckets - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::sampling;

    fn landed(i: u32) -> Landed {
        let [a, b] = [0, 1].map(|key| rng::uniform2([i, key, 7, 0]));
        Landed {
            position: Vec3::new(a.x, a.y, b.x * 0.2) * 4.0 - 2.0,
            direction: sampling::uniform_sphere(rng::uniform2([i, 2, 7, 0])),
            bounces: i % 300,
            flux: SampledSpectrum([a.x, 1e-6 * a.y, 1e6 * b.x, 0.0]),
            hue: b.y,
            time: a.x,
            source: LightSource::Light(i),
            medium: i as u16,
        }
    }

    #[test]
    fn a_map_finds_all_photons_within_its_radius_once() {
        let all: Vec<Landed> = (0..3000).map(landed).collect();
        let kept = Kept { hues: true, times: true, sources: true, media: true };
        for radius in [0.01, 0.1, 0.7, 5.0] {
            let map = PhotonMap::new(&all, radius, kept);
            assert_eq!(map.len(), all.len());
            for i in 0..200 {
                let point = landed(i * 31).position + 0.3 * radius;
                let is_near = |p: Vec3| p.distance(point) < radius;
                let expected = all.iter().filter(|photon| is_near(photon.position)).count();
                let nearby = map.near(point);
                let mut found: Vec<u32> =
                    nearby.photons().filter(|&photon| is_near(map.position(photon))).collect();
                found.sort_unstable();
                found.dedup();
                assert_eq!(found.len(), expected);
                assert_eq!(
                    nearby.photons().filter(|&p| is_near(map.position(p))).count(),
                    expected
                );
            }
        }
    }

    #[test]
    fn photons_are_kept_to_three_digits() {
        let all: Vec<Landed> = (0..1000).map(landed).collect();
        let kept = Kept { hues: true, times: true, sources: true, media: true };
        let map = PhotonMap::new(&all, 0.1, kept);
        for photon in 0..1000 {
            let Some(LightSource::Light(i)) = map.source(photon) else { panic!("it is kept") };
            let from = &all[i as usize];
            assert_eq!(
                (map.position(photon), map.way(photon).1),
                (from.position, (i % 300).min(255))
            );
            assert!(map.way(photon).0.distance(from.direction) < 1e-3);
            for (a, b) in map.flux(photon).0.iter().zip(from.flux.0) {
                assert!((a - b).abs() <= 0.004 * b);
            }
            assert!((map.hue(photon) - from.hue).abs() < 2e-5);
            assert_eq!(map.medium(photon), from.medium);
            assert!(map.time(photon).is_some_and(|time| (time - from.time).abs() < 2e-5));
        }
        assert_eq!(PhotonMap::default().near(Vec3::ZERO).photons().count(), 0);
    }
}
