//! Traces a batch in one of Embree's modes: 1, 8 or 16 rays per call, flagged as coherent or not.

use crate::abi::{Arguments, INVALID_ID, RayHits, Rays};
use crate::floats::with_flushed_denormals;
use crate::scene::PeerScene;
use snell_intersect::Hit;
use snell_math::{Ray, Vec2};

/// The number of rays per call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// `rtcIntersect1`, `rtcOccluded1`.
    One,
    /// `rtcIntersect8`, `rtcOccluded8`.
    Eight,
    /// `rtcIntersect16`, `rtcOccluded16`.
    Sixteen,
}

/// A mode of calling Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// Rays per call.
    pub width: Width,
    /// Sets the flag for coherent rays, which only affects packets.
    pub coherent: bool,
}

impl Mode {
    /// One ray per call.
    pub const ONE: Self = Self { width: Width::One, coherent: false };

    /// All distinct modes.
    pub const ALL: [Self; 5] = [
        Self::ONE,
        Self { width: Width::Eight, coherent: false },
        Self { width: Width::Eight, coherent: true },
        Self { width: Width::Sixteen, coherent: false },
        Self { width: Width::Sixteen, coherent: true },
    ];

    /// A name such as `16 coherent`.
    pub fn name(self) -> &'static str {
        match (self.width, self.coherent) {
            (Width::One, _) => "1",
            (Width::Eight, false) => "8 incoherent",
            (Width::Eight, true) => "8 coherent",
            (Width::Sixteen, false) => "16 incoherent",
            (Width::Sixteen, true) => "16 coherent",
        }
    }
}

/// The valid mask of a packet: -1 for lanes with rays, 0 for others, aligned as the widest packet
/// requires.
#[repr(align(64))]
struct Valid<const N: usize>([i32; N]);

impl<const N: usize> Valid<N> {
    fn first(count: usize) -> Self {
        Self(std::array::from_fn(|lane| if lane < count { -1 } else { 0 }))
    }
}

impl PeerScene {
    /// Finds the closest hit of each ray. Ids are Embree's own.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        let functions = &self.device.embree.functions;
        let mut arguments = Arguments::new(mode.coherent);
        with_flushed_denormals(|| match mode.width {
            Width::One => closest::<1>(rays, hits, |_, packet| {
                // SAFETY: the scene is alive and built, and the structures have Embree's layout.
                unsafe { (functions.intersect_1)(self.handle, packet, &mut arguments) };
            }),
            Width::Eight => closest::<8>(rays, hits, |count, packet| {
                let valid = Valid::<8>::first(count);
                // SAFETY: the scene is alive and built, the structures have Embree's layout, and
                // valid lanes hold rays.
                unsafe {
                    (functions.intersect_8)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
            Width::Sixteen => closest::<16>(rays, hits, |count, packet| {
                let valid = Valid::<16>::first(count);
                // SAFETY: the scene is alive and built, the structures have Embree's layout, and
                // valid lanes hold rays.
                unsafe {
                    (functions.intersect_16)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
        });
    }

    /// Tests each ray for occlusion.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded(&self, mode: Mode, rays: &[Ray], blocked: &mut [bool]) {
        let functions = &self.device.embree.functions;
        let mut arguments = Arguments::new(mode.coherent);
        with_flushed_denormals(|| match mode.width {
            Width::One => occluded::<1>(rays, blocked, |_, packet| {
                // SAFETY: the scene is alive and built, and the structures have Embree's layout.
                unsafe { (functions.occluded_1)(self.handle, packet, &mut arguments) };
            }),
            Width::Eight => occluded::<8>(rays, blocked, |count, packet| {
                let valid = Valid::<8>::first(count);
                // SAFETY: the scene is alive and built, the structures have Embree's layout, and
                // valid lanes hold rays.
                unsafe {
                    (functions.occluded_8)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
            Width::Sixteen => occluded::<16>(rays, blocked, |count, packet| {
                let valid = Valid::<16>::first(count);
                // SAFETY: the scene is alive and built, the structures have Embree's layout, and
                // valid lanes hold rays.
                unsafe {
                    (functions.occluded_16)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
        });
    }
}

/// Packs rays `N` at a time, calls `trace` with the number of valid ones, and unpacks the hits.
#[inline(always)]
fn closest<const N: usize>(
    rays: &[Ray],
    hits: &mut [Hit],
    mut trace: impl FnMut(usize, &mut RayHits<N>),
) {
    assert_eq!(rays.len(), hits.len(), "one hit per ray");
    let mut packet = RayHits::<N> {
        origin: [[0.0; N]; 3],
        t_near: [0.0; N],
        direction: [[0.0; N]; 3],
        time: [0.0; N],
        t_far: [0.0; N],
        mask: [u32::MAX; N],
        id: [0; N],
        flags: [0; N],
        normal: [[0.0; N]; 3],
        uv: [[0.0; N]; 2],
        primitive: [INVALID_ID; N],
        geometry: [INVALID_ID; N],
        instance: [INVALID_ID; N],
        instance_primitive: [INVALID_ID; N],
    };
    for (rays, hits) in rays.chunks(N).zip(hits.chunks_mut(N)) {
        for (lane, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                packet.origin[axis][lane] = ray.origin[axis];
                packet.direction[axis][lane] = ray.direction[axis];
            }
            packet.t_near[lane] = ray.t_min;
            packet.t_far[lane] = ray.t_max;
        }
        packet.geometry = [INVALID_ID; N];
        trace(rays.len(), &mut packet);
        for (lane, hit) in hits.iter_mut().enumerate() {
            *hit = if packet.geometry[lane] == INVALID_ID {
                Hit::MISS
            } else {
                Hit {
                    t: packet.t_far[lane],
                    uv: Vec2::new(packet.uv[0][lane], packet.uv[1][lane]),
                    instance: packet.instance[lane],
                    geometry: packet.geometry[lane],
                    primitive: packet.primitive[lane],
                }
            };
        }
    }
}

/// Packs rays `N` at a time, calls `trace` with the number of valid ones, and unpacks the
/// occlusion.
#[inline(always)]
fn occluded<const N: usize>(
    rays: &[Ray],
    blocked: &mut [bool],
    mut trace: impl FnMut(usize, &mut Rays<N>),
) {
    assert_eq!(rays.len(), blocked.len(), "one answer per ray");
    let mut packet = Rays::<N> {
        origin: [[0.0; N]; 3],
        t_near: [0.0; N],
        direction: [[0.0; N]; 3],
        time: [0.0; N],
        t_far: [0.0; N],
        mask: [u32::MAX; N],
        id: [0; N],
        flags: [0; N],
    };
    for (rays, blocked) in rays.chunks(N).zip(blocked.chunks_mut(N)) {
        for (lane, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                packet.origin[axis][lane] = ray.origin[axis];
                packet.direction[axis][lane] = ray.direction[axis];
            }
            packet.t_near[lane] = ray.t_min;
            packet.t_far[lane] = ray.t_max;
        }
        trace(rays.len(), &mut packet);
        for (lane, blocked) in blocked.iter_mut().enumerate() {
            *blocked = packet.t_far[lane] == f32::NEG_INFINITY;
        }
    }
}
