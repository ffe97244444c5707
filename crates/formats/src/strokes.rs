//! Points and lines of files, which have no thickness: balls and tubes that can be seen.
//!
//! Every reader whose format has points or lines collects them as [`Strokes`]; the radii follow
//! from the extent and the density of what is drawn ([`Radii::of`]).

use rayon::prelude::*;
use snell_intersect::{Curves, StrandBasis};
use snell_math::{Bounds3d, DVec3, Vec3};
use std::collections::HashSet;

/// The radius of a ball, as a fraction of the distance between neighbours: most balls of a surface
/// touch, and its holes are small.
const OF_SPACING: f64 = 0.6;
/// The largest radius of a ball, as a fraction of the diagonal of the bounds.
const LARGEST_BALL: f64 = 1.0 / 80.0;
/// The bounds of the radius of a tube, as fractions of that diagonal.
const THIN_TUBE: f64 = 1.0 / 4000.0;
const THICK_TUBE: f64 = 1.0 / 400.0;
/// The radius of a tube, as a fraction of the distance between lines that fill the area evenly.
const OF_GAP: f64 = 0.15;
/// The least radius, in steps of single precision at the place.
const STEPS: f64 = 8.0;

/// Points and chains of straight lines through numbered vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strokes {
    /// The vertices of all strokes, one stroke after the other.
    vertices: Vec<u32>,
    /// The number of vertices of each stroke: 1 for a point.
    sizes: Vec<u32>,
    /// The number of points, and that of lines, that [`Self::keep_visible`] has left out.
    left_out: [usize; 2],
}

impl Strokes {
    /// A point at each of the vertices.
    pub fn points(vertices: Vec<u32>) -> Self {
        Self { sizes: vec![1; vertices.len()], vertices, left_out: [0; 2] }
    }

    /// Adds a point, or a line through several vertices.
    pub fn push(&mut self, vertices: impl IntoIterator<Item = u32>) {
        let before = self.vertices.len();
        self.vertices.extend(vertices);
        if self.vertices.len() > before {
            self.sizes.push((self.vertices.len() - before) as u32);
        }
    }

    /// Leaves out points where one is already, because rays that meet thousands of equal balls are
    /// slow (depth cameras put all pixels without an answer at zero), and points that are not
    /// finite. Lines end before vertices that are not finite, and begin again after them.
    pub fn keep_visible(&mut self, positions: &[Vec3]) {
        let mut kept = Self::default();
        let mut places = HashSet::new();
        for stroke in self.iter() {
            let is_finite = |i: &u32| positions[*i as usize].is_finite();
            match *stroke {
                [alone] => {
                    // Both signs of zero are one place.
                    let place = (positions[alone as usize] + 0.0).to_array().map(f32::to_bits);
                    match is_finite(&alone) && places.insert(place) {
                        true => kept.push([alone]),
                        false => kept.left_out[0] += 1,
                    }
                }
                _ => {
                    let before = kept.sizes.len();
                    let parts = stroke.split(|i| !is_finite(i)).filter(|part| part.len() > 1);
                    parts.for_each(|part| kept.push(part.iter().copied()));
                    kept.left_out[1] += usize::from(kept.sizes.len() == before);
                }
            }
        }
        *self = kept;
    }

    /// True if there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.sizes.is_empty()
    }

    /// The number of points, and that of lines.
    pub fn counts(&self) -> [usize; 2] {
        let points = self.sizes.iter().filter(|size| **size == 1).count();
        [points, self.sizes.len() - points]
    }

    /// The vertices of each stroke.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let mut rest = self.vertices.as_slice();
        self.sizes.iter().map(move |&size| {
            let (stroke, after) = rest.split_at(size as usize);
            rest = after;
            stroke
        })
    }

    /// The balls and tubes, with the colours of the vertices (empty for white). `None` if there is
    /// nothing to draw, or more than 32-bit numbers can count. Vertices must be in range.
    pub fn curves(&self, positions: &[Vec3], colors: &[[f32; 4]], radii: Radii) -> Option<Curves> {
        if self.is_empty() {
            return None;
        }
        // A ball is a strand between two equal points.
        let doubled = |stroke: &[u32]| match *stroke {
            [alone] => [alone, alone].to_vec(),
            _ => stroke.to_vec(),
        };
        let mut points = Vec::with_capacity(self.vertices.len() + self.sizes.len());
        let mut shown = Vec::with_capacity(if colors.is_empty() { 0 } else { points.capacity() });
        let mut strands = Vec::with_capacity(self.sizes.len());
        for stroke in self.iter() {
            let radius = if stroke.len() == 1 { radii.ball } else { radii.tube };
            let stroke = doubled(stroke);
            strands.push(stroke.len() as u32);
            points.extend(stroke.iter().map(|&i| positions[i as usize].extend(radius)));
            if !colors.is_empty() {
                shown.extend(stroke.iter().map(|&i| colors[i as usize]));
            }
        }
        Curves::new(StrandBasis::Linear, points, strands).ok()?.with_colors(shown).ok()
    }
}

