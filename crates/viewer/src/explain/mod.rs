//! Explains the colour of a pixel in words and numbers: [`Report`]. `snell explain`, the viewer's
//! page and the Python package share this module.
//!
//! [`snell_render::explain`] and [`snell_intersect::World::trace`] record what happens. The report
//! adds names, and becomes text ([`text`]), a drawing ([`svg`]) or JSON (it is `Serialize`).

mod classes;
mod report;
pub mod svg;
pub mod text;

pub use report::{
    LightReport, PathClass, Point, Report, SampleReport, StepReport, TraceReport, VertexReport,
};

use snell_intersect::AcceleratorKind;
use snell_intersect::{RegionKind, TraversalTrace};
use snell_math::{DVec2, Ray, SampledSpectrum, Vec2, real};
use snell_render::explain::{
    Explanation, LightRay, PathTree, PathVertex, VertexKind, Wanted, explain,
};
use snell_render::integrator::light_part::{LightSource, Lobe};
use snell_render::{CompiledScene, IntegratorKind, Job, Settings};
use snell_scene::{Camera, CameraSample, Scene};
use std::sync::Arc;

/// Maximum number of points of the convergence plot.
const MAX_POINTS: usize = 160;
/// Maximum number of traversal steps in a report.
const MAX_STEPS: usize = 1500;
/// Columns and rows of the points that sketch the scene.
const CLOUD: [u32; 2] = [56, 32];

/// A question about a pixel.
#[derive(Clone, Debug)]
pub struct Question {
    /// Column and row of the pixel, from the upper left corner.
    pub pixel: [u32; 2],
    /// The number of the sample whose path tree is reported; `None` for the one whose colour is
    /// closest to the pixel's.
    pub sample: Option<u32>,
}

/// A scene with everything that is needed to render it.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene graph, which has the names.
    pub scene: &'a Scene,
    /// The compiled scene.
    pub compiled: &'a CompiledScene,
    /// The camera.
    pub camera: &'a Camera,
    /// The render settings.
    pub settings: &'a Settings,
}

/// The scene compiled with another acceleration structure.
pub type Structure = (AcceleratorKind, Arc<CompiledScene>);

/// The scene compiled with each of these acceleration structures.
pub fn structures(
    scene: &Scene,
    settings: &Settings,
    kinds: &[AcceleratorKind],
) -> Result<Vec<Structure>, String> {
    let build = |&kind: &AcceleratorKind| {
        let options = snell_intersect::BuildOptions { accelerator: kind, ..settings.build.clone() };
        let compiled = CompiledScene::new(scene, &options).map_err(|e| e.to_string())?;
        Ok((kind, Arc::new(compiled)))
    };
    kinds.iter().map(build).collect()
}

/// Answers the question. An error is a message for the user.
pub fn report(
    subject: Subject,
    question: &Question,
    structures: &[Structure],
) -> Result<Report, String> {
    let Subject { scene, compiled, camera, settings } = subject;
    let Question { pixel, sample } = *question;
    if settings.noise.is_some() {
        return Err("how many samples a pixel takes depends on the whole picture with --noise; \
            leave it out"
            .into());
    }
    if settings.integrator == IntegratorKind::Aov {
        return Err(
            "the integrator aov shows a layer and no light: there is nothing to explain".into()
        );
    }
    if sample.is_some_and(|s| s >= settings.spp) {
        return Err(format!(
            "sample {}: the pixel has samples 0 to {}",
            sample.unwrap_or(0),
            settings.spp - 1
        ));
    }
    let [width, height] = settings.size;
    let job = Job::new(compiled, camera, settings);
    let outside = || {
        format!(
            "pixel {},{} is outside of the picture of {width}x{height} pixels",
            pixel[0], pixel[1]
        )
    };
    let (looks, mut classes) = (looks(settings.spp), classes::Classes::default());
    let wanted = Wanted { sample, looks: &looks };
    let explanation =
        explain(&job, pixel, 1, wanted, |tree| classes.add(tree)).ok_or_else(outside)?;
    let tree = chosen(&explanation, sample).ok_or("the pixel has no samples")?;
    let ray = tree.vertices.first().map_or_else(|| middle_ray(camera, settings, pixel), |v| v.ray);
    Ok(Report {
        scene: scene.name.clone(),
        pixel,
        size: settings.size,
        integrator: settings.integrator.name().into(),
        value: explanation.value,
        error: explanation.convergence.last().map_or([0.0; 3], |last| last.error),
        spp: settings.spp,
        convergence: points(&explanation),
        classes: classes.finish(),
        samples: (0..).zip(&explanation.samples).map_while(in_order).collect(),
        tree: sample_report(scene, compiled, tree),
        traces: structures
            .iter()
            .map(|(kind, compiled)| trace_report(*kind, compiled, &ray))
            .collect(),
        bounds: bounds(compiled),
        cloud: cloud(compiled, camera, settings),
    })
}

