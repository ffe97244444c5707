//! Materials and their colours.

use super::*;
use snell_math::Rgb;
use snell_scene::material::{ConductorSpectrum, HeightUnit, MaterialKind};

#[test]
fn materials_map_to_ours() {
    let of = |text: &str| {
        let scene = world(&format!("{text} Shape \"sphere\""));
        material(&scene).kind.clone()
    };
    let MaterialKind::Conductor(metal) = of("Material \"conductor\" \"float roughness\" 0.04")
    else {
        panic!("no metal")
    };
    // In pbrt the parameter alpha of the microfacets is the root of the roughness; in Snell alpha
    // is the square of the roughness.
    assert!(
        close(metal.roughness.factor, 0.04f32.sqrt().sqrt())
            && matches!(metal.spectrum, ConductorSpectrum::Metal(_))
    );
    let MaterialKind::Conductor(metal) =
        of("Material \"conductor\" \"float roughness\" 0.04 \"bool remaproughness\" false")
    else {
        panic!("no metal")
    };
    assert!(close(metal.roughness.factor, 0.2));
    let MaterialKind::Dielectric(glass) = of("Material \"dielectric\" \"float eta\" 1.33") else {
        panic!("no glass")
    };
    assert_eq!((glass.ior.at_line_d(), glass.roughness.factor), (1.33, 0.0));
    let MaterialKind::CoatedDiffuse(coated) =
        of("Material \"coateddiffuse\" \"rgb reflectance\" [1 0 0]")
    else {
        panic!("no coat")
    };
    assert_eq!((coated.reflectance.factor, coated.ior), (Rgb::new(1.0, 0.0, 0.0), 1.5));
    let MaterialKind::CoatedConductor(coated) =
        of("Material \"coatedconductor\" \"float interface.roughness\" 0.04")
    else {
        panic!("no coat")
    };
    assert!(close(coated.roughness.factor, 0.04f32.sqrt().sqrt()));
    let MaterialKind::Conductor(stretched) =
        of("Material \"conductor\" \"float uroughness\" 0.04 \"float vroughness\" 0.01 \"bool \
            remaproughness\" false")
    else {
        panic!("no stretched metal")
    };
    assert!(close(stretched.anisotropy.factor, 0.75));
    let MaterialKind::Diffuse(_) =
        of("MakeNamedMaterial \"a\" \"string type\" \"diffuse\" NamedMaterial \"a\"")
    else {
        panic!("not diffuse")
    };
}

#[test]
fn materials_of_the_third_version_are_understood() {
    let of = |text: &str| material(&world(&format!("{text} Shape \"sphere\""))).kind.clone();
    let MaterialKind::Plastic(plastic) = of(
        "Material \"plastic\" \"color Kd\" [.4 .2 .2] \"color Ks\" [.5 .5 .5] \"float roughness\" \
            .025",
    ) else {
        panic!("no plastic")
    };
    assert_eq!(
        (plastic.diffuse.factor, plastic.specular.factor),
        (Rgb::new(0.4, 0.2, 0.2), Rgb::splat(0.5))
    );
    assert!(
        (plastic.roughness.factor.powi(2) - 0.2156).abs() < 0.001,
        "{}",
        plastic.roughness.factor.powi(2)
    );
    let MaterialKind::Diffuse(_) = of("Material \"matte\" \"float sigma\" 0") else {
        panic!("not diffuse")
    };
    let MaterialKind::Mirror(_) = of("Material \"mirror\"") else { panic!("no mirror") };
    let MaterialKind::Dielectric(glass) =
        of("Material \"glass\" \"float index\" 1.2 \"rgb Kt\" [1 0 0]")
    else {
        panic!("no glass")
    };
    assert_eq!((glass.ior.at_line_d(), glass.tint.factor), (1.2, Rgb::new(1.0, 0.0, 0.0)));
}

#[test]
fn displacement_is_a_map_of_bumps_in_units_of_the_scene() {
    let noise = "Texture \"h\" \"float\" \"wrinkled\" Texture \"low\" \"float\" \"scale\" \
        \"texture tex\" \"h\" \"float scale\" 0.25 ";
    for name in ["displacement", "bumpmap"] {
        let text =
            format!("{noise} Material \"diffuse\" \"texture {name}\" \"low\" Shape \"sphere\"");
        let scene = world(&text);
        assert_eq!(scene.warnings, [], "{name}");
        let map = material(&scene).bump_map.expect("a map");
        assert_eq!((map.height, map.unit), (0.25, HeightUnit::Scene), "{name}");
    }
    let flat = world("Material \"diffuse\" \"float displacement\" 3 Shape \"sphere\"");
    assert_eq!((material(&flat).bump_map, flat.warnings.as_slice()), (None, &[][..]));
}

