//! A BSDF in world space, with its shading frame and the geometric normal.

use super::{FrameNeeds, Material, MaterialKind, NormalMap, Prepared, ShadingPoint, normal};
use crate::bsdf::{Bsdf, BsdfSample, BsdfSeen, Lobes, SpecularBranch};
use snell_math::{Frame, SampledSpectrum, Vec2, Vec3};
use std::borrow::Cow;

/// A BSDF with its shading frame. Its methods take and return unit directions in world space that
/// point away from the surface. If the BSDF was made for a viewer, evaluation for that direction is
/// faster.
///
/// The shading normal may differ from the geometric normal, so a direction above one may lie below
/// the other. Light that would be reflected through the surface, or transmitted without crossing
/// it, is dropped here (Veach, Robust Monte Carlo Methods for Light Transport Simulation, section
/// 5.3).
#[derive(Clone, Debug)]
pub struct ShadingBsdf<'a> {
    /// The lobes of the BSDF.
    pub bsdf: Cow<'a, Bsdf>,
    /// Local frame, whose `z` is the shading normal (with maps applied) on the outer side.
    pub frame: Frame,
    /// Unit geometric normal, on the outer side.
    pub geometric_normal: Vec3,
    /// The direction of the viewer, and the lobes' precomputed state for that direction.
    viewer: Option<(Vec3, BsdfSeen)>,
}

impl Material {
    /// The BSDF at a point, whose shading normal is not bent towards a viewer. Prefer
    /// [`Self::bsdf_towards`] where there is a viewer.
    pub fn bsdf(&self, point: &ShadingPoint) -> ShadingBsdf<'static> {
        let (bsdf, frame) = (self.kind.bsdf(point), self.frame(point));
        let geometric_normal = point.surface.geometric_normal;
        let bsdf = Cow::Owned(self.with_own_coat(&bsdf, &frame, point, None).unwrap_or(bsdf));
        ShadingBsdf { bsdf, frame, geometric_normal, viewer: None }
    }

    /// The frame of the shading normal, not bent towards a viewer.
    fn frame(&self, point: &ShadingPoint) -> Frame {
        let frame = normal::shading_frame(self.normal_map.as_ref(), self.bump_map.as_ref(), point);
        let angle = if let MaterialKind::OpenPbr(surface) = &self.kind {
            surface.tangent_angle(point)
        } else {
            0.0
        };
        normal::turned(frame, angle)
    }

    /// The normal map of a coat, and the angle by which its tangent is rotated; `None` if the coat
    /// follows the base.
    pub(super) fn coat_map(&self, point: &ShadingPoint) -> Option<(Option<NormalMap>, f32)> {
        let (map, angle) = match &self.kind {
            MaterialKind::MetallicRoughness(kind) => (kind.clearcoat_normal_map, 0.0),
            MaterialKind::OpenPbr(surface) => {
                (surface.geometry_coat_normal, surface.coat_tangent_angle(point))
            }
            _ => (None, 0.0),
        };
        (map != self.normal_map || self.bump_map.is_some() || angle != 0.0).then_some((map, angle))
    }

    /// The BSDF with a coat that has a normal of its own; `None` if the coat has none.
    fn with_own_coat(
        &self,
        bsdf: &Bsdf,
        frame: &Frame,
        point: &ShadingPoint,
        wo: Option<Vec3>,
    ) -> Option<Bsdf> {
        let Bsdf::OpenPbr(layers) = bsdf else { return None };
        if !layers.has_coat() {
            return None;
        }
        let (map, angle) = self.coat_map(point)?;
        let own = normal::turned(normal::shading_frame(map.as_ref(), None, point), angle);
        let z = wo.map_or(own.z, |wo| {
            normal::valid_towards(own.z, point.surface.geometric_normal, wo, true)
        });
        let [z, x] = [z, own.x].map(|v| frame.to_local(v));
        Some(Bsdf::OpenPbr(Box::new(layers.with_coat_frame(Frame::from_z_and_x(z, x)))))
    }

    /// The BSDF at a point seen from `wo` (a unit vector in world space). The shading normal is
    /// bent just enough to face the viewer's side, and for mirrors just enough to reflect away from
    /// the surface. Otherwise smooth meshes and normal maps would turn black at grazing angles.
    pub fn bsdf_towards(&self, point: &ShadingPoint, wo: Vec3) -> ShadingBsdf<'static> {
        self.towards(Cow::Owned(self.kind.bsdf(point)), point, wo)
    }

    /// Does what [`Self::bsdf_towards`] does, with the precomputed data of the material.
    pub fn prepared_towards<'a>(
        &self,
        prepared: &'a Prepared,
        point: &ShadingPoint,
        wo: Vec3,
    ) -> ShadingBsdf<'a> {
        self.towards(prepared.bsdf(self, point), point, wo)
    }

    /// [`ShadingBsdf::albedo`] at a point, with the precomputed data of the material.
    pub fn albedo(&self, prepared: &Prepared, point: &ShadingPoint, wo: Vec3) -> SampledSpectrum {
        let bsdf = prepared.bsdf(self, point);
        bsdf.albedo_from_anywhere().unwrap_or_else(|| self.towards(bsdf, point, wo).albedo(wo))
    }

    /// The frame at a point seen from `wo`, for a BSDF with these needs.
    pub fn frame_towards(&self, needs: FrameNeeds, point: &ShadingPoint, wo: Vec3) -> Frame {
        needs.frame(&self.frame(point), point.surface.geometric_normal, wo)
    }

    fn towards<'a>(&self, bsdf: Cow<'a, Bsdf>, point: &ShadingPoint, wo: Vec3) -> ShadingBsdf<'a> {
        let geometric_normal = point.surface.geometric_normal;
        let frame = self.frame_towards(FrameNeeds::of(&bsdf), point, wo);
        let own = self.with_own_coat(&bsdf, &frame, point, Some(wo));
        let bsdf = own.map_or(bsdf, Cow::Owned);
        ShadingBsdf::seen_from(wo, bsdf, frame, geometric_normal)
    }
}

