//! Numbered sets of objects that rays are inside, so that paths and light rays need only store a
//! number.

use super::insides::{Filling, Inside};
use super::{Insides, OwnMedia};
use snell_scene::MaterialId;
use std::collections::HashMap;

/// Entries of the cache of crossings; a power of two.
const REMEMBERED: usize = 64;

/// All sets of objects that rays of a batch are inside, and the content of each. Number 0 is the
/// empty set.
#[derive(Debug)]
pub struct KnownInsides {
    all: Vec<(Insides, Filling)>,
    /// The content outside of all objects.
    everywhere: Filling,
    numbers: HashMap<Vec<Inside>, u32>,
    /// A cache of the results of the last crossings.
    recent: [Option<(Crossed, u32)>; REMEMBERED],
    /// The media that materials define.
    pub own: OwnMedia,
}

/// The key of a crossing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossed {
    /// The insides before.
    pub from: u32,
    /// The material of the surface.
    pub material: MaterialId,
    /// To its inside.
    pub enters: bool,
}

impl KnownInsides {
    /// Only number 0, given the content outside of all objects.
    pub fn new(everywhere: Filling) -> Self {
        let (all, numbers, own) = (Vec::new(), HashMap::new(), OwnMedia::new());
        let mut known = Self { all, everywhere, numbers, recent: [None; REMEMBERED], own };
        known.clear();
        known
    }

    /// Removes all but number 0.
    pub fn clear(&mut self) {
        self.all.clear();
        self.numbers.clear();
        self.recent = [None; REMEMBERED];
        self.own.clear();
        self.number(Insides::default());
    }

    /// The number of a set.
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

    /// The content of a set.
    #[inline]
    pub fn filling(&self, number: u32) -> Filling {
        self.all[number as usize].1
    }

    /// The number of the set to which a crossing leads. `find` computes it, and returns whether all
    /// crossings with the same key lead there.
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
