//! The scene graph: a directed acyclic graph of nodes, and the tables that nodes refer to.
//!
//! Nodes refer to each other by ids instead of pointers, so a node used under two parents is stored
//! once. Transforms compose in double precision.

use crate::camera::Camera;
use crate::image::Image;
use crate::light::Light;
use crate::light::environment::Portal;
use crate::material::Material;
use crate::medium::Medium;
use crate::motion::Motion;
use crate::settings::SceneSettings;
use crate::texture::Texture;
use snell_intersect::{AnyShape, Curves, Shape, TriangleMesh};
use snell_math::parameters::{Kind, Value, Visitor};
use snell_math::{Bounds3d, DAffine3, DVec3, Rgb, Transform};
use std::collections::BTreeMap;
use std::sync::Arc;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident in $table:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[derive(serde::Serialize, serde::Deserialize)]
        pub struct $name(pub u32);

        impl $name {
            /// The name of an entry of the table that the id points into.
            pub const TABLE: &'static str = $table;

            /// The position in that table.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl Value for $name {
            const KIND: Kind = Kind::Reference(Self::TABLE);

            fn visit(&self, visitor: &mut Visitor<'_>) {
                visitor.reference(Self::TABLE, self.0);
            }
        }
    };
}

id!(
    /// Position in [`Scene::nodes`].
    NodeId in "node"
);
id!(
    /// Position in [`Scene::materials`].
    MaterialId in "material"
);
id!(
    /// Position in [`Scene::textures`].
    TextureId in "texture"
);
id!(
    /// Position in [`Scene::images`].
    ImageId in "image"
);
id!(
    /// Position in [`Scene::media`].
    MediumId in "medium"
);

/// The geometry of a surface. Shared by reference: a mesh used twice is stored once.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A triangle mesh.
    Mesh(Arc<TriangleMesh>),
    /// An analytic shape.
    Shape(Arc<AnyShape>),
    /// Curves of round cross-section, in bulk: hair, fur, grass. The texture coordinate `u` runs
    /// from 0 at the root to 1 at the tip, and `v` around the curve.
    Curves(Arc<Curves>),
}

impl Geometry {
    /// Bounds in the geometry's own coordinates.
    pub fn bounds(&self) -> Bounds3d {
        match self {
            Self::Mesh(mesh) => mesh.bounds().into(),
            Self::Shape(shape) => shape.bounds(),
            Self::Curves(curves) => curves.bounds_of_all(),
        }
    }

    /// True if its vertices or control points have colours.
    pub fn has_colors(&self) -> bool {
        match self {
            Self::Mesh(mesh) => !mesh.colors.is_empty(),
            Self::Shape(_) => false,
            Self::Curves(curves) => !curves.colors().is_empty(),
        }
    }

    /// A description for users, such as "sphere" or "mesh of 12 triangles".
    pub fn describe(&self) -> String {
        match self {
            Self::Shape(shape) => shape.name().to_string(),
            Self::Mesh(mesh) => format!("mesh of {} triangles", mesh.indices.len()),
            Self::Curves(curves) => match (curves.ball_count(), curves.strands().len()) {
                (0, strands) => format!("curves of {strands} strands"),
                (balls, strands) if balls == strands => format!("{balls} balls"),
                (balls, strands) => {
                    format!("{balls} balls and {} curves", strands - balls)
                }
            },
        }
    }
}

/// A geometry with its materials.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The mesh, shape or curves, in the coordinates of the node.
    pub geometry: Geometry,
    /// The material of each slot ([`TriangleMesh::material_slots`]; other geometries have slot 0
    /// only). A slot that is `None` or missing takes the material of the node, or of the nearest
    /// ancestor that has one.
    pub materials: Vec<Option<MaterialId>>,
}

impl Surface {
    /// A surface that takes its material from the node.
    pub fn new(geometry: Geometry) -> Self {
        Self { geometry, materials: Vec::new() }
    }

    /// A surface whose slot 0 has this material.
    pub fn with_material(geometry: Geometry, material: MaterialId) -> Self {
        Self { geometry, materials: vec![Some(material)] }
    }

    /// A surface that is a shape with this material.
    pub fn shape(shape: impl Into<AnyShape>, material: MaterialId) -> Self {
        Self::with_material(Geometry::Shape(Arc::new(shape.into())), material)
    }
}

