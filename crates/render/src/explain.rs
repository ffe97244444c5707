//! Explains the value of a pixel: the path tree of each of its samples, with every contribution to
//! the sample, and how the mean of the samples developed.
//!
//! There is no second integrator here. The renderer itself renders the pixel and keeps a
//! [`Journal`]; this module only assembles the entries. The trees therefore add up to the samples,
//! and the samples to the pixel of the picture, bit for bit.

use crate::compile::CompiledScene;
use crate::film::FilmPart;
use crate::film::sensor::Sensor;
use crate::integrator::light_part::{LightSource, Lobe, LobeShares};
use crate::integrator::{PathState, SurfaceVertex};
use crate::job::{Event, Job, Journal, Shaded};
use snell_intersect::{Hit, SurfaceInteraction};
use snell_math::{ColorMode, Ray, Rgb, SampledSpectrum, Vec3};
use snell_scene::MaterialId;

/// The number of samples that an explanation keeps at most, the first ones: a pixel may have
/// millions.
pub const KEPT: u32 = 4096;

/// The number of vertices that are kept in all trees: some trees have thousands.
const KEPT_VERTICES: usize = 1 << 20;

/// The value of a pixel and the path trees of its samples.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// Pixel coordinates, from the upper left corner of the whole picture.
    pub pixel: [u32; 2],
    /// The pixel's value in the picture: red, green, blue (linear), alpha.
    pub value: [f32; 4],
    /// The first samples, at most [`KEPT`], in order, and the requested sample.
    pub samples: Vec<PathTree>,
    /// The pixel's value after the requested numbers of samples, and after all samples.
    pub convergence: Vec<Mean>,
}

/// The value of a pixel after some of its samples.
#[derive(Clone, Copy, Debug)]
pub struct Mean {
    /// The number of samples.
    pub samples: u32,
    /// Red, green and blue, linear.
    pub value: [f32; 3],
    /// The standard error of each value; 0 after one sample.
    pub error: [f32; 3],
}

/// One sample as a tree of vertices, with what they contributed.
#[derive(Clone, Debug)]
pub struct PathTree {
    /// The sample's number in the pixel.
    pub number: u32,
    /// The sample's colour, before its weight: linear Rec. 709.
    pub color: Rgb,
    /// Weight of the sample in the reconstruction filter: 1 or -1.
    pub weight: f32,
    /// What the lanes of the tree's spectra stand for.
    pub mode: ColorMode,
    /// The sensor of the camera, if it changes the light.
    pub sensor: Option<Sensor>,
    /// The vertices, parents first. The first is where the camera ray ended.
    pub vertices: Vec<PathVertex>,
    /// All contributions, in the order in which they were added.
    pub additions: Vec<Addition>,
}

/// A contribution to a sample.
#[derive(Clone, Copy, Debug)]
pub struct Addition {
    /// Position of the contributing vertex in the tree.
    pub vertex: usize,
    /// The number of the vertex's light ray that contributed; `None` for light found at the vertex
    /// or on the way there.
    pub light_ray: Option<usize>,
    /// True for light that photons brought to the vertex.
    pub by_photons: bool,
    /// The contribution.
    pub radiance: SampledSpectrum,
}

/// The point at which a ray ended, with what was found there.
#[derive(Clone, Debug)]
pub struct PathVertex {
    /// Position of the vertex that the ray came from; `None` for the camera.
    pub parent: Option<usize>,
    /// The number of bounces before this vertex.
    pub depth: u32,
    /// The ray that led here.
    pub ray: Ray,
    /// What the ray hit.
    pub kind: VertexKind,
    /// The path's throughput on arrival.
    pub throughput: SampledSpectrum,
    /// How the ray's direction was chosen at the parent; `None` for the camera ray.
    pub scattering: Option<Scattering>,
    /// Radiance emitted by media on the way, multiplied by the throughput.
    pub glow: SampledSpectrum,
    /// Radiance that photons bring to the vertex, multiplied by the throughput.
    pub by_photons: SampledSpectrum,
    /// The number of these photons.
    pub photons: u32,
    /// Radiance found at the vertex, multiplied by the throughput and by the MIS weight.
    pub found: SampledSpectrum,
    /// The MIS weight of the radiance found at the vertex.
    pub found_weight: f32,
    /// Rays from the vertex towards lights.
    pub light_rays: Vec<LightRay>,
}

