//! `--dump-rays`: writes the triangles and rays of a benchmark as NumPy arrays, for other programs
//! to trace.

use super::kinds::Kind;
use super::make_folder;
use super::scenes::{self, Bench};
use crate::failure::Failure;
use snell_intersect::{AcceptAll, Geometry, GeometryId, Grouping, Hit, World};
use snell_math::Ray;
use std::path::Path;

/// Writes the triangles of a scene, and each batch of rays with its hits, to a folder named after
/// the scene.
pub fn write(
    folder: &Path,
    bench: &Bench,
    world: &World,
    batches: &[(Kind, Vec<Ray>)],
) -> Result<(), Failure> {
    let is_mesh = |i| matches!(world.geometry(GeometryId(i)), Geometry::Mesh(_));
    if !(0..world.geometry_count() as u32).all(is_mesh) {
        return Err(Failure::Scene(format!(
            "{}: has geometry other than triangles, which cannot be written; use a scene of meshes",
            bench.name
        )));
    }
    let folder = folder.join(scenes::short_name(&bench.name).replace([':', '='], "-"));
    make_folder(&folder)?;
    let mesh = scenes::merged(world);
    save(
        &folder,
        "positions",
        "<f4",
        3,
        mesh.positions.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes),
    )?;
    save(
        &folder,
        "triangles",
        "<u4",
        3,
        mesh.indices.iter().flatten().flat_map(|i| i.to_le_bytes()),
    )?;
    for (kind, rays) in batches {
        let numbers = rays.iter().flat_map(|r| {
            let ([a, b, c], [d, e, f]) = (r.origin.to_array(), r.direction.to_array());
            [a, b, c, r.t_min, d, e, f, r.t_max]
        });
        save(&folder, kind.name(), "<f4", 8, numbers.flat_map(f32::to_le_bytes))?;
        let answers = format!("{}-t", kind.name());
        save(
            &folder,
            &answers,
            "<f4",
            1,
            distances(*kind, world, rays).into_iter().flat_map(f32::to_le_bytes),
        )?;
    }
    Ok(())
}

/// The distance to the hit of each ray; infinite for a miss. For shadow rays, 0 if the ray is
/// occluded.
fn distances(kind: Kind, world: &World, rays: &[Ray]) -> Vec<f32> {
    if kind == Kind::Shadow {
        let mut blocked = vec![false; rays.len()];
        world.occluded(rays, Grouping::None, &AcceptAll, &mut blocked);
        return blocked.iter().map(|&b| if b { 0.0 } else { f32::INFINITY }).collect();
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    hits.iter().map(|h| h.t).collect()
}

/// Writes an array with rows of `columns` numbers in NumPy's format (version 1.0).
fn save(
    folder: &Path,
    name: &str,
    kind: &str,
    columns: usize,
    bytes: impl Iterator<Item = u8>,
) -> Result<(), Failure> {
    let body: Vec<u8> = bytes.collect();
    let rows = body.len() / (4 * columns);
    let shape = if columns == 1 { format!("({rows},)") } else { format!("({rows}, {columns})") };
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    // The data is aligned to 64 bytes.
    let padded = (10 + header.len() + 1).next_multiple_of(64) - 10;
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((padded as u16).to_le_bytes());
    file.extend(format!("{header:<width$}\n", width = padded - 1).bytes());
    file.extend(body);
    Ok(snell_formats::atomic::write(&folder.join(format!("{name}.npy")), &file)?)
}