#[test]
fn sheets_and_depths_have_their_colours() {
    let of = |text: &str| match material(&world(&format!("{text} Shape \"sphere\""))).kind.clone() {
        MaterialKind::OpenPbr(surface) => surface,
        other => panic!("{other:?}"),
    };
    let sheet = of(
        "Material \"diffusetransmission\" \"rgb reflectance\" [.2 .1 0] \"rgb transmittance\" [.6 \
            .6 .6]",
    );
    let through = sheet.subsurface_color.factor * sheet.subsurface_weight.factor;
    let back = sheet.base_color.factor * (1.0 - sheet.subsurface_weight.factor);
    assert!(
        sheet.geometry_thin_walled
            && close(through.r, 0.6)
            && close(back.r, 0.2)
            && close(back.g, 0.1)
    );
    let skin =
        of("Material \"subsurface\" \"rgb reflectance\" [.8 .5 .3] \"rgb mfp\" [2 1 .5] \"float \
            scale\" 3");
    assert_eq!(
        (skin.subsurface_radius.factor, skin.subsurface_radius_scale.factor),
        (6.0, Rgb::new(1.0, 0.5, 0.25))
    );
    let ketchup = of("Material \"subsurface\" \"string name\" \"Ketchup\"").subsurface_color.factor;
    assert!(ketchup.r > 4.0 * ketchup.g, "{ketchup:?}");
}

#[test]
fn mixes_are_layers_with_their_shares() {
    let scene = world(
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string \
            type\" \"conductor\"\n\
        Material \"mix\" \"string materials\" [ \"a\" \"b\" ] \"float amount\" 0.25 Shape \
        \"sphere\"",
    );
    let layers: Vec<_> = scene.materials.iter().map(|m| (m.kind.name(), m.alpha.factor)).collect();
    assert_eq!(layers, [("conductor", 0.25), ("diffuse", 1.0)]);
}

#[test]
fn alpha_makes_surfaces_of_one_material_differ() {
    let scene = world(
        "Material \"diffuse\" Shape \"sphere\" Shape \"sphere\" \"float alpha\" 0.25 Shape \
            \"sphere\" \"float alpha\" 0.25",
    );
    let alphas: Vec<f32> = scene.materials.iter().map(|m| m.alpha.factor).collect();
    assert_eq!(alphas, [1.0, 0.25]);
}

#[test]
fn colours_of_other_spaces_are_converted() {
    let color = |space: &str, rgb: &str| {
        let scene = world(&format!(
            "ColorSpace \"{space}\" Material \"diffuse\" \"rgb reflectance\" [{rgb}] Shape \
                \"sphere\""
        ));
        diffuse(material(&scene)).to_array()
    };
    for space in ["srgb", "rec2020", "dci-p3", "aces2065-1"] {
        let white = color(space, "1 1 1");
        assert!(white.iter().all(|c| (c - 1.0).abs() < 1e-3), "{space}: {white:?}");
    }
    let red = color("rec2020", "1 0 0");
    assert!(red[0] > 1.5 && red[1] == 0.0, "{red:?}");
}

#[test]
fn spectra_become_colours() {
    let color = |spectrum: &str| {
        diffuse(material(&world(&format!(
            "Material \"diffuse\" \"spectrum reflectance\" [{spectrum}] Shape \"sphere\""
        ))))
        .to_array()
    };
    let grey = color("300 .5 900 .5");
    assert!(grey.iter().all(|c| (c - 0.5).abs() < 1e-3), "{grey:?}");
    let red = color("300 0 590 0 600 1 900 1");
    assert!(red[0] > 0.5 && red[1] < 0.2 && red[2] < 0.05, "{red:?}");
}

#[test]
fn hair_has_its_absorption_its_colour_or_its_pigments() {
    let hair = |text: &str| {
        let scene = scene(&format!("WorldBegin Material \"hair\" {text} Shape \"sphere\""));
        let MaterialKind::Hair(hair) = scene.materials[0].kind.clone() else { panic!("hair") };
        (hair, scene.warnings.len())
    };
    let (brown, _) =
        hair("\"float beta_m\" 0.2 \"float beta_n\" 0.4 \"float alpha\" 3 \"float eta\" 1.6");
    assert_eq!((brown.eumelanin, brown.scale_tilt, brown.ior), (1.3.into(), 3.0, 1.6));
    assert_eq!((brown.longitudinal_roughness, brown.azimuthal_roughness), (0.2.into(), 0.4.into()));
    let (red, _) = hair("\"float pheomelanin\" 2");
    assert_eq!((red.eumelanin, red.pheomelanin), (0.0.into(), 2.0.into()));
    let (dyed, warnings) = hair("\"rgb reflectance\" [0.5 0.25 0.125]");
    assert_eq!(
        (dyed.color.factor, dyed.eumelanin, warnings),
        (Rgb::new(0.5, 0.25, 0.125), 0.0.into(), 0)
    );
    let (absorbing, warnings) = hair("\"rgb sigma_a\" [0.5 1 4] \"float eumelanin\" 1");
    assert_eq!(
        (absorbing.sigma_a.factor, absorbing.eumelanin, warnings),
        (Rgb::new(0.5, 1.0, 4.0), 0.0.into(), 1)
    );
}

#[test]
fn what_is_named_and_not_defined_is_left_out_with_a_warning() {
    let said = warnings(
        "WorldBegin\nMaterial \"diffuse\" \"texture reflectance\" \"none\"\nShape \"sphere\"\n\
            NamedMaterial \"none\"\nShape \"sphere\"\nMediumInterface \"none\" \"\"\n\
            Shape \"sphere\"\nObjectInstance \"none\"\n",
    );
    for what in ["spectrum texture", "material", "object"] {
        assert!(said.contains(&format!("there is no {what} \"none\" so far; ")), "{what}: {said}");
    }
    assert!(said.contains("there is no medium \"none\" in the scene; "), "{said}");
}
