//! Batches of vertices of `path` and `direct` on smooth glass and mirrors
//! ([`crate::integrator::path`]). Delta lobes need no light samples, so only the next rays are
//! computed.

use crate::batch::vertices::{
    CarriedColumns, CarriedLanes, MarkLanes, OtherPoint, RayColumns, Roulette, UNMARKED,
    VertexLanes,
};
use crate::batch::{Batch, BatchShader, Shaded};
use crate::integrator::carried::Marks;
use crate::integrator::roulette::unknown_survival;
use crate::integrator::{Context, dimension};
use crate::lanes::{
    BLACK, ENDLESS, HitColors, LANES, NOUGHTS, ZERO, at, at_level_by_color, put_color,
};
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors, PlainMesh};
use snell_intersect::{GeometryId, Hit, TrianglePoints};
use snell_math::simd::max;
use snell_math::{ColorModel, Frame, Ray, Vec3, at_level, robust};
use snell_scene::Material;
use snell_scene::bsdf::Split;
use snell_scene::material::{Specular, reflecting_normal};

/// Shades vertices on specular surfaces.
#[derive(Debug)]
pub struct SpecularShader<'a> {
    /// By geometry: the mesh, if it is a plain one.
    meshes: Vec<Option<PlainMesh<'a>>>,
    /// By material: its specular lobes, if it is specular.
    materials: Vec<Option<Specular>>,
    lanes: VertexLanes,
    color: ColorModel,
    lobes: Lobes,
    /// Shading normals.
    normal: HitVectors,
    bounces: Bounces,
}

/// What the surfaces do to light, by lane.
#[derive(Debug)]
struct Lobes {
    /// Index of refraction inside divided by that outside.
    ior: HitLanes,
    /// By channel, the factor on light that crosses the surface.
    tint: HitColors,
    /// By channel, the factor on light that arrives from inside.
    arriving: HitColors,
    /// By channel, the factor on reflected light at surfaces without refraction.
    reflectance: HitColors,
    /// 1 where the surface reflects only, 0 where it also refracts.
    is_mirror: [u32; LANES],
}

/// The next rays of paths, by lane.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    origin: HitVectors,
    /// The shading normals on the side of the paths.
    facing: HitVectors,
    /// By channel, the throughput along the next ray.
    throughput: HitColors,
    eta_scale: HitLanes,
    /// See [`crate::integrator::carried::Carried::marks`].
    marks: MarkLanes,
    /// 1 where there is a next ray, 0 where the path ends.
    exists: [u32; LANES],
}

/// The specular lobes of a material, if [`SpecularShader`] can shade it.
pub fn specular_part(context: &Context, material: &Material) -> Option<Specular> {
    let settings = context.settings;
    // In spectral mode, only interfaces without dispersion: among a path's wavelengths only their
    // tint differs.
    let knows_color = |lobe: &Specular| match settings.color {
        ColorModel::Rgb => true,
        ColorModel::Spectral => {
            matches!(lobe, Specular::Interface { .. }) && !material.is_dispersive()
        }
    };
    Specular::of(material).filter(|lobe| settings.integrator.is_path() && knows_color(lobe))
}

impl<'a> SpecularShader<'a> {
    /// Makes the shader; `None` if the scene has no specular surfaces, or with portable code.
    pub fn new(context: &Context<'a>, sampler: &Sampler) -> Option<Self> {
        let (scene, color) = (context.scene, context.settings.color);
        let wide = scene.world.simd().wide()?;
        let materials: Vec<_> =
            scene.materials.iter().map(|material| specular_part(context, material)).collect();
        if materials.iter().all(Option::is_none) {
            return None;
        }
        let plain = |geometry| scene.world.plain_mesh(GeometryId(geometry));
        let meshes = (0..scene.world.geometry_count() as u32).map(plain).collect();
        let (number, mark) = ([0.0; LANES], [0; LANES]);
        Some(Self {
            meshes,
            materials,
            lanes: VertexLanes::new(sampler, Some(wide)),
            color,
            lobes: Lobes {
                ior: number,
                tint: BLACK,
                arriving: BLACK,
                reflectance: BLACK,
                is_mirror: mark,
            },
            normal: ZERO,
            bounces: Bounces {
                wi: ZERO,
                origin: ZERO,
                facing: ZERO,
                throughput: BLACK,
                eta_scale: number,
                marks: UNMARKED,
                exists: mark,
            },
        })
    }