/// The requested sample, or else the recorded one whose colour is closest to that of the pixel.
fn chosen(explanation: &Explanation, sample: Option<u32>) -> Option<&PathTree> {
    if let Some(number) = sample {
        return explanation.samples.iter().find(|tree| tree.number == number);
    }
    let distance = |tree: &PathTree| {
        let color = tree.color.to_array();
        (0..3).map(|c| real::powi(color[c] - explanation.value[c], 2)).sum::<f32>()
    };
    explanation.samples.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// The colour of a recorded sample, if all samples before it are recorded, too.
fn in_order((number, tree): (u32, &PathTree)) -> Option<[f32; 3]> {
    (tree.number == number).then(|| tree.color.to_array())
}

fn middle_ray(camera: &Camera, settings: &Settings, pixel: [u32; 2]) -> Ray {
    let film = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    camera.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, settings.size).ray
}

/// Numbers of samples for the convergence plot, evenly spaced on a logarithmic axis.
fn looks(spp: u32) -> Vec<u32> {
    let last = f64::from(spp.max(1));
    let mut numbers: Vec<u32> = (0..MAX_POINTS)
        .map(|i| real::powf(last, i as f64 / (MAX_POINTS - 1) as f64).round() as u32)
        .collect();
    numbers.dedup();
    numbers
}

fn points(explanation: &Explanation) -> Vec<Point> {
    let all = explanation.convergence.iter();
    all.map(|mean| Point { samples: mean.samples, value: mean.value, error: mean.error }).collect()
}

fn bounds(compiled: &CompiledScene) -> [[f32; 3]; 2] {
    let (center, radius) = (compiled.center, compiled.radius);
    let b = compiled.world.bounds();
    if b.is_finite() && !b.is_empty() {
        return [b.min.as_vec3().to_array(), b.max.as_vec3().to_array()];
    }
    [(center - radius).to_array(), (center + radius).to_array()]
}

/// Some points of surfaces that the camera sees, as a sketch of the scene.
fn cloud(compiled: &CompiledScene, camera: &Camera, settings: &Settings) -> Vec<[f32; 3]> {
    let filter = snell_render::job::camera_filter(compiled);
    let at = |i: u32| {
        let [x, y] = [i % CLOUD[0], i / CLOUD[0]];
        let place =
            |n: u32, of: u32, size: u32| (f64::from(n) + 0.5) / f64::from(of) * f64::from(size);
        let film =
            DVec2::new(place(x, CLOUD[0], settings.size[0]), place(y, CLOUD[1], settings.size[1]));
        let ray = camera.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, settings.size).ray;
        let hit = compiled.world.closest_one(&ray, filter.at(0));
        hit.is_hit().then(|| (ray.origin + ray.direction * hit.t).to_array())
    };
    (0..CLOUD[0] * CLOUD[1]).filter_map(at).filter(|p| p.iter().all(|x| x.is_finite())).collect()
}

