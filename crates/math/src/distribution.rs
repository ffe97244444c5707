//! Tabulated distributions in one and two dimensions, sampled by inversion, which preserves
//! stratification.

use glam::Vec2;

/// A piecewise constant density over `[0, 1)`.
#[derive(Clone, Debug)]
pub struct Distribution1D {
    /// Cumulative weights divided by their sum, from 0 to 1; one entry more than there are pieces.
    cdf: Vec<f32>,
    /// Where the search in `cdf` starts. `[0, 1)` is divided into as many equal parts as there are
    /// pieces; for the lower end of each part, and for 1, this is the index of the first entry of
    /// `cdf` above that number (the cutpoint method of Chen and Asau, 1974).
    guide: Vec<u32>,
    sum: f64,
}

impl Distribution1D {
    /// The density proportional to `weights`. Negative, NaN and infinite weights count as 0. If all
    /// are 0, the density is uniform and [`Self::sum`] is 0. At least one weight is needed: an
    /// empty slice acts as one piece.
    #[inline]
    pub fn new(weights: &[f32]) -> Self {
        let mut weights: Vec<f32> =
            weights.iter().map(|&w| if w.is_finite() && w > 0.0 { w } else { 0.0 }).collect();
        if weights.is_empty() {
            weights.push(0.0);
        }
        let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        if sum == 0.0 {
            weights.fill(1.0);
        }
        let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        let mut running = 0.0;
        let mut cdf = vec![0.0];
        cdf.extend(weights.iter().map(|&w| {
            running += f64::from(w) / total;
            running as f32
        }));
        *cdf.last_mut().expect("the table has an entry") = 1.0;
        let count = weights.len();
        let mut first = 0;
        let guide = (0..=count)
            .map(|k| {
                let begin = k as f32 / count as f32;
                first += cdf[first..].iter().take_while(|&&c| c <= begin).count();
                first as u32
            })
            .collect();
        Self { cdf, guide, sum }
    }

    /// Number of pieces.
    #[inline]
    pub fn len(&self) -> usize {
        self.cdf.len() - 1
    }

    /// Never true: a distribution has at least one piece.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sum of the weights given to [`Self::new`], after those that are not valid were set to 0.
    #[inline]
    pub fn sum(&self) -> f64 {
        self.sum
    }

    /// Chooses a piece with its probability. Returns the index of the piece and a new uniform
    /// number in `[0, 1)`, made from `u`.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let i = self.first_above(u).clamp(1, self.len()) - 1;
        // Skip empty pieces, which rounding may have reached.
        let i = if self.cdf[i + 1] > self.cdf[i] { i } else { self.nearest_nonempty(i) };
        let width = self.cdf[i + 1] - self.cdf[i];
        let rest = ((u - self.cdf[i]) / width).clamp(0.0, crate::rng::ONE_MINUS_EPSILON);
        (i, rest)
    }

    /// The index of the first entry of `cdf` above `u`.
    #[inline]
    fn first_above(&self, u: f32) -> usize {
        let part = ((u * self.len() as f32) as usize).min(self.len() - 1);
        let [from, to] = [self.guide[part] as usize, self.guide[part + 1] as usize];
        let found = from + self.cdf[from..to].partition_point(|&c| c <= u);
        // Rounding may have led to a neighbouring part.
        let is_first = found == 0 || self.cdf[found - 1] <= u;
        let is_above = self.cdf.get(found).is_none_or(|&c| c > u);
        if is_first && is_above { found } else { self.cdf.partition_point(|&c| c <= u) }
    }

    #[inline]
    fn nearest_nonempty(&self, i: usize) -> usize {
        let wide = |&k: &usize| self.cdf[k + 1] > self.cdf[k];
        (0..i).rev().find(wide).or_else(|| (i..self.len()).find(wide)).unwrap_or(i)
    }

    /// Probability of piece `i`: exactly the one with which [`Self::sample`] chooses it.
    #[inline]
    pub fn probability(&self, i: usize) -> f32 {
        self.cdf[i + 1] - self.cdf[i]
    }
}

/// A piecewise constant density over the unit square: `width x height` pieces, row by row.
#[derive(Clone, Debug)]
pub struct Distribution2D {
    rows: Vec<Distribution1D>,
    marginal: Distribution1D,
}

impl Distribution2D {
    /// The density proportional to `weights` (row-major, `width` per row).
    ///
    /// # Panics
    /// If `width` is 0 or does not divide `weights.len()`.
    #[inline]
    pub fn new(weights: &[f32], width: usize) -> Self {
        assert!(width > 0 && weights.len().is_multiple_of(width), "rows of equal length");
        let rows: Vec<_> = weights.chunks_exact(width).map(Distribution1D::new).collect();
        let sums: Vec<f32> = rows.iter().map(|r| r.sum() as f32).collect();
        Self { marginal: Distribution1D::new(&sums), rows }
    }

