//! AOVs that hold parts of the light.

use super::colors;
use super::{AovKind, Declared, Needs};
use crate::integrator::light_part::{LightPart, Lobe, Scatterings};

/// The declaration of the AOV of every part. Its values are added during light transport.
pub const LIGHT: Declared = Declared {
    name: "light",
    channels: &["R", "G", "B"],
    kind: AovKind::Averaged,
    needs: Needs::Nothing,
    values: |_, _, _, values| values.extend([0.0; 3]),
    preview: colors::color,
};

/// The parts that can be AOVs without light groups.
pub const PARTS: [LightPart; 11] = [
    part(None, Scatterings::None),
    part(None, Scatterings::One),
    part(None, Scatterings::Many),
    part(Some(Lobe::Diffuse), Scatterings::One),
    part(Some(Lobe::Diffuse), Scatterings::Many),
    part(Some(Lobe::Specular), Scatterings::One),
    part(Some(Lobe::Specular), Scatterings::Many),
    part(Some(Lobe::Transmission), Scatterings::One),
    part(Some(Lobe::Transmission), Scatterings::Many),
    part(Some(Lobe::Volume), Scatterings::One),
    part(Some(Lobe::Volume), Scatterings::Many),
];

const fn part(lobe: Option<Lobe>, scatterings: Scatterings) -> LightPart {
    LightPart { lobe, scatterings: Some(scatterings), group: None }
}

/// The name of a part of the light, without its group.
pub fn name(part: LightPart) -> &'static str {
    use {Lobe as L, Scatterings as S};
    match (part.lobe, part.scatterings) {
        (None, None) => LIGHT.name,
        (None, Some(S::None)) | (Some(_), Some(S::None)) => "emission",
        (None, Some(S::One)) => "direct",
        (None, Some(S::Many)) => "indirect",
        (Some(L::Diffuse), Some(S::One)) => "diffuse-direct",
        (Some(L::Diffuse), Some(S::Many)) => "diffuse-indirect",
        (Some(L::Specular), Some(S::One)) => "specular-direct",
        (Some(L::Specular), Some(S::Many)) => "specular-indirect",
        (Some(L::Transmission), Some(S::One)) => "transmission-direct",
        (Some(L::Transmission), Some(S::Many)) => "transmission-indirect",
        (Some(L::Volume), Some(S::One)) => "volume-direct",
        (Some(L::Volume), Some(S::Many)) => "volume-indirect",
        (Some(L::Diffuse), None) => "diffuse",
        (Some(L::Specular), None) => "specular",
        (Some(L::Transmission), None) => "transmission",
        (Some(L::Volume), None) => "volume",
    }
}
