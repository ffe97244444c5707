//! Scenes that come with the program. They also show how scenes are built in code.

mod ajar;
mod caustic;
mod cornell_box;
mod drink;
mod fog;
mod hair;
mod minray;
mod night_town;
mod palette;
mod pool;
mod prism;
mod quads;
mod smoke;
mod spheres;
mod teapot;

pub use minray::{MinrayDescription, MinrayError, MinraySphere, minray_scene};

use crate::graph::Scene;

/// A built-in scene.
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// The scene's name on the command line.
    pub name: &'static str,
    /// A description of the scene in one line.
    pub description: &'static str,
    /// Makes the scene.
    pub make: fn() -> Scene,
}

/// All built-in scenes.
pub const BUILTINS: &[Builtin] = &[
    Builtin {
        name: "caustic",
        description: "A glass ball under a small lamp, whose light it gathers on the floor",
        make: caustic::scene,
    },
    Builtin {
        name: "cornell-box",
        description: "The Cornell box with its measured geometry: soft shadows and colour bleeding",
        make: cornell_box::scene,
    },
    Builtin {
        name: "door-ajar",
        description: "A room lit through a door ajar, with the lamp in the next room",
        make: ajar::scene,
    },
    Builtin {
        name: "drink",
        description: "Iced tea in a tumbler: coloured media in glass, within each other",
        make: drink::scene,
    },
    Builtin {
        name: "fog",
        description: "A dusty room into which the sun shines through a barred window",
        make: fog::scene,
    },
    Builtin {
        name: "hair",
        description: "Three balls of fur, of 9000 strands each: brown, blonde and dyed hair",
        make: hair::scene,
    },
    Builtin {
        name: "minray",
        description: "Heckbert's business card ray tracer: five spheres, three of which shine",
        make: minray::scene,
    },
    Builtin {
        name: "night-town",
        description: "A town at night: a thousand lamps of very different strengths, most of them \
            hidden",
        make: night_town::scene,
    },
    Builtin {
        name: "pool",
        description: "A pool under a small sun, whose light the rippled water gathers on its tiles",
        make: pool::scene,
    },
    Builtin {
        name: "prism",
        description: "A slit seen through a prism of flint glass; render it with --color spectral",
        make: prism::scene,
    },
    Builtin {
        name: "smoke",
        description: "A camp fire with its plume of smoke, on grids",
        make: smoke::scene,
    },
    Builtin {
        name: "spheres",
        description: "Metal, glass and plastic balls under a sky, seen through a lens",
        make: spheres::scene,
    },
    Builtin {
        name: "teapot",
        description: "Newell's teapot of 32 Bezier patches on a ground",
        make: teapot::scene,
    },
];

/// Makes the built-in scene of this name; `None` if there is none.
pub fn builtin(name: &str) -> Option<Scene> {
    BUILTINS.iter().find(|b| b.name == name).map(|b| (b.make)())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Geometry;

    #[test]
    fn every_scene_is_found_by_its_name_and_complete() {
        for b in BUILTINS {
            let scene = builtin(b.name).expect("the name is in the list");
            assert_eq!(scene.name, b.name);
            assert!(!b.description.is_empty() && !scene.cameras.is_empty(), "{}", b.name);
            assert!(scene.settings.size.is_some_and(|[w, h]| w > 0 && h > 0));
            assert!(scene.warnings.is_empty());
        }
        assert!(builtin("no such scene").is_none());
    }

    #[test]
    fn every_scene_has_a_valid_graph_with_finite_bounds_and_meshes() {
        for b in BUILTINS {
            let scene = (b.make)();
            let order = scene.topological_order().expect(b.name);
            let bounds = scene.bounds().expect(b.name);
            assert!(bounds.is_finite() && !bounds.is_empty(), "{} {bounds:?}", b.name);
            for surface in order.iter().flat_map(|n| &scene.nodes[n.index()].surfaces) {
                if let Geometry::Mesh(mesh) = &surface.geometry {
                    mesh.validate().expect(b.name);
                    assert!(mesh.normals.iter().all(|n| n.is_normalized()), "{}", b.name);
                }
            }
        }
    }

    #[test]
    fn every_camera_sees_something() {
        for b in BUILTINS {
            let scene = (b.make)();
            let (camera, size) = (&scene.cameras[0], scene.settings.size.expect("a size"));
            let bounds = scene.bounds().expect(b.name);
            let corners = (0..8).map(|i| {
                let pick = |axis: usize| {
                    if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] }
                };
                snell_math::DVec3::new(pick(0), pick(1), pick(2))
            });
            assert!(corners.clone().any(|c| camera.project(c, size).is_some()), "{}", b.name);
        }
    }
}
