//! `--stats`, and the hash of the picture.

use super::support::Place;
use sha2::{Digest, Sha256};

fn hash(place: &Place, name: &str) -> String {
    place.json(name)["image_sha256"].as_str().expect("the hash is text").to_string()
}

#[test]
fn the_statistics_have_all_their_keys() {
    let place = Place::new();
    place.run("render cornell-box --size 16x12 --spp 4 -t 2 -q --stats s.json -o a.png").done();
    let s = place.json("s.json");
    assert_eq!(
        (&s["scene"], &s["triangles"], &s["shapes"]),
        (&"cornell-box".into(), &32.into(), &0.into())
    );
    assert_eq!(
        (&s["spp"], &s["threads"], &s["rays"]["camera"]),
        (&4.into(), &2.into(), &(16 * 12 * 4).into())
    );
    for key in ["instances", "peak_memory_bytes"] {
        assert!(s[key].as_u64().is_some_and(|n| n > 0), "{key}: {}", s[key]);
    }
    for key in ["load_seconds", "build_seconds", "render_seconds", "mrays_per_second"] {
        assert!(s[key].as_f64().is_some_and(|x| x >= 0.0), "{key}: {}", s[key]);
    }
    for key in ["shadow", "indirect"] {
        assert!(s["rays"][key].as_u64().is_some_and(|n| n > 0), "{key}: {}", s["rays"]);
    }
    assert!(
        ["scalar", "vector128", "avx2", "avx512"].contains(&s["simd"].as_str().expect("a name"))
    );
    assert_eq!(hash(&place, "s.json").len(), 64);
}

#[test]
fn the_statistics_have_the_warnings_that_are_not_shown() {
    let place = Place::new();
    let obj = "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    std::fs::write(place.path("a.obj"), obj).expect("written");
    let words = "render a.obj --size 8x6 --spp 1 --aov depth --stats s.json -o a.png";
    let shown = place.run(words).done().err;
    let quiet = place.run(&format!("{words} -q")).done().err;
    assert_eq!(quiet, "");
    let listed = place.json("s.json")["warnings"].clone();
    let listed = listed.as_array().expect("a list");
    let messages: Vec<_> = listed.iter().map(|w| w["message"].as_str().expect("text")).collect();
    assert!(
        messages.iter().any(|m| m.contains("none.mtl"))
            && messages.iter().any(|m| m.contains("OpenEXR"))
    );
    for message in messages {
        assert!(shown.contains(&format!("warning: {message}")), "{message}\n{shown}");
    }
    assert_eq!(shown.matches("warning: ").count(), listed.len(), "{shown}");
}

#[test]
fn the_hash_is_that_of_the_linear_floats_from_the_top_row() {
    let place = Place::new();
    place.run("render cornell-box --size 20x14 --spp 4 -t 1 -q --stats s.json -o a.pfm").done();
    place.run("render cornell-box --size 20x14 --spp 4 -t 1 -q --stats e.json -o a.exr").done();
    let mut hasher = Sha256::new();
    let bytes = std::fs::read(place.path("a.pfm")).expect("the picture was written");
    assert!(bytes.starts_with(b"PF\n20 14\n-1"), "little-endian colour");
    // PFM has its rows from the bottom.
    let rows: Vec<_> = bytes[bytes.len() - 20 * 14 * 12..].chunks(20 * 12).rev().collect();
    hasher.update(rows.concat());
    let expected: String = hasher.finalize().iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!(
        [hash(&place, "s.json"), hash(&place, "e.json")],
        [expected.clone(), expected.clone()]
    );

    let mut hasher = Sha256::new();
    for value in &place.layers("a.exr").layers[0].values {
        hasher.update(value.to_le_bytes());
    }
    assert_eq!(hasher.finalize().iter().map(|b| format!("{b:02x}")).collect::<String>(), expected);
}

#[test]
fn the_hash_does_not_depend_on_threads_or_instruction_sets() {
    let place = Place::new();
    for scene in ["cornell-box", "spheres"] {
        let words = format!("render {scene} --size 40x30 --spp 4 -q -o a.pfm --stats s.json");
        place.run(&format!("{words} -t 1")).done();
        let expected = hash(&place, "s.json");
        place.run(&format!("{words} -t 3")).done();
        assert_eq!(hash(&place, "s.json"), expected, "{scene}: threads");
        for level in ["scalar", "avx2", "avx512"] {
            let run = place.finish(place.command(&words).env("SNELL_SIMD", level), b"");
            if run.code == 2 && level != "scalar" {
                assert!(run.err.contains(level), "{}", run.err);
                eprintln!("skipped: this machine has no {level}");
                continue;
            }
            run.done();
            assert_eq!(place.json("s.json")["simd"], level);
            assert_eq!(hash(&place, "s.json"), expected, "{scene}: {level}");
        }
    }
}

#[test]
fn a_level_that_does_not_exist_is_wrong_usage() {
    let place = Place::new();
    let run =
        place.finish(place.command("render --size 8x8 --spp 1").env("SNELL_SIMD", "sse9"), b"");
    let message = "error: SNELL_SIMD=sse9 is not a level; use scalar, vector128, avx2 or avx512, \
                   or unset it\n";
    assert_eq!((run.code, run.err.as_str()), (2, message));
}
