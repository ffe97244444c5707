//! Classifies the light of a pixel by path, in Heckbert's notation (Heckbert, Adaptive radiosity
//! textures for bidirectional ray tracing, 1990).

use super::PathClass;
use snell_render::explain::{Addition, PathTree, Scattering};
use snell_render::integrator::light_part::Lobe;
use std::collections::BTreeMap;

/// Paths with more letters than this form one class.
const LONGEST: usize = 6;

/// Sums of all contributions to a pixel's samples by path class.
#[derive(Default)]
pub struct Classes {
    sums: BTreeMap<String, [f64; 3]>,
    weights: f64,
}

impl Classes {
    /// Adds a sample.
    pub fn add(&mut self, tree: &PathTree) {
        self.weights += f64::from(tree.weight);
        for addition in &tree.additions {
            let color = tree.color_of(addition.radiance);
            if color.to_array() == [0.0; 3] {
                continue;
            }
            let sum = self.sums.entry(way(tree, addition)).or_default();
            for (sum, c) in sum.iter_mut().zip(color.to_array()) {
                *sum += f64::from(c * tree.weight);
            }
        }
    }

    /// The contribution of each class to the pixel, the brightest first.
    pub fn finish(self) -> Vec<PathClass> {
        let divisor = if self.weights > 0.0 { self.weights } else { 1.0 };
        let luminance = |v: &[f64; 3]| 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
        let all: f64 = self.sums.values().map(&luminance).sum();
        let mut classes: Vec<PathClass> = self
            .sums
            .into_iter()
            .map(|(way, sum)| PathClass {
                way,
                value: sum.map(|v| (v / divisor) as f32),
                share: if all > 0.0 { (luminance(&sum) / all) as f32 } else { 0.0 },
            })
            .collect();
        classes.sort_by(|a, b| b.share.total_cmp(&a.share).then_with(|| a.way.cmp(&b.way)));
        classes
    }
}

/// The class of a path: its letters from the eye to the light. What photons have met is not known
/// any more; they land on surfaces that scatter light in all directions or nearly so.
fn way(tree: &PathTree, addition: &Addition) -> String {
    let vertex = addition.vertex;
    let mut letters = Vec::new();
    if addition.by_photons {
        letters.push('D');
    }
    if let Some(light) = addition.light_ray.and_then(|i| tree.vertices[vertex].light_rays.get(i)) {
        letters.push(letter(light.lobe, false));
    }
    let mut at = Some(vertex);
    while let Some(vertex) = at.map(|i| &tree.vertices[i]) {
        if let Some(Scattering { lobe, is_delta, .. }) = vertex.scattering {
            letters.push(letter(lobe, is_delta));
        }
        at = vertex.parent;
    }
    letters.reverse();
    let is_cut = letters.len() > LONGEST || addition.by_photons;
    let ellipsis = if is_cut { "…" } else { "" };
    letters.truncate(LONGEST);
    format!("E{}{ellipsis}L", letters.into_iter().collect::<String>())
}

fn letter(lobe: Lobe, is_delta: bool) -> char {
    match lobe {
        Lobe::Diffuse => 'D',
        Lobe::Specular if is_delta => 'S',
        Lobe::Specular => 'G',
        Lobe::Transmission => 'T',
        Lobe::Volume => 'V',
    }
}
