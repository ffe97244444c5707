//! The nearest hit of two rays on a triangle: `cargo run -p snell-intersect --example first_hit`.

use snell_intersect::{
    AcceptAll, BuildOptions, Grouping, Hit, TriangleMesh, WorldBuilder, WorldError,
};
use snell_math::{Ray, Vec3};
use std::sync::Arc;

fn main() -> Result<(), WorldError> {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = TriangleMesh { positions, indices: vec![[0, 1, 2]], ..TriangleMesh::default() };
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    let world = builder.build(&BuildOptions::default())?;

    let rays =
        [[0.25, 0.5, -2.0], [0.75, 0.5, -2.0]].map(|origin| Ray::new(Vec3::from(origin), Vec3::Z));
    let mut hits = [Hit::MISS; 2];
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
        let surface = world.interaction(ray, hit);
        println!("t = {}, at {}, normal {}", hit.t, surface.position, surface.geometric_normal);
    }
    Ok(())
}
