//! Closed meshes for tests of exactness.

use snell_intersect::TriangleMesh;
use snell_math::{DVec3, Vec3};
use std::collections::{BTreeMap, HashMap};

/// A closed latitude-longitude sphere of `rings` by `segments`, normals outward.
pub fn latitude_longitude_sphere(radius: f64, rings: u32, segments: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let last = 1 + (rings - 1) * segments;
    mesh.positions.push(Vec3::new(0.0, 0.0, radius as f32));
    for ring in 1..rings {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for s in 0..segments {
            let phi = std::f64::consts::TAU * f64::from(s) / f64::from(segments);
            let p =
                DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()) * radius;
            mesh.positions.push(p.as_vec3());
        }
    }
    mesh.positions.push(Vec3::new(0.0, 0.0, -radius as f32));
    let at = |ring: u32, s: u32| match ring {
        0 => 0,
        r if r == rings => last,
        r => 1 + (r - 1) * segments + s % segments,
    };
    for ring in 0..rings {
        for s in 0..segments {
            let (a, b, c, d) = (at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1));
            if ring + 1 < rings {
                mesh.indices.push([a, b, c]);
            }
            if ring > 0 {
                mesh.indices.push([a, c, d]);
            }
        }
    }
    mesh
}

/// An icosahedron divided `levels` times, its vertices on a sphere; normals outward.
pub fn icosphere(radius: f64, levels: u32) -> TriangleMesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        points.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    let edge = points[0].distance(points[3]);
    let near = |a: usize, b: usize| (points[a].distance(points[b]) - edge).abs() < 1e-9;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in (b + 1..12).filter(|&c| near(a, b) && near(b, c) && near(c, a)) {
                let outward =
                    (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                triangles.push(if outward { [a, b, c] } else { [a, c, b] });
            }
        }
    }
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut divided = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut middle = |a: usize, b: usize| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push((points[a].normalize() + points[b].normalize()).normalize());
                    points.len() - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            divided.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = divided;
    }
    TriangleMesh {
        positions: points.iter().map(|p| (p.normalize() * radius).as_vec3()).collect(),
        indices: triangles.iter().map(|t| t.map(|v| v as u32)).collect(),
        ..TriangleMesh::default()
    }
}

/// The mesh with equal vertices merged and every hole closed by a fan around the middle of its
/// border. `None` if the result is not a closed, consistently oriented surface.
pub fn closed(mesh: &TriangleMesh) -> Option<TriangleMesh> {
    let mut numbers = BTreeMap::new();
    let mut result = TriangleMesh::default();
    let mut merged = Vec::with_capacity(mesh.positions.len());
    for p in &mesh.positions {
        let number =
            *numbers.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
                result.positions.push(*p);
                result.positions.len() as u32 - 1
            });
        merged.push(number);
    }
    let triangles = mesh.indices.iter().map(|t| t.map(|i| merged[i as usize]));
    result.indices = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let open = open_edges(&result.indices)?;
    // The border runs against the edges of the adjacent triangles.
    let mut next: BTreeMap<u32, u32> = open.iter().map(|&(a, b)| (b, a)).collect();
    if next.len() != open.len() {
        return None;
    }
    while let Some((&start, _)) = next.iter().next() {
        let mut ring = vec![start];
        let mut at = next.remove(&start)?;
        while at != start {
            ring.push(at);
            at = next.remove(&at)?;
        }
        let sum: DVec3 = ring.iter().map(|&i| result.positions[i as usize].as_dvec3()).sum();
        let middle = result.positions.len() as u32;
        result.positions.push((sum / ring.len() as f64).as_vec3());
        result
            .indices
            .extend((0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()], middle]));
    }
    open_edges(&result.indices)?.is_empty().then_some(result)
}

/// Directed edges without an opposite; `None` if an edge is used twice in one direction.
fn open_edges(triangles: &[[u32; 3]]) -> Option<Vec<(u32, u32)>> {
    let mut edges = BTreeMap::new();
    for t in triangles {
        for i in 0..3 {
            if edges.insert((t[i], t[(i + 1) % 3]), ()).is_some() {
                return None;
            }
        }
    }
    Some(edges.keys().filter(|&&(a, b)| !edges.contains_key(&(b, a))).copied().collect())
}
