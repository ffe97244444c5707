//! The contents of a field, laid out for look-ups at many points at once. A look-up walks through
//! an unpredictable number of tables, and each step waits for memory. All points therefore take
//! each step together, and the list of unfinished points is made without branches.

use super::density::{COORDINATE_DIGITS, DIGITS, Density, ONE};
use super::parallax::Parallax;
use super::regions::{Halves, Place, Regions};
use snell_math::Vec2;

/// Marks an entry as the number of a table. Other entries are the bits of densities, which are not
/// negative.
const TABLE: u32 = 1 << 31;

/// The data of a region in short form.
#[derive(Clone, Copy, Debug)]
pub struct Brief {
    /// The first table of the region's density, marked with [`TABLE`]; 0, which stands for a
    /// density of 0, if the region is not trained.
    table: u32,
    /// The position of the region's parts in [`Atlas::starts`]; see [`Density`].
    starts: u32,
    /// The number of the region's parts.
    parts: u32,
    /// See [`super::Cell`] for this field and the next.
    pub bsdf_share: f32,
    pub expected: f32,
    pub parallax: Parallax,
}

impl Brief {
    /// True if the region is trained.
    #[inline]
    pub fn is_known(&self) -> bool {
        self.table != 0
    }
}

/// The data of all regions.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    regions: Regions,
    briefs: Vec<Brief>,
    /// The tables of all densities. Each table covers 4 x 4 squares, and each entry is a density
    /// per steradian or the number of a further table.
    tables: Vec<[u32; 16]>,
    /// The first quad of each part; see [`Density`].
    starts: Vec<u32>,
    /// The cumulative probabilities of the quads; see [`Density`].
    ends: Vec<u32>,
    /// The corner (x, y) and the size of each quad.
    quads: Vec<[f32; 3]>,
}

impl Atlas {
    /// An atlas without the data of regions, for the trees with these roots.
    pub fn of_trees<N: Halves>(roots: impl Iterator<Item = N>) -> Self {
        Self { regions: Regions::new(roots), ..Self::default() }
    }

    /// Adds the data of the next region.
    pub fn add(
        &mut self,
        density: Option<&Density>,
        bsdf_share: f32,
        expected: f32,
        parallax: Parallax,
    ) {
        let mut brief = Brief { table: 0, starts: 0, parts: 1, bsdf_share, expected, parallax };
        if let Some(density) = density {
            let (first_table, first_quad) = (self.tables.len() as u32, self.quads.len() as u32);
            brief.table = first_table | TABLE;
            self.tables
                .extend(density.tables(|pdf| pdf.to_bits(), |table| (first_table + table) | TABLE));
            (brief.starts, brief.parts) = (self.starts.len() as u32, density.starts().len() as u32);
            self.starts.extend(density.starts().iter().map(|&quad| first_quad + u32::from(quad)));
            self.ends.extend_from_slice(density.ends());
            self.quads.extend(density.squares());
        }
        self.briefs.push(brief);
    }

    /// The data of a region.
    #[inline]
    pub fn brief(&self, region: u32) -> &Brief {
        &self.briefs[region as usize]
    }

    /// The region of a point; see [`Regions::find`].
    pub fn region(&self, face: usize, place: Place) -> u32 {
        self.regions.find(face, place)
    }

    /// Finds the regions of the first `count` points.
    pub fn regions<const N: usize>(
        &self,
        faces: &[u32; N],
        places: &[[u32; N]; 3],
        count: usize,
        to: &mut [u32; N],
    ) {
        self.regions.find_many(faces, places, count, to);
    }

    /// Densities per steradian at [coordinates](super::density::coordinates) in regions, for lanes
    /// where `is_wanted` is 1; other lanes get 0.
    pub fn pdfs<const N: usize>(
        &self,
        regions: &[u32; N],
        [x, y]: &[[u32; N]; 2],
        is_wanted: &[u32; N],
        to: &mut [f32; N],
    ) {
        let mut entries = [0; N];
        let (mut walking, mut left) = ([0u16; N], 0);
        for i in 0..N {
            let table = self.briefs[regions[i] as usize].table;
            entries[i] = if is_wanted[i] != 0 { table } else { 0 };
            walking[left] = i as u16;
            left += (entries[i] >> 31) as usize;
        }
        let mut digits = COORDINATE_DIGITS;
        while left > 0 && digits > 0 {
            digits -= 2;
            let count = std::mem::take(&mut left);
            for k in 0..count {
                let i = usize::from(walking[k]);
                let cell = (y[i] >> digits & 3) * 4 + (x[i] >> digits & 3);
                entries[i] = self.tables[(entries[i] & !TABLE) as usize][cell as usize & 15];
                walking[left] = walking[k];
                left += (entries[i] >> 31) as usize;
            }
        }
        for (to, entry) in to.iter_mut().zip(entries) {
            *to = f32::from_bits(entry);
        }
    }

