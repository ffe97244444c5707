//! Balls of fur: the same strands with three kinds of hair.

use super::palette::matte;
use super::quads::ground;
use crate::camera::{Camera, Projection};
use crate::framing::sky_seen_by;
use crate::graph::{Geometry, Node, Scene, Surface};
use crate::light::Directional;
use crate::material::{Hair, Material};
use snell_intersect::shape::Sphere;
use snell_intersect::{Curves, StrandBasis};
use snell_math::{DAffine3, DVec3, Rgb, Vec3, real, rng, rotation};
use std::f32::consts::TAU;
use std::sync::Arc;

/// The number of strands of a ball.
const STRANDS: u32 = 9000;
/// Radius of a ball's skin.
const SKIN: f32 = 0.72;
/// Radius of a strand at its root.
const THICKNESS: f32 = 0.0045;

/// The strands of a ball of fur around the origin. The roots are distributed evenly by the golden
/// angle; the strands bend into tufts and hang slightly.
fn fur() -> Curves {
    let golden = TAU * (1.0 - 2.0 / (1.0 + 5f32.sqrt()));
    let mut points = Vec::new();
    for i in 0..STRANDS {
        let y = 1.0 - (2.0 * i as f32 + 1.0) / STRANDS as f32;
        let (sin, cos) = real::sin_cos((golden * i as f32).rem_euclid(TAU));
        let up = Vec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin);
        let random = |k: u32| rng::pcg4d([i, k, 7, 3]).map(rng::to_unit);
        let [a, b, c, length] = random(0);
        // A slow swirl over the ball, which neighbouring strands share, and individual variation.
        let swirl = Vec3::new(
            real::sin(5.0 * up.y) + real::cos(7.0 * up.z),
            real::sin(6.0 * up.x),
            real::cos(5.0 * up.z + 4.0 * up.y),
        );
        let own = Vec3::new(a - 0.5, b - 0.5, c - 0.5);
        let lean = swirl.cross(up) * 0.22 + own * 0.35;
        let length = 0.34 + 0.12 * length;
        for k in 0..4u8 {
            let s = f32::from(k) / 3.0;
            let hanging = Vec3::NEG_Y * (0.3 * s * s);
            let position = up * (SKIN - 0.01) + (up * s + lean * (s * s) + hanging) * length;
            points.push(position.extend(THICKNESS * (1.0 - 0.7 * s)));
        }
    }
    let counts = vec![4; STRANDS as usize];
    Curves::new(StrandBasis::Bezier, points, counts).expect("four points each")
}

/// The built-in scene of three balls of fur on a ground.
pub fn scene() -> Scene {
    let mut scene = Scene::new("hair");
    let floor = scene.add_material(matte("ground", Rgb::new(0.4, 0.38, 0.36)));
    scene.add_child(
        scene.root,
        Node { surfaces: vec![ground(0.0, 60.0, floor)], ..Node::named("ground") },
    );
    let fur = Arc::new(fur());
    let blonde = Hair { longitudinal_roughness: 0.25.into(), ..Hair::pigmented(0.25, 0.05) };
    let dyed = Hair {
        color: Rgb::new(0.75, 0.16, 0.3).into(),
        longitudinal_roughness: 0.35.into(),
        ..Hair::default()
    };
    let kinds = [("brown", Hair::pigmented(1.3, 0.2)), ("blonde", blonde), ("dyed", dyed)];
    for ((name, hair), x) in kinds.into_iter().zip([-2.3, 0.0, 2.3]) {
        let skin = scene
            .add_material(matte(&format!("skin below {name} hair"), Rgb::new(0.25, 0.16, 0.12)));
        let hair = scene.add_material(Material::new(format!("{name} hair"), hair));
        let surfaces = vec![
            Surface::with_material(Geometry::Curves(fur.clone()), hair),
            Surface::shape(Sphere { radius: f64::from(SKIN) }, skin),
        ];
        let transform =
            DAffine3::from_mat3_translation(rotation::about(DVec3::Y, x), DVec3::new(x, 1.15, 0.0));
        scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(name) });
    }
    let camera = Camera::from_target(
        DVec3::new(0.0, 2.6, 8.2),
        DVec3::new(0.0, 1.05, 0.0),
        DVec3::Y,
        Projection::from_half_angle_x(0.42),
    );
    scene.environment = Some(sky_seen_by(&camera, DVec3::Y));
    // The sun is behind the balls, so that it shines through thin parts of the fur.
    scene.add_light(Directional {
        direction: DVec3::new(0.5, -0.7, 0.65).normalize(),
        irradiance: Rgb::splat(2.5),
    });
    scene.cameras.push(Camera { name: "main".into(), ..camera });
    scene.settings.size = Some([800, 400]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec4;

    #[test]
    fn strands_grow_out_of_the_skin() {
        let fur = fur();
        assert_eq!(fur.strands().len(), STRANDS as usize);
        for strand in fur.strand_points() {
            let height = |p: &Vec4| p.truncate().length();
            assert!(
                height(&strand[0]) < SKIN && strand[1..].iter().all(|p| height(p) > SKIN),
                "{strand:?}"
            );
        }
    }
}
