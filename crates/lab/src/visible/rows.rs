//! The facets that a row of pixels may intersect: bucket-sorted by first row, and active until
//! their last row.

use super::Screen;

/// Facets in the order in which rows from the top reach them.
pub(super) struct ActiveRows<'a> {
    screen: &'a Screen,
    /// Facets sorted by first row, and within a row by number.
    sorted: Vec<u32>,
    /// For each row, and one after the last, the index in `sorted` where its facets start.
    starts: Vec<u32>,
    active: Vec<u32>,
    /// The maximum number of active facets.
    pub most: usize,
}

impl<'a> ActiveRows<'a> {
    /// Sorts all facets by their first row, by a counting sort.
    pub fn new(screen: &'a Screen) -> Self {
        let first = |item: &u32| screen.facets[*item as usize].rows[0] as usize;
        let mut starts = vec![0; screen.size[1] as usize + 1];
        screen.sampled.iter().for_each(|item| starts[first(item) + 1] += 1);
        for row in 1..starts.len() {
            starts[row] += starts[row - 1];
        }
        let mut next = starts.clone();
        let mut sorted = vec![0; screen.sampled.len()];
        for item in &screen.sampled {
            let place = &mut next[first(item)];
            sorted[*place as usize] = *item;
            *place += 1;
        }
        Self { screen, sorted, starts, active: Vec::new(), most: 0 }
    }

    /// The facets whose extent includes this row. Rows must be requested in order from 0.
    pub fn advance(&mut self, row: u32) -> &[u32] {
        let facets = &self.screen.facets;
        self.active.retain(|item| facets[*item as usize].rows[1] > row);
        let [from, to] = [row, row + 1].map(|r| self.starts[r as usize] as usize);
        self.active.extend_from_slice(&self.sorted[from..to]);
        self.most = self.most.max(self.active.len());
        &self.active
    }

    /// Size of the lists in bytes.
    pub fn memory(&self) -> usize {
        size_of_val(&self.sorted[..]) + size_of_val(&self.starts[..]) + self.most * size_of::<u32>()
    }
}