/// A node of the scene graph. Children are further nodes; the same child may have several parents.
#[derive(Clone, Debug)]
pub struct Node {
    /// A name for users; it need not be unique and may be empty.
    pub name: String,
    /// Map from the node's coordinates to its parent's: `parent_from_node`.
    pub transform: DAffine3,
    /// Child nodes.
    pub children: Vec<NodeId>,
    /// Surfaces in the node's coordinates.
    pub surfaces: Vec<Surface>,
    /// Material of the surfaces of this node, and of nodes below, that have none of their own.
    pub material: Option<MaterialId>,
}

impl Default for Node {
    fn default() -> Self {
        Self {
            name: String::new(),
            transform: DAffine3::IDENTITY,
            children: Vec::new(),
            surfaces: Vec::new(),
            material: None,
        }
    }
}

impl Node {
    /// An empty node with a name.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }
}

/// Light from all directions.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// Constant radiance from all directions, W / (m^2 sr).
    Constant(Rgb),
    /// A latitude-longitude image.
    Image {
        /// The picture, in linear radiance; row 0 is the zenith.
        image: Arc<Image>,
        /// Factor on the picture's radiance.
        scale: Rgb,
        /// Map from the environment's coordinates to the world. In the environment's coordinates
        /// `+y` is the zenith and the middle of the picture is `-z`, with `+x` to its right (the
        /// convention of glTF viewers).
        world_from_environment: DAffine3,
    },
}

/// The background, which camera rays that leave the scene show.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Background {
    /// The environment, or black if the scene has none.
    #[default]
    Environment,
    /// A linear colour, which illuminates nothing.
    Color(Rgb),
    /// No background: the pixel has alpha 0.
    Transparent,
    /// A colour that the scene casts its shadow on.
    ShadowCatcher(ShadowCatcher),
}

/// A background of one colour that shows the scene's shadow on a floor, in the light of the
/// environment. Only camera rays see it, so it lights nothing, and mirrors do not show it.
///
/// The colour is that of the floor where the whole sky over it is unoccluded, so that no horizon is
/// visible. Without an environment there is no shadow.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ShadowCatcher {
    /// The linear colour.
    pub color: Rgb,
    /// The direction away from the floor, of any length.
    pub up: DVec3,
    /// The distance from the origin to the floor, along `up`.
    pub height: f64,
}

/// The cause of a warning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WarningKind {
    /// Something in the scene differs from the file, or was left out.
    #[default]
    Changed,
    /// A file that the scene names is missing, or cannot be read.
    Missing,
    /// The reader made a choice that the file leaves open, or the file uses a feature of another
    /// program; nothing is wrong.
    Choice,
    /// The scene has numbers that are not finite, as they were in the file.
    NotFinite,
}

/// A message of a reader or check for the user. Equal messages are counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// One sentence with the problem, its place, and what was done instead.
    pub message: String,
    /// Number of occurrences, at least 1.
    pub count: u64,
    /// The cause of the warning.
    pub kind: WarningKind,
}

/// Writes the message, followed by the number of occurrences if there are several.
impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.count {
            1 => f.write_str(&self.message),
            count => write!(f, "{} ({count} times)", self.message),
        }
    }
}

impl Warning {
    /// Maximum number of different warnings in one list.
    const MAX_DIFFERENT: usize = 1000;

    /// Adds a warning to a list. A warning that is in the list already is counted instead of
    /// repeated, and beyond a thousand different ones all are counted together.
    pub fn note(list: &mut Vec<Self>, message: String, count: u64) {
        Self::note_of(WarningKind::Changed, list, message, count);
    }

    /// Does what [`Self::note`] does for a warning of any kind.
    pub fn note_of(kind: WarningKind, list: &mut Vec<Self>, message: String, count: u64) {
        let known = list.iter().position(|w| w.message == message);
        match known {
            Some(i) => list[i].count += count,
            None if list.len() < Self::MAX_DIFFERENT => list.push(Self { message, count, kind }),
            None if list.len() == Self::MAX_DIFFERENT => list.push(Self {
                message: "there are more warnings than are shown".into(),
                count,
                kind,
            }),
            None => list[Self::MAX_DIFFERENT].count += count,
        }
    }
}

