//! Shapes: their geometry, transform, material and emission.
//!
//! Texture coordinates: in pbrt v points up on meshes and on shapes; in the scene it is flipped to
//! point down on both.

mod curve;
mod loop_subdivision;
mod mesh;
mod patch;
mod quadric;

use super::Builder;
use super::light::AreaLight;
use super::material::Finish;
use super::options::is_kind;
use super::params::{Params, Type};
use crate::scene::fault::Fault;
use crate::scene::shapes::{ShapeTable, wind_by_normals};
use snell_intersect::{AnyShape, Curves, Shape, StrandBasis, TriangleMesh};
use snell_math::{DAffine3, DVec3, Transform, Vec3, Vec4, real};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Surface};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// State that the shapes of a scene share.
#[derive(Debug, Default)]
pub struct Shapes {
    /// Area lights in the order of definition.
    pub area_lights: Vec<AreaLight>,
    table: ShapeTable,
    /// Meshes read from files, by path and whether their orientation was reversed.
    files: HashMap<(PathBuf, bool), (Arc<TriangleMesh>, DVec3, Lamps)>,
    /// The last surface's parent node, its transform and its node. A further surface with the same
    /// transform joins it.
    last: Option<(NodeId, DAffine3, NodeId)>,
    triangles: usize,
    /// Total number of triangles generated for other primitives.
    made: usize,
    /// Curves so far, by the node that holds them and their materials.
    strands: Vec<Strands>,
    /// Total number of points of all curves.
    strand_points: usize,
}

/// Curves with the same transform and materials.
#[derive(Debug)]
struct Strands {
    node: NodeId,
    materials: Vec<MaterialId>,
    points: Vec<Vec4>,
    /// Number of points of each curve.
    counts: Vec<u32>,
}

/// Maximum number of triangles generated for curves, subdivision surfaces and parts of shapes in
/// one scene: a short file can ask for any number.
const MAX_MADE: usize = 1 << 25;
/// Memory of a generated triangle, including its vertices and its part of the acceleration
/// structure.
const MADE_BYTES: u64 = 100;

/// The geometry made for a shape.
pub enum Made {
    /// Triangles, the place of their zero in object space, and the lights that they are if they
    /// emit.
    Mesh(Arc<TriangleMesh>, DVec3, Lamps),
    /// An analytic shape and its place in object space.
    Shape(Box<AnyShape>, DAffine3),
    /// A strand of cubic Bézier segments, with radii.
    Strand(Vec<Vec4>),
    /// The shape is invisible.
    Nothing,
}

/// The area lights that a mesh is if it emits: in pbrt each of them has the whole `power`.
#[derive(Clone, Debug)]
pub enum Lamps {
    /// Every triangle is a light.
    Triangles,
    /// Every run of so many triangles is a patch and a light.
    Patches(Arc<[u32]>),
    /// The mesh stands for one round shape of this area in its own space.
    Whole(f64),
}

impl Made {
    /// Makes an analytic shape.
    fn shape(shape: impl Into<AnyShape>, object_from_shape: DAffine3) -> Self {
        Self::Shape(Box::new(shape.into()), object_from_shape)
    }
}