    /// The specular lobes of the surface that a path hit.
    fn lobe(&self, batch: &Batch, path: u32) -> Option<&Specular> {
        self.materials.get(batch.materials[path as usize] as usize)?.as_ref()
    }

    /// Puts the vertices of these paths into the lanes.
    fn gather(&mut self, batch: &Batch, paths: &[u32]) {
        self.lanes.start(batch, paths);
        for lane in 0..self.lanes.paths().len() {
            self.gather_lane(batch, lane);
        }
        let meshes = &self.meshes;
        self.lanes.gather_triangles(batch.paths, |hit| plain_mesh(meshes, hit));
    }

    fn gather_lane(&mut self, batch: &Batch, lane: usize) {
        let path = self.lanes.paths()[lane] as usize;
        let (ray, hit) = (&batch.paths.rays[path], &batch.paths.hits[path]);
        let number = batch.materials[path] as usize;
        let Some(lobe) = &self.materials[number] else { return };
        let (context, material) = (batch.context, &batch.context.scene.materials[number]);
        self.lobes.ior[lane] = lobe.ior(batch.outside_ior(path));
        match lobe {
            Specular::Interface { .. } => {
                let mode = self.lanes.modes[lane];
                put_color(&mut self.lobes.tint, lane, lobe.tint(mode));
                put_color(&mut self.lobes.arriving, lane, lobe.transmittance(hit.t, mode));
                self.lobes.is_mirror[lane] = 0;
            }
            Specular::Reflector(_) => self.lobes.is_mirror[lane] = 1,
        }
        if material.is_bent() {
            self.gather_other(context, lane, ray, hit, material);
        } else if plain_mesh(&self.meshes, hit).is_some() {
            self.lanes.put_triangle(lane);
        } else if !self.lanes.gather_shape(context, lane, ray, hit) {
            self.gather_other(context, lane, ray, hit, material);
        }
    }

    #[inline(never)]
    fn gather_other(
        &mut self,
        context: &Context,
        lane: usize,
        ray: &Ray,
        hit: &Hit,
        material: &Material,
    ) {
        let surface = context.scene.interaction(ray, self.lanes.times[lane], hit);
        let footprint = self.lanes.carried.cone_width[lane];
        let normal = material.shading_normal(&context.scene.shading_point(
            &surface,
            footprint,
            self.lanes.modes[lane],
        ));
        self.lanes.put_point(lane, OtherPoint::of(&surface, normal, Vec3::ZERO));
    }

    /// Computes the outputs of the lanes.
    fn shade_lanes(&mut self, batch: &Batch) {
        let (context, depth) = (batch.context, batch.depth);
        self.lanes.place();
        let wide = self.lanes.wide;
        let choice = self.lanes.randoms.numbers(dimension::LOBE, wide);
        let roulette = self.lanes.roulette(context, depth);
        at_level!(
            wide,
            normals,
            (
                points: &TrianglePoints = &self.lanes.points,
                wo: &HitVectors = &self.lanes.wo,
                normal: &mut HitVectors = &mut self.normal,
            )
        );
        for (lane, &path) in self.lanes.paths().iter().enumerate() {
            let cos = at(&self.normal, lane).dot(at(&self.lanes.wo, lane));
            let lobe = self.lobe(batch, path);
            if let Some(reflectance) = lobe.and_then(|lobe| lobe.reflectance(cos.abs())) {
                put_color(&mut self.lobes.reflectance, lane, reflectance);
            }
        }
        let known = Known {
            points: &self.lanes.points,
            wo: &self.lanes.wo,
            carried: &self.lanes.carried,
            normal: &self.normal,
            lobes: &self.lobes,
            choice: &choice,
            is_guided: context.field.is_some(),
            roulette: &roulette,
        };
        at_level_by_color!(
            wide,
            self.color,
            bounce,
            (known: &Known<'_> = &known, to: &mut Bounces = &mut self.bounces)
        );
    }
}

/// The mesh that was hit, if it is a plain one outside of instances.
fn plain_mesh<'m, 'a>(meshes: &'m [Option<PlainMesh<'a>>], hit: &Hit) -> Option<&'m PlainMesh<'a>> {
    meshes[hit.geometry as usize].as_ref().filter(|_| hit.instance == 0)
}

