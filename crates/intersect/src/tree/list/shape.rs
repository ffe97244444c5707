//! Analytic shapes that lists test in lanes.

use crate::group::Object;
use crate::shape::{AnyShape, Rectangle};
use snell_math::{DAffine3, DVec2};

/// A shape that is tested with sixteen rays at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ListShape {
    pub geometry: u32,
    pub kind: Kind,
    pub shape_from_group: DAffine3,
}

/// The shape in its own coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Sphere {
        radius: f64,
    },
    /// A shape in the plane `z = 0`.
    Flat(Outline),
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Outline {
    /// A rectangle; the whole plane if the size is infinite.
    Rectangle { half_size: DVec2 },
    /// The area between two circles, given by the squares of their radii.
    Ring { inner: f64, outer: f64 },
}

/// True for zero and for sizes with which nothing overflows or vanishes here for ordinary rays: all
/// nonzero values are then between `1e-91` and `1e44` in the coordinates of the shape.
fn is_moderate(x: f64) -> bool {
    x == 0.0 || (1e-30..1e30).contains(&x.abs())
}

impl ListShape {
    /// The shape of an object; `None` if the object cannot be tested in lanes.
    pub fn of(object: &Object) -> Option<Self> {
        let Object::Shape { shape, geometry, shape_from_group } = object else { return None };
        let (kind, sizes) = match shape.to_any()? {
            AnyShape::Sphere(sphere) => {
                (Kind::Sphere { radius: sphere.radius }, [sphere.radius, 0.0])
            }
            AnyShape::Rectangle(Rectangle { half_size }) => {
                (Kind::Flat(Outline::Rectangle { half_size }), half_size.to_array())
            }
            AnyShape::Disk(disk) => {
                let (inner, outer) =
                    (disk.inner_radius * disk.inner_radius, disk.radius * disk.radius);
                (Kind::Flat(Outline::Ring { inner, outer }), [inner, outer])
            }
            AnyShape::Plane(_) => {
                (Kind::Flat(Outline::Rectangle { half_size: DVec2::INFINITY }), [0.0; 2])
            }
            _ => return None,
        };
        let is_moderate =
            shape_from_group.to_cols_array().iter().chain(&sizes).all(|&x| is_moderate(x));
        is_moderate.then_some(Self {
            geometry: *geometry,
            kind,
            shape_from_group: *shape_from_group,
        })
    }

    /// True if the shape lies in a plane.
    #[inline(always)]
    pub fn is_flat(&self) -> bool {
        matches!(self.kind, Kind::Flat(_))
    }
}
