//! Layouts and numbers of Embree's C interface, version 4.

use std::ffi::{c_char, c_int, c_uint, c_void};

/// An opaque handle: `RTCDevice`, `RTCScene` or `RTCGeometry`.
pub type Handle = *mut c_void;

/// The id that stands for no geometry or no instance.
pub const INVALID_ID: u32 = u32::MAX;

pub const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
pub const GEOMETRY_TYPE_INSTANCE: c_int = 121;
pub const BUFFER_TYPE_INDEX: c_int = 0;
pub const BUFFER_TYPE_VERTEX: c_int = 1;
pub const FORMAT_UINT3: c_int = 0x5003;
pub const FORMAT_FLOAT3: c_int = 0x9003;
pub const FORMAT_FLOAT3X4_COLUMN_MAJOR: c_int = 0x9234;
pub const SCENE_FLAG_COMPACT: c_int = 1 << 1;
pub const SCENE_FLAG_ROBUST: c_int = 1 << 2;
pub const RAY_QUERY_FLAG_COHERENT: c_int = 1 << 16;
pub const FEATURE_FLAG_ALL: c_uint = u32::MAX;
pub const DEVICE_PROPERTY_VERSION_MAJOR: c_int = 1;
pub const DEVICE_PROPERTY_VERSION_MINOR: c_int = 2;
pub const DEVICE_PROPERTY_VERSION_PATCH: c_int = 3;

/// `RTCRay`, `RTCRay8` and `RTCRay16`: one array per field. Aligned more strictly than Embree
/// requires.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub struct Rays<const N: usize> {
    pub origin: [[f32; N]; 3],
    pub t_near: [f32; N],
    pub direction: [[f32; N]; 3],
    pub time: [f32; N],
    /// The end of the ray's interval. Embree sets it to the distance of the hit, or to minus
    /// infinity if the ray is occluded.
    pub t_far: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
}

/// `RTCRayHit`, `RTCRayHit8` and `RTCRayHit16`. The fields of the ray are repeated, because a
/// single ray has no padding after it.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub struct RayHits<const N: usize> {
    pub origin: [[f32; N]; 3],
    pub t_near: [f32; N],
    pub direction: [[f32; N]; 3],
    pub time: [f32; N],
    pub t_far: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
    pub normal: [[f32; N]; 3],
    pub uv: [[f32; N]; 2],
    pub primitive: [u32; N],
    pub geometry: [u32; N],
    /// The number of the instance; one level, as in default builds of Embree.
    pub instance: [u32; N],
    /// The index within an array of instances, present since version 4.3.
    pub instance_primitive: [u32; N],
}

/// `RTCIntersectArguments` and `RTCOccludedArguments`, as initialised by
/// `rtcInitIntersectArguments`.
#[repr(C)]
pub struct Arguments {
    pub flags: c_int,
    pub feature_mask: c_uint,
    pub context: *mut c_void,
    pub filter: *mut c_void,
    pub callback: *mut c_void,
    pub min_width_distance_factor: f32,
}

impl Arguments {
    pub fn new(coherent: bool) -> Self {
        Self {
            flags: if coherent { RAY_QUERY_FLAG_COHERENT } else { 0 },
            feature_mask: FEATURE_FLAG_ALL,
            context: std::ptr::null_mut(),
            filter: std::ptr::null_mut(),
            callback: std::ptr::null_mut(),
            min_width_distance_factor: 0.0,
        }
    }
}

/// The type `RTCMemoryMonitorFunction`.
pub type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

/// A function that traces one ray.
pub type TraceOne<T> = unsafe extern "C" fn(Handle, *mut T, *mut Arguments);
/// A function that traces a packet in which some lanes are valid (-1) and others not (0).
pub type TracePacket<T> = unsafe extern "C" fn(*const c_int, Handle, *mut T, *mut Arguments);

