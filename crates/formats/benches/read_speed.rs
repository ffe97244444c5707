//! Measures how fast a scene is read: `cargo bench -p snell-formats --bench read_speed -- FILE`.
//! Without a file, 20 MB of pbrt text are generated.
//!
//! Cargo runs the benchmark in the crate's folder, so the path must be absolute.

#![expect(clippy::disallowed_methods, reason = "times need no certain bits")]

use snell_formats::{ReadOptions, read_scene_bytes};
use snell_scene::Geometry;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// Generates pbrt text of at least `bytes` bytes: as many wavy grids of triangles as needed.
fn generated(bytes: usize) -> String {
    const SIDE: usize = 300;
    let mut text = String::from("WorldBegin\nMaterial \"diffuse\"\n");
    while text.len() < bytes {
        text += "Shape \"trianglemesh\"\n \"point3 P\" [";
        for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
            let (x, y) = (i as f64 / 30.0, j as f64 / 30.0);
            let z = x.sin() * y.cos();
            writeln!(text, "{x:.6} {y:.6} {z:.6}").expect("strings grow");
        }
        text += "]\n \"integer indices\" [";
        for (i, j) in (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |j| (i, j))) {
            let a = i * SIDE + j;
            writeln!(text, "{a} {} {} {a} {} {}", a + 1, a + SIDE + 1, a + SIDE + 1, a + SIDE)
                .expect("strings grow");
        }
        text += "]\n";
    }
    text
}

fn main() {
    let (name, bytes) = match std::env::args().nth(1).filter(|word| word != "--bench") {
        Some(file) => (file.clone(), std::fs::read(&file).expect("the file can be read")),
        None => ("generated.pbrt".into(), generated(20_000_000).into_bytes()),
    };
    let folder = Path::new(&name).parent().unwrap_or(Path::new(".")).to_path_buf();
    for _ in 0..5 {
        let content = bytes.clone();
        let start = Instant::now();
        let scene = read_scene_bytes(&name, content, &folder, &ReadOptions::default())
            .expect("the scene is fine");
        let seconds = start.elapsed().as_secs_f64();
        let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces);
        let count =
            |g: &Geometry| if let Geometry::Mesh(mesh) = g { mesh.indices.len() } else { 1 };
        let triangles: usize = surfaces.map(|s| count(&s.geometry)).sum();
        println!(
            "{:.1} MB in {seconds:.3} s: {:.0} MB/s, {:.2} million triangles/s",
            bytes.len() as f64 / 1e6,
            bytes.len() as f64 / 1e6 / seconds,
            triangles as f64 / 1e6 / seconds
        );
    }
}
