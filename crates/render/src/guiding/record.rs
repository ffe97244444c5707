//! Training records along paths.

use snell_math::{SampledSpectrum, Vec3};

/// The number of vertices of a path that are recorded; later ones contribute little.
const MAX_VERTICES: u32 = 32;

/// The light that a path found in a direction.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// The point at which the direction was sampled.
    pub position: Vec3,
    /// The surface's normal on the side of the viewer.
    pub normal: Vec3,
    /// The direction; unit.
    pub direction: Vec3,
    /// Of a photon: its flux. Of a path: the square of incident radiance times the cosine, over the
    /// density of the direction.
    pub light: f32,
    /// Incident radiance times the cosine and the BSDF, over the density of the direction: the
    /// light that the vertex scattered.
    pub found: f32,
    /// The probability that the direction came from the BSDF, given the direction.
    pub bsdf_share: f32,
}

/// A sampled direction, as the vertex function reports it.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// As in [`Record`].
    pub position: Vec3,
    /// As in [`Record`].
    pub normal: Vec3,
    /// As in [`Record`].
    pub direction: Vec3,
    /// Density of the direction per steradian, times the survival probability of the path.
    pub pdf: f32,
    /// As in [`Record`].
    pub bsdf_share: f32,
}

/// A sampled direction whose light is not known yet.
#[derive(Clone, Copy, Debug)]
struct Open {
    choice: Choice,
    sample: u32,
    /// The path's throughput before and after the choice.
    before: SampledSpectrum,
    after: SampledSpectrum,
    /// The light of the path before the contribution of this direction.
    collected: SampledSpectrum,
}

const NONE: u32 = u32::MAX;

/// Records the paths of a part.
#[derive(Debug, Default)]
pub struct Recorder {
    open: Vec<Open>,
    /// The last sampled direction of each sample, until its path arrives at a vertex.
    last: Vec<u32>,
}

impl Recorder {
    /// Starts a part of this many samples.
    pub fn start(&mut self, samples: usize) {
        self.open.clear();
        self.last.clear();
        self.last.resize(samples, NONE);
    }

    /// Reports that a path arrives at a vertex, with the light of earlier ones.
    pub fn arrive(&mut self, sample: u32, collected: SampledSpectrum) {
        let last = std::mem::replace(&mut self.last[sample as usize], NONE);
        if let Some(open) = self.open.get_mut(last as usize) {
            open.collected = collected;
        }
    }

    /// Reports that a path continues.
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

    /// Ends a part; `total` is the radiance of each sample.
    pub fn finish(&mut self, total: impl Fn(u32) -> SampledSpectrum, records: &mut Vec<Record>) {
        records.extend(self.open.iter().map(|open| {
            let brought = (total(open.sample) - open.collected).map(|x| x.max(0.0));
            let Choice { position, normal, direction, pdf, bsdf_share } = open.choice;
            let incident = mean_ratio(brought, open.after) * direction.dot(normal).abs();
            let light = incident * incident / pdf;
            let found = mean_ratio(brought, open.before);
            // Values that are not finite count as 0, as they do in the picture.
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
