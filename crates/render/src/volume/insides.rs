//! The set of nested objects that a path is inside.

use snell_scene::medium::MediumProperties;
use snell_scene::{MaterialId, MediumId};

/// The largest number of objects at a point; further ones are ignored.
const MOST: usize = 6;

/// What fills an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filling {
    /// Nothing.
    #[default]
    Empty,
    /// This medium of the scene.
    Medium(MediumId),
    /// The material's own medium with the values of the point where the path entered: an index into
    /// [`OwnMedia`].
    Own(u32),
}

/// The media that materials define, evaluated at the points where paths entered.
pub type OwnMedia = Vec<MediumProperties>;

/// One object that a path is inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Inside {
    /// The material of the surface that bounds the object.
    pub material: MaterialId,
    /// The object's priority: where objects overlap, the highest is active.
    pub priority: i32,
    /// What fills the object.
    pub filling: Filling,
}

impl Inside {
    const NONE: Self =
        Self { material: MaterialId(u32::MAX), priority: 0, filling: Filling::Empty };
}

/// The objects that a point is inside, in the order in which a path entered them.
#[derive(Clone, Copy, Debug)]
pub struct Insides {
    entries: [Inside; MOST],
    count: usize,
}

impl Default for Insides {
    fn default() -> Self {
        Self { entries: [Inside::NONE; MOST], count: 0 }
    }
}

impl Insides {
    /// All objects, in the order in which they were entered.
    pub fn entered(&self) -> &[Inside] {
        &self.entries[..self.count]
    }

    /// The active object: the one entered last among those of the highest priority. `None` outside
    /// of all objects.
    pub fn innermost(&self) -> Option<&Inside> {
        self.entered().iter().max_by_key(|inside| inside.priority)
    }

    /// The active object when those bounded by this material are ignored.
    pub fn innermost_but(&self, material: MaterialId) -> Option<&Inside> {
        self.entered()
            .iter()
            .filter(|inside| inside.material != material)
            .max_by_key(|inside| inside.priority)
    }

    /// What fills the space at the point. `everywhere` fills the space outside of all objects.
    pub fn filling(&self, everywhere: Filling) -> Filling {
        self.innermost().map_or(everywhere, |inside| inside.filling)
    }

    /// Enters an object.
    pub fn enter(&mut self, inside: Inside) {
        if self.count < MOST {
            self.entries[self.count] = inside;
            self.count += 1;
        }
    }

    /// Leaves the object that was entered last of those that this material bounds, if there is one.
    pub fn leave(&mut self, material: MaterialId) {
        if let Some(at) = self.entered().iter().rposition(|inside| inside.material == material) {
            self.entries.copy_within(at + 1..self.count, at);
            self.count -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(material: u32, priority: i32) -> Inside {
        Inside {
            material: MaterialId(material),
            priority,
            filling: Filling::Medium(MediumId(material)),
        }
    }

    fn at(insides: &Insides) -> Option<u32> {
        insides.innermost().map(|i| i.material.0)
    }

    #[test]
    fn the_last_one_entered_is_there_unless_another_has_a_higher_priority() {
        let mut insides = Insides::default();
        assert_eq!(at(&insides), None);
        insides.enter(inside(1, 0));
        insides.enter(inside(2, 0));
        assert_eq!(at(&insides), Some(2));
        insides.enter(inside(3, -1));
        assert_eq!(at(&insides), Some(2));
        insides.leave(MaterialId(2));
        assert_eq!(
            (at(&insides), insides.innermost_but(MaterialId(1)).map(|i| i.material.0)),
            (Some(1), Some(3))
        );
        insides.leave(MaterialId(7));
        insides.leave(MaterialId(1));
        assert_eq!(at(&insides), Some(3));
    }

    #[test]
    fn too_many_insides_are_not_noticed_and_leave_no_trace() {
        let mut insides = Insides::default();
        (0..20).for_each(|i| insides.enter(inside(i, 0)));
        (0..20).rev().for_each(|i| insides.leave(MaterialId(i)));
        assert_eq!(at(&insides), None);
    }
}
