//! Thin sheets with diffuse reflection and transmission: leaves, paper, cloth.

use snell_scene::Material;
use snell_scene::material::{ColorParam, OpenPbr};

/// A sheet with this diffuse reflectance and transmittance. If their sum exceeds 1, both are scaled
/// down.
pub fn letting_through(reflectance: ColorParam, transmittance: ColorParam) -> Material {
    let most = |color: ColorParam| color.factor.max_element().max(0.0);
    let (r, t) = (most(reflectance), most(transmittance));
    let share = if r + t > 0.0 { t / (r + t) } else { 0.0 };
    let at_most_one = if r + t > 1.0 { 1.0 / (r + t) } else { 1.0 };
    // A lobe that covers a part of the surface is divided by that part, so that the whole reflects
    // the given share.
    let of_part = |color: ColorParam, part: f32| ColorParam {
        factor: color.factor * (at_most_one / part.max(1e-6)),
        ..color
    };
    let kind = OpenPbr {
        base_color: of_part(reflectance, 1.0 - share),
        subsurface_weight: share.into(),
        subsurface_color: of_part(transmittance, share),
        subsurface_scatter_anisotropy: 1.0.into(),
        specular_weight: 0.0.into(),
        geometry_thin_walled: true,
        ..OpenPbr::default()
    };
    Material::new("", kind)
}
