//! Cameras, films and the other options before the world.

use super::*;
use snell_math::{DVec2, DVec3};
use snell_scene::Projection;

/// The image position of a point of the file, as fractions of the size from the upper left corner.
fn seen(scene: &Scene, point: DVec3) -> DVec2 {
    let point = scene.nodes[scene.root.index()].transform.transform_point3(point);
    let size = scene.settings.size.expect("the reader sets a size");
    let film = scene.cameras[0].project(point, size).expect("in view");
    film / DVec2::new(f64::from(size[0]), f64::from(size[1]))
}

#[test]
fn pictures_are_not_mirrored() {
    // pbrt's cameras see +x on the right in whatever direction LookAt points; only a transform that
    // mirrors flips them.
    for (text, right) in [
        ("", DVec3::new(0.2, 0.0, 1.0)),
        ("LookAt 0 0 -5  0 0 0  0 1 0", DVec3::new(0.5, 0.0, 0.0)),
        ("Scale -1 1 1 LookAt 0 0 -5  0 0 0  0 1 0", DVec3::new(-0.5, 0.0, 0.0)),
        ("LookAt 0 0 5  0 0 0  0 1 0", DVec3::new(-0.5, 0.0, 0.0)),
    ] {
        let scene = scene(&format!("{text} Camera \"perspective\" WorldBegin"));
        let at = seen(&scene, right + DVec3::Y * 0.1);
        assert!(at.x > 0.51 && at.y < 0.499, "{text}: {at}");
    }
}

#[test]
fn the_field_of_view_spans_the_shorter_side() {
    for (size, top) in
        [([200, 100], DVec3::new(0.0, 1.0, 1.0)), ([100, 200], DVec3::new(1.0, 0.0, 1.0))]
    {
        let text = format!(
            "Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" [{}] Camera \
                \"perspective\" \"float fov\" 90 WorldBegin",
            size[0], size[1]
        );
        let scene = scene(&text);
        let at = seen(&scene, top);
        assert!(at.x > 0.999 || at.y < 0.001, "{at}");
    }
}

#[test]
fn a_screen_window_cuts_a_part_out_of_the_view() {
    let film = "Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 100";
    let scene = scene(&format!(
        "{film} Camera \"perspective\" \"float screenwindow\" [0 1 -1 0] WorldBegin"
    ));
    assert!((seen(&scene, DVec3::Z) - DVec2::new(0.0, 0.0)).length() < 1e-9);
    assert!((seen(&scene, DVec3::new(1.0, -1.0, 1.0)) - DVec2::ONE).length() < 1e-9);
    assert!(scene.warnings.is_empty());
}

#[test]
fn an_orthographic_camera_is_scaled_by_its_transform() {
    let scene = scene("Scale .5 .5 .5 Camera \"orthographic\" WorldBegin");
    let Projection::Orthographic { half_size } = scene.cameras[0].projection else {
        panic!("not orthographic")
    };
    assert_eq!(half_size, [None, Some(2.0)]);
}

#[test]
fn realistic_cameras_have_the_view_of_their_focal_length() {
    let folder = tempfile::tempdir().expect("a folder");
    // A thin lens with the focal length 50 mm.
    std::fs::write(folder.path().join("a.dat"), "50 0 1.5 20\n-50 50 1 20\n").expect("written");
    let tan = |film: &str, camera: &str| {
        let text = format!(
            "Film \"rgb\" \"integer xresolution\" 400 \"integer yresolution\" 300 {film}\nCamera \
                \"realistic\" \"string lensfile\" \"a.dat\" {camera}\nWorldBegin"
        );
        let scene =
            testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"));
        assert!(scene.warnings[0].message.contains("50.0 mm"), "{:?}", scene.warnings);
        match scene.cameras[0].projection {
            Projection::Perspective { tan_half_fov: [None, Some(tan)] } => tan,
            ref other => panic!("{other:?}"),
        }
    };
    // The film's sides are 0.8 and 0.6 of its diagonal.
    let far = "\"float focusdistance\" 1e9";
    assert!((tan("", far) / (0.5 * 35.0 * 0.6 / 50.0) - 1.0).abs() < 1e-6);
    assert!((tan("\"float diagonal\" 50", far) / 0.3 - 1.0).abs() < 1e-6);
    // Sharp at twice the focal length, the film is there too.
    let near = "\"float focusdistance\" 0.1";
    assert!((tan("\"float diagonal\" 50", near) / 0.15 - 1.0).abs() < 1e-6);
}