    /// Samples points of the unit square as [`Density::point`] does, for lanes where `is_wanted` is
    /// 1.
    pub fn points<const N: usize>(
        &self,
        regions: &[u32; N],
        choice: &[f32; N],
        u: &[[f32; N]; 2],
        is_wanted: &[u32; N],
        to: &mut [[f32; N]; 2],
    ) {
        let (mut drawing, mut count) = ([(0u16, 0u32, 0u32); N], 0);
        for i in 0..N {
            let brief = &self.briefs[regions[i] as usize];
            let number = (choice[i] * ONE) as u32;
            let part = (number as usize * brief.parts as usize) >> DIGITS;
            drawing[count] = (i as u16, number, brief.starts + part as u32);
            count += usize::from((is_wanted[i] != 0) & brief.is_known());
        }
        // From parts to the first quads of parts.
        for (_, _, at) in &mut drawing[..count] {
            *at = self.starts[*at as usize];
        }
        let mut left = 1;
        while left > 0 {
            left = 0;
            for (_, number, quad) in &mut drawing[..count] {
                let is_before = u32::from(self.ends[*quad as usize] <= *number);
                *quad += is_before;
                left += is_before;
            }
        }
        for &(i, _, quad) in &drawing[..count] {
            let (i, [x, y, size]) = (usize::from(i), self.quads[quad as usize]);
            let point = Vec2::new(x, y) + Vec2::new(u[0][i], u[1][i]) * size;
            (to[0][i], to[1][i]) = (point.x, point.y);
        }
    }

    /// Memory use in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.regions.memory_bytes()
            + size_of_val(&self.briefs[..])
            + size_of_val(&self.tables[..])
            + size_of_val(&self.starts[..])
            + size_of_val(&self.ends[..])
            + size_of_val(&self.quads[..])
    }
}

#[cfg(test)]
mod tests {
    use super::super::density::coordinates;
    use super::super::directional::{Gatherer, Moment};
    use super::*;
    use snell_math::Vec3;
    use snell_math::rng::uniform2;

    const MANY: usize = 64;

    /// Densities learnt from lights of several sizes.
    fn densities() -> Vec<Density> {
        let learnt = |size: u32| {
            let mut gatherer = Gatherer::default();
            let mut shares = None;
            for round in 0..4 {
                for i in 0..3000 {
                    let [u, jitter] = [0, 1].map(|k| uniform2([i, round, size, k]));
                    let direction = snell_math::sampling::uniform_sphere(u);
                    let near = direction.dot(Vec3::new(0.6, -0.48, 0.64))
                        > 1.0 - 0.5 / (size as f32 * size as f32);
                    gatherer.add(direction, 0.02 + f32::from(near) * size as f32, jitter);
                }
                shares = gatherer.shares(Moment::First, 0.0);
                gatherer = Gatherer::suited_to(shares.as_ref().expect("there is light"));
            }
            shares.expect("there was a round").density()
        };
        (1..8).map(learnt).collect()
    }

    /// Batched look-ups must give the same bits as those of each density by itself.
    #[test]
    fn many_are_looked_up_as_one_by_one() {
        #[derive(Clone, Copy)]
        struct Whole;
        impl Halves for Whole {
            fn halves(self) -> Result<[Self; 2], u32> {
                Err(0)
            }
        }
        let densities = densities();
        let mut atlas = Atlas::of_trees([Whole].into_iter());
        for (i, density) in densities.iter().enumerate() {
            atlas.add(Some(density), i as f32, 0.5, Parallax::default());
            atlas.add(None, 1.0, 0.0, Parallax::default());
        }
        for round in 0..50 {
            let numbers = |k: u32| {
                std::array::from_fn::<f32, MANY, _>(|i| uniform2([round, i as u32, k, 8]).x)
            };
            let (choice, u, at) = (numbers(0), [1, 2].map(numbers), [3, 4].map(numbers));
            let regions: [u32; MANY] =
                std::array::from_fn(|i| i as u32 * 5 % (2 * densities.len() as u32));
            let is_wanted: [u32; MANY] = std::array::from_fn(|i| u32::from(i % 7 != 3));
            let places: [[u32; 2]; MANY] =
                std::array::from_fn(|i| coordinates(Vec2::new(at[0][i], at[1][i])));
            let (mut pdfs, mut points) = ([0.0; MANY], [[-1.0; MANY]; 2]);
            let columns = [0, 1].map(|axis| places.map(|place| place[axis]));
            atlas.pdfs(&regions, &columns, &is_wanted, &mut pdfs);
            atlas.points(&regions, &choice, &u, &is_wanted, &mut points);
            for i in 0..MANY {
                let density =
                    regions[i].is_multiple_of(2).then(|| &densities[regions[i] as usize / 2]);
                let density = density.filter(|_| is_wanted[i] != 0);
                let pdf = density.map_or(0.0, |d| d.pdf_at(places[i]));
                assert_eq!(pdfs[i], pdf, "{i}");
                let point = density
                    .map_or(Vec2::NEG_ONE, |d| d.point(choice[i], Vec2::new(u[0][i], u[1][i])));
                assert_eq!([points[0][i], points[1][i]], point.to_array(), "{i}");
            }
        }
    }
}
