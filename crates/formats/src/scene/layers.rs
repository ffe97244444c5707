//! Several materials on one surface, as coincident surfaces that are each present with some
//! probability. Where one surface is absent the ray hits the next, so the shares are exact for any
//! materials.

use snell_scene::Material;
use snell_scene::material::{AlphaMode, ScalarParam};

/// Materials from the outermost to the innermost; empty for no surface at all. The opacity of each
/// is the probability that its layer is hit if the layers before it were not.
pub type Layers = Vec<Material>;

/// Maximum number of layers of a surface. Each level of nested blends doubles them.
pub const MAX_LAYERS: usize = 256;

/// Puts `top` on this share of the surface and `rest` elsewhere.
pub fn blend(top: Layers, rest: Layers, share: ScalarParam) -> Layers {
    if share == ScalarParam::constant(1.0) {
        return top;
    }
    if share == ScalarParam::constant(0.0) {
        return rest;
    }
    let mut layers = mask(top, share).0;
    layers.extend(rest);
    layers
}

/// Reduces the layers to this share of the surface. The result is false if only the last layer
/// could be reduced, because the share has a texture.
pub fn mask(mut layers: Layers, share: ScalarParam) -> (Layers, bool) {
    let (count, factor) = (layers.len(), share.factor.clamp(0.0, 1.0));
    if share.texture.is_some() {
        if let Some(last) = layers.last_mut() {
            last.alpha = share;
            last.alpha_mode = AlphaMode::Blend;
        }
        return (layers, count <= 1);
    }
    // The shares of rays that reach a layer before and after the reduction.
    let (mut before, mut after) = (1.0f32, 1.0f32);
    for layer in &mut layers {
        let own = if layer.alpha_mode == AlphaMode::Opaque { 1.0 } else { layer.alpha.factor };
        let met = before * own * factor;
        layer.alpha.factor = if after > 0.0 { (met / after).clamp(0.0, 1.0) } else { 0.0 };
        layer.alpha_mode = AlphaMode::Blend;
        before *= 1.0 - own;
        after -= met;
    }
    (layers, true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Rgb;
    use snell_scene::material::Diffuse;

    fn one() -> Layers {
        vec![Material::new("", Diffuse::new(Rgb::WHITE))]
    }

    /// The probability of a hit for each layer.
    fn met(layers: &Layers) -> Vec<f32> {
        let mut left = 1.0;
        let share = |layer: &Material| {
            let own = if layer.alpha_mode == AlphaMode::Opaque { 1.0 } else { layer.alpha.factor };
            let met: f32 = left * own;
            left -= met;
            (met * 1000.0).round() / 1000.0
        };
        layers.iter().map(share).collect()
    }

    #[test]
    fn blends_of_blends_have_their_shares() {
        let two = blend(one(), one(), 0.25.into());
        assert_eq!(met(&two), [0.25, 0.75]);
        let three = blend(two.clone(), one(), 0.4.into());
        assert_eq!(met(&three), [0.1, 0.3, 0.6]);
        assert_eq!(met(&mask(three, 0.5.into()).0), [0.05, 0.15, 0.3]);
        assert_eq!(blend(one(), two, 1.0.into()).len(), 1);
    }
}
