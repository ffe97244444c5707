//! The output of the methods: an item for each pixel.

use super::facet::{centre, is_nearer};
use super::{NOTHING, Screen};

/// A picture that is being painted.
pub(super) struct Canvas {
    width: u32,
    pub items: Vec<u32>,
    cost: Option<Vec<u32>>,
}

/// The result of a method, and its cost.
#[derive(Clone, Debug)]
pub struct Seen {
    /// For each pixel, in rows from the top, the number of the facet that is visible at its centre
    /// ([`Screen::primitive`]), or [`NOTHING`].
    pub items: Vec<u32>,
    /// Named counts of the method's own operations.
    pub work: Vec<(&'static str, u64)>,
    /// Bytes that the method needed besides the facets and the picture: its largest lists. `None`
    /// if unknown.
    pub memory: Option<usize>,
    /// Work per pixel, if requested and defined: see [`super::Characterization::cost`].
    pub cost: Option<Vec<u32>>,
}

impl Canvas {
    /// An empty picture; `with_cost` enables counting work per pixel.
    pub fn new(screen: &Screen, with_cost: bool) -> Self {
        let [width, height] = screen.size;
        let count = width as usize * height as usize;
        Self { width, items: vec![NOTHING; count], cost: with_cost.then(|| vec![0; count]) }
    }

    /// The number of pixels.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// The index of a pixel.
    #[inline(always)]
    pub fn pixel(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// Counts work at a pixel.
    #[inline(always)]
    pub fn charge(&mut self, pixel: usize) {
        if let Some(cost) = &mut self.cost {
            cost[pixel] = cost[pixel].saturating_add(1);
        }
    }

    /// Stores a facet in those pixels of a row where it is the nearest so far; `depth` is the row's
    /// depth buffer. Returns the number of pixels tested and written.
    pub fn keep_nearest(
        &mut self,
        screen: &Screen,
        item: u32,
        y: u32,
        depth: &mut [f64],
    ) -> [u64; 2] {
        let facet = &screen.facets[item as usize];
        let [low, end] = facet.span(y);
        let mut written = 0;
        for x in low..end {
            let (near, pixel) = (facet.nearness.at(centre(x, y)), self.pixel(x, y));
            self.charge(pixel);
            let old = self.items[pixel];
            if old == NOTHING || is_nearer((item, near), (old, depth[x as usize])) {
                (self.items[pixel], depth[x as usize]) = (item, near);
                written += 1;
            }
        }
        [u64::from(end.saturating_sub(low)), written]
    }

    /// Adds work at a pixel.
    pub fn charge_more(&mut self, x: u32, y: u32, amount: u32) {
        let pixel = self.pixel(x, y);
        if let Some(cost) = &mut self.cost {
            cost[pixel] = cost[pixel].saturating_add(amount);
        }
    }

    /// Counts work at all pixels of a rectangle; `end` is exclusive.
    pub fn charge_window(&mut self, low: [u32; 2], end: [u32; 2]) {
        if self.cost.is_some() {
            for y in low[1]..end[1] {
                (low[0]..end[0]).for_each(|x| self.charge(self.pixel(x, y)));
            }
        }
    }

    /// Fills columns `low..end` of a row.
    pub fn fill(&mut self, y: u32, [low, end]: [u32; 2], item: u32) {
        if low < end {
            let first = self.pixel(low, y);
            self.items[first..first + (end - low) as usize].fill(item);
        }
    }

    /// The finished picture.
    pub fn seen(self, work: Vec<(&'static str, u64)>, memory: usize) -> Seen {
        Seen { items: self.items, work, memory: Some(memory), cost: self.cost }
    }

    /// The finished picture of a method without work per pixel.
    pub fn seen_without_cost(self, work: Vec<(&'static str, u64)>, memory: usize) -> Seen {
        Seen { items: self.items, work, memory: Some(memory), cost: None }
    }
}