/// What a ray hit.
#[derive(Clone, Copy, Debug)]
pub enum VertexKind {
    /// A surface.
    Surface {
        /// The hit.
        hit: Hit,
        /// The point that was hit.
        position: Vec3,
        /// Shading normal.
        normal: Vec3,
        /// The material of the surface.
        material: MaterialId,
    },
    /// A point at which a medium scattered the path.
    Medium {
        /// The scattering point.
        position: Vec3,
    },
    /// Nothing was hit: the ray reached the environment or the background.
    Escaped,
    /// Nothing: media absorbed all that the path carried.
    Absorbed,
}

impl VertexKind {
    /// The position of the vertex, if it has one.
    pub fn position(&self) -> Option<Vec3> {
        match *self {
            Self::Surface { position, .. } | Self::Medium { position } => Some(position),
            Self::Escaped | Self::Absorbed => None,
        }
    }
}

/// How the next ray of a path was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// The lobe that contributes most to the BSDF in the ray's direction.
    pub lobe: Lobe,
    /// True if a delta lobe was sampled: a perfect mirror or clear glass.
    pub is_delta: bool,
    /// Density per steradian with which the direction was chosen; 0 for a delta lobe.
    pub pdf: f32,
}

/// A ray from a vertex to a light.
#[derive(Clone, Copy, Debug)]
pub struct LightRay {
    /// The ray; its interval ends at the light.
    pub ray: Ray,
    /// The light's source, if it is recorded.
    pub source: Option<LightSource>,
    /// The contribution if nothing blocked the ray.
    pub value: SampledSpectrum,
    /// The contribution that arrived: less through media, and zero if the ray is blocked.
    pub brought: SampledSpectrum,
    /// True if something blocks the ray.
    pub is_blocked: bool,
    /// The MIS weight, which is already part of the values.
    pub weight: f32,
    /// The lobe that scatters most of the light towards the path's origin.
    pub lobe: Lobe,
}

impl PathTree {
    /// The sum of all contributions in the renderer's own order: light that was found and light
    /// from light rays are summed separately, then added.
    pub fn sum(&self) -> SampledSpectrum {
        let of = |is_brought: bool| {
            let parts = self.additions.iter().filter(move |a| a.light_ray.is_some() == is_brought);
            parts.fold(SampledSpectrum::ZERO, |sum, a| sum + a.radiance)
        };
        of(false) + of(true)
    }

    /// The colour of a contribution in the picture.
    pub fn color_of(&self, radiance: SampledSpectrum) -> Rgb {
        let light = self.mode.to_rgb(radiance);
        self.sensor.map_or(light, |sensor| sensor.response(light))
    }
}

/// Options of [`explain`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted<'a> {
    /// The number of a sample to keep, even if it is not one of the first.
    pub sample: Option<u32>,
    /// The numbers of samples after which the pixel's value is recorded, ascending.
    pub looks: &'a [u32],
}