macro_rules! functions {
    ($($field:ident: $symbol:literal = $signature:ty;)*) => {
        /// The functions of the library that this crate calls.
        #[derive(Clone, Copy)]
        pub struct Functions {
            $(pub $field: $signature,)*
        }

        impl Functions {
            /// Looks up all functions. The error names the first missing one.
            ///
            /// # Safety
            /// The library must be Embree, version 4, and stay loaded as long as the functions are
            /// used.
            pub unsafe fn find(library: &libloading::Library) -> Result<Self, &'static str> {
                Ok(Self {
                    $(
                        // SAFETY: the caller promises that this is Embree 4, whose functions have
                        // these signatures.
                        $field: *unsafe { library.get::<$signature>($symbol.as_bytes()) }
                            .map_err(|_| $symbol)?,
                    )*
                })
            }
        }
    };
}

functions! {
    new_device: "rtcNewDevice" = unsafe extern "C" fn(*const c_char) -> Handle;
    release_device: "rtcReleaseDevice" = unsafe extern "C" fn(Handle);
    device_property: "rtcGetDeviceProperty" = unsafe extern "C" fn(Handle, c_int) -> isize;
    device_error: "rtcGetDeviceError" = unsafe extern "C" fn(Handle) -> c_int;
    set_memory_monitor: "rtcSetDeviceMemoryMonitorFunction" =
        unsafe extern "C" fn(Handle, MemoryMonitor, *mut c_void);
    new_scene: "rtcNewScene" = unsafe extern "C" fn(Handle) -> Handle;
    release_scene: "rtcReleaseScene" = unsafe extern "C" fn(Handle);
    set_scene_quality: "rtcSetSceneBuildQuality" = unsafe extern "C" fn(Handle, c_int);
    set_scene_flags: "rtcSetSceneFlags" = unsafe extern "C" fn(Handle, c_int);
    commit_scene: "rtcCommitScene" = unsafe extern "C" fn(Handle);
    attach: "rtcAttachGeometry" = unsafe extern "C" fn(Handle, Handle) -> c_uint;
    new_geometry: "rtcNewGeometry" = unsafe extern "C" fn(Handle, c_int) -> Handle;
    set_geometry_quality: "rtcSetGeometryBuildQuality" = unsafe extern "C" fn(Handle, c_int);
    release_geometry: "rtcReleaseGeometry" = unsafe extern "C" fn(Handle);
    commit_geometry: "rtcCommitGeometry" = unsafe extern "C" fn(Handle);
    set_new_buffer: "rtcSetNewGeometryBuffer"
        = unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void;
    set_instanced_scene: "rtcSetGeometryInstancedScene" = unsafe extern "C" fn(Handle, Handle);
    set_transform: "rtcSetGeometryTransform" =
        unsafe extern "C" fn(Handle, c_uint, c_int, *const c_void);
    intersect_1: "rtcIntersect1" = TraceOne<RayHits<1>>;
    intersect_8: "rtcIntersect8" = TracePacket<RayHits<8>>;
    intersect_16: "rtcIntersect16" = TracePacket<RayHits<16>>;
    occluded_1: "rtcOccluded1" = TraceOne<Rays<1>>;
    occluded_8: "rtcOccluded8" = TracePacket<Rays<8>>;
    occluded_16: "rtcOccluded16" = TracePacket<Rays<16>>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn fields_lie_where_the_c_interface_has_them() {
        // A single ray has 48 bytes, followed by its hit; packets have one array of N numbers per
        // field.
        assert_eq!((offset_of!(RayHits<1>, direction), offset_of!(RayHits<1>, t_far)), (16, 32));
        assert_eq!((offset_of!(RayHits<1>, normal), offset_of!(RayHits<1>, geometry)), (48, 72));
        assert_eq!(
            (offset_of!(RayHits<8>, t_far), offset_of!(RayHits<8>, normal)),
            (8 * 32, 12 * 32)
        );
        assert_eq!(
            (offset_of!(RayHits<16>, geometry), offset_of!(RayHits<16>, instance)),
            (18 * 64, 19 * 64)
        );
        assert_eq!((offset_of!(Rays<16>, t_far), offset_of!(Rays<16>, flags)), (8 * 64, 11 * 64));
        assert_eq!(
            (offset_of!(Arguments, context), offset_of!(Arguments, min_width_distance_factor)),
            (8, 32)
        );
    }
}