/// A whole scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The name of the scene, which most readers take from the file's name.
    pub name: String,
    /// All nodes. Only nodes that can be reached from the root are part of the picture.
    pub nodes: Vec<Node>,
    /// The root of the graph; its transform maps to the world.
    pub root: NodeId,
    /// Materials by id.
    pub materials: Vec<Material>,
    /// Textures by id.
    pub textures: Vec<Texture>,
    /// Images by id, shared by textures.
    pub images: Vec<Arc<Image>>,
    /// Media by id, in world coordinates. They fill the insides of surfaces
    /// ([`crate::material::Interior`]).
    pub media: Vec<Medium>,
    /// The medium outside of all interiors of surfaces, such as the fog of a landscape.
    pub medium: Option<MediumId>,
    /// Lights that are not surfaces, in world coordinates.
    pub lights: Vec<Light>,
    /// Cameras in world coordinates; there may be none. The first is used unless another is
    /// requested.
    pub cameras: Vec<Camera>,
    /// Light from all directions, if there is any.
    pub environment: Option<Environment>,
    /// The portals through which alone points see the environment; empty if they see it everywhere.
    pub portals: Vec<Portal>,
    /// The background, which camera rays that leave the scene show.
    pub background: Background,
    /// Ambient light of local illumination: the radiance of a surface with ambient reflectance 1.
    /// Only the integrators `raycast` and `whitted` use it; the others compute indirect light.
    pub ambient: Rgb,
    /// Render settings of the file, which options override.
    pub settings: SceneSettings,
    /// Names and values of the file's parameters, such as `$name` in Mitsuba scenes.
    pub parameters: Vec<(String, String)>,
    /// Warnings of the reader.
    pub warnings: Vec<Warning>,
    /// The reader's notes on conversions that are not obvious. They are shown on request and are
    /// not warnings.
    pub notes: Vec<Warning>,
    /// Names of the file's material variants; empty for files without variants.
    pub variants: Vec<String>,
    /// Names of the scenes in the file, including this one; empty for formats with one scene.
    pub scenes: Vec<String>,
    /// The motion of the scene, if there is any; see [`Scene::apply`]. Everything else describes
    /// the scene at rest.
    pub motion: Option<Arc<Motion>>,
}

/// The reason why a scene graph cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SceneError {
    /// A node is its own descendant.
    #[error("node {node} (\"{name}\") is its own descendant; a scene graph must not have cycles")]
    Cycle {
        /// The number of a node on the cycle.
        node: u32,
        /// The node's name.
        name: String,
    },
    /// A material refers to a texture that is not in the table.
    #[error("material {material} (\"{name}\") refers to texture {id}, but there are only {count}")]
    DanglingTexture {
        /// The number of the material.
        material: usize,
        /// The material's name.
        name: String,
        /// The id of the missing texture.
        id: u32,
        /// The length of the table.
        count: usize,
    },
    /// Something refers to a medium that is not in the table.
    #[error("{what} refers to medium {id}, but there are only {count}")]
    DanglingMedium {
        /// A description of what refers to it.
        what: String,
        /// The id of the missing medium.
        id: u32,
        /// The length of the table.
        count: usize,
    },
    /// A node refers to an entry that is not in its table.
    #[error("node {node} (\"{name}\") refers to {what} {id}, but there are only {count}")]
    DanglingId {
        /// The number of the node.
        node: u32,
        /// The node's name.
        name: String,
        /// What the node refers to, such as "material".
        what: &'static str,
        /// The id of the missing entry.
        id: u32,
        /// The length of the table.
        count: usize,
    },
}

impl Default for Scene {
    fn default() -> Self {
        Self::new("")
    }
}

