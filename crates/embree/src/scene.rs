//! Converts a world for Embree: meshes as triangles, occurrences of groups as instances.

use crate::abi::{self, Handle};
use crate::device::Device;
use snell_intersect::{Geometry, GeometryId, GroupId, TriangleMesh, World};
use snell_math::Transform;
use std::sync::Arc;
use std::time::Instant;

/// Errors of converting a world.
#[derive(Debug, thiserror::Error)]
pub enum PeerError {
    /// The world has geometry other than triangles.
    #[error(
        "the scene has geometry other than triangles, which Embree is not given; use a scene of \
            meshes"
    )]
    Shapes,
    /// Embree reported the error with this number.
    #[error("Embree could not build the scene (error {0})")]
    Build(i32),
}

/// Embree's build quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuildQuality {
    /// Built in Morton order (`RTC_BUILD_QUALITY_LOW`).
    Low,
    /// Built by the surface area heuristic (`RTC_BUILD_QUALITY_MEDIUM`).
    Medium,
    /// Built with spatial splits (`RTC_BUILD_QUALITY_HIGH`).
    High,
}

impl BuildQuality {
    /// All qualities, from the lowest.
    pub const ALL: [Self; 3] = [Self::Low, Self::Medium, Self::High];

    /// Embree's name for the quality.
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }
}

/// Options for building a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneOptions {
    /// The build quality.
    pub quality: BuildQuality,
    /// Whether edges are watertight and boxes conservative (`RTC_SCENE_FLAG_ROBUST`).
    pub robust: bool,
    /// Whether the scene takes less memory, with slower rays (`RTC_SCENE_FLAG_COMPACT`).
    pub compact: bool,
}

/// A scene that Embree has built.
#[derive(Debug)]
pub struct PeerScene {
    pub(crate) device: Arc<Device>,
    pub(crate) handle: Handle,
    /// The scenes of groups, which instances refer to as well.
    children: Vec<Handle>,
    options: SceneOptions,
    build_seconds: f64,
    memory_bytes: i64,
}

// SAFETY: a committed scene is never changed, and Embree's API reference says that ray queries are
// thread-safe.
unsafe impl Send for PeerScene {}
// SAFETY: a committed scene is never changed, and ray queries are thread-safe.
unsafe impl Sync for PeerScene {}

impl PeerScene {
    /// Builds a scene of the triangles of a world. A group that occurs below the root becomes a
    /// scene, and each of its occurrences one instance in the top scene, because Embree is built
    /// with one level of instances.
    pub fn build(
        device: &Arc<Device>,
        world: &World,
        options: SceneOptions,
    ) -> Result<Self, PeerError> {
        if !(0..world.geometry_count() as u32)
            .all(|i| matches!(world.geometry(GeometryId(i)), Geometry::Mesh(_)))
        {
            return Err(PeerError::Shapes);
        }
        device.take_error();
        let new_scene = || {
            let functions = &device.embree.functions;
            // SAFETY: the device is alive; the handle is new.
            unsafe {
                let handle = (functions.new_scene)(device.handle);
                (functions.set_scene_quality)(handle, options.quality as i32);
                let flag = |on: bool, bit: i32| if on { bit } else { 0 };
                let flags = flag(options.robust, abi::SCENE_FLAG_ROBUST)
                    | flag(options.compact, abi::SCENE_FLAG_COMPACT);
                (functions.set_scene_flags)(handle, flags);
                handle
            }
        };
        let mut scene = Self {
            device: device.clone(),
            handle: new_scene(),
            children: Vec::new(),
            options,
            build_seconds: 0.0,
            memory_bytes: 0,
        };
        let mut of_group = vec![None; world.group_count()];
        for (group, world_from_group) in occurrences(world) {
            if group == ROOT {
                scene.add_meshes(scene.handle, world, group);
                continue;
            }
            let child = *of_group[group.0 as usize].get_or_insert_with(|| {
                let child = new_scene();
                scene.children.push(child);
                scene.add_meshes(child, world, group);
                scene.commit(child);
                child
            });
            scene.add_instance(child, &world_from_group);
        }
        scene.commit(scene.handle);
        match device.take_error() {
            0 => Ok(scene),
            error => Err(PeerError::Build(error)),
        }
    }

    /// The options with which the scene was built.
    pub fn options(&self) -> SceneOptions {
        self.options
    }

