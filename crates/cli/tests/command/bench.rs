//! `snell bench`: its output and its errors. Speeds cannot be tested here.

use super::support::Place;
use serde_json::Value;

/// A closed pyramid.
const PYRAMID: &str = "OFF\n5 6 0\n-1 0 -1\n1 0 -1\n1 0 1\n-1 0 1\n0 1.5 0\n3 0 4 1\n3 1 4 2\n3 2 \
    4 3\n3 3 4 0\n3 0 1 2\n3 0 2 3\n";

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|l| serde_json::from_str(l).expect("each line is JSON")).collect()
}

#[test]
fn each_kind_of_ray_and_number_of_threads_is_a_line() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    let run = place.run("bench rays p.off --side 16 --repeat 1 --threads 1,2 --json").done();
    let rows = lines(run.text());
    let names: Vec<_> =
        rows.iter().map(|r| (r["rays"].as_str().unwrap_or(""), r["threads"].as_u64())).collect();
    let kinds = ["primary", "shadow", "diffuse", "shuffled"];
    let expected: Vec<_> = [1, 2].iter().flat_map(|&n| kinds.map(|k| (k, Some(n)))).collect();
    assert_eq!(names, expected);
    for row in &rows {
        assert_eq!((&row["scene"], &row["triangles"]), (&"p.off".into(), &6.into()));
        assert_eq!((&row["accelerator"], &row["call"]), (&"bvh".into(), &"batch".into()));
        assert!(row["mrays_per_second"].as_f64().is_some_and(|r| r > 0.0), "{row}");
        assert!(row["simd"].is_string() && row["quality"].is_string() && row["peer"].is_null());
    }
    let number = |row: &Value, key: &str| row[key].as_u64().expect("a number");
    let seen = number(&rows[0], "hits");
    // The camera frames the pyramid, which covers some of the picture, but not all.
    assert_eq!(number(&rows[0], "ray_count"), 256);
    assert!((40..230).contains(&seen), "{seen}");
    for row in &rows[1..4] {
        assert_eq!(number(row, "ray_count"), seen, "one ray from each hit");
        assert!(number(row, "hits") < seen, "a convex shape hides little of itself: {row}");
    }
}

#[test]
fn every_way_to_build_and_call_hits_the_same() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    let words = "bench rays p.off:copies=20 p.off:instances=20 --side 16 --repeat 1 --threads 1 \
        --json --rays primary,shuffled \
                 --accelerator none,bvh --simd scalar --calls batch,one";
    let run = place.run(words).done();
    let rows = lines(run.text());
    assert_eq!(rows.len(), 2 * 2 * 2 * 2);
    for kind in ["primary", "shuffled"] {
        for scene in rows.chunks(8) {
            let hits: Vec<_> =
                scene.iter().filter(|r| r["rays"] == kind).map(|r| &r["hits"]).collect();
            assert!(hits.len() == 4 && hits.iter().all(|h| *h == hits[0]), "{kind}: {hits:?}");
        }
    }
    assert_eq!(rows[0]["triangles"], 120);
}

#[test]
fn without_json_there_is_a_table() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    let table = place
        .run("bench rays p.off:subdivide=2 --side 16 --repeat 1 --threads 1 --rays diffuse")
        .done();
    let rows: Vec<_> = table.text().lines().collect();
    assert!(
        rows.len() == 3 && rows[2].starts_with("p.off:subdivide=2") && rows[2].contains("diffuse"),
        "{rows:?}"
    );
}

