//! Scenes, and the queries of their rays.

use crate::error::{Failure, SnellError, null, report};
use crate::memory::{input, output, with_room};
use snell_intersect::{
    AcceptAll, BuildOptions, Cancelled, Grouping, Hit, TriangleMesh, World, WorldBuilder,
};
use snell_math::{Ray, Vec3};
use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::sync::Arc;

/// The id that means "nothing": of a miss, and of a geometry that could not be attached.
pub const SNELL_INVALID_GEOMETRY_ID: u32 = 0xffff_ffff;

/// Number of rays that are answered at a time, by all threads. Their copies take 15 MB.
const RAYS_AT_ONCE: usize = 1 << 18;

/// A scene: geometries, and the structure for its rays once it is committed.
#[derive(Default)]
pub struct SnellScene {
    meshes: Vec<Arc<TriangleMesh>>,
    world: Option<World>,
}

/// A ray. 32 bytes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SnellRay {
    /// The origin.
    pub org_x: f32,
    pub org_y: f32,
    pub org_z: f32,
    /// Hits at this distance and before are ignored; usually 0.
    pub tnear: f32,
    /// The direction, of any length but zero. Distances are in units of it.
    pub dir_x: f32,
    pub dir_y: f32,
    pub dir_z: f32,
    /// Hits at this distance and beyond are ignored; usually INFINITY.
    pub tfar: f32,
}

/// The nearest hit of a ray. 20 bytes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct SnellHit {
    /// The distance, in units of the ray's direction; infinite for a miss.
    pub t: f32,
    /// Weights of the second and the third vertex; that of the first is 1 - u - v.
    pub u: f32,
    pub v: f32,
    /// The geometry; SNELL_INVALID_GEOMETRY_ID for a miss.
    pub geom_id: u32,
    /// The triangle in the geometry; SNELL_INVALID_GEOMETRY_ID for a miss.
    pub prim_id: u32,
}

// C programs may be compiled against an older header.
const _: () = assert!(size_of::<SnellRay>() == 32 && size_of::<SnellHit>() == 20);

impl From<&SnellRay> for Ray {
    fn from(ray: &SnellRay) -> Self {
        Self {
            origin: Vec3::new(ray.org_x, ray.org_y, ray.org_z),
            t_min: ray.tnear,
            direction: Vec3::new(ray.dir_x, ray.dir_y, ray.dir_z),
            t_max: ray.tfar,
        }
    }
}

impl From<Hit> for SnellHit {
    fn from(hit: Hit) -> Self {
        let (geom_id, prim_id) = (hit.geometry, hit.primitive);
        Self { t: hit.t, u: hit.uv.x, v: hit.uv.y, geom_id, prim_id }
    }
}

/// Returns the version of the library, such as "0.1.0". The text is never released.
#[unsafe(export_name = "snellGetVersion")]
pub extern "C" fn version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Makes an empty scene, to be released by snellReleaseScene.
#[unsafe(export_name = "snellNewScene")]
pub extern "C" fn new_scene() -> *mut SnellScene {
    Box::into_raw(Box::default())
}

/// Releases a scene; null is allowed.
///
/// # Safety
/// The scene is from snellNewScene, was not released, and is not in use.
#[unsafe(export_name = "snellReleaseScene")]
pub unsafe extern "C" fn release_scene(scene: *mut SnellScene) {
    let release = || {
        if !scene.is_null() {
            // SAFETY: the caller promises that this is a live scene that nobody uses.
            drop(unsafe { Box::from_raw(scene) });
        }
        Ok(())
    };
    report(release);
}

/// Attaches a mesh: three floats for each vertex, and three vertex numbers for each triangle. Both
/// arrays are copied. Returns the number of the geometry, counted from 0, or
/// SNELL_INVALID_GEOMETRY_ID after an error. Triangles with a vertex that is not finite are never
/// hit. The scene must be committed again before its next query.
///
/// # Safety
/// Pointers are null or valid for the sizes given, and no other thread uses the scene.
#[unsafe(export_name = "snellAttachTriangleGeometry")]
pub unsafe extern "C" fn attach_triangle_geometry(
    scene: *mut SnellScene,
    vertices: *const f32,
    vertex_count: usize,
    indices: *const u32,
    triangle_count: usize,
) -> u32 {
    let mut id = SNELL_INVALID_GEOMETRY_ID;
    report(|| {
        // SAFETY: the caller promises what these ask for; `[f32; 3]` is aligned as `float` is.
        let (scene, vertices, indices) = unsafe {
            (
                scene.as_mut().ok_or_else(|| null("scene"))?,
                input(vertices.cast::<[f32; 3]>(), vertex_count, "vertices")?,
                input(indices.cast::<[u32; 3]>(), triangle_count, "indices")?,
            )
        };
        let mut mesh = TriangleMesh {
            positions: with_room(vertices.len())?,
            indices: with_room(indices.len())?,
            ..TriangleMesh::default()
        };
        mesh.positions.extend(vertices.iter().map(|&vertex| Vec3::from(vertex)));
        mesh.indices.extend_from_slice(indices);
        mesh.validate().map_err(|error| Failure(SnellError::InvalidArgument, error.to_string()))?;
        let next = u32::try_from(scene.meshes.len()).ok().filter(|&n| n != u32::MAX);
        let next = next.ok_or(Failure(SnellError::Limit, "too many geometries".into()))?;
        scene.meshes.push(Arc::new(mesh));
        scene.world = None;
        id = next;
        Ok(())
    });
    id
}

