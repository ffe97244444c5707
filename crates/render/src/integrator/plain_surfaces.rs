//! Meshes and shapes of one material that is the same everywhere, and the frames of vertices on them.

use super::Context;
use super::estimators::may_be_lifted;
use super::lanes::{LANES, VertexLanes, ZERO, at, put};
use super::lights::horizon;
use super::path::Scatterer;
use crate::light_sampler::Receiver;
use snell_intersect::triangles::{HitVectors, PlainMesh};
use snell_intersect::{GeometryId, TrianglePoints};
use snell_math::{ColorMode, Frame, at_level};
use snell_scene::bsdf::{Bsdf, Lobes, ManyBsdf};
use snell_scene::material::{FrameNeeds, ShadingBsdf};
use std::borrow::Cow;

/// A mesh or shape that does not shine, of one BSDF that is the same everywhere.
#[derive(Clone, Copy, Debug)]
pub struct PlainSurface<'a> {
    /// `None` for other shapes, whose points [`VertexLanes::gather_shape`] knows.
    pub mesh: Option<PlainMesh<'a>>,
    bsdf: &'a Bsdf,
    pub many: Option<&'a ManyBsdf>,
    needs: FrameNeeds,
    is_opaque: bool,
    /// It may stand for a smooth surface.
    pub is_lifted: bool,
}

impl<'a> PlainSurface<'a> {
    /// A geometry, if it is one.
    pub fn of(context: &Context<'a>, geometry: u32) -> Option<Self> {
        let scene = context.scene;
        let mesh = scene.world.plain_mesh(GeometryId(geometry));
        let id = scene.only_material(geometry).filter(|&id| !scene.material(id).is_emissive())?;
        let material = scene.material(id);
        let bsdf = scene.prepared(id).plain(material)?;
        // (What a field has learnt is asked one by one.)
        let many = scene.prepared(id).plain_many(material).filter(|_| context.field.is_none());
        let is_opaque = bsdf.is_opaque();
        let is_lifted = is_opaque && !bsdf.is_delta() && may_be_lifted(context, material);
        let needs = FrameNeeds::of(bsdf);
        (mesh.is_some() || !needs.has_tangent).then_some(Self { mesh, bsdf, many, needs, is_opaque, is_lifted })
    }

    /// As [`Receiver::transmits`].
    pub fn transmits(&self) -> bool {
        !self.is_opaque
    }

    /// What scatters in a lane that is on it.
    pub fn scatterer(&self, lanes: &VertexLanes, frames: &Frames, lane: usize) -> Scatterer<'a> {
        let (wo, frame, lift) = (at(&lanes.wo, lane), frames.at(lane), at(&lanes.lift, lane));
        let arrival = lanes.arrival(lane, ColorMode::Rgb, 0.0);
        let flat = at(&lanes.points.geometric_normal, lane);
        let shading = ShadingBsdf::seen_from(wo, Cow::Borrowed(self.bsdf), frame, horizon(flat, frame.z, lift));
        let receiver = Receiver {
            position: arrival.position,
            normal: if frame.z.dot(wo) < 0.0 { -frame.z } else { frame.z },
            transmits: self.transmits(),
        };
        Scatterer { shading, at: arrival, receiver }
    }
}

/// Frames of lanes on plain surfaces.
#[derive(Debug)]
pub struct Frames {
    /// What is known of the tangents.
    dpdu: HitVectors,
    /// As [`FrameNeeds`].
    mirrors: [bool; LANES],
    has_tangent: [bool; LANES],
    x: HitVectors,
    y: HitVectors,
    z: HitVectors,
}

impl Frames {
    /// Of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Frame {
        Frame { x: at(&self.x, lane), y: at(&self.y, lane), z: at(&self.z, lane) }
    }

    /// Puts one that is known already into a lane.
    pub fn put(&mut self, lane: usize, frame: &Frame) {
        put(&mut self.x, lane, frame.x);
        put(&mut self.y, lane, frame.y);
        put(&mut self.z, lane, frame.z);
    }

    /// Works out those of lanes on plain surfaces, once these are placed.
    pub fn turn(&mut self, lanes: &VertexLanes, on_plain: &[(usize, PlainSurface)]) {
        lanes.tangents(&mut self.dpdu);
        for &(lane, PlainSurface { needs, .. }) in on_plain {
            (self.mirrors[lane], self.has_tangent[lane]) = (needs.mirrors, needs.has_tangent);
        }
        at_level!(
            lanes.wide,
            turn,
            (points: &TrianglePoints = &lanes.points, wo: &HitVectors = &lanes.wo, frames: &mut Frames = self)
        );
    }
}

impl Default for Frames {
    fn default() -> Self {
        let no = [false; LANES];
        Self { dpdu: ZERO, mirrors: no, has_tangent: no, x: ZERO, y: ZERO, z: ZERO }
    }
}

/// Frames as they are seen.
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
