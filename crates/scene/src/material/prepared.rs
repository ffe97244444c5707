//! What of BSDFs is the same at all points: worked out once per material.

use super::{FrameNeeds, Material, MaterialKind, OpenPbr, ShadingPoint};
use crate::bsdf::{Bsdf, ManyBsdf, ManyPoint};
use crate::texture::TextureSet;
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, Vec3};
use std::borrow::Cow;

/// What differs from point to point of surfaces with a [`ManyBsdf`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Differs {
    Nothing,
    Body,
    All,
}

/// What is known of a material's BSDF before the point is.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The material as layers, if that is what it is.
    surface: Option<Box<OpenPbr>>,
    /// At a plain point, without textures.
    bsdf: Bsdf,
    /// The same, if many directions can be asked about at once; what it is may differ from point to
    /// point.
    many: Option<ManyBsdf>,
    /// As [`ManyPoint`] says.
    differs: Differs,
    /// True if it is the same at all [plain](ShadingPoint::is_plain) points.
    is_everywhere: bool,
}

impl Prepared {
    /// What is known of a material.
    pub fn of(material: &Material) -> Self {
        let (bsdf, looks_up) = anywhere(&material.kind);
        let depends_on_point = match &material.kind {
            // On where across the fibre it is met, and on how far light came through the glass.
            MaterialKind::Hair(_) => true,
            MaterialKind::Dielectric(glass) => !glass.absorption.is_black(),
            _ => false,
        };
        let is_everywhere = !looks_up && !depends_on_point;
        let surface = match &material.kind {
            MaterialKind::OpenPbr(surface) => Some(Box::new(surface.clone())),
            MaterialKind::MetallicRoughness(kind) => Some(Box::new(kind.open_pbr())),
            _ => None,
        };
        let (many, differs) = match &surface {
            _ if is_everywhere => (ManyBsdf::of(&bsdf), Differs::Nothing),
            Some(surface) => match ManyBsdf::of(&bsdf).filter(ManyBsdf::takes_any_body) {
                Some(many) if surface.varies_in_color_alone() => (Some(many), Differs::Body),
                _ => (surface.many_mixed(), Differs::All),
            },
            None => (None, Differs::Nothing),
        };
        Self { surface, bsdf, many, differs, is_everywhere }
    }

    /// The BSDF, if it is the same at all [plain](ShadingPoint::is_plain) points, in the frame of
    /// the surface's own normal and tangent.
    pub fn plain(&self, material: &Material) -> Option<&Bsdf> {
        let is_turned = match &material.kind {
            MaterialKind::OpenPbr(surface) => {
                surface.geometry_tangent.is_some() || surface.geometry_coat_tangent.is_some()
            }
            _ => false,
        };
        (self.is_everywhere && !material.is_bent() && !is_turned).then_some(&self.bsdf)
    }

    /// [`Self::plain`], if many directions can be asked about at once.
    pub fn plain_many(&self, material: &Material) -> Option<&ManyBsdf> {
        self.plain(material).and(self.many.as_ref())
    }

    /// The BSDF of the material at a point and what it is there, if many directions can be asked
    /// about at once; and what it asks of its frame.
    pub fn many_at(
        &self,
        material: &Material,
        point: &ShadingPoint,
    ) -> Option<(&ManyBsdf, ManyPoint, FrameNeeds)> {
        let follows = |many: &&ManyBsdf| !many.has_coat() || material.coat_map(point).is_none();
        let many = self.many.as_ref().filter(|_| point.is_in_air()).filter(follows)?;
        let (mut at, needs) = match (&self.surface, self.differs) {
            (Some(surface), Differs::All) => surface.mixed_at(point)?,
            _ => (many.point(), FrameNeeds::of(&self.bsdf)),
        };
        match (&self.surface, point.mode) {
            (Some(surface), ColorMode::Rgb) if self.differs == Differs::Body => {
                at.palette[0] = surface.base(point)
            }
            (_, ColorMode::Rgb) => {}
            (Some(surface), ColorMode::Spectral(_)) => at.palette = surface.palette(point)?,
            (None, ColorMode::Spectral(_)) => {
                at.palette = match &material.kind {
                    MaterialKind::Conductor(metal) => metal.palette(point),
                    _ => ManyBsdf::palette_of(&self.bsdf(material, point))?,
                }
            }
        }
        Some((many, at, needs))
    }

    /// [`Self::many_at`] any plain point, in any mode, of a material that has [`Self::plain_many`].
    pub fn plain_many_in(
        &self,
        material: &Material,
        mode: ColorMode,
    ) -> Option<(&ManyBsdf, ManyPoint)> {
        at_plain_point(mode, |point| self.many_at(material, point).map(|(many, at, _)| (many, at)))
    }

    /// The BSDF at any plain point, in any mode, of a material that has [`Self::plain`].
    pub fn plain_in(&self, material: &Material, mode: ColorMode) -> Cow<'_, Bsdf> {
        at_plain_point(mode, |point| self.bsdf(material, point))
    }

    /// The BSDF of the material at a point.
    pub(super) fn bsdf(&self, material: &Material, point: &ShadingPoint) -> Cow<'_, Bsdf> {
        if self.is_everywhere && point.is_plain() {
            return Cow::Borrowed(&self.bsdf);
        }
        Cow::Owned(match (&self.surface, &material.kind, &self.bsdf) {
            (Some(surface), _, Bsdf::OpenPbr(known)) => surface.bsdf_like(Some(known), point),
            (_, MaterialKind::Dielectric(glass), Bsdf::Dielectric(known)) => {
                glass.bsdf_like(Some(known), point)
            }
            _ => material.kind.bsdf(point),
        })
    }
}

/// The BSDF at a point like any other without textures, and true if it would have looked some up.
pub(super) fn anywhere(kind: &MaterialKind) -> (Bsdf, bool) {
    let bsdf = at_plain_point(ColorMode::Rgb, |point| kind.bsdf(point));
    (bsdf, !Material::new("", kind.clone()).textures().is_empty())
}

fn at_plain_point<T>(mode: ColorMode, ask: impl FnOnce(&ShadingPoint) -> T) -> T {
    let (surface, textures) =
        (SurfaceInteraction::plain(Vec3::ZERO, Vec3::Z), TextureSet::default());
    ask(&ShadingPoint {
        surface: &surface,
        footprint: 0.0,
        textures: &textures,
        mode,
        outside_ior: 1.0,
    })
}

impl ShadingPoint<'_> {
    /// True in [`ColorMode::Rgb`], in air, and without a vertex colour.
    pub fn is_plain(&self) -> bool {
        matches!(self.mode, ColorMode::Rgb) && self.is_in_air()
    }

    /// True in air and without a vertex colour.
    fn is_in_air(&self) -> bool {
        let [r, g, b, _] = self.surface.color;
        self.outside_ior == 1.0 && [r, g, b] == [1.0; 3]
    }
}
