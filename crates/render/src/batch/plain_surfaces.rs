//! Meshes and shapes of one uniform material, and the shading frames of vertices on them.

use super::lights::horizon;
use super::vertices::VertexLanes;
use crate::integrator::Context;
use crate::integrator::estimators::may_be_lifted;
use crate::integrator::path::Scatterer;
use crate::lanes::{LANES, ZERO, at, put};
use crate::light_sampler::Receiver;
use snell_intersect::triangles::{HitLanes, HitVectors, PlainMesh};
use snell_intersect::{GeometryId, TrianglePoints};
use snell_math::simd::mask_select_vector;
use snell_math::{ColorMode, Frame, SampledSpectrum, Vec3, at_level};
use snell_scene::Material;
use snell_scene::bsdf::{BatchBsdf, BatchPoint, Bsdf, Lobes};
use snell_scene::material::{Bend, FrameNeeds, Prepared, ShadingBsdf};
use std::borrow::Cow;

/// A mesh or shape without emission, with one material whose BSDF is uniform.
#[derive(Clone, Copy, Debug)]
pub struct PlainSurface<'a> {
    /// The mesh; `None` for a shape, whose points [`VertexLanes::gather_shape`] computes.
    pub mesh: Option<PlainMesh<'a>>,
    bsdf: &'a Bsdf,
    material: &'a Material,
    prepared: &'a Prepared,
    pub batch: Option<&'a BatchBsdf>,
    pub needs: FrameNeeds,
    is_opaque: bool,
    /// True if points on the surface may be lifted ([`crate::integrator::estimators::Skin::lift`]).
    pub is_lifted: bool,
}

impl<'a> PlainSurface<'a> {
    /// The geometry with this number, if it is a plain surface.
    pub fn of(context: &Context<'a>, geometry: u32) -> Option<Self> {
        let scene = context.scene;
        let mesh = scene.world.plain_mesh(GeometryId(geometry));
        let id = scene.only_material(geometry).filter(|&id| !scene.material(id).is_emissive())?;
        let material = scene.material(id);
        let prepared = scene.prepared(id);
        let bsdf = prepared.plain(material)?;
        // With a guiding field, lanes are evaluated one by one.
        let batch = prepared.plain_batch(material).filter(|_| context.field.is_none());
        let is_opaque = bsdf.is_opaque();
        let is_lifted = is_opaque && !bsdf.is_delta() && may_be_lifted(context, material);
        let needs = FrameNeeds::of(bsdf);
        let surface = Self { mesh, bsdf, material, prepared, batch, needs, is_opaque, is_lifted };
        (mesh.is_some() || !needs.has_tangent).then_some(surface)
    }

    /// True if the surface transmits light; see [`Receiver::transmits`].
    pub fn transmits(&self) -> bool {
        !self.is_opaque
    }

    /// The surface's BSDF for batches with the BSDF's values in this mode; `None` if the BSDF
    /// cannot be evaluated in batches.
    pub fn batch_in(&self, mode: ColorMode) -> Option<(&'a BatchBsdf, BatchPoint)> {
        self.batch.and_then(|_| self.prepared.plain_batch_in(self.material, mode))
    }

    /// The surface's BSDF in this mode.
    fn bsdf_in(&self, mode: ColorMode) -> Cow<'a, Bsdf> {
        match mode {
            ColorMode::Rgb => Cow::Borrowed(self.bsdf),
            mode => self.prepared.plain_in(self.material, mode),
        }
    }

    /// The albedo ([`Material::albedo`]) at a point with this geometric normal (`flat`) and shading
    /// normal (`smooth`), for materials that do not depend on tangents.
    pub fn albedo(&self, mode: ColorMode, [flat, smooth]: [Vec3; 2], wo: Vec3) -> SampledSpectrum {
        let bsdf = self.bsdf_in(mode);
        bsdf.albedo_from_anywhere().unwrap_or_else(|| {
            let frame = self.needs.frame(&Frame::from_z(smooth), flat, wo);
            ShadingBsdf::seen_from(wo, bsdf, frame, flat).albedo(wo)
        })
    }

    /// The BSDF at the vertex of a lane, with the vertex as receiver of light.
    pub fn scatterer(&self, lanes: &VertexLanes, frames: &Frames, lane: usize) -> Scatterer<'a> {
        let (wo, frame, lift) = (at(&lanes.wo, lane), frames.at(lane), at(&lanes.lift, lane));
        let arrival = lanes.arrival(lane);
        let flat = at(&lanes.points.geometric_normal, lane);
        let bsdf = self.bsdf_in(lanes.modes[lane]);
        let shading = ShadingBsdf::seen_from(wo, bsdf, frame, horizon(flat, frame.z, lift));
        let receiver = Receiver {
            position: arrival.position,
            normal: if frame.z.dot(wo) < 0.0 { -frame.z } else { frame.z },
            transmits: self.transmits(),
        };
        Scatterer { shading, at: arrival, receiver }
    }
}

