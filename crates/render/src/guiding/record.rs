//! What is written down along paths while a field learns.

use snell_math::{SampledSpectrum, Vec3};

/// Vertices of a path that are written down; later ones carry little.
const MAX_VERTICES: u32 = 32;

/// What a path found in a direction.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// The point that the direction was chosen at.
    pub position: Vec3,
    /// The surface's normal on the side of the viewer.
    pub normal: Vec3,
    /// The direction; unit.
    pub direction: Vec3,
    /// Of a photon: its flux. Of a path: the square of incident radiance times the cosine, over the
    /// density of the direction.
    pub light: f32,
    /// Incident radiance times the cosine and the BSDF, over the density of the direction: what the
    /// vertex sent on.
    pub found: f32,
    /// The probability that the direction came from the BSDF, given the direction.
    pub bsdf_share: f32,
}

/// A choice of direction, as the vertex function reports it.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// As in [`Record`].
    pub position: Vec3,
    /// As in [`Record`].
    pub normal: Vec3,
    /// As in [`Record`].
    pub direction: Vec3,
    /// Density of the direction per steradian, times the probability that the path goes on.
    pub pdf: f32,
    /// As in [`Record`].
    pub bsdf_share: f32,
}

/// A choice whose outcome is open.
#[derive(Clone, Copy, Debug)]
struct Open {
    choice: Choice,
    sample: u32,
    /// The path's throughput before and after the choice.
    before: SampledSpectrum,
    after: SampledSpectrum,
    /// What the path had brought before anything came from the direction.
    collected: SampledSpectrum,
}

const NONE: u32 = u32::MAX;

/// Writes down what the paths of a part do.
#[derive(Debug, Default)]
pub struct Recorder {
    open: Vec<Open>,
    /// The last open choice of each sample, until its path arrives somewhere.
    last: Vec<u32>,
}

impl Recorder {
    /// Begins a part of this many samples.
    pub fn start(&mut self, samples: usize) {
        self.open.clear();
        self.last.clear();
        self.last.resize(samples, NONE);
    }

    /// A path arrives at a vertex, with this brought by earlier ones.
    pub fn arrive(&mut self, sample: u32, collected: SampledSpectrum) {
        let last = std::mem::replace(&mut self.last[sample as usize], NONE);
        if let Some(open) = self.open.get_mut(last as usize) {
            open.collected = collected;
        }
    }

    /// A path goes on.
    pub fn leave(
        &mut self,
        sample: u32,
        depth: u32,
        choice: Choice,
        before: SampledSpectrum,
        after: SampledSpectrum,
    ) {
        if depth < MAX_VERTICES {
            self.last[sample as usize] = self.open.len() as u32;
            self.open.push(Open {
                choice,
                sample,
                before,
                after,
                collected: SampledSpectrum::ZERO,
            });
        }
    }

    /// Ends a part: `total` is what each sample brought.
    pub fn finish(&mut self, total: impl Fn(u32) -> SampledSpectrum, records: &mut Vec<Record>) {
        records.extend(self.open.iter().map(|open| {
            let brought = (total(open.sample) - open.collected).map(|x| x.max(0.0));
            let Choice { position, normal, direction, pdf, bsdf_share } = open.choice;
            let incident = mean_ratio(brought, open.after) * direction.dot(normal).abs();
            let light = incident * incident / pdf;
            let found = mean_ratio(brought, open.before);
            // What is not finite counts as nothing, as it does in the picture.
            let valid = light.is_finite() && found.is_finite();
            let [light, found] = [light, found].map(|x| if valid { x } else { 0.0 });
            Record { position, normal, direction, light, found, bsdf_share }
        }));
        self.open.clear();
    }
}

/// The mean of `a / b` over the lanes where `b` is not 0.
fn mean_ratio(a: SampledSpectrum, b: SampledSpectrum) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in a.0.into_iter().zip(b.0) {
        if b > 0.0 {
            sum += a / b;
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}