impl<'a> BatchShader<'a> for SpecularShader<'a> {
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize {
        if batch.has_journal || batch.wants_lobes() {
            return 0;
        }
        let is_specular = |path: &&u32| self.lobe(batch, **path).is_some();
        paths.iter().take(LANES).take_while(is_specular).count()
    }

    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        // Specular surfaces do not emit light, so the last vertex of a path adds nothing.
        if batch.is_last() {
            return self.lanes.clear();
        }
        self.gather(batch, paths);
        self.shade_lanes(batch);
    }

    fn shaded(&self) -> Shaded<'_> {
        let Self { lanes, bounces, .. } = self;
        Shaded {
            paths: lanes.paths(),
            is_sound: &lanes.points.is_sound,
            goes_on: &bounces.exists,
            next_rays: RayColumns {
                origin: &bounces.origin,
                direction: &bounces.wi,
                end: &ENDLESS,
            },
            carried: CarriedColumns {
                throughput: &bounces.throughput,
                eta_scale: &bounces.eta_scale,
                cone_width: &lanes.carried.cone_width,
                cone_spread: &lanes.carried.cone_spread,
                marks: &bounces.marks,
                position: &lanes.points.position,
                bsdf_pdf: &NOUGHTS,
                normal: &bounces.facing,
            },
            ..Shaded::NONE
        }
    }
}

/// The normals by which mirrors reflect ([`reflecting_normal`]).
#[inline(always)]
fn normals(points: &TrianglePoints, wo: &HitVectors, normal: &mut HitVectors) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let n = reflecting_normal(
            vector(&points.shading_normal),
            vector(&points.geometric_normal),
            vector(wo),
        );
        (0..3).for_each(|axis| normal[axis][i] = n[axis]);
    }
}

/// The inputs of [`bounce`].
struct Known<'a> {
    points: &'a TrianglePoints,
    wo: &'a HitVectors,
    carried: &'a CarriedLanes,
    normal: &'a HitVectors,
    lobes: &'a Lobes,
    /// Random numbers that choose a lobe.
    choice: &'a HitLanes,
    is_guided: bool,
    roulette: &'a Roulette,
}

/// Computes the next directions and throughputs.
#[inline(always)]
fn bounce<const CHANNELS: usize>(known: &Known, to: &mut Bounces) {
    let Known { points, wo, carried, normal, lobes, choice, is_guided, roulette } = *known;
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let (wo, n, flat) = (vector(wo), vector(normal), vector(&points.geometric_normal));
        let frame = Frame::from_z(n);
        let local = frame.to_local(wo);
        let split = Split::at(local, lobes.ior[i]);
        let is_mirror = lobes.is_mirror[i] != 0;
        let reflects = is_mirror | (choice[i] < split.reflectance);
        let pick = |mirrored: f32, refracted: f32| if reflects { mirrored } else { refracted };
        let next = Vec3::new(
            pick(-local.x, split.refracted.x),
            pick(-local.y, split.refracted.y),
            pick(local.z, split.refracted.z),
        );
        let direction = frame.from_local(next);
        let scale = 1.0 / direction.length();
        let wi = direction * scale;
        let sides = flat.dot(wo) * flat.dot(wi);
        let agrees = if reflects { sides > 0.0 } else { (sides < 0.0) & split.is_partial };
        let mut exists = (local.z != 0.0) & agrees & (scale > 0.0) & (scale < f32::INFINITY);
        let (mut throughput, mut largest, mut largest_weight) = ([0.0; CHANNELS], 0.0, 0.0);
        for (channel, throughput) in throughput.iter_mut().enumerate() {
            let absorbed = if local.z < 0.0 { lobes.arriving[channel][i] } else { 1.0 };
            let (share, rest) = (split.reflectance, 1.0 - split.reflectance);
            let mirrored = absorbed * share / share;
            let refracted =
                lobes.tint[channel][i] * Split::compression(split.eta) * absorbed * rest / rest;
            let weight =
                if is_mirror { lobes.reflectance[channel][i] } else { pick(mirrored, refracted) };
            *throughput = carried.throughput[channel][i] * weight;
            largest = max(largest, *throughput);
            largest_weight = max(largest_weight, weight);
            exists &= throughput.abs() < f32::INFINITY;
        }
        let crossing = pick(1.0, split.eta * split.eta);
        let eta_scale = carried.eta_scale[i] * crossing;
        // This is the weight of `GuidedBsdf::survival`.
        let weight = if is_guided {
            largest_weight * crossing
        } else {
            unknown_survival(largest * eta_scale)
        };
        let (scale, survives) = roulette.survival(i, weight);
        exists &= (largest > 0.0) & survives;
        let origin = robust::offset_ray_origin(
            vector(&points.position),
            vector(&points.position_error),
            flat,
            wi,
        );
        for axis in 0..3 {
            to.wi[axis][i] = wi[axis];
            to.origin[axis][i] = origin[axis];
            to.facing[axis][i] = if n.dot(wo) < 0.0 { -n[axis] } else { n[axis] };
        }
        for (to, throughput) in to.throughput.iter_mut().zip(throughput) {
            to[i] = throughput * scale;
        }
        to.eta_scale[i] = eta_scale;
        let marks = carried.marks[i];
        to.marks[i] = Marks::new(marks.expected(), !is_mirror, marks.is_specular());
        to.exists[i] = u32::from(exists);
    }
}