/// Shading frames of vertices on plain surfaces, by lane.
#[derive(Debug)]
pub struct Frames {
    /// The tangents along u, where the mesh has texture coordinates.
    dpdu: HitVectors,
    /// The fields of [`FrameNeeds`].
    mirrors: [bool; LANES],
    has_tangent: [bool; LANES],
    x: HitVectors,
    y: HitVectors,
    z: HitVectors,
}

impl Frames {
    /// The frame of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Frame {
        Frame { x: at(&self.x, lane), y: at(&self.y, lane), z: at(&self.z, lane) }
    }

    /// Stores a frame that was computed elsewhere.
    pub fn put(&mut self, lane: usize, frame: &Frame) {
        put(&mut self.x, lane, frame.x);
        put(&mut self.y, lane, frame.y);
        put(&mut self.z, lane, frame.z);
    }

    /// Records the frame that the BSDF of a lane needs.
    pub fn expect(&mut self, lane: usize, needs: FrameNeeds) {
        (self.mirrors[lane], self.has_tangent[lane]) = (needs.mirrors, needs.has_tangent);
    }

    /// Computes the frames of all lanes from points that were computed before. Tangents are defined
    /// on triangles of plain meshes only.
    pub fn turn(&mut self, lanes: &VertexLanes) {
        lanes.tangents(&mut self.dpdu);
        at_level!(
            lanes.wide,
            turn,
            (
                points: &TrianglePoints = &lanes.points,
                wo: &HitVectors = &lanes.wo,
                frames: &mut Frames = self
            )
        );
    }
}

impl Default for Frames {
    fn default() -> Self {
        let no = [false; LANES];
        Self { dpdu: ZERO, mirrors: no, has_tangent: no, x: ZERO, y: ZERO, z: ZERO }
    }
}

/// The values of normal maps, by lane.
#[derive(Debug)]
pub struct Bends {
    is_any: bool,
    /// 1 for lanes with a normal map, 0 for others.
    has: [u32; LANES],
    /// The columns of [`Bend`].
    local: HitVectors,
    tangent: HitVectors,
    upwards: HitVectors,
    side: HitLanes,
}

impl Default for Bends {
    fn default() -> Self {
        let (local, tangent, upwards) = (ZERO, ZERO, ZERO);
        Self { is_any: false, has: [0; LANES], local, tangent, upwards, side: [0.0; LANES] }
    }
}

impl Bends {
    /// Removes all lanes.
    pub fn clear(&mut self) {
        if self.is_any {
            (self.is_any, self.has) = (false, [0; LANES]);
        }
    }

    /// Stores the value of a lane's normal map, if there is one.
    pub fn put(&mut self, lane: usize, bend: Option<Bend>) {
        let Some(Bend { local, tangent, upwards, side }) = bend else { return };
        put(&mut self.local, lane, local);
        put(&mut self.tangent, lane, tangent);
        put(&mut self.upwards, lane, upwards);
        (self.is_any, self.has[lane], self.side[lane]) = (true, 1, side);
    }

    /// Applies normal maps to the shading normals of lanes whose points were computed.
    pub fn bend(&self, lanes: &mut VertexLanes) {
        if self.is_any {
            at_level!(
                lanes.wide,
                bend,
                (bends: &Bends = self, points: &mut TrianglePoints = &mut lanes.points)
            );
        }
    }
}

/// Applies normal maps to shading normals.
#[inline(always)]
fn bend(bends: &Bends, points: &mut TrianglePoints) {
    for i in 0..LANES {
        let [local, tangent, upwards] =
            [at(&bends.local, i), at(&bends.tangent, i), at(&bends.upwards, i)];
        let bend = Bend { local, tangent, upwards, side: bends.side[i] };
        let (smooth, flat) = (at(&points.shading_normal, i), at(&points.geometric_normal, i));
        put(
            &mut points.shading_normal,
            i,
            mask_select_vector(bends.has[i], bend.normal(smooth, flat), smooth),
        );
    }
}

/// Computes shading frames for the direction from which each surface is seen.
#[inline(always)]
fn turn(points: &TrianglePoints, wo: &HitVectors, frames: &mut Frames) {
    for i in 0..LANES {
        let (n, flat) = (at(&points.shading_normal, i), at(&points.geometric_normal, i));
        let plain = Frame::from_z_and_x(n, at(&frames.dpdu, i));
        let needs = FrameNeeds { mirrors: frames.mirrors[i], has_tangent: frames.has_tangent[i] };
        let frame = needs.frame(&plain, flat, at(wo, i));
        for axis in 0..3 {
            frames.x[axis][i] = frame.x[axis];
            frames.y[axis][i] = frame.y[axis];
            frames.z[axis][i] = frame.z[axis];
        }
    }
}