fn trace_report(kind: AcceleratorKind, compiled: &CompiledScene, ray: &Ray) -> TraceReport {
    let filter = snell_render::job::camera_filter(compiled);
    let TraversalTrace { steps, left_out, hit, counters } = compiled.world.trace(ray, filter.at(0));
    let statistics = compiled.world.stats();
    TraceReport {
        accelerator: kind.name().into(),
        nodes: counters.nodes_visited,
        cells: counters.cells_stepped,
        primitives: counters.primitives_tested,
        built_nodes: statistics.nodes,
        distance: hit.is_hit().then_some(hit.t),
        left_out: left_out + steps.len().saturating_sub(MAX_STEPS) as u64,
        steps: steps
            .iter()
            .take(MAX_STEPS)
            .map(|step| StepReport {
                kind: match step.region.kind {
                    RegionKind::Box => "box",
                    RegionKind::Ball => "ball",
                    RegionKind::Plane => "plane",
                    RegionKind::Stretch => "stretch",
                }
                .into(),
                center: step.region.center.as_vec3().to_array(),
                axes: step.region.axes.map(|axis| axis.as_vec3().to_array()),
                is_leaf: step.is_leaf,
                level: step.level,
                tested: step.tested,
                found: step.found,
            })
            .collect(),
    }
}

fn sample_report(scene: &Scene, compiled: &CompiledScene, tree: &PathTree) -> SampleReport {
    let vertices = tree.vertices.iter().map(|v| vertex_report(scene, compiled, tree, v)).collect();
    let color = |s: SampledSpectrum| tree.color_of(s).to_array();
    let sum = color(tree.sum());
    SampleReport {
        number: tree.number,
        color: tree.color.to_array(),
        weight: tree.weight,
        sum,
        vertices,
    }
}

fn vertex_report(
    scene: &Scene,
    compiled: &CompiledScene,
    tree: &PathTree,
    vertex: &PathVertex,
) -> VertexReport {
    let color = |s: SampledSpectrum| tree.color_of(s).to_array();
    let (what, object, material, primitive, normal) = match &vertex.kind {
        VertexKind::Surface { hit, normal, material, .. } => {
            let path = compiled.node_path(hit);
            let names =
                path.iter().filter_map(|id| scene.nodes.get(id.index())).map(|n| n.name.clone());
            let object: Vec<String> = names.skip(1).filter(|name| !name.is_empty()).collect();
            let name = compiled.material(*material).name.clone();
            ("surface", object.join(" › "), name, Some(hit.primitive), Some(normal.to_array()))
        }
        VertexKind::Medium { .. } => ("medium", String::new(), String::new(), None, None),
        VertexKind::Escaped => ("escaped", String::new(), String::new(), None, None),
        VertexKind::Absorbed => ("absorbed", String::new(), String::new(), None, None),
    };
    let position = vertex.kind.position();
    let scattering = vertex.scattering;
    VertexReport {
        parent: vertex.parent.map(|p| p as u32),
        depth: vertex.depth,
        what: what.into(),
        object,
        material,
        primitive,
        origin: vertex.ray.origin.to_array(),
        direction: vertex.ray.direction.to_array(),
        position: position.map(|p| p.to_array()),
        normal,
        distance: position.map(|p| p.distance(vertex.ray.origin)),
        throughput: color(vertex.throughput),
        lobe: scattering.map(|s| lobe_name(s.lobe, s.is_delta).into()),
        pdf: scattering.filter(|s| !s.is_delta).map(|s| s.pdf),
        glow: color(vertex.glow),
        by_photons: color(vertex.by_photons),
        photons: vertex.photons,
        found: color(vertex.found),
        found_weight: vertex.found_weight,
        lights: vertex
            .light_rays
            .iter()
            .map(|ray| light_report(scene, compiled, tree, ray))
            .collect(),
    }
}

