//! A town at night with a thousand lamps of very different strengths. From most places, most lamps
//! are hidden.

use super::palette::{matte, plastic};
use super::quads::{ground, quads};
use crate::camera::{Camera, Projection};
use crate::graph::{Background, MaterialId, Node, Scene, Surface};
use crate::material::{Black, Material};
use snell_intersect::shape::{Rectangle, Sphere};
use snell_math::rng::uniform2;
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, Vec2, real};

/// The number of houses along a side of the town.
const HOUSES: u32 = 8;
/// Distance between the middles of neighbouring houses.
const DISTANCE: f32 = 2.0;
/// Half of a house's width.
const HALF: f32 = 0.62;
/// The number of lamps in the streets.
const LAMPS: u32 = 500;
/// The number of lit windows.
const WINDOWS: u32 = 500;

/// The built-in scene: a town with a thousand lamps, half of them bulbs in the streets, half
/// windows.
pub fn scene() -> Scene {
    let mut scene = Scene::new("night-town");
    let street = scene.add_material(plastic("street", Rgb::new(0.2, 0.2, 0.22), 0.35));
    let walls = [Rgb::new(0.55, 0.42, 0.3), Rgb::new(0.5, 0.5, 0.52), Rgb::new(0.6, 0.35, 0.28)]
        .map(|color| scene.add_material(matte("wall", color)));
    let glows = [
        Rgb::new(1.0, 0.55, 0.2),
        Rgb::new(1.0, 0.8, 0.55),
        Rgb::new(0.65, 0.8, 1.0),
        Rgb::new(1.0, 0.25, 0.4),
    ];
    // The materials of the lamps, ordered by colour, then by strength.
    let lamps: Vec<MaterialId> = glows
        .iter()
        .flat_map(|&color| (0..4).map(move |power| color * (4.0 * real::powi(5f32, power))))
        .map(|radiance| scene.add_material(Material::new("lamp", Black {}).emitting(radiance)))
        .collect();
    scene.add_child(
        scene.root,
        Node { surfaces: vec![ground(0.0, 30.0, street)], ..Node::named("ground") },
    );
    for house in 0..HOUSES * HOUSES {
        let surfaces = vec![walls_of(house, walls[house as usize % 3])];
        scene.add_child(scene.root, Node { surfaces, ..Node::named("house") });
    }
    (0..LAMPS).for_each(|i| add_bulb(&mut scene, i, &lamps));
    (0..WINDOWS).for_each(|i| add_window(&mut scene, i, &lamps));
    let eye = DVec3::new(2.2, 5.2, 11.5);
    let camera = Camera::from_target(
        eye,
        DVec3::new(-0.4, 0.4, 1.2),
        DVec3::Y,
        Projection::from_half_angle_x(0.45),
    );
    scene.cameras.push(Camera { name: "main".into(), ..camera });
    scene.background = Background::Color(Rgb::new(0.002, 0.003, 0.008));
    scene.settings.size = Some([800, 500]);
    scene
}

/// The middle of a house on the ground, and its height.
fn house_at(number: u32) -> (Vec2, f32) {
    let place = |k: u32| (k as f32 - (HOUSES - 1) as f32 * 0.5) * DISTANCE;
    (
        Vec2::new(place(number % HOUSES), place(number / HOUSES)),
        0.6 + 1.5 * uniform2([number, 1, 0, 0]).x,
    )
}

fn walls_of(number: u32, material: MaterialId) -> Surface {
    let (m, top) = house_at(number);
    let p = |x: f32, y: f32, z: f32| [m.x + x * HALF, y, m.y + z * HALF];
    let side = |(ax, az): (f32, f32), (bx, bz): (f32, f32)| {
        [p(ax, 0.0, az), p(bx, 0.0, bz), p(bx, top, bz), p(ax, top, az)]
    };
    let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    let roof = corners.map(|(x, z)| p(x, top, z));
    quads(
        &[
            side(corners[0], corners[1]),
            side(corners[1], corners[2]),
            side(corners[2], corners[3]),
            side(corners[3], corners[0]),
            roof,
        ],
        material,
    )
}

fn add_bulb(scene: &mut Scene, number: u32, lamps: &[MaterialId]) {
    let (u, v) = (uniform2([number, 2, 0, 0]), uniform2([number, 3, 0, 0]));
    // The lamp stands along a street, which is between two rows of houses.
    let street =
        (((u.x * (HOUSES - 1) as f32) as u32) as f32 - (HOUSES - 2) as f32 * 0.5) * DISTANCE;
    let along = (u.y * 2.0 - 1.0) * 0.5 * HOUSES as f32 * DISTANCE;
    let across = street + (v.x - 0.5) * 0.5;
    let (x, z) = if number.is_multiple_of(2) { (across, along) } else { (along, across) };
    let at = DVec3::new(x.into(), f64::from(0.1 + 0.5 * v.y * v.y), z.into());
    let radius = 0.012 + 0.02 * f64::from(uniform2([number, 4, 0, 0]).x);
    let surfaces = vec![Surface::shape(Sphere { radius }, lamp(number, lamps))];
    scene.add_child(
        scene.root,
        Node { transform: DAffine3::from_translation(at), surfaces, ..Node::named("bulb") },
    );
}

fn add_window(scene: &mut Scene, number: u32, lamps: &[MaterialId]) {
    let (u, v) = (uniform2([number, 5, 0, 0]), uniform2([number, 6, 0, 0]));
    let (middle, top) = house_at((u.x * (HOUSES * HOUSES) as f32) as u32);
    let normal = [DVec3::X, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Z][(u.y * 4.0) as usize % 4];
    let side = DVec3::Y.cross(normal);
    let along = f64::from((v.x - 0.5) * 1.7 * HALF);
    let height = f64::from(0.15 + v.y * (top - 0.3));
    let base = DVec3::new(middle.x.into(), height, middle.y.into());
    let at = base + normal * f64::from(HALF + 0.004) + side * along;
    let transform = DAffine3 { matrix3: DMat3::from_cols(side, DVec3::Y, normal), translation: at };
    let half_size = DVec2::new(0.05, 0.07);
    let surfaces = vec![Surface::shape(Rectangle { half_size }, lamp(number + LAMPS, lamps))];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named("window") });
}

/// Chooses the material of a lamp; strong lamps are rare.
fn lamp(number: u32, lamps: &[MaterialId]) -> MaterialId {
    let u = uniform2([number, 7, 0, 0]);
    let strength = (real::powi(u.x, 3) * 4.0) as usize;
    lamps[((u.y * 4.0) as usize % 4) * 4 + strength.min(3)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_a_thousand_lamps_outside_of_the_houses() {
        let scene = scene();
        let lamps = scene.nodes.iter().filter(|n| n.name == "bulb" || n.name == "window");
        assert_eq!(lamps.clone().count(), 1000);
        for lamp in lamps {
            let p = lamp.transform.translation;
            let inside = (0..HOUSES * HOUSES).any(|h| {
                let (m, top) = house_at(h);
                let d = (Vec2::new(p.x as f32, p.z as f32) - m).abs().max_element();
                d < HALF && p.y < f64::from(top)
            });
            assert!(!inside && p.y > 0.0, "{p}");
        }
    }
}