/// Builds the structure for the rays of a scene, on all cores.
///
/// # Safety
/// The scene is null or from snellNewScene, and no other thread uses it.
#[unsafe(export_name = "snellCommitScene")]
pub unsafe extern "C" fn commit_scene(scene: *mut SnellScene) -> SnellError {
    report(|| {
        // SAFETY: the caller promises that this is a live scene that nobody else uses.
        let scene = unsafe { scene.as_mut() }.ok_or_else(|| null("scene"))?;
        let mut builder = WorldBuilder::default();
        for mesh in &scene.meshes {
            builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
        }
        let world = builder.build(&BuildOptions::default());
        scene.world = Some(world.map_err(|error| Failure(SnellError::Limit, error.to_string()))?);
        Ok(())
    })
}

/// Finds the nearest hit of each ray, on all cores. Hits are the same bits for any number of
/// threads and on any machine; of hits at one distance that of the lowest geometry and triangle
/// counts. Invalid rays (not finite, no direction, an empty interval) miss.
///
/// # Safety
/// Pointers are null or valid for the count given. Many threads may ask one scene.
#[unsafe(export_name = "snellIntersect")]
pub unsafe extern "C" fn intersect(
    scene: *const SnellScene,
    rays: *const SnellRay,
    hits: *mut SnellHit,
    count: usize,
) -> SnellError {
    report(|| {
        // SAFETY: the caller promises what these ask for.
        let (scene, rays, hits) =
            unsafe { (scene.as_ref(), input(rays, count, "rays")?, output(hits, count, "hits")?) };
        let find = |world: &World, rays: &[Ray], found: &mut [Hit]| {
            world.parallel().closest(rays, Grouping::None, &AcceptAll, found)
        };
        answer(scene, rays, hits, Hit::MISS, find)
    })
}

/// Finds whether anything is in the interval of each ray: 1 if so, 0 if not. It is faster than
/// snellIntersect.
///
/// # Safety
/// Pointers are null or valid for the count given. Many threads may ask one scene.
#[unsafe(export_name = "snellOccluded")]
pub unsafe extern "C" fn occluded(
    scene: *const SnellScene,
    rays: *const SnellRay,
    occluded: *mut u8,
    count: usize,
) -> SnellError {
    report(|| {
        // SAFETY: the caller promises what these ask for.
        let (scene, rays, occluded) = unsafe {
            (scene.as_ref(), input(rays, count, "rays")?, output(occluded, count, "occluded")?)
        };
        let find = |world: &World, rays: &[Ray], found: &mut [bool]| {
            world.parallel().occluded(rays, Grouping::None, &AcceptAll, found)
        };
        answer(scene, rays, occluded, false, find)
    })
}

/// Answers rays piece by piece, so that their copies stay small.
fn answer<A: Copy, B: From<A>>(
    scene: Option<&SnellScene>,
    rays: &[SnellRay],
    answers: &mut [MaybeUninit<B>],
    empty: A,
    find: impl Fn(&World, &[Ray], &mut [A]) -> Result<(), Cancelled>,
) -> Result<(), Failure> {
    let world = scene.ok_or_else(|| null("scene"))?.world.as_ref().ok_or_else(|| {
        let message = "the scene has changes that are not committed; call snellCommitScene";
        Failure(SnellError::NotCommitted, message.into())
    })?;
    let room = rays.len().min(RAYS_AT_ONCE);
    let (mut asked, mut found) = (with_room(room)?, with_room(room)?);
    for (rays, answers) in rays.chunks(RAYS_AT_ONCE).zip(answers.chunks_mut(RAYS_AT_ONCE)) {
        asked.clear();
        asked.extend(rays.iter().map(Ray::from));
        found.clear();
        found.resize(rays.len(), empty);
        // Nothing cancels this query.
        let _ = find(world, &asked, &mut found);
        for (answer, &found) in answers.iter_mut().zip(&found) {
            answer.write(B::from(found));
        }
    }
    Ok(())
}