#[test]
fn builds_are_measured() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    let run = place.run("bench build p.off:subdivide=3 --repeat 2 --threads 1 --json").done();
    let row = &lines(run.text())[0];
    assert_eq!((&row["triangles"], &row["builder"]), (&384.into(), &"Snell".into()));
    let all = place
        .run("bench build p.off --quality fast,medium,high --repeat 1 --threads 1 --json")
        .done();
    let qualities: Vec<_> = lines(all.text()).iter().map(|row| row["quality"].clone()).collect();
    assert_eq!(qualities, ["fast", "medium", "high"]);
    for key in ["seconds", "mtriangles_per_second", "bytes_per_triangle"] {
        assert!(row[key].as_f64().is_some_and(|x| x > 0.0), "{key}: {row}");
    }
    assert!(
        place.run("bench build p.off --repeat 1 --threads 1").done().text().lines().count() == 2
    );
    let both =
        place.run("bench build p.off:subdivide=5 --compact --repeat 1 --threads 1 --json").done();
    let both: Vec<_> = lines(both.text());
    assert_eq!(both.iter().map(|row| row["compact"].clone()).collect::<Vec<_>>(), [false, true]);
    let [plain, compact] =
        [0, 1].map(|i| both[i]["bytes_per_triangle"].as_f64().expect("a number"));
    assert!(compact < 0.8 * plain, "{compact} and {plain}");
    let rays = place
        .run("bench rays p.off --compact --rays diffuse --side 16 --repeat 1 --threads 1")
        .done();
    let rows: Vec<_> = rays
        .text()
        .lines()
        .filter(|line| line.starts_with("p.off"))
        .map(|l| l.contains("compact"))
        .collect();
    assert_eq!(rows, [false, true]);
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_measured() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    for (words, complaint) in [
        ("bench rays p.off --rays primary,difuse", "did you mean diffuse?"),
        ("bench rays p.off --accelerator bvx", "did you mean bvh?"),
        ("bench rays p.off --quality fats", "did you mean fast?"),
        ("bench rays p.off --simd avx3", "did you mean avx2?"),
        ("bench rays p.off --calls two", "known: batch, one"),
        ("bench rays p.off --threads 0", "0 is not in 1..=4096"),
        ("bench rays p.off --side 100", "a power of two"),
        ("bench rays p.off --peer embre=x", "write embree=PATH"),
        ("bench rays p.off:copies=none", "copies takes a number"),
        ("bench rays p.off:shrink=2", "subdivide=N, copies=N or instances=N"),
        ("bench rays", "SCENE"),
        ("bench build p.off --accelerator x", "no accelerator"),
    ] {
        let run = place.run(words);
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(run.err.contains(complaint) && run.out.is_empty(), "{words}: {}", run.err);
    }
}

#[test]
fn a_peer_that_cannot_be_loaded_is_an_error_with_a_remedy() {
    let place = Place::new();
    place.write("p.off", PYRAMID).write("libembree4.so", "nothing").write("a.whl", "nothing");
    for (path, remedy) in [
        ("none.so", "give the shared library of Embree 4"),
        ("libembree4.so", "must be the shared library of Embree 4"),
        ("a.whl", "give the shared library of Embree 4"),
    ] {
        let run = place.run(&format!("bench rays p.off --peer embree={path}"));
        assert_eq!(run.code, 1, "{}", run.err);
        assert!(
            run.err.starts_with("error: ") && run.err.contains(remedy) && run.out.is_empty(),
            "{path}: {}",
            run.err
        );
    }
    let run = place.run("bench rays none.off --json");
    assert_eq!(run.code, 1, "{}", run.err);
}

#[test]
fn the_rays_of_a_render_are_measured() {
    let place = Place::new();
    let run = place
        .run("bench render cornell-box --side 16 --spp 16 --threads 2 --repeat 1 --json")
        .done();
    let row = &lines(run.text())[0];
    assert_eq!((&row["triangles"], &row["threads"]), (&32.into(), &2.into()));
    assert!(row["ray_count"].as_u64().is_some_and(|n| n > 16 * 16 * 16 * 2), "{row}");
    for key in
        ["mrays_per_second", "tracing_mrays_per_second", "raw_mrays_per_second", "mean_batch"]
    {
        assert!(row[key].as_f64().is_some_and(|x| x > 0.0), "{key}: {row}");
    }
    assert!(row["tracing_share"].as_f64().is_some_and(|x| x > 0.0 && x < 1.0), "{row}");
}