#[test]
fn options_become_settings() {
    let scene = scene(
        "Film \"rgb\" \"integer xresolution\" 320 \"integer yresolution\" 200 \"float iso\" \
            400\nSampler \"halton\" \"integer pixelsamples\" 77\n\
         PixelFilter \"triangle\" \"float xradius\" 1 \"float yradius\" 1\nIntegrator \"volpath\" \
         \"integer maxdepth\" 9\nWorldBegin",
    );
    let settings = &scene.settings;
    assert_eq!(
        (settings.size, settings.spp, settings.max_depth),
        (Some([320, 200]), Some(77), Some(9))
    );
    assert_eq!((settings.filter.as_deref(), settings.imaging_ratio), (Some("tent"), Some(4.0)));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(super::scene("WorldBegin").settings.size, Some([1280, 720]));
    assert_eq!(super::scene("Film \"image\" WorldBegin").settings.size, Some([640, 480]));
}

#[test]
fn films_of_version_3_have_a_factor_and_no_clamp() {
    let text = "Film \"image\" \"float scale\" 8 \"float maxsampleluminance\" 2\nWorldBegin";
    assert_eq!(scene(text).settings.imaging_ratio, Some(8.0));
    assert!(warnings(text).contains("maxsampleluminance"));
}

#[test]
fn sensors_have_their_sensitivity_and_white_balance() {
    let read = |film: &str| {
        let text = format!("Film \"rgb\" {film}\nWorldBegin");
        let settings = scene(&text).settings;
        (settings.imaging_ratio, settings.white_balance, warnings(&text))
    };
    let silent = String::new;
    assert_eq!(read("\"string sensor\" \"cie1931\""), (None, None, silent()));
    assert_eq!(read("\"float whitebalance\" 3200"), (None, Some(3200.0), silent()));
    let (ratio, white, said) = read("\"string sensor\" \"canon_eos_5d\" \"float iso\" 50");
    assert_eq!((ratio, white), (Some(0.5), Some(6500.0)));
    assert!(said.contains("the sensor \"canon_eos_5d\""), "{said}");
    for (film, message) in [
        ("\"float iso\" -100", "multiplies light by -1: the picture is black"),
        ("\"float whitebalance\" 500", "the nearest temperature from 1000 to 25000 K"),
    ] {
        let said = read(film).2;
        assert!(said.contains(message), "{said}");
    }
}

#[test]
fn subsurface_scattering_lifts_the_limit_of_bounces() {
    let text = |depth: i32, material: &str| {
        format!(
            "Integrator \"volpath\" \"integer maxdepth\" {depth}\nWorldBegin Material {material} \
            Shape \"sphere\""
        )
    };
    let below = "\"subsurface\" \"rgb mfp\" [.02 .02 .02] \"rgb reflectance\" [.8 .8 .8]";
    let depth = |text: &str| scene(text).settings.max_depth;
    assert_eq!(depth(&text(5, below)), None);
    assert!(warnings(&text(5, below)).contains("\"maxdepth\" 5 was ignored"));
    assert_eq!(depth(&text(0, below)), Some(0), "only what emits");
    assert_eq!(depth(&text(5, "\"diffuse\"")), Some(5));
    assert_eq!(depth(&text(5, "\"diffusetransmission\"")), Some(5), "a thin sheet");
}

#[test]
fn the_recursive_integrator_of_version_3_has_soft_shadows() {
    let text = "Integrator \"whitted\" \"integer maxdepth\" 4\nWorldBegin";
    let settings = scene(text).settings;
    assert_eq!(settings.integrator.as_deref(), Some("whitted"));
    assert_eq!((settings.max_depth, settings.shadows.as_deref()), (Some(3), Some("soft")));
    assert_eq!(warnings(text), "");
}

#[test]
fn integrators_of_pbrt_2_are_read_and_what_else_it_had_is_named() {
    let text = "Renderer \"sampler\" SurfaceIntegrator \"directlighting\" VolumeIntegrator \
            \"emission\"\nWorldBegin Shape \"sphere\"
        Volume \"homogeneous\" \"point p0\" [0 0 0]";
    assert_eq!(scene(text).settings.integrator.as_deref(), Some("direct"));
    let said = warnings(text);
    for what in ["Renderer \"sampler\"", "VolumeIntegrator \"emission\"", "Volume \"homogeneous\""]
    {
        assert!(said.contains(&format!("{what} of pbrt 2 is left out")), "{what}: {said}");
    }
}