impl<'a> ShadingBsdf<'a> {
    /// A BSDF made for a viewer in direction `wo`, in this frame, on a surface with this geometric
    /// normal.
    #[inline]
    pub fn seen_from(wo: Vec3, bsdf: Cow<'a, Bsdf>, frame: Frame, geometric_normal: Vec3) -> Self {
        let viewer = Some((wo, bsdf.seen(frame.to_local(wo))));
        Self { bsdf, frame, geometric_normal, viewer }
    }

    /// True if the shading and the geometric normal agree on whether light is transmitted from one
    /// direction to the other.
    fn agrees(&self, wo: Vec3, wi: Vec3, is_transmission: bool) -> bool {
        let sides = self.geometric_normal.dot(wo) * self.geometric_normal.dot(wi);
        if is_transmission { sides < 0.0 } else { sides > 0.0 }
    }

    /// The two directions in the local frame; `None` if light between them would leak.
    fn local(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        self.agrees(wo, wi, o.z * i.z < 0.0).then_some((o, i))
    }

    /// The lobes' precomputed state for a direction.
    fn seen(&self, wo: Vec3) -> Cow<'_, BsdfSeen> {
        match &self.viewer {
            Some((viewer, seen)) if *viewer == wo => Cow::Borrowed(seen),
            _ => Cow::Owned(self.bsdf.seen(self.frame.to_local(wo))),
        }
    }

    /// `f(wo, wi) |cos(wi)|` without delta lobes; the cosine is with the shading normal.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval_and_pdf(wo, wi).0
    }

    /// The diffuse part of [`Self::eval`].
    pub fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.local(wo, wi).map_or(SampledSpectrum::ZERO, |(o, i)| self.bsdf.diffuse(o, i))
    }

    /// Density per steradian with which [`Self::sample`] samples `wi`, without delta lobes.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    /// [`Self::eval`] and [`Self::pdf`].
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        let Some((_, i)) = self.local(wo, wi) else { return (SampledSpectrum::ZERO, 0.0) };
        self.bsdf.value_and_pdf_from(&self.seen(wo), i)
    }

    /// The factor that undoes the change of radiance by refraction; see [`Lobes::crossing_scale`].
    pub fn crossing_scale(&self, wo: Vec3) -> f32 {
        self.bsdf.crossing_scale(self.frame.to_local(wo))
    }

    /// Samples a direction; see [`Lobes::sample_from`].
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let local = self.bsdf.sample_from(&self.seen(wo), u_lobe, u)?;
        let wi = self.frame.from_local(local.wi).try_normalize()?;
        self.agrees(wo, wi, local.is_transmission).then_some(BsdfSample { wi, ..local })
    }

    /// `pi f |cos(wi)|`, or the classic formula in its place; see [`Lobes::eval_classic`].
    pub fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.local(wo, wi).map_or(SampledSpectrum::ZERO, |(o, i)| self.bsdf.eval_classic(o, i))
    }

    /// Reflectance for ambient light.
    pub fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        self.bsdf.ambient(self.frame.to_local(wo))
    }

    /// Approximate fraction of light that is reflected or transmitted towards `wo`.
    pub fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        self.bsdf.albedo_from(&self.seen(wo))
    }

    /// True if all lobes are delta lobes.
    pub fn is_delta(&self) -> bool {
        self.bsdf.is_delta()
    }

    /// True if [`Self::eval`] is 0 for directions on opposite sides of the shading normal.
    pub fn is_opaque(&self) -> bool {
        self.bsdf.is_opaque()
    }

    /// The directions of perfect reflection and refraction, at most two.
    pub fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        self.bsdf.specular_branches(self.frame.to_local(wo)).map(|branch| {
            let branch = branch?;
            let wi = self.frame.from_local(branch.wi).try_normalize()?;
            self.agrees(wo, wi, branch.is_transmission).then_some(SpecularBranch { wi, ..branch })
        })
    }
}