/// The radii of balls and tubes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Radii {
    /// The radius of the ball of a point.
    pub ball: f32,
    /// The radius of the tube of a line.
    pub tube: f32,
}

impl Radii {
    /// Radii for all strokes of a file. `around` are the bounds of everything that is shown with
    /// them, in the same coordinates; they may be empty.
    pub fn of(strokes: &[&Strokes], positions: &[Vec3], around: Bounds3d) -> Self {
        let place = |i: u32| positions[i as usize].as_dvec3();
        let (mut bounds, mut points, mut length) = (around, Vec::new(), 0.0);
        for stroke in strokes.iter().flat_map(|strokes| strokes.iter()) {
            for at in stroke.iter().map(|&i| place(i)).filter(|at| at.is_finite()) {
                bounds = bounds.union(&Bounds3d { min: at, max: at });
            }
            match stroke {
                &[alone] => points.push(place(alone)),
                chain => {
                    let lengths = chain.windows(2).map(|w| place(w[0]).distance(place(w[1])));
                    length += lengths.filter(|length| length.is_finite()).sum::<f64>();
                }
            }
        }
        if bounds.is_empty() {
            return Self { ball: 1.0, tube: 1.0 };
        }
        let size = bounds.max - bounds.min;
        let diagonal = size.length();
        let away = bounds.min.abs().max(bounds.max.abs()).max_element();
        let least = (away * f64::from(f32::EPSILON) * STEPS).max(f64::from(f32::MIN_POSITIVE));
        if diagonal == 0.0 {
            // A point alone has no size to go by.
            let radius = f64::max(0.01, least) as f32;
            return Self { ball: radius, tube: radius };
        }
        points.retain(|at| at.is_finite());
        let ball = (spacing(&points) * OF_SPACING).min(diagonal * LARGEST_BALL);
        let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let gap = if length > 0.0 { area / length } else { 0.0 };
        let tube = (gap * OF_GAP).clamp(diagonal * THIN_TUBE, diagonal * THICK_TUBE);
        Self { ball: ball.max(least) as f32, tube: tube.max(least) as f32 }
    }

    /// What was drawn and what was not, for a message: "3 points are drawn as balls of radius 0.1".
    pub fn describe(self, strokes: &[&Strokes]) -> String {
        let sum = |of: fn(&Strokes) -> [usize; 2]| {
            strokes.iter().map(|s| of(s)).fold([0; 2], |[a, b], [c, d]| [a + c, b + d])
        };
        let part = |count: usize, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            _ => Some(format!("{count} {many}")),
        };
        let of_radius = |said: Option<String>, radius: f32| {
            let radius = format!("{radius:.2e}").parse().unwrap_or(radius);
            said.map(|said| format!("{said} of radius {radius}"))
        };
        let ([points, lines], [no_points, no_lines]) = (sum(Strokes::counts), sum(|s| s.left_out));
        let balls = part(points, "point is drawn as a ball", "points are drawn as balls");
        let tubes = part(lines, "line is drawn as a tube", "lines are drawn as tubes");
        let drawn = [of_radius(balls, self.ball), of_radius(tubes, self.tube)];
        let drawn = drawn.into_iter().flatten().collect::<Vec<_>>().join(", and ");
        let left_out = [
            part(
                no_points,
                "point at the place of another, or that is not finite, is left out",
                "points at the places of others, or that are not finite, are left out",
            ),
            part(
                no_lines,
                "line of vertices that are not finite is left out",
                "lines of vertices that are not finite are left out",
            ),
        ];
        let drawn = Some(drawn).filter(|drawn| !drawn.is_empty());
        drawn.into_iter().chain(left_out.into_iter().flatten()).collect::<Vec<_>>().join("; ")
    }
}

