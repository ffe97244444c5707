//! Lists of ways to build and query a world, for the command line.

use crate::failure::{Failure, choice};
use snell_intersect::AcceleratorKind;
use snell_intersect::{BuildOptions, Geometry, GroupId, Quality, World, WorldBuilder, WorldError};
use snell_math::simd::Level;

/// Options that choose how worlds are built.
#[derive(Debug, clap::Args)]
#[group(skip)]
pub struct Options {
    /// Acceleration structures
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "bvh")]
    accelerator: Vec<String>,
    /// Build quality of `bvh`: fast, medium, high
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "medium")]
    quality: Vec<String>,
    /// Also build `bvh` compact: less memory, somewhat slower
    #[arg(long)]
    pub compact: bool,
    /// Instruction sets: scalar, vector128, avx2, avx512. Default: the best one of this machine
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    simd: Vec<String>,
}

impl Options {
    /// Every combination of the requested options.
    pub fn variants(&self) -> Result<Vec<BuildOptions>, Failure> {
        let accelerators = self.accelerator.iter();
        let accelerators: Vec<_> = accelerators
            .map(|name| choice("accelerator", name, &AcceleratorKind::ALL, AcceleratorKind::name))
            .collect::<Result<_, _>>()?;
        let qualities =
            self.quality.iter().map(|name| choice("quality", name, &Quality::ALL, Quality::name));
        let qualities: Vec<_> = qualities.collect::<Result<_, _>>()?;
        let levels = self.levels()?;
        let mut variants = Vec::new();
        for &accelerator in &accelerators {
            // Only the BVH is built in several qualities.
            let qualities = if accelerator == AcceleratorKind::Bvh {
                &qualities[..]
            } else {
                &[Quality::Medium]
            };
            let layouts = if self.compact && accelerator == AcceleratorKind::Bvh {
                &[false, true][..]
            } else {
                &[false]
            };
            for (&quality, &compact) in
                qualities.iter().flat_map(|q| layouts.iter().map(move |c| (q, c)))
            {
                variants.extend(levels.iter().map(|&simd| BuildOptions {
                    accelerator,
                    quality,
                    compact,
                    simd,
                    ..BuildOptions::default()
                }));
            }
        }
        Ok(variants)
    }

    fn levels(&self) -> Result<Vec<Level>, Failure> {
        if self.simd.is_empty() {
            return Ok(vec![Level::from_env().map_err(Failure::Usage)?]);
        }
        let level = |name: &String| {
            let level = choice("instruction set", name, &Level::ALL, Level::name)?;
            if level.is_supported() {
                return Ok(level);
            }
            Err(Failure::Usage(format!(
                "this machine does not have {level}; the best it has is {}",
                Level::best()
            )))
        };
        self.simd.iter().map(level).collect()
    }
}

/// The name of the layout in tables.
pub fn layout(compact: bool) -> &'static str {
    if compact { "compact" } else { "" }
}

/// A builder with the full contents of a world, except its filters. Another structure built from it
/// gives the same hits.
pub fn builder_of(world: &World) -> WorldBuilder {
    let mut builder = WorldBuilder::default();
    for _ in 1..world.group_count() {
        builder.add_group();
    }
    let groups = || (0..world.group_count() as u32).map(GroupId);
    // Numbers of geometries ascend over all groups.
    let mut geometries: Vec<_> = groups()
        .flat_map(|group| world.group(group).geometries.iter().map(move |&id| (id, group)))
        .collect();
    geometries.sort();
    for (id, group) in geometries {
        match world.geometry(id) {
            Geometry::Mesh(mesh) => builder.add_mesh(group, mesh.clone()),
            Geometry::Shape(shape, placed) => builder.add_shape(group, shape.clone(), *placed),
            Geometry::Set(set) => builder.add_set(group, set.clone()),
            Geometry::Quads(quads) => builder.add_quads(group, quads.clone()),
            Geometry::MovingMesh(mesh) => builder.add_moving_mesh(group, mesh.clone()),
            Geometry::Heightfield(field) => builder.add_heightfield(group, field.clone()),
        };
    }
    for group in groups() {
        for instance in &world.group(group).instances {
            builder.add(group, instance.clone());
        }
    }
    builder
}

/// Builds the contents of a world with other options.
pub fn rebuilt(world: &World, options: &BuildOptions) -> Result<World, WorldError> {
    builder_of(world).build(options)
}
