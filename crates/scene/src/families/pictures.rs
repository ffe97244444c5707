//! The pictures of the reference pages: for each kind of a family, the arguments of `snell render`
//! that draw it. The scenes are `scenes/preview-*.snell`, or built in.

use super::Family;

/// The arguments of `snell render` that draw a kind.
pub(super) fn arguments(family: &Family, kind: &str) -> String {
    let of_kind = |(of, name, _): &&(&str, &str, &str)| *of == family.name && *name == kind;
    let scene = format!("scenes/preview-{}.snell", family.name);
    match PICTURES.iter().find(of_kind) {
        Some((_, _, given)) if given.starts_with('-') => format!("{scene} {given}"),
        Some((_, _, given)) => (*given).to_string(),
        None => format!("{scene} {}", usual(family.name, kind)),
    }
}

/// The changes of a preview scene that show a kind without a line in [`PICTURES`].
fn usual(family: &str, kind: &str) -> String {
    match family {
        "material" => format!("-D material.ball.kind={kind}"),
        "pattern" => format!("-D 'texture.2={{\"pattern\":\"{kind}\"}}'"),
        "light" => format!("-D 'light.0={{\"light\":\"{kind}\"}}'"),
        _ => format!("-D node.{kind}.isolated=true"),
    }
}

/// Families, kinds, and what draws them: changes of the family's preview scene, or a scene with its
/// options.
const PICTURES: &[(&str, &str, &str)] = &[
    (
        "material",
        "black",
        "-D material.ball.kind=black -D material.ball.emission.factor=[0.9,0.5,0.2]",
    ),
    (
        "material",
        "phong",
        "-D material.ball.kind=phong -D material.ball.diffuse.factor=[0.5,0.1,0.1] \
         -D material.ball.specular.factor=[0.4,0.4,0.4] -D material.ball.shininess=40",
    ),
    (
        "material",
        "conductor",
        r#"-D 'material.ball.kind={"material":"conductor","spectrum":{"metal":"gold"},"roughness":{"factor":0.3}}'"#,
    ),
    (
        "material",
        "plastic",
        "-D material.ball.kind=plastic -D material.ball.diffuse.factor=[0.1,0.3,0.6]",
    ),
    (
        "material",
        "metallic-roughness",
        "-D material.ball.kind=metallic-roughness -D material.ball.metallic.factor=1 \
         -D material.ball.base_color.factor=[0.9,0.6,0.4] -D material.ball.roughness.factor=0.4",
    ),
    (
        "material",
        "interface",
        "-D material.ball.kind=interface -D material.ball.emission.factor=[0.9,0.5,0.2]",
    ),
    (
        "material",
        "open-pbr",
        "-D material.ball.kind=open-pbr -D material.ball.base_color.factor=[0.5,0.05,0.08] \
         -D material.ball.coat_weight.factor=1",
    ),
    (
        "material",
        "coated-diffuse",
        "-D material.ball.kind=coated-diffuse -D material.ball.reflectance.factor=[0.3,0.5,0.2] \
         -D material.ball.roughness.factor=0.2",
    ),
    ("material", "hair", "hair --size 320x240"),
    (
        "pattern",
        "checkerboard",
        r#"-D 'texture.2={"pattern":"checkerboard","odd":{"factor":[0.1,0.3,0.5]},"mapping":{"uv":{"uv_transform":[[8,0,0],[0,8,0]]}}}'"#,
    ),
    (
        "pattern",
        "solid-checkerboard",
        r#"-D 'texture.2={"pattern":"solid-checkerboard","odd":{"factor":[0.6,0.1,0.1]},"texture_from_world":[[2,0,0,0],[0,2,0,0],[0,0,2,0]]}'"#,
    ),
    (
        "pattern",
        "dots",
        r#"-D 'texture.2={"pattern":"dots","inside":{"factor":[0.1,0.25,0.15]},"outside":{"factor":[0.9,0.75,0.1]},"mapping":{"uv":{"uv_transform":[[12,0,0],[0,8,0]]}}}'"#,
    ),
    (
        "pattern",
        "bilerp",
        r#"-D 'texture.2={"pattern":"bilerp","v00":{"factor":[0.9,0.1,0.1]},"v01":{"factor":[0.1,0.7,0.2]},"v10":{"factor":[0.1,0.2,0.8]},"v11":{"factor":[0.9,0.8,0.2]}}'"#,
    ),
    (
        "pattern",
        "fbm",
        r#"-D 'texture.1={"pattern":"fbm","texture_from_world":[[2,0,0,0],[0,2,0,0],[0,0,2,0]]}' -D 'texture.2={"pattern":"mix","first":{"factor":[0.2,0.35,0.7]},"second":{"factor":[1,1,1]},"amount":{"factor":[1,1,1],"texture":1}}'"#,
    ),
    (
        "pattern",
        "windy",
        r#"-D 'texture.1={"pattern":"windy","texture_from_world":[[9,0,0,0],[0,9,0,0],[0,0,9,0]]}' -D 'texture.2={"pattern":"mix","first":{"factor":[0.02,0.15,0.2]},"second":{"factor":[0.7,0.9,0.9]},"amount":{"factor":[1,1,1],"texture":1}}'"#,
    ),
    ("pattern", "marble", r#"-D 'texture.2={"pattern":"marble","scale":4,"variation":1.5}'"#),
    (
        "pattern",
        "scale",
        r#"-D 'texture.2={"pattern":"scale","texture":{"factor":[1,1,1],"texture":1},"scale":{"factor":[1,0.55,0.35]}}'"#,
    ),
    (
        "pattern",
        "mix",
        r#"-D 'texture.2={"pattern":"mix","first":{"factor":[0.1,0.2,0.5]},"second":{"factor":[0.9,0.6,0.2]},"amount":{"factor":[1,1,1],"texture":1}}'"#,
    ),
    (
        "pattern",
        "direction-mix",
        r#"-D 'texture.2={"pattern":"direction-mix","first":{"factor":[0.9,0.9,0.95]},"second":{"factor":[0.25,0.15,0.08]}}'"#,
    ),
    (
        "pattern",
        "power",
        r#"-D 'texture.2={"pattern":"power","base":{"factor":[1,1,1],"texture":1},"exponent":3}'"#,
    ),
    (
        "pattern",
        "ramp",
        r#"-D 'texture.2={"pattern":"ramp","amount":{"factor":[1,1,1],"texture":1},"colors":[[0.05,0.02,0.1],[0.7,0.1,0.1],[1,0.8,0.3]]}'"#,
    ),
    (
        "pattern",
        "projected",
        r#"-D 'texture.1={"pattern":"checkerboard","odd":{"factor":[0.1,0.4,0.3]}}' -D 'texture.2={"pattern":"projected","texture":{"factor":[1,1,1],"texture":1},"mapping":{"planar":{"st_from_world":[[3,0,0,0],[0,3,0,0]]}}}'"#,
    ),
    ("medium", "grid", "smoke --size 320x240"),
    (
        "light",
        "directional",
        r#"-D 'light.0={"light":"directional","direction":[-0.5,-1,-0.4],"irradiance":[3,3,3]}'"#,
    ),
    (
        "light",
        "point",
        r#"-D 'light.0={"light":"point","position":[1,4,2],"intensity":[30,30,30]}'"#,
    ),
    (
        "light",
        "spot",
        r#"-D 'light.0={"light":"spot","position":[1,5,3],"direction":[-0.2,-0.85,-0.45],"intensity":[70,70,70],"falloff":{"falloff":"smooth","inner":0.25,"outer":0.4}}'"#,
    ),
    (
        "light",
        "profile",
        r#"-D 'light.0={"light":"profile","position":[0,4.5,1],"world_from_light":[1,0,0,0,0,-1,0,-1,0],"scale":[12,12,12],"table":{"polar":[0,0.2,0.3,0.4,0.6],"azimuth":[0],"values":[[3,3,3],[2,2,2],[0.5,0.5,0.5],[2,2,2],[0,0,0]]}}'"#,
    ),
    (
        "light",
        "projector",
        r#"-D 'light.0={"light":"projector","position":[0,5,1.5],"world_from_light":[1,0,0,0,0,-1,0,-1,0],"scale":[25,25,25],"slide":{"width":3,"height":2,"values":[[1,0.1,0.1],[0.1,1,0.1],[0.1,0.1,1],[1,1,0.1],[0.1,1,1],[1,0.1,1]],"half_size":[0.6,0.4]}}'"#,
    ),
    (
        "light",
        "disk",
        r#"-D 'light.0={"light":"disk","position":[0.5,4,2],"direction":[0,-0.9,-0.4],"radius":1.5,"emission":[20,20,20]}'"#,
    ),
    (
        "light",
        "rectangle",
        r#"-D 'light.0={"light":"rectangle","center":[0.5,4,1],"axes":[[1,0,0],[0,0,1]],"lengths":[5,0.4],"emission":[20,20,20]}'"#,
    ),
    (
        "projection",
        "perspective",
        r#"spheres --size 320x180 -D 'camera.main.projection={"projection":"perspective","tan_half_fov":[null,0.3]}'"#,
    ),
    (
        "projection",
        "intrinsics",
        r#"spheres --size 320x180 -D 'camera.main.projection={"projection":"intrinsics","focal_length":[900,900],"principal_point":[400,225],"size":[800,450],"distortion":[-0.6,0.3,0,0,0,0,0,0,0,0,0,0]}'"#,
    ),
    (
        "projection",
        "orthographic",
        r#"spheres --size 320x180 -D 'camera.main.projection={"projection":"orthographic","half_size":[4.6,null]}'"#,
    ),
    (
        "projection",
        "panoramic",
        r#"spheres --size 320x160 -D camera.main.eye=[0,1.3,3.2] -D 'camera.main.projection={"projection":"panoramic"}'"#,
    ),
    (
        "projection",
        "equal-area",
        r#"spheres --size 240x240 -D camera.main.eye=[0,1.3,3.2] -D 'camera.main.projection={"projection":"equal-area"}'"#,
    ),
    (
        "projection",
        "fisheye",
        r#"spheres --size 240x240 -D camera.main.eye=[0,1.3,3.2] -D 'camera.main.projection={"projection":"fisheye","max_angle":3.1415927}'"#,
    ),
];