#[test]
fn triangles_and_rays_are_written_as_arrays() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    place
        .run(
            "bench rays p.off:copies=2 --side 16 --repeat 1 --threads 1 --rays primary,shadow \
            --dump-rays out",
        )
        .done();
    let array = |name: &str| {
        let bytes = std::fs::read(place.path(&format!("out/p.off-copies-2/{name}.npy")))
            .expect("it was written");
        let begin = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = String::from_utf8(bytes[10..begin].to_vec()).expect("text");
        assert!(
            bytes.starts_with(b"\x93NUMPY\x01\x00") && begin % 64 == 0 && header.ends_with('\n'),
            "{header}"
        );
        (
            header,
            bytes[begin..]
                .chunks(4)
                .map(|b| f32::from_le_bytes(b.try_into().expect("four")))
                .collect::<Vec<_>>(),
        )
    };
    assert!(array("triangles").0.contains("'<u4'") && array("triangles").0.contains("(12, 3)"));
    assert!(array("positions").0.contains("(10, 3)"));
    let (header, rays) = array("primary");
    assert!(header.contains("(256, 8)") && rays.len() == 256 * 8, "{header}");
    let unit = rays[4] * rays[4] + rays[5] * rays[5] + rays[6] * rays[6];
    assert!((unit - 1.0).abs() < 1e-5 && rays[7].is_infinite());
    let (header, distances) = array("primary-t");
    let hits = distances.iter().filter(|t| t.is_finite()).count();
    assert!(header.contains("(256,)") && hits > 10, "{header}");
    assert_eq!(array("shadow").1.len(), hits * 8);
}

#[test]
fn samplers_are_measured_on_every_integrand() {
    let place = Place::new();
    let words = "bench samplers --spp 1,16 --pictures 1 --side 16 --json --plot p.svg";
    let rows = lines(place.run(words).done().text());
    assert_eq!(
        rows.len(),
        7 * 4 * 3,
        "integrands, samplers, two numbers of samples and the exponent"
    );
    let exponent = |sampler: &str| {
        let row = rows.iter().find(|r| {
            r["integrand"] == "smooth" && r["sampler"] == sampler && !r["exponent"].is_null()
        });
        row.and_then(|r| r["exponent"].as_f64()).expect("a number")
    };
    assert!(exponent("zsobol") < exponent("independent") - 0.3);
    let plot = std::fs::read_to_string(place.path("p.svg")).expect("the plot was written");
    assert!(plot.contains("product8") && plot.ends_with("</svg>\n"));
    assert!(place.run("bench samplers --sampler sobel").err.contains("did you mean sobol"));
}

#[test]
fn where_results_go_is_looked_at_before_anything_is_measured() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    place.write("file", "");
    for words in [
        "accelerators p.off --side 16 --plot none/p.svg",
        "samplers --spp 1 --pictures 1 --side 16 --plot none/p.svg",
        "guiding door-ajar --width 8 --keep file/folder",
        "coherence p.off --side 16 --repeat 1 --image-folder file/folder",
    ] {
        let run = place.run(&format!("bench {words}"));
        assert_eq!((run.code, run.text()), (1, ""), "{words}");
        assert!(
            run.err.contains("none/p.svg: ") || run.err.contains("file/folder: "),
            "{words}: {}",
            run.err
        );
    }
    let row = &lines(
        place
            .run("bench guiding door-ajar --width 8 --seconds 0.05 -t 1 --json --keep new/folder")
            .done()
            .text(),
    )[0];
    assert!(row["gain"].as_f64().is_some_and(|g| g > 0.0), "{row}");
    let kept = ["plain", "plain-again", "guided", "guided-again"]
        .map(|kind| place.image(&format!("new/folder/door-ajar-{kind}.exr")));
    assert_ne!(kept[0], kept[1]);
}