impl Builder<'_> {
    /// Reads `Shape "sphere" ...`.
    pub(super) fn shape(&mut self, params: Params) -> Result<(), Fault> {
        // The shape's transform at the start of the motion.
        let [place, _] = self.state.transform.0;
        if Transform::new(place).is_none() {
            self.note_singular(params.at);
            return Ok(());
        }
        let made = self.make_shape(&params)?;
        let alpha = self.pattern_param(&params, "alpha", false)?;
        if let Some(param) = params.get("shadowalpha") {
            let at = param.at;
            self.note("shadowalpha", at, || "\"shadowalpha\": shadows follow alpha instead".into());
        }
        self.note_unused(&params);
        let emission = self.emission(&params, &made, place);
        // pbrt samples such lamps and never meets them (DiffuseAreaLight's constructor).
        let is_hidden = emission.is_some()
            && alpha.as_ref().and_then(|a| a.as_constant()).is_some_and(|alpha| alpha.r == 0.0);
        let finish = Finish {
            emission,
            is_hidden,
            alpha: alpha
                .filter(|a| !is_hidden && a.as_constant().is_none_or(|c| c.r < 1.0))
                .map(|a| self.scalar_param(&a)),
            interior: self.interior(),
        };
        let materials = self.finished_material(&finish, params.at);
        if materials.is_empty() {
            self.mention("interface", params.at, || {
                "surfaces without a material that bound no medium are not seen, and were left out"
                    .into()
            });
            return Ok(());
        }
        let (geometry, object_from_geometry) = match made {
            Made::Nothing => return Ok(()),
            Made::Mesh(mesh, origin, _) => {
                self.count_triangles(&params, mesh.indices.len())?;
                (Geometry::Mesh(mesh), DAffine3::from_translation(origin))
            }
            Made::Shape(shape, object_from_shape) => {
                (self.shapes.table.shared(*shape), object_from_shape)
            }
            Made::Strand(points) => return self.add_strand(&params, place, points, materials),
        };
        let moves = self.moves();
        let node = self.node_at(place * object_from_geometry, moves);
        self.note_motion(node, object_from_geometry);
        let surfaces = materials.into_iter().map(|m| Surface::with_material(geometry.clone(), m));
        self.scene.nodes[node.index()].surfaces.extend(surfaces);
        Ok(())
    }

    /// Adds a curve to those with the same transform and materials.
    fn add_strand(
        &mut self,
        params: &Params,
        place: DAffine3,
        points: Vec<Vec4>,
        materials: Vec<MaterialId>,
    ) -> Result<(), Fault> {
        self.shapes.strand_points += points.len();
        let limit = self.main.options.limits.elements;
        if self.shapes.strand_points > limit {
            return Err(params.fault(
                format!("the scene has more than {limit} points of curves, the limit"),
                "split it",
            ));
        }
        let moves = self.moves();
        let node = self.node_at(place, moves);
        self.note_motion(node, DAffine3::IDENTITY);
        let count = points.len() as u32;
        match self.shapes.strands.last_mut() {
            Some(last) if last.node == node && last.materials == materials => {
                last.points.extend(points);
                last.counts.push(count);
            }
            _ => self.shapes.strands.push(Strands { node, materials, points, counts: vec![count] }),
        }
        Ok(())
    }

    /// Adds the curves to their nodes.
    pub(super) fn finish_curves(&mut self) {
        for Strands { node, materials, points, counts } in std::mem::take(&mut self.shapes.strands)
        {
            let curves = Curves::new(StrandBasis::Bezier, points, counts)
                .expect("whole segments, fewer than the limit");
            let geometry = Geometry::Curves(Arc::new(curves));
            let surfaces =
                materials.into_iter().map(|m| Surface::with_material(geometry.clone(), m));
            self.scene.nodes[node.index()].surfaces.extend(surfaces);
        }
    }

    fn make_shape(&mut self, params: &Params) -> Result<Made, Fault> {
        let kind = |kind: &str| is_kind(params, kind);
        if kind("trianglemesh") {
            self.triangle_mesh(params)
        } else if kind("plymesh") {
            self.ply_mesh(params)
        } else if kind("bilinearmesh") {
            self.bilinear_mesh(params)
        } else if kind("loopsubdiv") {
            self.loop_subdivision(params)
        } else if kind("curve") {
            self.curve(params)
        } else if kind("sphere")
            || kind("cylinder")
            || kind("disk")
            || kind("cone")
            || kind("paraboloid")
        {
            self.quadric(params)
        } else if kind("hyperboloid") {
            self.hyperboloid(params)
        } else {
            let owner = params.owner.clone();
            self.note(owner.clone(), params.at, || {
                format!("{owner} is not a known shape; it was left out")
            });
            Ok(Made::Nothing)
        }
    }

    /// The radiance of the shape, and whether both sides emit; `None` if the shape does not emit.
    fn emission(
        &mut self,
        params: &Params,
        made: &Made,
        place: DAffine3,
    ) -> Option<(snell_scene::material::ColorParam, bool)> {
        let light = self.shapes.area_lights[self.state.area_light?].clone();
        if self.is_without_surface() {
            self.note("emitting interface", params.at, || {
                "a surface without a material does not emit, as in pbrt".into()
            });
            return None;
        }
        if self.object.is_some() {
            self.note("area light in object", params.at, || {
                "area lights within object definitions do not emit, as in pbrt".into()
            });
            return None;
        }
        let area = if light.depends_on_area() { self.piece_area(params, made, place) } else { 1.0 };
        Some((light.radiance(area), light.both_sides))
    }

    /// The area by which `power` is divided: in pbrt, `power` is that of each triangle or bilinear
    /// patch (here, of the mean one), or of a whole round shape in its own space.
    fn piece_area(&mut self, params: &Params, made: &Made, place: DAffine3) -> f64 {
        let (mesh, lamps) = match made {
            Made::Shape(shape, _) => return shape.area(),
            Made::Nothing => return 0.0,
            Made::Strand(points) => return side_area(points, place),
            Made::Mesh(_, _, Lamps::Whole(area)) => return *area,
            Made::Mesh(mesh, _, lamps) => (mesh, lamps),
        };
        let area = |triangle: usize| {
            let [a, b, c] = mesh.corners(triangle).map(|p| place.transform_point3(p.as_dvec3()));
            0.5 * (b - a).cross(c - a).length()
        };
        let mut triangles = (0..mesh.indices.len()).map(area);
        let (piece, areas): (_, Vec<f64>) = match lamps {
            Lamps::Patches(counts) => {
                let patch = |&count: &u32| triangles.by_ref().take(count as usize).sum();
                ("bilinear patch", counts.iter().map(patch).collect())
            }
            _ => ("triangle", triangles.collect()),
        };
        let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
        if areas.iter().any(|area| *area > mean * 1.01) {
            self.note(format!("power of each {piece}"), params.at, || {
                format!(
                    "\"power\" is that of each {piece}, and these differ: all got the radiance of \
                    the mean one"
                )
            });
        }
        mean
    }

    fn count_triangles(&mut self, params: &Params, count: usize) -> Result<(), Fault> {
        self.shapes.triangles += count;
        let limit = self.main.options.limits.elements;
        if self.shapes.triangles <= limit {
            return Ok(());
        }
        Err(params
            .fault(format!("the scene has more than {limit} triangles, the limit"), "split it"))
    }

    /// True if this many more triangles may be generated.
    fn may_make(&mut self, params: &Params, triangles: usize) -> bool {
        let made = self.shapes.made.saturating_add(triangles);
        let owner = params.owner.clone();
        if made > MAX_MADE {
            self.note("made triangles", params.at, || {
                format!(
                    "{owner} needs more than {MAX_MADE} triangles together with those before \
                    it; it was left out"
                )
            });
            return false;
        }
        if let Err(error) = self.main.charge(triangles as u64 * MADE_BYTES, "its triangles") {
            self.note("made triangles", params.at, || {
                format!("{owner}: {}; it was left out", error.problem)
            });
            return false;
        }
        self.shapes.made = made;
        true
    }

    /// The node for surfaces at a transform of the current object; moving surfaces get a node of
    /// their own.
    fn node_at(&mut self, transform: DAffine3, moves: bool) -> NodeId {
        let parent = self.parent();
        if let Some((last_parent, last_transform, node)) = self.shapes.last
            && last_parent == parent
            && last_transform == transform
            && !moves
        {
            return node;
        }
        let node = self.scene.add_child(parent, Node { transform, ..Node::default() });
        self.shapes.last = Some((parent, transform, node)).filter(|_| !moves);
        node
    }

    /// True if the winding of triangles is to be reversed.
    fn is_reversed(&self) -> bool {
        self.state.reverse_orientation
    }

    /// Marks parameters that many shapes have and that have no effect here.
    fn note_common(&mut self, params: &Params) {
        if let Some(param) = params.get("displacement") {
            let at = param.at;
            self.note("shape displacement", at, || {
                "\"displacement\" of a mesh was ignored: it stays smooth".into()
            });
        }
        for name in ["edgelength", "splitdepth", "faceIndices"] {
            params.get(name);
        }
    }

    /// A whole number of at least `least`, in a parameter.
    fn count_param(
        &self,
        params: &Params,
        name: &str,
        default: i64,
        range: [i64; 2],
    ) -> Result<usize, Fault> {
        let number = params.integer(name)?.unwrap_or(default);
        if !(range[0]..=range[1]).contains(&number) {
            let problem = format!("\"{name}\" is {number}");
            return Err(
                params.fault(problem, format!("give a number from {} to {}", range[0], range[1]))
            );
        }
        Ok(number as usize)
    }

    /// The required points of a shape.
    fn points(&self, params: &Params) -> Result<Vec<Vec3>, Fault> {
        let points = params.points("P")?;
        if points.is_empty() {
            return Err(params.fault("there are no points", "give some in \"point3 P\""));
        }
        Ok(points)
    }
}