impl Scene {
    /// An empty scene, which has a root node and nothing else.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            nodes: vec![Node::named("root")],
            root: NodeId(0),
            materials: Vec::new(),
            textures: Vec::new(),
            images: Vec::new(),
            media: Vec::new(),
            medium: None,
            lights: Vec::new(),
            cameras: Vec::new(),
            environment: None,
            portals: Vec::new(),
            background: Background::default(),
            ambient: Rgb::BLACK,
            settings: SceneSettings::default(),
            parameters: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            variants: Vec::new(),
            scenes: Vec::new(),
            motion: None,
        }
    }

    /// Adds a node without a parent, and returns its id.
    pub fn add_node(&mut self, node: Node) -> NodeId {
        self.nodes.push(node);
        NodeId(self.nodes.len() as u32 - 1)
    }

    /// Adds a node below `parent`, and returns its id.
    pub fn add_child(&mut self, parent: NodeId, node: Node) -> NodeId {
        let id = self.add_node(node);
        self.nodes[parent.index()].children.push(id);
        id
    }

    /// Adds a material, and returns its id.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId(self.materials.len() as u32 - 1)
    }

    /// Adds an image, and returns its id.
    pub fn add_image(&mut self, image: Arc<Image>) -> ImageId {
        self.images.push(image);
        ImageId(self.images.len() as u32 - 1)
    }

    /// Adds a texture, and returns its id.
    pub fn add_texture(&mut self, texture: impl Into<Texture>) -> TextureId {
        self.textures.push(texture.into());
        TextureId(self.textures.len() as u32 - 1)
    }

    /// Adds a light that is not a surface.
    pub fn add_light(&mut self, light: impl Into<Light>) {
        self.lights.push(light.into());
    }

    /// Adds a medium, and returns its id.
    pub fn add_medium(&mut self, medium: impl Into<Medium>) -> MediumId {
        self.media.push(medium.into());
        MediumId(self.media.len() as u32 - 1)
    }

    /// True if the file declares a parameter of this name.
    pub fn takes_parameter(&self, name: &str) -> bool {
        self.parameters.iter().any(|(known, _)| known == name)
    }

    /// Adds a warning. An equal one is counted instead of repeated.
    pub fn warn(&mut self, message: impl Into<String>) {
        self.warn_of(WarningKind::Changed, message);
    }

    /// Adds a warning of this kind. An equal one is counted instead of repeated.
    pub fn warn_of(&mut self, kind: WarningKind, message: impl Into<String>) {
        Warning::note_of(kind, &mut self.warnings, message.into(), 1);
    }

    /// Adds a note on a conversion. An equal one is counted instead of repeated.
    pub fn note(&mut self, message: impl Into<String>) {
        Warning::note(&mut self.notes, message.into(), 1);
    }

    /// Checks that all ids are in range and that no node is its own descendant. Returns the
    /// reachable nodes, each once, children before parents.
    pub fn topological_order(&self) -> Result<Vec<NodeId>, SceneError> {
        #[derive(Clone, Copy, PartialEq)]
        enum Mark {
            New,
            Open,
            Done,
        }
        let mut marks = vec![Mark::New; self.nodes.len()];
        let mut order = Vec::new();
        self.check_ids(self.root)?;
        marks[self.root.index()] = Mark::Open;
        // The stack is explicit, because files may nest deeper than a thread's stack allows.
        let mut stack = vec![(self.root, 0)];
        while let Some((id, next)) = stack.pop() {
            let Some(&child) = self.nodes[id.index()].children.get(next) else {
                marks[id.index()] = Mark::Done;
                order.push(id);
                continue;
            };
            stack.push((id, next + 1));
            match marks[child.index()] {
                Mark::Done => {}
                Mark::Open => {
                    let name = self.nodes[child.index()].name.clone();
                    return Err(SceneError::Cycle { node: child.0, name });
                }
                Mark::New => {
                    self.check_ids(child)?;
                    marks[child.index()] = Mark::Open;
                    stack.push((child, 0));
                }
            }
        }
        Ok(order)
    }

    /// Checks that the textures of all materials are in the table of textures.
    pub fn check_textures(&self) -> Result<(), SceneError> {
        for (material, declaration) in self.materials.iter().enumerate() {
            if let Some(TextureId(id)) = self.missing_texture(declaration) {
                let (name, count) = (declaration.name.clone(), self.textures.len());
                return Err(SceneError::DanglingTexture { material, name, id, count });
            }
        }
        Ok(())
    }

    /// A texture of the material that is not in the table of textures, if there is one.
    pub(crate) fn missing_texture(&self, material: &Material) -> Option<TextureId> {
        material.textures().into_iter().find(|texture| texture.index() >= self.textures.len())
    }

    fn check_ids(&self, id: NodeId) -> Result<(), SceneError> {
        let Some(node) = self.nodes.get(id.index()) else {
            let name = String::new();
            return Err(SceneError::DanglingId {
                node: id.0,
                name,
                what: "node",
                id: id.0,
                count: self.nodes.len(),
            });
        };
        let dangling = |what, dangling: u32, count| {
            Err(SceneError::DanglingId {
                node: id.0,
                name: node.name.clone(),
                what,
                id: dangling,
                count,
            })
        };
        if let Some(child) = node.children.iter().find(|c| c.index() >= self.nodes.len()) {
            return dangling("child node", child.0, self.nodes.len());
        }
        let of_surfaces = node.surfaces.iter().flat_map(|s| s.materials.iter().flatten());
        if let Some(m) =
            of_surfaces.chain(&node.material).find(|m| m.index() >= self.materials.len())
        {
            return dangling("material", m.0, self.materials.len());
        }
        Ok(())
    }

    /// The bounding box of each reachable node in the node's own coordinates. The box includes the
    /// children, by their transforms.
    pub fn node_bounds(&self) -> Result<BTreeMap<NodeId, Bounds3d>, SceneError> {
        let mut bounds = BTreeMap::new();
        for id in self.topological_order()? {
            let node = &self.nodes[id.index()];
            let own =
                node.surfaces.iter().fold(Bounds3d::EMPTY, |b, s| b.union(&s.geometry.bounds()));
            let all = node.children.iter().fold(own, |b, child| {
                // A singular transform flattens its subtree, which then has no surface to hit.
                let placed = Transform::new(self.nodes[child.index()].transform);
                b.union(&placed.map_or(Bounds3d::EMPTY, |m| m.bounds(&bounds[child])))
            });
            bounds.insert(id, all);
        }
        Ok(bounds)
    }

    /// The box around all surfaces in world coordinates. Its sides may be infinite; it is empty for
    /// a scene without surfaces.
    pub fn bounds(&self) -> Result<Bounds3d, SceneError> {
        let root = self.node_bounds()?[&self.root];
        Ok(Transform::new(self.nodes[self.root.index()].transform)
            .map_or(Bounds3d::EMPTY, |m| m.bounds(&root)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::shape::Sphere;
    use snell_math::DVec3;

    fn two_balls_shared() -> (Scene, NodeId) {
        let mut scene = Scene::new("test");
        let ball = scene.add_node(Node {
            surfaces: vec![Surface::new(Geometry::Shape(Arc::new(Sphere { radius: 1.0 }.into())))],
            ..Node::named("ball")
        });
        for x in [-2.0, 2.0] {
            let transform = DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
            let place = Node { transform, children: vec![ball], ..Node::named("place") };
            scene.add_child(scene.root, place);
        }
        (scene, ball)
    }

    #[test]
    fn a_shared_subtree_is_visited_once_and_bounds_every_use() {
        let (scene, ball) = two_balls_shared();
        assert_eq!(
            scene.topological_order().expect("no cycle").iter().filter(|&&n| n == ball).count(),
            1
        );
        let bounds = scene.bounds().expect("no cycle");
        assert_eq!(
            (bounds.min, bounds.max),
            (DVec3::new(-3.0, -1.0, -1.0), DVec3::new(3.0, 1.0, 1.0))
        );
    }

    #[test]
    fn a_cycle_is_an_error_that_names_a_node() {
        let (mut scene, ball) = two_balls_shared();
        let root = scene.root;
        scene.nodes[ball.index()].children.push(root);
        let error = scene.topological_order().expect_err("the graph has a cycle");
        assert!(error.to_string().contains("its own descendant"), "{error}");
    }

    #[test]
    fn a_dangling_id_is_an_error() {
        let (mut scene, ball) = two_balls_shared();
        scene.nodes[ball.index()].material = Some(MaterialId(3));
        assert!(matches!(scene.bounds(), Err(SceneError::DanglingId { what: "material", .. })));
    }

    #[test]
    fn warnings_beyond_a_thousand_are_only_counted() {
        let mut scene = Scene::new("test");
        for i in 0..100_000 {
            scene.warn(format!("warning {i}"));
            scene.warn("the same");
        }
        assert_eq!(scene.warnings.len(), 1001);
        assert_eq!(scene.warnings.iter().map(|w| w.count).sum::<u64>(), 200_000);
    }

    #[test]
    fn a_chain_of_a_hundred_thousand_nodes_does_not_overflow_the_stack() {
        let mut scene = Scene::new("deep");
        let mut last = scene.root;
        for _ in 0..100_000 {
            last = scene.add_child(last, Node::default());
        }
        assert_eq!(scene.topological_order().expect("no cycle").len(), 100_001);
    }
}