fn light_report(
    scene: &Scene,
    compiled: &CompiledScene,
    tree: &PathTree,
    light: &LightRay,
) -> LightReport {
    let end = light.ray.origin + light.ray.direction * light.ray.t_max;
    LightReport {
        source: light.source.map_or_else(|| "a light".into(), |s| source_name(scene, compiled, s)),
        lobe: lobe_name(light.lobe, false).into(),
        origin: light.ray.origin.to_array(),
        direction: light.ray.direction.to_array(),
        end: end.is_finite().then(|| end.to_array()),
        value: tree.color_of(light.value).to_array(),
        brought: tree.color_of(light.brought).to_array(),
        is_blocked: light.is_blocked,
        weight: light.weight,
    }
}

fn source_name(scene: &Scene, compiled: &CompiledScene, source: LightSource) -> String {
    let named =
        |what: &str, name: &str| if name.is_empty() { what.to_string() } else { name.to_string() };
    match source {
        LightSource::Light(number) => {
            let kind = scene.lights.get(number as usize).map_or("", |light| light.name());
            format!("{kind} light {number}").trim_start().into()
        }
        LightSource::Material(material) => named("a lamp", &compiled.material(material).name),
        LightSource::Environment => "the environment".into(),
        LightSource::Medium => "a medium".into(),
    }
}

/// The name of a lobe.
fn lobe_name(lobe: Lobe, is_delta: bool) -> &'static str {
    match (lobe, is_delta) {
        (Lobe::Diffuse, _) => "diffuse",
        (Lobe::Specular, true) => "mirror",
        (Lobe::Specular, false) => "glossy",
        (Lobe::Transmission, true) => "refraction",
        (Lobe::Transmission, false) => "rough transmission",
        (Lobe::Volume, _) => "phase function",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::BuildOptions;
    use snell_scene::builtin::builtin;

    fn report_of(name: &str, pixel: [u32; 2], sample: Option<u32>) -> Result<Report, String> {
        let scene = builtin(name).expect("the scene is built in");
        let settings = Settings { size: [40, 30], spp: 8, ..Settings::default() };
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let structures = structures(&scene, &settings, &AcceleratorKind::ALL)?;
        let subject = Subject {
            scene: &scene,
            compiled: &compiled,
            camera: &scene.cameras[0],
            settings: &settings,
        };
        report(subject, &Question { pixel, sample }, &structures)
    }

    #[test]
    fn a_report_names_things_and_its_parts_add_up() {
        let report = report_of("cornell-box", [20, 22], None).expect("a pixel of the picture");
        let mean = |c: usize| report.samples.iter().map(|s| s[c]).sum::<f32>() / 8.0;
        let classes = |c: usize| report.classes.iter().map(|class| class.value[c]).sum::<f32>();
        for c in 0..3 {
            assert!(
                (mean(c) - report.value[c]).abs() < 1e-5
                    && (classes(c) - report.value[c]).abs() < 1e-5
            );
        }
        assert_eq!(report.tree.sum, report.tree.color);
        let first = &report.tree.vertices[0];
        assert!(
            !first.material.is_empty() && first.parent.is_none() && first.throughput == [1.0; 3]
        );
        // All structures find the same hit; only their traversals differ.
        assert_eq!(report.traces.len(), AcceleratorKind::ALL.len());
        assert!(
            report
                .traces
                .iter()
                .all(|j| j.distance == report.traces[0].distance && !j.steps.is_empty())
        );
        for text in [
            text::text(&report),
            svg::svg(&report),
            serde_json::to_string(&report).expect("plain data"),
        ] {
            assert!(text.contains(&first.material) && text.contains("kdtree"), "{text}");
        }
        let drawing = svg::svg(&report);
        assert!(
            drawing.starts_with("<svg") && !drawing.contains("NaN") && !drawing.contains("inf")
        );
    }

    #[test]
    fn what_cannot_be_answered_is_said() {
        assert!(report_of("cornell-box", [40, 0], None).is_err_and(|e| e.contains("40x30")));
        assert!(report_of("cornell-box", [0, 0], Some(8)).is_err_and(|e| e.contains("0 to 7")));
    }
}
