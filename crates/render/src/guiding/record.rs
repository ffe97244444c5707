//! Training records along paths.

use snell_math::{SampledSpectrum, Vec3};

/// The number of vertices of a path that are recorded; later ones contribute little.
const MAX_VERTICES: u32 = 32;

/// The light that a path or photon brought from a direction.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// The point at which the direction was sampled.
    pub position: Vec3,
    /// The unit normal of the surface on the side of the viewer.
    pub normal: Vec3,
    /// The unit direction in which the path continued, or from which the photon came.
    pub direction: Vec3,
    /// For a photon its flux. For a path the square of incident radiance times the cosine, divided
    /// by the density of the direction.
    pub light: f32,
    /// Incident radiance times the cosine and the BSDF, divided by the density of the direction:
    /// the light that the vertex scattered.
    pub found: f32,
    /// The probability that this direction was sampled from the BSDF and not from the field.
    pub bsdf_share: f32,
}

/// A sampled direction, as the vertex function reports it.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// See [`Record::position`].
    pub position: Vec3,
    /// See [`Record::normal`].
    pub normal: Vec3,
    /// See [`Record::direction`].
    pub direction: Vec3,
    /// Density of the direction per steradian, times the survival probability of the path.
    pub pdf: f32,
    /// See [`Record::bsdf_share`].
    pub bsdf_share: f32,
}

/// A sampled direction whose light is not complete yet.
#[derive(Clone, Copy, Debug)]
struct Open {
    choice: Choice,
    sample: u32,
    /// The path's throughput before the bounce.
    before: SampledSpectrum,
    /// The path's throughput after the bounce.
    after: SampledSpectrum,
    /// The light that the path had collected before it found any from this direction.
    collected: SampledSpectrum,
}

const NONE: u32 = u32::MAX;

/// Records the paths of a part.
#[derive(Debug, Default)]
pub struct Recorder {
    open: Vec<Open>,
    /// For each sample, the last entry of `open`, until the path arrives at the next vertex.
    last: Vec<u32>,
}

impl Recorder {
    /// Starts a part with this many samples.
    pub fn start(&mut self, samples: usize) {
        self.open.clear();
        self.last.clear();
        self.last.resize(samples, NONE);
    }

    /// Records that a path arrives at a vertex. `collected` is the light that it has found at
    /// earlier vertices.
    pub fn arrive(&mut self, sample: u32, collected: SampledSpectrum) {
        let last = std::mem::replace(&mut self.last[sample as usize], NONE);
        if let Some(open) = self.open.get_mut(last as usize) {
            open.collected = collected;
        }
    }

    /// Records that a path continues in a sampled direction.
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

    /// Ends a part, and appends its records to `records`. `total` returns the radiance of each
    /// sample.
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
