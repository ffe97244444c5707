//! Tracing a batch in one of Embree's ways: one ray, 8 or 16 rays a call, announced as coherent or
//! not.

use crate::abi::{Arguments, INVALID_ID, RayHits, Rays};
use crate::floats::with_flushed_denormals;
use crate::scene::PeerScene;
use snell_intersect::Hit;
use snell_math::{Ray, Vec2};

/// How many rays go into one call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// `rtcIntersect1`, `rtcOccluded1`.
    One,
    /// `rtcIntersect8`, `rtcOccluded8`.
    Eight,
    /// `rtcIntersect16`, `rtcOccluded16`.
    Sixteen,
}

/// A way to call Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// How many rays a call.
    pub width: Width,
    /// With the flag that promises coherent rays; it only matters to packets.
    pub coherent: bool,
}

impl Mode {
    /// One ray a call.
    pub const ONE: Self = Self { width: Width::One, coherent: false };

    /// All that differ.
    pub const ALL: [Self; 5] = [
        Self::ONE,
        Self { width: Width::Eight, coherent: false },
        Self { width: Width::Eight, coherent: true },
        Self { width: Width::Sixteen, coherent: false },
        Self { width: Width::Sixteen, coherent: true },
    ];

    /// Such as `16 coherent`.
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

/// Which lanes of a packet hold rays (-1) and which do not (0), aligned as the widest packet asks.
#[repr(align(64))]
struct Valid<const N: usize>([i32; N]);

impl<const N: usize> Valid<N> {
    fn first(count: usize) -> Self {
        Self(std::array::from_fn(|lane| if lane < count { -1 } else { 0 }))
    }
}

impl PeerScene {
    /// The nearest hit of each ray. Ids are Embree's own.
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
                // SAFETY: as above; the lanes that are valid hold rays.
                unsafe {
                    (functions.intersect_8)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
            Width::Sixteen => closest::<16>(rays, hits, |count, packet| {
                let valid = Valid::<16>::first(count);
                // SAFETY: as above; the lanes that are valid hold rays.
                unsafe {
                    (functions.intersect_16)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
        });
    }

    /// For each ray, whether anything is in its way.
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
                // SAFETY: as above; the lanes that are valid hold rays.
                unsafe {
                    (functions.occluded_8)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
            Width::Sixteen => occluded::<16>(rays, blocked, |count, packet| {
                let valid = Valid::<16>::first(count);
                // SAFETY: as above; the lanes that are valid hold rays.
                unsafe {
                    (functions.occluded_16)(valid.0.as_ptr(), self.handle, packet, &mut arguments)
                };
            }),
        });
    }
}

/// Packs rays `N` at a time, calls `trace` with how many there are, and unpacks what it found.
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

/// As [`closest`], for any hit.
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