/// The approximate side area of a strand, from its control polygon.
fn side_area(points: &[Vec4], place: DAffine3) -> f64 {
    let scale = real::cbrt(place.matrix3.determinant().abs());
    let side = |ends: &[Vec4]| {
        let [a, b] = [ends[0], ends[1]].map(|p| place.transform_point3(p.truncate().as_dvec3()));
        (b - a).length() * f64::from(ends[0].w + ends[1].w) * std::f64::consts::PI * scale
    };
    points.windows(2).map(side).sum()
}

/// Checks that an attribute of a mesh is present for each vertex.
fn check_length(params: &Params, name: &str, found: usize, vertices: usize) -> Result<(), Fault> {
    if found == 0 || found == vertices {
        return Ok(());
    }
    let problem = format!("\"{name}\" has {found} values, but there are {vertices} vertices");
    Err(
        match params
            .typed(name, &[Type::Normal, Type::Vector3, Type::Point2, Type::Vector2, Type::Float])?
        {
            Some(param) => param.fault(problem, "give one for each vertex"),
            None => params.fault(problem, "give one for each vertex"),
        },
    )
}

/// Flips v to point down.
fn flip_v(mesh: &mut TriangleMesh) {
    for uv in &mut mesh.uvs[0] {
        uv.y = 1.0 - uv.y;
    }
}

/// Reverses triangles that face away from their vertex normals; without normals, reverses all if
/// `reversed`. In pbrt, a triangle's outer side is that of its normals.
fn orient(mesh: &mut TriangleMesh, reversed: bool) {
    if mesh.normals.is_empty() {
        if reversed {
            mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
        }
        return;
    }
    if reversed {
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }
    wind_by_normals(mesh);
}