/// The typical distance between neighbouring points that lie on a surface, a line, or in a volume.
///
/// Cells of a size `h` that hold a point are counted: `m` cells cover a surface of about `m h²`, on
/// which `n` points are `h √(m / n)` apart. Repeated with cells of twice that size, the estimate
/// settles whatever the bounds of the points are.
fn spacing(points: &[DVec3]) -> f64 {
    const ROUNDS: usize = 6;
    let all =
        points.iter().fold(Bounds3d::EMPTY, |all, &at| all.union(&Bounds3d { min: at, max: at }));
    if points.len() < 2 || !all.is_finite() {
        return f64::INFINITY;
    }
    let extent = (all.max - all.min).max_element();
    let mut cell = extent / (points.len() as f64).sqrt() * 2.0;
    for _ in 0..ROUNDS {
        // A key has 21 bits for each axis.
        cell = cell.max(extent / f64::from(1 << 20));
        if cell <= 0.0 {
            return f64::INFINITY;
        }
        let key = |at: &DVec3| {
            let [x, y, z] = ((*at - all.min) / cell).to_array().map(|v| v as u64);
            x << 42 | y << 21 | z
        };
        let mut keys: Vec<u64> = points.par_iter().with_min_len(1 << 12).map(key).collect();
        keys.par_sort_unstable();
        keys.dedup();
        cell = 2.0 * cell * (keys.len() as f64 / points.len() as f64).sqrt();
    }
    cell / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radii(positions: &[Vec3]) -> Radii {
        let points = Strokes::points((0..positions.len() as u32).collect());
        Radii::of(&[&points], positions, Bounds3d::EMPTY)
    }

    #[test]
    fn balls_of_a_surface_about_touch_whatever_lies_far_from_it() {
        let mut sheet: Vec<Vec3> =
            (0..10_000).map(|i| Vec3::new((i % 100) as f32, (i / 100) as f32, 0.0)).collect();
        let alone = radii(&sheet).ball;
        assert!((0.35..0.9).contains(&alone), "{alone}");
        sheet.push(Vec3::splat(3000.0));
        let with_stray = radii(&sheet).ball;
        assert!((0.35..0.9).contains(&with_stray), "{with_stray}");
        let line: Vec<Vec3> = (0..1000).map(|i| Vec3::X * i as f32).collect();
        let ball = radii(&line).ball;
        assert!((0.3..1.3).contains(&ball), "{ball}");
    }

    #[test]
    fn few_points_and_single_ones_have_a_size() {
        let two = radii(&[Vec3::ZERO, Vec3::X * 8.0]).ball;
        assert!((two - 0.1).abs() < 1e-6, "{two}");
        assert_eq!(radii(&[Vec3::ONE]).ball, 0.01);
        assert!(radii(&[Vec3::splat(1e7); 3]).ball >= 8.0, "single precision sees it");
        assert!(radii(&[Vec3::NAN]).ball > 0.0);
    }

    #[test]
    fn equal_points_are_one_and_gaps_divide_lines() {
        let gap = Vec3::new(0.0, f32::NAN, 0.0);
        let positions = [Vec3::X, Vec3::ZERO, -Vec3::ZERO, gap, Vec3::Y, Vec3::Z];
        let mut strokes = Strokes::points(vec![0, 1, 2, 1, 3]);
        strokes.push([0, 1, 3, 4, 5, 3, 0]);
        strokes.keep_visible(&positions);
        let kept: Vec<_> = strokes.iter().collect();
        assert_eq!(kept, [&[0][..], &[1], &[0, 1], &[4, 5]]);
        let said = Radii { ball: 0.25, tube: 0.125 }.describe(&[&strokes]);
        let left_out = "; 3 points at the places of others, or that are not finite, are left out";
        assert!(said.ends_with(left_out), "{said}");
        let mut nothing = Strokes::default();
        nothing.push([3, 0]);
        nothing.keep_visible(&positions);
        let said = Radii::default().describe(&[&nothing]);
        assert_eq!(said, "1 line of vertices that are not finite is left out");
    }

    #[test]
    fn strokes_become_balls_and_tubes_with_their_colours() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let colors = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
        let mut strokes = Strokes::points(vec![2]);
        strokes.push([0, 1, 2]);
        strokes.push([]);
        let radii = Radii::of(&[&strokes], &positions, Bounds3d::EMPTY);
        let curves = strokes.curves(&positions, &colors, radii).expect("something");
        assert_eq!((curves.strands(), curves.ball_count()), ([2, 3].as_slice(), 1));
        assert_eq!(curves.color_of_strand(0, 0.5), colors[2]);
        assert_eq!(curves.color_of_strand(1, 0.5), colors[1]);
        assert_eq!(curves.color_of_strand(1, 0.75), [0.0, 0.5, 0.5, 1.0]);
        let said = Radii { ball: 0.25, tube: 0.125 }.describe(&[&strokes]);
        assert_eq!(
            said,
            "1 point is drawn as a ball of radius 0.25, and 1 line is drawn as a tube of radius \
            0.125"
        );
        assert_eq!(Strokes::default().curves(&positions, &[], radii), None);
    }
}
