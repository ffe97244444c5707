//! Projection maps for photons that glass and mirrors focus. Few of a light's photons hit such
//! surfaces, but they cause all caustics. After some photons were emitted in all directions, half
//! of the others are therefore emitted where the focused ones were (Jensen, Global illumination
//! using photon maps, 1996, section 2.1). The maps are over the random numbers by which a photon is
//! emitted, so one kind of map serves all kinds of lights.

use snell_math::Vec2;
use snell_math::rng::ONE_MINUS_EPSILON;
use std::collections::BTreeMap;

/// Cells along each side of a map.
const SIDE: usize = 16;
/// The number of maps. If there are more lights, some share a map.
const MAPS: usize = 1 << 10;
/// The fraction of photons that are emitted without the maps.
const ANYWHERE: f32 = 0.5;

/// The cell of a map that holds the random numbers of a photon's emission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Departure {
    map: u32,
    cell: u32,
}

/// The maps of focused photons of all lights, by number.
#[derive(Debug, Default)]
pub struct ProjectionMaps {
    maps: BTreeMap<u32, Map>,
}

/// A map, as the cumulative number of focused photons up to and including each cell.
#[derive(Debug)]
struct Map {
    ends: Vec<u32>,
}

impl Map {
    fn count(&self, cell: usize) -> u32 {
        self.ends[cell] - cell.checked_sub(1).map_or(0, |before| self.ends[before])
    }

    fn all(&self) -> u32 {
        self.ends[self.ends.len() - 1]
    }
}

impl ProjectionMaps {
    /// The maps of photons that were emitted from these cells and focused.
    pub fn new(focused: impl Iterator<Item = Departure>) -> Self {
        let mut maps = BTreeMap::new();
        for Departure { map, cell } in focused {
            maps.entry(map).or_insert_with(|| Map { ends: vec![0; SIDE * SIDE] }).ends
                [cell as usize] += 1;
        }
        for map in maps.values_mut() {
            let mut sum = 0;
            for end in &mut map.ends {
                sum += *end;
                *end = sum;
            }
        }
        Self { maps }
    }

    /// Maps random numbers to those of a photon's emission. Returns the mapped numbers, the ratio
    /// of the uniform to the mapped density, and the cell.
    pub fn aim(&self, light: usize, choice: f32, u: Vec2) -> (Vec2, f32, Departure) {
        let number = (light % MAPS) as u32;
        let departure = |u: Vec2| {
            let [x, y] = u.to_array().map(|x| ((x * SIDE as f32) as usize).min(SIDE - 1));
            Departure { map: number, cell: (y * SIDE + x) as u32 }
        };
        let Some(map) = self.maps.get(&number) else { return (u, 1.0, departure(u)) };
        let u = if choice < ANYWHERE {
            u
        } else {
            let wanted = ((choice - ANYWHERE) / (1.0 - ANYWHERE) * map.all() as f32) as u32;
            let cell = map.ends.partition_point(|&end| end <= wanted.min(map.all() - 1));
            let moved = (Vec2::new((cell % SIDE) as f32, (cell / SIDE) as f32) + u) / SIDE as f32;
            moved.min(Vec2::splat(ONE_MINUS_EPSILON))
        };
        let departure = departure(u);
        let share = map.count(departure.cell as usize) as f32 / map.all() as f32;
        let often = ANYWHERE + (1.0 - ANYWHERE) * share * (SIDE * SIDE) as f32;
        (u, 1.0 / often, departure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng::uniform2;

    /// Weighted means must not change, and focused photons must become more frequent.
    #[test]
    fn what_is_aimed_is_weighed() {
        let narrow = |u: Vec2| u.x > 0.5 && u.x < 0.55 && u.y > 0.2 && u.y < 0.3;
        let nowhere = ProjectionMaps::default();
        let numbers = |i: u32| (uniform2([i, 1, 2, 3]).x, uniform2([i, 3, 2, 1]));
        let n = 200_000;
        let focused = (0..n)
            .map(|i| nowhere.aim(5, numbers(i).0, numbers(i).1))
            .filter(|found| narrow(found.0));
        let aim = ProjectionMaps::new(focused.map(|found| found.2));
        let found: Vec<_> = (n..2 * n).map(|i| aim.aim(5, numbers(i).0, numbers(i).1)).collect();
        let mean = |f: &dyn Fn(Vec2, f32) -> f32| {
            found.iter().map(|&(u, w, _)| f64::from(f(u, w))).sum::<f64>() / f64::from(n)
        };
        assert!((mean(&|_, weight| weight) - 1.0).abs() < 0.01);
        assert!((mean(&|u, weight| u.x * weight) - 0.5).abs() < 0.01);
        assert!((mean(&|u, weight| f32::from(narrow(u)) * weight) - 0.005).abs() < 0.0002);
        assert!(mean(&|u, _| f32::from(narrow(u))) > 0.1);
        assert_eq!(aim.aim(6, 0.9, Vec2::splat(0.1)).1, 1.0);
        // The last random number in the last cell.
        let last = Vec2::splat(ONE_MINUS_EPSILON);
        let corner = ProjectionMaps::new(std::iter::once(nowhere.aim(0, 0.0, last).2));
        assert!(corner.aim(0, 0.9, last).0.max_element() < 1.0);
    }
}