    /// Samples a point of the unit square. Returns the point and its density with respect to area.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let (row, v) = self.marginal.sample(u.y);
        let (column, s) = self.rows[row].sample(u.x);
        let point = Vec2::new(
            (column as f32 + s) / self.rows[row].len() as f32,
            (row as f32 + v) / self.rows.len() as f32,
        );
        (point.min(Vec2::splat(crate::rng::ONE_MINUS_EPSILON)), self.piece_pdf(row, column))
    }

    /// Density at a point of the unit square (points outside are clamped to the border).
    #[inline]
    pub fn pdf(&self, p: Vec2) -> f32 {
        let index = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        let row = index(p.y, self.rows.len());
        let column = index(p.x, self.rows[row].len());
        self.piece_pdf(row, column)
    }

    #[inline]
    fn piece_pdf(&self, row: usize, column: usize) -> f32 {
        let n = self.rows.len() as f32 * self.rows[row].len() as f32;
        self.marginal.probability(row) * self.rows[row].probability(column) * n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guide_leads_to_where_a_search_of_all_leads() {
        for weights in [
            vec![1.0],
            vec![0.0, 1.0, 0.0],
            vec![1e-9, 5.0, 0.0, 0.0, 1e-3, 1e6, 2.0],
            vec![0.7; 1000],
        ] {
            let table = Distribution1D::new(&weights);
            let edges = table.cdf.iter().flat_map(|&c| [c, c.next_down(), c.next_up()]);
            for u in
                edges.chain((0..1000).map(|i| i as f32 / 1000.0)).filter(|u| (0.0..1.0).contains(u))
            {
                assert_eq!(
                    table.first_above(u),
                    table.cdf.partition_point(|&c| c <= u),
                    "{weights:?} {u}"
                );
            }
        }
    }

    #[test]
    fn pieces_are_picked_with_their_probability() {
        let d = Distribution1D::new(&[1.0, 0.0, 3.0, f32::NAN]);
        let n = 40_000;
        let mut counts = [0; 4];
        for i in 0..n {
            counts[d.sample((i as f32 + 0.5) / n as f32).0] += 1;
        }
        assert_eq!(counts, [n / 4, 0, 3 * n / 4, 0]);
        assert!((d.probability(2) - 0.75).abs() < 1e-7);
        assert_eq!(d.sample(0.999_999_9).0, 2);
    }

    #[test]
    fn the_square_density_integrates_to_one_and_matches_samples() {
        let d = Distribution2D::new(&[1.0, 2.0, 3.0, 0.0, 0.0, 6.0], 3);
        let mut integral = 0.0;
        for i in 0..60 {
            for j in 0..60 {
                integral +=
                    d.pdf(Vec2::new((i as f32 + 0.5) / 60.0, (j as f32 + 0.5) / 60.0)) / 3600.0;
            }
        }
        assert!((integral - 1.0).abs() < 1e-4);
        let (p, pdf) = d.sample(Vec2::new(0.4, 0.8));
        assert_eq!(pdf, d.pdf(p));
    }
    /// Chi-squared test of the pieces that are sampled from tables of random weights, some of them
    /// 0, over several orders of magnitude.
    #[test]
    fn pieces_of_the_square_are_distributed_as_stated() {
        use crate::rng::uniform2;
        use crate::statistics::{chi_squared_deviation, sidak_deviation};
        let (n, tables) = (30_000u32, 8);
        for table in 0..tables {
            let [width, height] = [1 + 3 * table as usize, 9];
            let weight = |i: u32| {
                let r = uniform2([i, table, 1, 5]);
                if r.x < 0.3 { 0.0 } else { (8.0 * r.y).exp() }
            };
            let weights: Vec<f32> = (0..(width * height) as u32).map(weight).collect();
            let d = Distribution2D::new(&weights, width);
            let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            let mut found = vec![0; weights.len()];
            for i in 0..n {
                let (p, pdf) = d.sample(uniform2([i, table, 2, 5]));
                let at = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
                let cell = at(p.y, height) * width + at(p.x, width);
                let expected = f64::from(weights[cell]) / total * weights.len() as f64;
                assert!(
                    (f64::from(pdf) / expected - 1.0).abs() < 1e-3,
                    "table {table}: {pdf} {expected}"
                );
                found[cell] += 1;
            }
            let expected: Vec<f64> =
                weights.iter().map(|&w| f64::from(w) / total * f64::from(n)).collect();
            let z = chi_squared_deviation(&found, &expected);
            assert!(z < sidak_deviation(0.01, tables), "table {table}: {z} standard deviations");
        }
    }
}