#[test]
fn a_scene_without_surfaces_is_not_measured() {
    let place = Place::new();
    place.write("empty.obj", "v 0 0 0\nv 1 0 0\n");
    let run = place.run("bench rays empty.obj --side 16 --repeat 1");
    assert_eq!(run.code, 1);
    assert!(run.err.contains("empty.obj: the scene has no surfaces"), "{}", run.err);
}

#[test]
fn every_hidden_surface_method_sees_what_rays_see() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    let run = place
        .run("bench hidden-surfaces p.off:copies=12 --side 64 --repeat 1 --json --image-folder out")
        .done();
    let rows = lines(run.text());
    let names: Vec<_> = rows.iter().map(|r| r["method"].as_str().unwrap_or("")).collect();
    let surfaces = [
        "ray-casting-all",
        "ray-casting",
        "z-buffer",
        "scan-line-z",
        "scan-line",
        "depth-sort",
        "bsp",
        "bsp-front-to-back",
        "warnock",
        "weiler-atherton",
    ];
    assert_eq!(names[..10], surfaces);
    assert_eq!(names[10..], ["quantitative-invisibility"]);
    for row in &rows {
        assert_eq!((&row["scene"], &row["triangles"]), (&"p.off:copies=12".into(), &72.into()));
        assert_eq!(row["unexplained"], 0, "{row}");
        assert!(row["agree"].as_f64().is_some_and(|a| a > 0.98), "{row}");
        assert!(
            row["seconds"].as_f64().is_some_and(|s| s > 0.0) && row["left_out"].is_null(),
            "{row}"
        );
        for key in ["space", "sorts", "coherence", "source"] {
            assert!(row[key].as_str().is_some_and(|t| !t.is_empty()), "{key}: {row}");
        }
    }
    for row in &rows[2..10] {
        assert_eq!(row["identical"], 1.0, "{row}");
    }
    let picture =
        |name: &str| std::fs::read(place.path(&format!("out/{name}.png"))).expect("a picture");
    for name in &surfaces[3..] {
        assert!(picture(name) == picture("z-buffer"), "{name}");
    }
    let files = place.files();
    assert!(files.iter().all(|f| f == "p.off" || f == "out"), "{files:?}");
    assert_eq!(std::fs::read_dir(place.path("out")).expect("a folder").count(), 10 + 8 + 1);
    let svg = std::fs::read_to_string(place.path("out/quantitative-invisibility.svg"))
        .expect("a drawing");
    assert!(svg.starts_with("<svg") && svg.contains("<path d=\"M"), "{svg}");
}

#[test]
fn hidden_surfaces_are_of_meshes_and_named_methods() {
    let place = Place::new();
    place.write("p.off", PYRAMID);
    let table = place
        .run("bench hidden-surfaces p.off --side 16 --repeat 1 --method warnock,z-buffer")
        .done();
    let rows: Vec<_> = table.text().lines().collect();
    assert!(
        rows[0].contains("6 triangles")
            && rows[2].starts_with("warnock")
            && rows[3].starts_with("z-buffer"),
        "{rows:?}"
    );
    assert!(rows.iter().any(|r| r.contains("Warnock 1969")), "{rows:?}");
    let wrong = place.run("bench hidden-surfaces p.off --method warnok");
    assert!(wrong.code == 2 && wrong.err.contains("did you mean warnock?"), "{}", wrong.err);
    let balls = place.run("bench hidden-surfaces caustic --side 16");
    assert!(balls.code == 1 && balls.err.contains("triangles"), "{}", balls.err);
    let many = place
        .run(
            "bench hidden-surfaces p.off:subdivide=6 --side 512 --repeat 1 --method \
            ray-casting-all",
        )
        .done();
    assert!(many.text().contains("left out: more than 5000000000"), "{}", many.text());
}