/// Renders one pixel of a job and explains its value. `each` is called once with the tree of every
/// sample, in order; only a bounded number of trees is kept. Returns `None` if the pixel is outside
/// of the picture.
pub fn explain(
    job: &Job,
    pixel: [u32; 2],
    threads: usize,
    wanted: Wanted,
    mut each: impl FnMut(&PathTree),
) -> Option<Explanation> {
    let size = job.settings().size;
    if pixel[0] >= size[0] || pixel[1] >= size[1] {
        return None;
    }
    let mut film = job.film_of_pixel(pixel);
    let (mut samples, mut vertices, mut convergence) = (Vec::new(), 0, Vec::new());
    let mut looks = wanted.looks.iter().copied().peekable();
    job.observe(pixel, threads, &mut |part, journal| {
        for tree in trees(job, part, journal) {
            each(&tree);
            let is_kept = tree.number < KEPT && vertices + tree.vertices.len() <= KEPT_VERTICES;
            if is_kept || tree.number == 0 || Some(tree.number) == wanted.sample {
                vertices += tree.vertices.len();
                samples.push(tree);
            }
        }
        let is_last = part.samples[1] == job.settings().spp;
        let is_looked_at = is_last || looks.peek().is_some_and(|&look| look <= part.samples[1]);
        if !is_looked_at {
            film.tiles[0].fold(part);
            return;
        }
        for number in 0..part.values.len() {
            let one = one_sample(part, number);
            film.tiles[0].fold(&one);
            let [_, count] = one.samples;
            while looks.peek().is_some_and(|&look| look < count) {
                looks.next();
            }
            if looks.peek() == Some(&count) || count == job.settings().spp {
                let triple = |image: snell_scene::LayeredImage| {
                    std::array::from_fn(|c| image.layers[0].values[c])
                };
                let variance: [f32; 3] = triple(film.variance());
                let error = variance.map(|v| v.max(0.0).sqrt());
                convergence.push(Mean { samples: count, value: triple(film.image()), error });
            }
        }
    });
    let value = film.image().layers[0].values[..4].try_into().unwrap_or_default();
    Some(Explanation { pixel, value, samples, convergence })
}

/// One sample of a part that has only one pixel, as a part of its own.
fn one_sample(part: &FilmPart, number: usize) -> FilmPart {
    fn share<T: Copy>(all: &[T], number: usize, count: usize) -> Vec<T> {
        let each = all.len() / count;
        all[number * each..(number + 1) * each].to_vec()
    }
    let count = part.values.len();
    let first = part.samples[0] + number as u32;
    FilmPart {
        area: part.area,
        samples: [first, first + 1],
        pixels: part.pixels.clone(),
        values: vec![part.values[number]],
        aovs: share(&part.aovs, number, count),
        keys: share(&part.keys, number, count),
    }
}

/// The trees of the samples of a part.
fn trees(job: &Job, part: &FilmPart, journal: &Journal) -> Vec<PathTree> {
    let tree = |(number, value): (u32, &crate::film::FilmSample)| PathTree {
        number,
        color: value.color,
        weight: value.weight,
        mode: ColorMode::Rgb,
        sensor: job.settings().sensor,
        vertices: Vec::new(),
        additions: Vec::new(),
    };
    let mut trees: Vec<PathTree> = (part.samples[0]..).zip(&part.values).map(tree).collect();
    let mut planting = Planting::default();
    let mut fates = journal.fates.iter();
    for event in &journal.events {
        match event {
            Event::Depth => planting.next_depth(),
            Event::Glow { path, sample, radiance } => {
                let tree = &mut trees[*sample as usize];
                let vertex = planting.vertex(tree, *path);
                tree.vertices[vertex].glow += *radiance;
                tree.additions.push(Addition {
                    vertex,
                    light_ray: None,
                    by_photons: false,
                    radiance: *radiance,
                });
            }
            Event::Photons { path, sample, radiance, photons } => {
                let tree = &mut trees[*sample as usize];
                let vertex = planting.vertex(tree, *path);
                tree.vertices[vertex].by_photons += *radiance;
                tree.vertices[vertex].photons += photons;
                tree.additions.push(Addition {
                    vertex,
                    light_ray: None,
                    by_photons: true,
                    radiance: *radiance,
                });
            }
            Event::Vertex(shaded) => {
                let tree = &mut trees[shaded.sample as usize];
                let vertex = planting.vertex(tree, shaded.path);
                add_vertex(job.scene(), tree, vertex, shaded, &mut fates);
                planting.leave(job.scene(), vertex, shaded);
            }
        }
    }
    trees
}

