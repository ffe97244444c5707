//! The first surfaces along camera rays, for AOVs: plain surfaces in batches, with the same bits as
//! [`FirstSurface::of`].

use super::plain_surfaces::PlainSurface;
use crate::integrator::aov::Aov;
use crate::integrator::first_surface::{FirstSurface, SurfaceNeeds, in_white_light};
use crate::integrator::{Context, outgoing};
use crate::lanes::{LANES, at};
use snell_intersect::{Hit, SphereHits, TriangleHits, TrianglePoints};
use snell_math::simd::Wide;
use snell_math::{ColorMode, Ray, Rgb, Vec2};

/// Looks up first surfaces on plain meshes and shapes for AOVs, for at most [`LANES`] rays at once.
#[derive(Debug)]
pub struct FirstSurfaces<'a> {
    needs: SurfaceNeeds,
    /// The triangles of each geometry that is a plain mesh; `None` for other geometries.
    plain: Vec<Option<PlainSurface<'a>>>,
    wide: Option<Wide>,
    triangles: TriangleHits,
    spheres: SphereHits,
    points: TrianglePoints,
    /// The geometry of each lane, if it is a plain mesh.
    on: [Option<u32>; LANES],
}

impl<'a> FirstSurfaces<'a> {
    /// Makes the look-up for the AOVs of a render; `None` if they need no surface. If they need
    /// texture coordinates, no surface is looked up in batches.
    pub fn for_aovs(context: &Context<'a>) -> Option<Self> {
        let (scene, aovs) = (context.scene, &context.settings.aovs);
        if !aovs.iter().any(|aov| aov.needs_surface(context)) {
            return None;
        }
        let needs =
            SurfaceNeeds { uv: aovs.contains(&Aov::Uv), albedo: aovs.contains(&Aov::Albedo) };
        let wide = scene.world.simd().wide();
        let is_many = wide.is_some() && !needs.uv;
        let plain = |geometry| {
            PlainSurface::of(context, geometry).filter(|s| is_many && !s.needs.has_tangent)
        };
        Some(Self {
            needs,
            plain: (0..scene.world.geometry_count() as u32).map(plain).collect(),
            wide,
            triangles: TriangleHits::default(),
            spheres: SphereHits::default(),
            points: TrianglePoints::default(),
            on: [None; LANES],
        })
    }

    /// The data that the AOVs need.
    pub fn needs(&self) -> SurfaceNeeds {
        self.needs
    }

    /// Looks up the surfaces at the hits of the first [`LANES`] rays.
    pub fn look_up(&mut self, context: &Context, rays: &[Ray], hits: &[Hit]) {
        self.spheres.clear();
        self.on = [None; LANES];
        let lanes = || rays.iter().zip(hits).take(LANES).enumerate();
        for (lane, (ray, hit)) in lanes() {
            if !hit.is_hit() || hit.instance != 0 {
                continue;
            }
            let Some(surface) = plain_surface(&self.plain, hit.geometry) else { continue };
            if surface.mesh.is_some()
                || context.scene.world.gather_sphere(ray, hit, lane, &mut self.spheres)
            {
                self.on[lane] = Some(hit.geometry);
            }
        }
        let mesh = |lane: usize| plain_surface(&self.plain, self.on[lane]?)?.mesh.as_ref();
        self.triangles
            .gather(lanes().filter_map(|(lane, (_, hit))| Some((lane, mesh(lane)?, hit))));
        self.triangles.points(&mut self.points, self.wide);
        self.spheres.points(&mut self.points, self.wide);
    }

    /// The surface of a lane, if it is a plain one.
    pub fn at(&self, lane: usize, ray: &Ray, mode: ColorMode) -> Option<FirstSurface> {
        let (points, surface) = (&self.points, plain_surface(&self.plain, self.on[lane]?)?);
        if points.is_sound[lane] == 0 {
            return None;
        }
        let position = at(&points.position, lane);
        let (geometric_normal, shading_normal) =
            (at(&points.geometric_normal, lane), at(&points.shading_normal, lane));
        let albedo = || surface.albedo(mode, [geometric_normal, shading_normal], outgoing(ray));
        let albedo = if self.needs.albedo { in_white_light(mode, albedo()) } else { Rgb::BLACK };
        Some(FirstSurface { position, geometric_normal, shading_normal, uv: Vec2::ZERO, albedo })
    }
}

fn plain_surface<'p, 'a>(
    plain: &'p [Option<PlainSurface<'a>>],
    geometry: u32,
) -> Option<&'p PlainSurface<'a>> {
    plain.get(geometry as usize)?.as_ref()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Settings;
    use crate::batch::twins::{assert_same_at_every_level, every_second_node};
    use crate::compile::Moving;
    use snell_math::ColorModel;
    use snell_scene::builtin::builtin;
    use snell_scene::material::{MaterialKind, NormalMap};
    use snell_scene::{Texture, texture::Pattern};

    #[test]
    fn layers_of_surfaces_are_the_bits_of_one_hit_at_a_time() {
        let kinds = MaterialKind::examples();
        let geometric =
            [Aov::Position, Aov::Normal, Aov::GeometricNormal, Aov::Facing, Aov::Motion];
        let both = [&geometric[..], &[Aov::Albedo]].concat();
        let all = [&both[..], &[Aov::Uv]].concat();
        let mut first = 0;
        for name in
            ["cornell-box", "teapot", "spheres", "prism", "minray", "night-town", "fog", "hair"]
        {
            let mut scene = builtin(name).expect("the scene is built in");
            let texture = scene.add_texture(Texture::Pattern(Pattern::examples().remove(0)));
            for (aovs, color) in [
                (&geometric[..], ColorModel::Rgb),
                (&both, ColorModel::Rgb),
                (&both, ColorModel::Spectral),
                (&all, ColorModel::Rgb),
            ] {
                for (i, material) in
                    scene.materials.iter_mut().enumerate().filter(|(_, m)| !m.is_emissive())
                {
                    material.kind = kinds[(first + i) % kinds.len()].clone();
                    material.normal_map = (i % 5 == 4).then_some(NormalMap::new(texture, 0.3));
                }
                first += 3;
                let settings = Settings {
                    size: [48, 36],
                    spp: 2,
                    max_depth: 1,
                    color,
                    aovs: aovs.to_vec(),
                    ..Settings::default()
                };
                for moving in [Moving::default(), every_second_node(&scene)] {
                    assert_same_at_every_level(&scene, &moving, &settings);
                }
            }
        }
    }
}
