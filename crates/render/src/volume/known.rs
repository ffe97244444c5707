//! Numbered sets of the objects that rays are inside, so that paths and light rays store only a
//! number.

use super::insides::{Filling, Inside};
use super::{Insides, OwnMedia};
use snell_scene::MaterialId;
use std::collections::HashMap;

/// The number of entries of the cache of crossings; a power of two.
const REMEMBERED: usize = 64;

/// All sets of objects that the rays of a batch are inside, with what fills the space in each.
/// Number 0 is the empty set.
#[derive(Debug)]
pub struct KnownInsides {
    all: Vec<(Insides, Filling)>,
    /// What fills the space outside of all objects.
    everywhere: Filling,
    numbers: HashMap<Vec<Inside>, u32>,
    /// A cache of the sets to which recent crossings led.
    recent: [Option<(Crossed, u32)>; REMEMBERED],
    /// The media that materials define, evaluated at points.
    pub own: OwnMedia,
}

/// What identifies a crossing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossed {
    /// The number of the set before the crossing.
    pub from: u32,
    /// The material of the surface that is crossed.
    pub material: MaterialId,
    /// True if the ray crosses to the inside of the surface.
    pub enters: bool,
}

impl KnownInsides {
    /// Only the empty set, with `everywhere` as what fills it.
    pub fn new(everywhere: Filling) -> Self {
        let (all, numbers, own) = (Vec::new(), HashMap::new(), OwnMedia::new());
        let mut known = Self { all, everywhere, numbers, recent: [None; REMEMBERED], own };
        known.clear();
        known
    }

    /// Removes all sets but the empty one.
    pub fn clear(&mut self) {
        self.all.clear();
        self.numbers.clear();
        self.recent = [None; REMEMBERED];
        self.own.clear();
        self.number(Insides::default());
    }

    /// The number of a set, which is added if it is new.
    pub fn number(&mut self, insides: Insides) -> u32 {
        if let Some(&number) = self.numbers.get(insides.entered()) {
            return number;
        }
        let number = self.all.len() as u32;
        self.numbers.insert(insides.entered().to_vec(), number);
        self.all.push((insides, insides.filling(self.everywhere)));
        number
    }

    /// The set with this number.
    #[inline]
    pub fn get(&self, number: u32) -> &Insides {
        &self.all[number as usize].0
    }

    /// What fills the space in the set with this number.
    #[inline]
    pub fn filling(&self, number: u32) -> Filling {
        self.all[number as usize].1
    }

    /// The number of the set after a crossing. `find` computes that set, and returns with it
    /// whether all crossings with the same key lead to it.
    #[inline]
    pub fn crossed(
        &mut self,
        crossed: Crossed,
        find: impl FnOnce(&Insides, &mut OwnMedia) -> (Insides, bool),
    ) -> u32 {
        let slot = (crossed.from.wrapping_mul(7)
            ^ crossed.material.0 << 1
            ^ u32::from(crossed.enters)) as usize;
        let slot = slot % REMEMBERED;
        if let Some((recent, to)) = self.recent[slot]
            && recent == crossed
        {
            return to;
        }
        let (insides, is_certain) = find(&self.all[crossed.from as usize].0, &mut self.own);
        let to = self.number(insides);
        if is_certain {
            self.recent[slot] = Some((crossed, to));
        }
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_insides_have_one_number_and_crossings_are_asked_about_once() {
        let mut known = KnownInsides::new(Filling::Empty);
        let inside = |material: u32| Inside {
            material: MaterialId(material),
            priority: 0,
            filling: Filling::Empty,
        };
        let mut asked = 0;
        let mut cross = |known: &mut KnownInsides, from: u32, material: u32, enters: bool| {
            known.crossed(Crossed { from, material: MaterialId(material), enters }, |insides, _| {
                asked += 1;
                let mut insides = *insides;
                match enters {
                    true => insides.enter(inside(material)),
                    false => insides.leave(MaterialId(material)),
                }
                (insides, true)
            })
        };
        let one = cross(&mut known, 0, 1, true);
        let two = cross(&mut known, one, 2, true);
        assert_eq!(known.get(two).innermost().map(|i| i.material), Some(MaterialId(2)));
        assert_eq!(cross(&mut known, two, 2, false), one);
        assert_eq!(cross(&mut known, one, 1, false), 0);
        for material in 0..3 * REMEMBERED as u32 {
            assert_eq!(cross(&mut known, 0, material, false), 0);
        }
        assert_eq!((cross(&mut known, one, 2, true), cross(&mut known, one, 2, true)), (two, two));
        assert!(asked < 4 + 3 * REMEMBERED + 2);
    }
}