#[cfg(test)]
mod tests {
    use crate::batch::twins::{assert_same_at_every_level, every_second_node};
    use crate::compile::Moving;
    use crate::sampler::SamplerKind;
    use crate::{Guiding, IntegratorKind, Settings};
    use snell_math::{ColorModel, Rgb};
    use snell_scene::Texture;
    use snell_scene::builtin::builtin;
    use snell_scene::material::{Conductor, Dielectric, MaterialKind, Mirror, NormalMap};
    use snell_scene::texture::Pattern;

    /// Every kind of specular material, without parameters that vary over the surface.
    fn kinds() -> [MaterialKind; 6] {
        let tint = Rgb::new(0.9, 0.7, 1.0).into();
        [
            Dielectric::smooth(1.5).into(),
            Dielectric { tint, absorption: Rgb::new(0.1, 0.0, 0.02), ..Dielectric::smooth(1.33) }
                .into(),
            Conductor::gold(0.0).into(),
            Mirror::new(Rgb::new(0.8, 0.9, 0.7)).into(),
            Dielectric::smooth(1.0).into(),
            Conductor::color(Rgb::new(0.9, 0.5, 0.4), 0.0).into(),
        ]
    }

    #[test]
    fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
        let guiding = Guiding { passes: 2, photons: 1 << 13 };
        for name in ["cornell-box", "teapot", "spheres", "night-town", "fog", "drink"] {
            let mut scene = builtin(name).expect("the scene is built in");
            let bumps = Pattern::examples()
                .into_iter()
                .find(|p| p.textures().is_empty())
                .expect("there is one");
            let texture = scene.add_texture(Texture::Pattern(bumps));
            // Some of the materials are left as they are.
            let materials = scene
                .materials
                .iter_mut()
                .filter(|m| !m.is_emissive() && m.interior.is_none())
                .skip(1);
            for (material, kind) in materials.step_by(2).zip(kinds().into_iter().cycle()) {
                material.normal_map = matches!(kind, MaterialKind::Conductor(_))
                    .then_some(NormalMap::new(texture, 0.3));
                material.kind = kind;
            }
            let ways = [
                (IntegratorKind::Path, SamplerKind::ZSobol, None, None, ColorModel::Rgb),
                (IntegratorKind::Path, SamplerKind::Independent, Some(2.0), None, ColorModel::Rgb),
                (
                    IntegratorKind::Path,
                    SamplerKind::Independent,
                    None,
                    Some(guiding),
                    ColorModel::Rgb,
                ),
                (IntegratorKind::Direct, SamplerKind::Stratified, None, None, ColorModel::Rgb),
                (IntegratorKind::Path, SamplerKind::ZSobol, None, None, ColorModel::Spectral),
                (
                    IntegratorKind::Path,
                    SamplerKind::Independent,
                    None,
                    Some(guiding),
                    ColorModel::Spectral,
                ),
            ];
            for (integrator, sampler, clamp, guiding, color) in ways {
                let how =
                    Settings { max_depth: 9, sampler, integrator, clamp, ..Settings::default() };
                let settings = Settings { size: [36, 24], spp: 4, guiding, color, ..how };
                assert_same_at_every_level(&scene, &Moving::default(), &settings);
                if sampler == SamplerKind::Independent && guiding.is_none() {
                    assert_same_at_every_level(&scene, &every_second_node(&scene), &settings);
                }
            }
        }
    }
}
