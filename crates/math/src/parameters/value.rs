//! The types of parameter values.

use super::{Kind, Parameter, Step, Visitor};
use crate::spectrum::{Metal, RefractiveIndex};
use crate::{DAffine3, DMat3, DVec2, DVec3, Rgb, Vec2, Vec3};
use std::sync::Arc;

/// A type that a parameter can have.
pub trait Value {
    /// The kind of the parameter.
    const KIND: Kind;

    /// Visits the value's numbers and references.
    fn visit(&self, visitor: &mut Visitor<'_>);

    /// The number, if the value is one.
    fn number(&self) -> Option<f64> {
        None
    }
}

/// A type with parameters, declared by [`declare!`](crate::declare).
pub trait Declared: Value {
    /// The type's doc comment as it stands in the source.
    const ABOUT: &'static str;
    /// The type's parameters, in the order of the source.
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
            // Formulas and tables of glasses are checked where they are read.
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

    fn number(&self) -> Option<f64> {
        self.as_ref()?.number()
    }
}

/// An array of numbers is a vector; an array of arrays is a matrix.
impl<T: Value, const N: usize> Value for [T; N] {
    const KIND: Kind = match T::KIND {
        Kind::Number | Kind::Whole | Kind::Optional(Kind::Number) => Kind::Numbers(N),
        Kind::Numbers(_) => Kind::Matrix,
        _ => Kind::List(&T::KIND),
    };

    fn visit(&self, visitor: &mut Visitor<'_>) {
        if matches!(Self::KIND, Kind::Numbers(_)) {
            visitor.numbers(&self.each_ref().map(T::number));
            return;
        }
        for (i, value) in self.iter().enumerate() {
            visitor.inside(Step::Index(i), value);
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

            fn number(&self) -> Option<f64> {
                Some(f64::from(*self))
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
}
