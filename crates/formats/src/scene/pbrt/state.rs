//! The graphics state, which applies to the directives that follow, and the stack on which it is
//! saved.

use super::params::Param;
use super::spectrum::ColorSpace;
use crate::scene::fault::{Fault, Spot};
use snell_math::DAffine3;
use std::rc::Rc;

/// The kinds of directive for which `Attribute` can set defaults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    Shape,
    Light,
    Material,
    Medium,
    Texture,
}

impl Target {
    /// The target of this name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "shape" => Self::Shape,
            "light" => Self::Light,
            "material" => Self::Material,
            "medium" => Self::Medium,
            "texture" => Self::Texture,
            _ => return None,
        })
    }
}

/// The current transform at both ends of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion(pub [DAffine3; 2]);

impl Motion {
    /// The identity at all times.
    pub const IDENTITY: Self = Self([DAffine3::IDENTITY; 2]);

    /// The inverse maps; `None` if one does not exist.
    pub fn inverse(&self) -> Option<Self> {
        let inverse = |m: DAffine3| snell_math::Transform::new(m).map(|t| *t.inverse_matrix());
        Some(Self([inverse(self.0[0])?, inverse(self.0[1])?]))
    }
}

/// The graphics state.
#[derive(Clone, Debug)]
pub struct State {
    /// The current transform.
    pub transform: Motion,
    /// True for each end of the motion that transform directives change.
    pub active: [bool; 2],
    /// True if the orientation of surfaces is reversed.
    pub reverse_orientation: bool,
    /// Index of the current material in the list of materials; `None` is pbrt's default.
    pub material: Option<usize>,
    /// Index of the current area light in the list of area lights.
    pub area_light: Option<usize>,
    /// The colour space of RGB values.
    pub color_space: ColorSpace,
    /// Names of the media inside and outside of surfaces; empty for none.
    pub media: [Rc<str>; 2],
    defaults: [Rc<Vec<Rc<Param>>>; 5],
}

impl Default for State {
    fn default() -> Self {
        Self {
            transform: Motion::IDENTITY,
            active: [true; 2],
            reverse_orientation: false,
            material: None,
            area_light: None,
            color_space: ColorSpace::Srgb,
            media: ["".into(), "".into()],
            defaults: Default::default(),
        }
    }
}

impl State {
    /// The parameters that `Attribute` has set for a target.
    pub fn defaults(&self, target: Target) -> &[Rc<Param>] {
        &self.defaults[target as usize]
    }

    /// Sets parameters for a target.
    pub fn add_defaults(&mut self, target: Target, params: Vec<Rc<Param>>) {
        Rc::make_mut(&mut self.defaults[target as usize]).extend(params);
    }

    /// Changes the current transform at the times that `ActiveTransform` selects.
    pub fn change_transform(&mut self, change: impl Fn(DAffine3) -> DAffine3) {
        for (transform, active) in self.transform.0.iter_mut().zip(self.active) {
            if active {
                *transform = change(*transform);
            }
        }
    }

    /// Concatenates a transform to the current one.
    pub fn concatenate(&mut self, map: DAffine3) {
        self.change_transform(|m| m * map);
    }
}

/// A kind of block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    Attribute,
    Transform,
    Object,
}

impl Block {
    /// The directives that begin and end a block of this kind.
    fn directives(self) -> [&'static str; 2] {
        match self {
            Self::Attribute => ["AttributeBegin", "AttributeEnd"],
            Self::Transform => ["TransformBegin", "TransformEnd"],
            Self::Object => ["ObjectBegin", "ObjectEnd"],
        }
    }
}

/// The saved states of open blocks.
#[derive(Debug, Default)]
pub struct Stack {
    saved: Vec<(Block, Spot, State)>,
}

impl Stack {
    /// The number of open blocks.
    pub fn depth(&self) -> usize {
        self.saved.len()
    }

    /// Opens a block.
    pub fn begin(
        &mut self,
        block: Block,
        at: Spot,
        state: &State,
        limit: usize,
    ) -> Result<(), Fault> {
        if self.saved.len() >= limit {
            let problem = format!("blocks are nested deeper than {limit}, the limit");
            return Err(Fault::new(at, problem, "flatten the scene"));
        }
        self.saved.push((block, at, state.clone()));
        Ok(())
    }

    /// Closes a block, and restores the saved state.
    pub fn end(&mut self, block: Block, at: Spot, state: &mut State) -> Result<(), Fault> {
        let [begin, end] = block.directives();
        match self.saved.last() {
            Some((open, opened, _)) if *open != block => {
                let [other, its_end] = open.directives();
                let problem = format!("{end}, but {other} of line {} is still open", opened.line);
                return Err(Fault::new(at, problem, format!("write {its_end} before it")));
            }
            None => return Err(Fault::new(at, format!("{end} without {begin}"), "remove it")),
            Some(_) => {}
        }
        if let Some((_, _, saved)) = self.saved.pop() {
            if block == Block::Transform {
                state.transform = saved.transform;
            } else {
                *state = saved;
            }
        }
        Ok(())
    }

    /// Fails if blocks above this depth are open.
    pub fn check_closed(&self, depth: usize) -> Result<(), Fault> {
        let Some((block, at, _)) = self.saved.get(depth) else { return Ok(()) };
        let [begin, end] = block.directives();
        Err(Fault::new(
            *at,
            format!("this {begin} has no {end}"),
            "close the block; the file may be cut off",
        ))
    }
}