/// A ray whose end is not processed yet: the vertex that it leaves, and how its direction was
/// chosen.
#[derive(Clone, Copy)]
struct Twig {
    parent: Option<usize>,
    ray: Option<Ray>,
    scattering: Option<Scattering>,
}

/// Tracks which ray leads to which vertex while trees grow. Paths are numbered anew at each depth:
/// those of the next depth are the rays that leave this one, in order.
#[derive(Default)]
struct Planting {
    depth: Option<u32>,
    arriving: Vec<Twig>,
    leaving: Vec<Twig>,
    /// The vertices of this depth, by the number of their path.
    vertices: Vec<Option<usize>>,
}

impl Planting {
    fn next_depth(&mut self) {
        self.depth = Some(self.depth.map_or(0, |d| d + 1));
        self.arriving = std::mem::take(&mut self.leaving);
        self.vertices.clear();
    }

    /// The position of the vertex at which a path arrives. The vertex is added to the tree the
    /// first time.
    fn vertex(&mut self, tree: &mut PathTree, path: usize) -> usize {
        if self.vertices.len() <= path {
            self.vertices.resize(path + 1, None);
        }
        let twig = self.arriving.get(path).copied().unwrap_or(Twig {
            parent: None,
            ray: None,
            scattering: None,
        });
        *self.vertices[path].get_or_insert_with(|| {
            tree.vertices.push(PathVertex {
                parent: twig.parent,
                depth: self.depth.unwrap_or(0),
                ray: twig.ray.unwrap_or(Ray::new(Vec3::ZERO, Vec3::Z)),
                kind: VertexKind::Absorbed,
                throughput: SampledSpectrum::ZERO,
                scattering: twig.scattering,
                glow: SampledSpectrum::ZERO,
                by_photons: SampledSpectrum::ZERO,
                photons: 0,
                found: SampledSpectrum::ZERO,
                found_weight: 1.0,
                light_rays: Vec::new(),
            });
            tree.vertices.len() - 1
        })
    }

    fn leave(&mut self, scene: &CompiledScene, vertex: usize, shaded: &Shaded) {
        for (ray, state) in &shaded.next {
            let scattering = Some(scattering(scene, shaded, ray, state));
            self.leaving.push(Twig { parent: Some(vertex), ray: Some(*ray), scattering });
        }
    }
}

fn add_vertex<'a>(
    scene: &CompiledScene,
    tree: &mut PathTree,
    number: usize,
    shaded: &Shaded,
    fates: &mut impl Iterator<Item = &'a (SampledSpectrum, bool)>,
) {
    tree.mode = shaded.state.mode;
    let vertex = &mut tree.vertices[number];
    let surface =
        shaded.hit.is_hit().then(|| scene.interaction(&shaded.ray, shaded.state.time, &shaded.hit));
    // Media advance the origin of a ray, but the vertex keeps the whole ray.
    vertex.ray = if vertex.parent.is_some() { vertex.ray } else { shaded.ray };
    vertex.kind = match (&surface, &shaded.medium) {
        (_, Some(medium)) => VertexKind::Medium { position: medium.position },
        (Some(surface), None) => VertexKind::Surface {
            hit: shaded.hit,
            position: surface.position,
            normal: surface.shading_normal,
            material: scene.material_id(&shaded.hit),
        },
        (None, None) => VertexKind::Escaped,
    };
    vertex.throughput = shaded.state.throughput;
    (vertex.found, vertex.found_weight) = (shaded.radiance, shaded.weights.found);
    for ((ray, value), &(arrived, is_blocked)) in shaded.light_rays.iter().zip(fates) {
        let brought = if is_blocked { SampledSpectrum::ZERO } else { arrived };
        let (source, weight) = (shaded.source, shaded.weights.light);
        let lobe = lobe(scene, shaded, surface.as_ref(), ray.direction.normalize_or_zero(), false);
        let light_ray =
            LightRay { ray: *ray, source, value: *value, brought, is_blocked, weight, lobe };
        if !is_blocked {
            tree.additions.push(Addition {
                vertex: number,
                light_ray: Some(vertex.light_rays.len()),
                by_photons: false,
                radiance: arrived,
            });
        }
        vertex.light_rays.push(light_ray);
    }
    tree.additions.push(Addition {
        vertex: number,
        light_ray: None,
        by_photons: false,
        radiance: shaded.radiance,
    });
}

