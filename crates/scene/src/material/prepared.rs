//! The parts of BSDFs that are the same at all points. They are computed once per material.

use super::{FrameNeeds, Material, MaterialKind, OpenPbr, ShadingPoint};
use crate::bsdf::{BatchBsdf, BatchPoint, Bsdf};
use crate::texture::TextureSet;
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, Vec3};
use std::borrow::Cow;

/// The parameters of a [`BatchBsdf`] that vary over the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Differs {
    Nothing,
    Body,
    All,
}

/// The parts of a material's BSDF that do not depend on the point.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The material as an [`OpenPbr`], if it has that form.
    surface: Option<Box<OpenPbr>>,
    /// The BSDF at a [plain](ShadingPoint::is_plain) point, without textures.
    bsdf: Bsdf,
    /// The BSDF for batches of directions, if it has that form. Its parameters may vary from point
    /// to point.
    batch: Option<BatchBsdf>,
    /// The parameters of `batch` that vary from point to point.
    differs: Differs,
    /// True if `bsdf` is the BSDF at all [plain](ShadingPoint::is_plain) points.
    is_everywhere: bool,
}

impl Prepared {
    /// Computes the constant parts of a material.
    pub fn of(material: &Material) -> Self {
        let (bsdf, looks_up) = anywhere(&material.kind);
        let depends_on_point = match &material.kind {
            // Hair depends on the offset across the fibre, and absorbing glass on the distance
            // through it.
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
        let (batch, differs) = match &surface {
            _ if is_everywhere => (BatchBsdf::of(&bsdf), Differs::Nothing),
            Some(surface) => match BatchBsdf::of(&bsdf).filter(BatchBsdf::takes_any_body) {
                Some(batch) if surface.varies_in_color_alone() => (Some(batch), Differs::Body),
                _ => (surface.batch_mixture(), Differs::All),
            },
            None => (None, Differs::Nothing),
        };
        Self { surface, bsdf, batch, differs, is_everywhere }
    }

    /// The BSDF in the frame of the surface's own normal and tangent, if it is the same at all
    /// [plain](ShadingPoint::is_plain) points.
    pub fn plain(&self, material: &Material) -> Option<&Bsdf> {
        let is_turned = match &material.kind {
            MaterialKind::OpenPbr(surface) => {
                surface.geometry_tangent.is_some() || surface.geometry_coat_tangent.is_some()
            }
            _ => false,
        };
        (self.is_everywhere && !material.is_bent() && !is_turned).then_some(&self.bsdf)
    }

    /// The batch form of [`Self::plain`], if there is one.
    pub fn plain_batch(&self, material: &Material) -> Option<&BatchBsdf> {
        self.plain(material).and(self.batch.as_ref())
    }

    /// The batch form of the material's BSDF at a point, with its parameters at the point and what
    /// it needs of the frame. `None` if the BSDF has no batch form there.
    pub fn batch_at(
        &self,
        material: &Material,
        point: &ShadingPoint,
    ) -> Option<(&BatchBsdf, BatchPoint, FrameNeeds)> {
        let follows = |batch: &&BatchBsdf| !batch.has_coat() || material.coat_map(point).is_none();
        let batch = self.batch.as_ref().filter(|_| point.is_in_air()).filter(follows)?;
        let (mut at, needs) = match (&self.surface, self.differs) {
            (Some(surface), Differs::All) => surface.mixed_at(point)?,
            _ => (batch.point(), FrameNeeds::of(&self.bsdf)),
        };
        match (&self.surface, point.mode) {
            (Some(surface), ColorMode::Rgb) if self.differs == Differs::Body => {
                at.spectra.base = surface.base(point)
            }
            (_, ColorMode::Rgb) => {}
            (Some(surface), ColorMode::Spectral(_)) => at.spectra = surface.spectra(point)?,
            (None, ColorMode::Spectral(_)) => {
                at.spectra = match &material.kind {
                    MaterialKind::Conductor(metal) => metal.spectra(point),
                    _ => BatchBsdf::spectra_of(&self.bsdf(material, point))?,
                }
            }
        }
        Some((batch, at, needs))
    }

    /// The result of [`Self::batch_at`] at plain points in any colour mode, for a material that has
    /// a [`Self::plain_batch`].
    pub fn plain_batch_in(
        &self,
        material: &Material,
        mode: ColorMode,
    ) -> Option<(&BatchBsdf, BatchPoint)> {
        at_plain_point(mode, |point| {
            self.batch_at(material, point).map(|(batch, at, _)| (batch, at))
        })
    }

    /// The BSDF at plain points in any colour mode, for a material that has a [`Self::plain`] BSDF.
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

/// The BSDF at a plain point without textures, and whether it would have looked up textures.
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
    /// True for a point in [`ColorMode::Rgb`], in air, and without a vertex colour.
    pub fn is_plain(&self) -> bool {
        matches!(self.mode, ColorMode::Rgb) && self.is_in_air()
    }

    /// True for a point in air and without a vertex colour.
    fn is_in_air(&self) -> bool {
        let [r, g, b, _] = self.surface.color;
        self.outside_ior == 1.0 && [r, g, b] == [1.0; 3]
    }
}
