//! Tabulated functions of the wavelength.

/// The values of a table at a wavelength, interpolated linearly between the rows and constant
/// beyond the ends. Each row is a wavelength, in ascending order, followed by the values at it. An
/// empty table gives zeros.
pub fn lookup<const ROW: usize, const VALUES: usize>(
    rows: &[[f32; ROW]],
    lambda: f32,
) -> [f32; VALUES] {
    debug_assert_eq!(ROW, VALUES + 1);
    let above = rows.partition_point(|row| row[0] <= lambda);
    let (Some(low), Some(high)) =
        (rows.get(above.saturating_sub(1)), rows.get(above).or(rows.last()))
    else {
        return [0.0; VALUES];
    };
    let width = high[0] - low[0];
    let t = if width > 0.0 { ((lambda - low[0]) / width).clamp(0.0, 1.0) } else { 0.0 };
    std::array::from_fn(|i| low[i + 1] * (1.0 - t) + high[i + 1] * t)
}

#[cfg(test)]
mod tests {
    use super::lookup;

    #[test]
    fn values_are_linear_between_rows_and_constant_beyond() {
        let rows = [[400.0, 1.0], [500.0, 3.0], [600.0, 2.0]];
        for (lambda, expected) in
            [(300.0, 1.0), (400.0, 1.0), (450.0, 2.0), (500.0, 3.0), (575.0, 2.25), (700.0, 2.0)]
        {
            assert_eq!(lookup::<2, 1>(&rows, lambda), [expected], "{lambda}");
        }
        assert_eq!(lookup::<2, 1>(&[], 500.0), [0.0]);
    }
}
