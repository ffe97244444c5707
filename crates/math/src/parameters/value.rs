//! Values of parameters, as their types are.

use super::{Kind, Parameter, Step, Visitor};
use crate::spectrum::{Metal, RefractiveIndex};
use crate::{DAffine3, DMat3, DVec2, DVec3, Rgb, Vec2, Vec3};
use std::sync::Arc;

/// What a parameter can be.
pub trait Value {
    /// What it looks like.
    const KIND: Kind;

    /// Goes through its numbers, and through what it refers to.
    fn visit(&self, visitor: &mut Visitor<'_>);
}

/// A thing with parameters: what [`declare!`](crate::declare) makes.
pub trait Declared: Value {
    /// Its documentation, as it stands in the source.
    const ABOUT: &'static str;
    /// Its parameters, in the order of the source.
    const PARAMETERS: &'static [Parameter];
}

impl Value for bool {
    const KIND: Kind = Kind::Flag;

    fn visit(&self, _: &mut Visitor<'_>) {}
}

impl Value for String {
    const KIND: Kind = Kind::Text("text");

    fn visit(&self, _: &mut Visitor<'_>) {}
}

impl Value for Metal {
    const KIND: Kind = Kind::Text("name of a metal");

    fn visit(&self, _: &mut Visitor<'_>) {}
}

impl Value for RefractiveIndex {
    const KIND: Kind = Kind::RefractiveIndex;

    fn visit(&self, visitor: &mut Visitor<'_>) {
        match self {
            Self::Constant(ior) => visitor.number(f64::from(*ior)),
            // Formulas and tables have ranges of their own where they are read.
            Self::Cauchy { .. } | Self::Glass(_) => {}
        }
    }
}

impl<T: Value> Value for Option<T> {
    const KIND: Kind = Kind::Optional(&T::KIND);

    fn visit(&self, visitor: &mut Visitor<'_>) {
        if let Some(value) = self {
            value.visit(visitor);
        }
    }
}

impl<T: Value> Value for Vec<T> {
    const KIND: Kind = Kind::List(&T::KIND);

    fn visit(&self, visitor: &mut Visitor<'_>) {
        for (i, value) in self.iter().enumerate() {
            visitor.inside(Step::Index(i), value);
        }
    }
}

impl<T: Value> Value for Arc<T> {
    const KIND: Kind = T::KIND;

    fn visit(&self, visitor: &mut Visitor<'_>) {
        T::visit(self, visitor);
    }
}

macro_rules! numbers {
    ($($type:ty: $kind:ident,)*) => {$(
        impl Value for $type {
            const KIND: Kind = Kind::$kind;

            fn visit(&self, visitor: &mut Visitor<'_>) {
                visitor.number(f64::from(*self));
            }
        }
    )*};
}

numbers! {
    f32: Number,
    f64: Number,
    u8: Whole,
    u32: Whole,
    i32: Whole,
}

macro_rules! vectors {
    ($($type:ty: $kind:expr, $vector:ident => $numbers:expr;)*) => {$(
        impl Value for $type {
            const KIND: Kind = $kind;

            fn visit(&self, visitor: &mut Visitor<'_>) {
                let $vector = self;
                visitor.numbers(&$numbers.map(|x| Some(f64::from(x))));
            }
        }
    )*};
}

vectors! {
    Rgb: Kind::Color, color => color.to_array();
    Vec2: Kind::Vector(2), vector => vector.to_array();
    Vec3: Kind::Vector(3), vector => vector.to_array();
    DVec2: Kind::Vector(2), vector => vector.to_array();
    DVec3: Kind::Vector(3), vector => vector.to_array();
    DMat3: Kind::Matrix, matrix => matrix.to_cols_array();
    DAffine3: Kind::Matrix, map => map.to_cols_array();
    [f32; 2]: Kind::Numbers(2), numbers => numbers;
    [f32; 3]: Kind::Numbers(3), numbers => numbers;
    [f32; 4]: Kind::Numbers(4), numbers => numbers;
    [f64; 2]: Kind::Numbers(2), numbers => numbers;
    [f64; 4]: Kind::Numbers(4), numbers => numbers;
    [u32; 2]: Kind::Numbers(2), numbers => numbers;
}

impl Value for [Option<f64>; 2] {
    const KIND: Kind = Kind::Numbers(2);

    fn visit(&self, visitor: &mut Visitor<'_>) {
        visitor.numbers(self);
    }
}

macro_rules! lists {
    ($($type:ty: $kind:expr;)*) => {$(
        impl Value for $type {
            const KIND: Kind = $kind;

            fn visit(&self, visitor: &mut Visitor<'_>) {
                for (i, value) in self.iter().enumerate() {
                    visitor.inside(Step::Index(i), value);
                }
            }
        }
    )*};
}

lists! {
    [DVec3; 2]: Kind::List(&Kind::Vector(3));
    [DVec3; 3]: Kind::List(&Kind::Vector(3));
    [[f32; 3]; 2]: Kind::Matrix;
    [[f64; 4]; 2]: Kind::Matrix;
    [[f64; 4]; 3]: Kind::Matrix;
}