/// How a next ray was chosen at a shaded vertex.
fn scattering(scene: &CompiledScene, shaded: &Shaded, ray: &Ray, state: &PathState) -> Scattering {
    let is_delta = state.bsdf_pdf == 0.0;
    let surface =
        shaded.hit.is_hit().then(|| scene.interaction(&shaded.ray, shaded.state.time, &shaded.hit));
    let lobe = lobe(scene, shaded, surface.as_ref(), ray.direction, is_delta);
    Scattering { lobe, is_delta, pdf: state.bsdf_pdf }
}

/// The lobe that contributes most of the light scattered from `wi` towards the origin of the
/// arriving ray.
fn lobe(
    scene: &CompiledScene,
    shaded: &Shaded,
    surface: Option<&SurfaceInteraction>,
    wi: Vec3,
    is_delta: bool,
) -> Lobe {
    let Some(surface) = surface.filter(|_| shaded.medium.is_none()) else { return Lobe::Volume };
    let id = scene.material_id(&shaded.hit);
    let material = scene.material(id);
    let state = &shaded.state;
    let vertex = SurfaceVertex {
        hit: &shaded.hit,
        interaction: surface,
        material,
        prepared: scene.prepared(id),
        footprint: state.cone_width + state.cone_spread * shaded.hit.t,
        mode: state.mode,
        outside_ior: shaded.outside_ior,
    };
    let wo = -shaded.ray.direction;
    let shading = material.bsdf_towards(&vertex.point(scene), wo);
    let shares = LobeShares::of_surface(&shading, wo, wi, is_delta);
    // The unit spectrum leaves out lanes that carry nothing.
    let share = |lobe: &Lobe| (shares.share(*lobe) * state.mode.unit()).0.iter().sum::<f32>();
    Lobe::ALL.into_iter().max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(Lobe::Diffuse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{IntegratorKind, Settings};
    use snell_intersect::BuildOptions;
    use snell_scene::builtin::builtin;

    /// Checks that the tree of every sample adds up to the sample, and the samples to the pixel of
    /// the picture, bit for bit.
    fn check(name: &str, fog: Option<f32>, settings: &Settings) {
        let mut scene = builtin(name).expect("the scene is built in");
        if let Some(density) = fog {
            snell_scene::framing::fill_with_fog(&mut scene, density)
                .expect("a scene that can be filled");
        }
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let job = Job::new(&compiled, &scene.cameras[0], settings);
        let image = job.run(2, &|_| true).0.image();
        let (mut longest, mut blocked, mut light_rays) = (0, 0, 0);
        for (number, pixel) in image.layers[0].values.chunks_exact(4).enumerate() {
            let at = [number as u32 % settings.size[0], number as u32 / settings.size[0]];
            let explanation =
                explain(&job, at, 1, Wanted::default(), |_| ()).expect("a pixel of the picture");
            assert_eq!(explanation.value, pixel, "{name} {at:?}");
            assert_eq!(explanation.samples.len(), settings.spp as usize);
            for tree in &explanation.samples {
                assert_eq!(
                    tree.color_of(tree.sum()),
                    tree.color,
                    "{name} {at:?} sample {}",
                    tree.number
                );
                let parts = tree.vertices.iter().map(|v| {
                    v.light_rays.iter().fold(v.glow + v.found, |sum, ray| sum + ray.brought)
                });
                let (sum, wanted) = (parts.fold(SampledSpectrum::ZERO, |a, b| a + b), tree.sum());
                let is_close = |(a, b): (f32, f32)| (a - b).abs() <= 1e-5 * b.abs();
                assert!(
                    sum.0.into_iter().zip(wanted.0).all(is_close),
                    "{name} {at:?}: {sum:?} {wanted:?}"
                );
                longest = longest.max(tree.vertices.len());
                let rays = tree.vertices.iter().flat_map(|v| &v.light_rays);
                rays.for_each(|ray| {
                    (light_rays, blocked) = (light_rays + 1, blocked + u32::from(ray.is_blocked))
                });
                for vertex in &tree.vertices[1..] {
                    let parent = &tree.vertices[vertex.parent.expect("only the first has none")];
                    let from = parent.kind.position().expect("paths go on from somewhere");
                    assert!(
                        (vertex.ray.origin - from).length() < 1e-2 * compiled.radius,
                        "{name} {at:?}"
                    );
                    assert_eq!(vertex.depth, parent.depth + 1);
                }
            }
            let last = explanation.convergence.last().expect("there are samples");
            assert_eq!(last.value, pixel[..3], "{name} {at:?}");
        }
        assert!(longest > 2 && light_rays > 0, "{name}: {longest} {light_rays}");
        assert!(fog.is_some() || blocked > 0, "{name}: some lights are hidden");
    }

    #[test]
    fn the_path_trees_of_a_pixel_add_up_to_it() {
        let settings = Settings { size: [12, 9], spp: 19, ..Settings::default() };
        check("cornell-box", None, &settings);
        check("drink", None, &settings);
        check("cornell-box", Some(0.3), &settings);
        let color = snell_math::ColorModel::Spectral;
        check("drink", None, &Settings { color, ..settings.clone() });
        let branching = Settings { integrator: IntegratorKind::Whitted, max_depth: 8, ..settings };
        check("drink", None, &branching);
    }

    #[test]
    fn lobes_have_their_names() {
        let scene = builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let settings = Settings { size: [20, 20], spp: 4, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let explanation =
            explain(&job, [10, 15], 1, Wanted::default(), |_| ()).expect("a pixel of the picture");
        let vertices = explanation.samples.iter().flat_map(|tree| &tree.vertices);
        let lobes: Vec<Lobe> = vertices.filter_map(|v| v.scattering).map(|s| s.lobe).collect();
        assert!(
            lobes.len() > 4 && lobes.iter().all(|l| *l == Lobe::Diffuse),
            "all is matt in the box: {lobes:?}"
        );
    }

    #[test]
    fn a_pixel_outside_of_the_picture_is_none() {
        let scene = builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let settings = Settings { size: [4, 3], spp: 1, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let is_outside = |pixel| explain(&job, pixel, 1, Wanted::default(), |_| ()).is_none();
        assert!(is_outside([4, 0]) && is_outside([0, 3]));
    }

    #[test]
    fn what_is_kept_of_many_samples_is_bounded() {
        let scene = builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let spp = KEPT + 1000;
        let settings = Settings { size: [4, 3], spp, max_depth: 0, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let (last, mut seen) = (KEPT + 500, 0);
        let wanted = Wanted { sample: Some(last), looks: &[1, 7, 40, 5000] };
        let explanation =
            explain(&job, [1, 1], 1, wanted, |_| seen += 1).expect("a pixel of the picture");
        assert_eq!((seen, explanation.samples.len()), (spp, KEPT as usize + 1));
        assert_eq!(explanation.samples.last().map(|tree| tree.number), Some(last));
        let looks: Vec<u32> = explanation.convergence.iter().map(|mean| mean.samples).collect();
        assert_eq!(looks, [1, 7, 40, 5000, spp]);
        let image = job.run(2, &|_| true).0.image();
        assert_eq!(explanation.value, image.layers[0].values[4 * 5..4 * 6]);
    }
}
