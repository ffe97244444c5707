//! AOVs of coverage: the keys of objects and materials, for Cryptomatte.

use super::{Aov, AovKind, Declared, Needs};
use crate::integrator::Context;
use snell_intersect::Hit;
use snell_math::Rgb;

/// The AOV of coverage by objects: instance and geometry.
pub const CRYPTO_OBJECT: Declared = Declared {
    name: "crypto-object",
    channels: &[],
    kind: AovKind::Coverage,
    needs: Needs::Nothing,
    values: |_, _, _, _| {},
    preview: |_, _| Rgb::BLACK,
};

/// The AOV of coverage by materials.
pub const CRYPTO_MATERIAL: Declared = Declared {
    name: "crypto-material",
    channels: &[],
    kind: AovKind::Coverage,
    needs: Needs::Nothing,
    values: |_, _, _, _| {},
    preview: |_, _| Rgb::BLACK,
};

/// The key of a hit: for objects made of its instance and geometry, for materials the number of the
/// material.
pub fn key(aov: Aov, context: &Context, hit: &Hit) -> u64 {
    match aov {
        Aov::CryptoObject => u64::from(hit.instance) << 32 | u64::from(hit.geometry),
        _ => u64::from(context.scene.material_id(hit).0),
    }
}