    /// Seconds that Embree took to build the acceleration structures, without copying the meshes.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Memory of the acceleration structures in bytes, without the meshes.
    pub fn memory_bytes(&self) -> i64 {
        self.memory_bytes
    }

    /// Adds the meshes of a group to a scene.
    fn add_meshes(&self, scene: Handle, world: &World, group: GroupId) {
        for &id in &world.group(group).geometries {
            if let Geometry::Mesh(mesh) = world.geometry(id) {
                self.add_mesh(scene, mesh);
            }
        }
    }

    fn add_mesh(&self, scene: Handle, mesh: &TriangleMesh) {
        let functions = &self.device.embree.functions;
        // SAFETY: device and scene are alive. Embree allocates the buffers for as many elements as
        // are copied into them; both sides have three packed 32-bit numbers per element.
        unsafe {
            let geometry =
                (functions.new_geometry)(self.device.handle, abi::GEOMETRY_TYPE_TRIANGLE);
            // The low quality of a scene affects only its top level, so geometries get it too.
            (functions.set_geometry_quality)(geometry, self.options.quality as i32);
            let buffer = |kind, format, count| {
                (functions.set_new_buffer)(geometry, kind, 0, format, 12, count)
            };
            let vertices =
                buffer(abi::BUFFER_TYPE_VERTEX, abi::FORMAT_FLOAT3, mesh.positions.len());
            let indices = buffer(abi::BUFFER_TYPE_INDEX, abi::FORMAT_UINT3, mesh.indices.len());
            if !vertices.is_null() && !indices.is_null() {
                std::ptr::copy_nonoverlapping(
                    mesh.positions.as_ptr(),
                    vertices.cast(),
                    mesh.positions.len(),
                );
                std::ptr::copy_nonoverlapping(
                    mesh.indices.as_ptr(),
                    indices.cast(),
                    mesh.indices.len(),
                );
                (functions.commit_geometry)(geometry);
                (functions.attach)(scene, geometry);
            }
            (functions.release_geometry)(geometry);
        }
    }

    fn add_instance(&self, child: Handle, world_from_child: &Transform) {
        let matrix = world_from_child.matrix();
        let columns = [
            matrix.matrix3.x_axis,
            matrix.matrix3.y_axis,
            matrix.matrix3.z_axis,
            matrix.translation,
        ];
        let columns = columns.map(|c| c.as_vec3().to_array());
        let functions = &self.device.embree.functions;
        // SAFETY: device and scenes are alive; the matrix has twelve floats, column by column, and
        // is copied.
        unsafe {
            let geometry =
                (functions.new_geometry)(self.device.handle, abi::GEOMETRY_TYPE_INSTANCE);
            (functions.set_instanced_scene)(geometry, child);
            (functions.set_transform)(
                geometry,
                0,
                abi::FORMAT_FLOAT3X4_COLUMN_MAJOR,
                columns.as_ptr().cast(),
            );
            (functions.commit_geometry)(geometry);
            (functions.attach)(self.handle, geometry);
            (functions.release_geometry)(geometry);
        }
    }

    /// Builds a scene, and records the time and memory.
    fn commit(&mut self, scene: Handle) {
        let before = self.device.memory_bytes();
        let start = Instant::now();
        // SAFETY: the scene is alive and not yet used elsewhere.
        unsafe { (self.device.embree.functions.commit_scene)(scene) };
        self.build_seconds += start.elapsed().as_secs_f64();
        self.memory_bytes += self.device.memory_bytes() - before;
    }
}

impl Drop for PeerScene {
    fn drop(&mut self) {
        for handle in self.children.drain(..).chain([self.handle]) {
            // SAFETY: made by this library and released once by us; instances hold their own
            // references.
            unsafe { (self.device.embree.functions.release_scene)(handle) };
        }
    }
}

/// The root group of the world.
const ROOT: GroupId = snell_intersect::WorldBuilder::ROOT;

/// Every occurrence of a group with geometries, and its transform to the world.
fn occurrences(world: &World) -> Vec<(GroupId, Transform)> {
    let mut found = Vec::new();
    let mut stack = vec![(ROOT, Transform::IDENTITY)];
    while let Some((group, world_from_group)) = stack.pop() {
        let contents = world.group(group);
        if !contents.geometries.is_empty() {
            found.push((group, world_from_group));
        }
        for instance in contents.instances.iter().rev() {
            stack.push((instance.child, world_from_group.compose(&instance.group_from_child)));
        }
    }
    found
}
