//! Ray casting: a ray through the centre of each pixel (Appel, Some Techniques for Shading Machine
//! Renderings of Solids, AFIPS 1968), with every triangle, or through the bounding volume
//! hierarchy.

use super::canvas::{Canvas, Seen};
use super::facet::centre;
use super::{NOTHING, Screen, VisibleError};
use crate::coherence::PrimitiveId;
use snell_intersect::Hit;
use snell_intersect::World;
use snell_intersect::{AcceptAll, Grouping};
use snell_math::{DVec3, Ray};

/// Maximum number of ray/triangle tests.
const MOST_TESTS: u64 = 5_000_000_000;

/// The side in pixels of the blocks that are traced together.
const BLOCK: u32 = 16;

/// Tests every ray with every triangle in `f64`, in world coordinates, without projection.
///
/// The test is that of Möller and Trumbore (Fast, Minimum Storage Ray/Triangle Intersection, 1997);
/// all terms that do not depend on the ray's direction are computed once, because all rays have the
/// same origin.
pub(super) fn run_all(screen: &Screen) -> Result<Seen, VisibleError> {
    let mut canvas = Canvas::new(screen, false);
    let tests = canvas.len() as u64 * screen.triangles.len() as u64;
    if tests > MOST_TESTS {
        return Err(VisibleError::TooMuchWork {
            what: "tests of a ray with a triangle",
            limit: MOST_TESTS,
        });
    }
    let eye = screen.view.apex().unwrap_or_default();
    let prepared: Vec<Prepared> =
        screen.triangles.iter().map(|t| Prepared::new(&t.corners, eye)).collect();
    let mut hits = 0;
    for y in 0..screen.size[1] {
        for x in 0..screen.size[0] {
            let direction = screen.view.direction(centre(x, y));
            let (mut best, mut nearest) = (NOTHING, 0.0);
            for (i, triangle) in prepared.iter().enumerate() {
                // At equal distance the first triangle is kept.
                if let Some(near) = triangle.nearness(direction) {
                    hits += 1;
                    if near > nearest {
                        (best, nearest) = (i as u32, near);
                    }
                }
            }
            if best != NOTHING {
                let pixel = canvas.pixel(x, y);
                canvas.items[pixel] = item_or_edge_on(screen, screen.triangles[best as usize].id);
            }
        }
    }
    let work = vec![("rays", canvas.len() as u64), ("tests", tests), ("hits", hits)];
    Ok(canvas.seen_without_cost(work, size_of_val(&prepared[..])))
}

/// The items that rays through the hierarchy hit.
pub(super) fn run(screen: &Screen, world: &World) -> Seen {
    let mut canvas = Canvas::new(screen, false);
    let [width, height] = screen.size;
    let (mut rays, mut pixels, mut hits) = (Vec::new(), Vec::new(), Vec::new());
    let mut count = 0;
    for top in (0..height).step_by(BLOCK as usize) {
        for left in (0..width).step_by(BLOCK as usize) {
            rays.clear();
            pixels.clear();
            for (x, y) in block(left, top, [width, height]) {
                rays.push(ray(screen, x, y));
                pixels.push(canvas.pixel(x, y));
            }
            hits.resize(rays.len(), Hit::MISS);
            world.closest(&rays, Grouping::Coherent, &AcceptAll, &mut hits);
            for (hit, &pixel) in hits.iter().zip(&pixels).filter(|(hit, _)| hit.is_hit()) {
                count += 1;
                let id = PrimitiveId::from([hit.instance, hit.geometry, hit.primitive]);
                canvas.items[pixel] = item_or_edge_on(screen, id);
            }
        }
    }
    let work = vec![("rays", canvas.len() as u64), ("hits", count)];
    canvas.seen_without_cost(work, world.memory_bytes() as usize)
}

/// The number of nodes and the number of triangles that the rays are tested with.
pub(super) fn work(screen: &Screen, world: &World) -> [u64; 2] {
    let [width, height] = screen.size;
    let mut total = [0; 2];
    for y in 0..height {
        let rays: Vec<Ray> = (0..width).map(|x| ray(screen, x, y)).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        let work = world.closest_work(&rays, &AcceptAll, &mut hits);
        total[0] += work.nodes_visited;
        total[1] += work.primitives_tested;
    }
    total
}

/// The ray through the centre of a pixel, rounded to `f32`.
pub(super) fn ray(screen: &Screen, x: u32, y: u32) -> Ray {
    let eye = screen.view.apex().unwrap_or_default();
    Ray::new(eye.as_vec3(), screen.view.direction(centre(x, y)).normalize().as_vec3())
}

/// The pixels of a block in groups of four by four, so that sixteen consecutive rays are those of
/// such a group.
fn block(left: u32, top: u32, [width, height]: [u32; 2]) -> impl Iterator<Item = (u32, u32)> {
    let pixel = move |i: u32| {
        let (group, within) = (i / 16, i % 16);
        let groups = BLOCK / 4;
        (left + group % groups * 4 + within % 4, top + group / groups * 4 + within / 4)
    };
    (0..BLOCK * BLOCK).map(pixel).filter(move |&(x, y)| x < width && y < height)
}

/// A triangle that is hit but seen edge-on has no facet, and therefore no item.
fn item_or_edge_on(screen: &Screen, id: PrimitiveId) -> u32 {
    match screen.item(id) {
        NOTHING => super::EDGE_ON,
        item => item,
    }
}

/// The terms of a triangle for rays from the eye: the volumes that the eye spans with each edge,
/// and with the plane.
struct Prepared {
    volume: DVec3,
    u: DVec3,
    v: DVec3,
    distance: f64,
}

impl Prepared {
    fn new([a, b, c]: &[DVec3; 3], eye: DVec3) -> Self {
        let (e1, e2, s) = (*b - *a, *c - *a, eye - *a);
        let q = s.cross(e1);
        Self { volume: e2.cross(e1), u: e2.cross(s), v: q, distance: e2.dot(q) }
    }

    /// The reciprocal of the ray's parameter at the hit, if there is one in front of the eye.
    fn nearness(&self, direction: DVec3) -> Option<f64> {
        let volume = self.volume.dot(direction);
        let sign = if volume < 0.0 { -1.0 } else { 1.0 };
        let (size, u, v) =
            (volume * sign, self.u.dot(direction) * sign, self.v.dot(direction) * sign);
        let distance = self.distance * sign;
        (u >= 0.0 && v >= 0.0 && u + v <= size && size > 0.0 && distance > 0.0)
            .then(|| size / distance)
    }
}
