//! The contents of a file, and the conversion to and from the scene graph.

use super::motion::MotionForm;
use super::numbers::Numbers;
use crate::image::read_image;
use crate::{Input, Limits};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use snell_intersect::{AnyShape, Curves, Shape, StrandBasis, TriangleMesh};
use snell_math::{DAffine3, DVec4, Rgb, Vec2, Vec3, Vec4};
use snell_scene::graph::MediumId;
use snell_scene::light::environment::Portal;
use snell_scene::medium::{CellGrid, CellValue, ColorGrid, Medium, ScalarGrid};
use snell_scene::texture::Wrap;
use snell_scene::written::{Rows, affine, rows};
use snell_scene::{
    Background, Camera, Encoding, Environment, Geometry, Image, Light, Material, MaterialId, Node,
    NodeId, Pixels, Scene, SceneSettings, Surface, Texture,
};
use std::collections::HashMap;
use std::sync::Arc;

/// A whole file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// The format's name.
    pub format: String,
    /// The format's version.
    pub version: u32,
    #[serde(default)]
    pub name: String,
    #[serde(default)]
    pub settings: SceneSettings,
    #[serde(default)]
    pub background: Background,
    #[serde(default)]
    pub ambient: Rgb,
    #[serde(default)]
    pub environment: Option<EnvironmentForm>,
    #[serde(default)]
    pub portals: Vec<Portal>,
    #[serde(default)]
    pub cameras: Vec<Camera>,
    #[serde(default)]
    pub lights: Vec<Light>,
    #[serde(default)]
    pub materials: Vec<Material>,
    #[serde(default)]
    pub textures: Vec<Texture>,
    #[serde(default)]
    pub images: Vec<ImageForm>,
    #[serde(default)]
    pub media: Vec<Medium>,
    #[serde(default)]
    pub grids: Vec<GridForm>,
    #[serde(default)]
    pub media_grids: Vec<MediumGrids>,
    #[serde(default)]
    pub medium: Option<MediumId>,
    pub root: NodeId,
    pub nodes: Vec<NodeForm>,
    #[serde(default)]
    pub meshes: Vec<MeshForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curves: Vec<CurvesForm>,
    #[serde(default)]
    pub motion: Option<MotionForm>,
}

/// Values on a regular grid.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridForm {
    size: [usize; 3],
    values: Numbers<f32>,
    /// True if values are not interpolated between cells.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    stepped: bool,
    /// What the values in the outer halves of the outermost cells are interpolated with.
    #[serde(default = "clamp", skip_serializing_if = "is_clamp")]
    wrap: Wrap,
}

fn clamp() -> Wrap {
    Wrap::Clamp
}

fn is_clamp(wrap: &Wrap) -> bool {
    *wrap == Wrap::Clamp
}

/// The grids of a medium.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MediumGrids {
    medium: MediumId,
    density: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    emission_scale: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    temperature: Option<u32>,
    /// Grids of red, green and blue, of the same size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sigma_a_tint: Option<[u32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sigma_s_tint: Option<[u32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    emission_tint: Option<[u32; 3]>,
}

/// Light from all directions.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum EnvironmentForm {
    Constant(Rgb),
    Image { image: ImageForm, scale: Rgb, world_from_environment: Rows },
}

/// A picture: its pixels, or an encoded file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "a picture has width, height, channels, encoding and pixels, or encoded"
)]
pub enum ImageForm {
    Pixels(PixelsForm),
    Encoded(EncodedForm),
}

/// The bytes of an image file in any supported format, so that other programs can embed it without
/// decoding.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncodedForm {
    encoded: Numbers<u8>,
}

/// The pixels of an image.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PixelsForm {
    width: u32,
    height: u32,
    channels: u32,
    encoding: Encoding,
    pixels: PixelForm,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PixelForm {
    U8(Numbers<u8>),
    U16(Numbers<u16>),
    F32(Numbers<f32>),
}

/// A node of the scene graph.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeForm {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    #[serde(default = "identity", skip_serializing_if = "is_identity")]
    transform: Rows,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<MaterialId>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    surfaces: Vec<SurfaceForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    children: Vec<NodeId>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceForm {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mesh: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shape: Option<AnyShape>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    curves: Option<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    materials: Vec<Option<MaterialId>>,
}

/// A mesh; its attributes are flat lists of numbers.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshForm {
    positions: Numbers<f32>,
    indices: Numbers<u32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    normals: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    tangents: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    uvs: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    second_uvs: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    third_uvs: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    fourth_uvs: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    colors: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    material_slots: Numbers<u16>,
    /// The positions in double precision, of a mesh that has them.
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    exact: Numbers<f64>,
}

/// Strands, as a flat list of four numbers per point: position and radius.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvesForm {
    #[serde(default)]
    basis: StrandBasis,
    points: Numbers<f32>,
    /// Number of points of each strand.
    strands: Numbers<u32>,
    /// Linear RGB and alpha of each point; empty if all are white.
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    colors: Numbers<f32>,
    /// The points in double precision, of strands that have them.
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    exact: Numbers<f64>,
}

/// A place in the file (a JSON pointer), and the problem there.
pub type Flaw = (String, String);

fn identity() -> Rows {
    rows(&DAffine3::IDENTITY)
}

fn is_identity(rows: &Rows) -> bool {
    *rows == identity()
}

/// Refuses values that would not survive a round trip: numbers that are not finite, and state that
/// is not serialised.
fn check<T: Serialize + DeserializeOwned + PartialEq>(
    what: &str,
    items: &[T],
) -> Result<(), String> {
    for (number, item) in items.iter().enumerate() {
        let again = serde_json::to_string(item).and_then(|text| serde_json::from_str::<T>(&text));
        if !again.is_ok_and(|again| again == *item) {
            return Err(format!(
                "{what} {number} holds what this format cannot express, such as an infinite \
                    number"
            ));
        }
    }
    Ok(())
}

impl Document {
    /// Converts a scene to a document. (Warnings that the reader of another file gave are left
    /// out.)
    pub fn of(scene: &Scene) -> Result<Self, String> {
        let Scene {
            name,
            nodes,
            root,
            materials,
            textures,
            images,
            media,
            medium,
            lights,
            cameras,
            environment,
            portals,
            background,
            ambient,
            settings,
            parameters: _,
            warnings: _,
            notes: _,
            variants: _,
            scenes: _,
            motion,
        } = scene;
        check("camera", cameras)?;
        check("light", lights)?;
        check("material", materials)?;
        let (grids, media_grids) = grids(media);
        let bare: Vec<Medium> = media.iter().map(Medium::without_grids).collect();
        check("medium", &bare)?;
        check("texture", textures)?;
        check("settings", std::slice::from_ref(settings))?;
        let mut meshes = Meshes::default();
        let mut curves = CurvesTable::default();
        let nodes = nodes.iter().map(|node| NodeForm::of(node, &mut meshes, &mut curves)).collect();
        let motion = motion.as_ref().map(|motion| MotionForm::of(motion, &mut meshes));
        if motion.as_ref().is_some_and(|motion| !motion.is_sayable()) {
            return Err(
                "the motion holds numbers that are not finite, which this format cannot express"
                    .into(),
            );
        }
        Ok(Self {
            format: super::FORMAT.into(),
            version: super::VERSION,
            name: name.clone(),
            settings: settings.clone(),
            background: *background,
            ambient: *ambient,
            environment: environment.as_ref().map(EnvironmentForm::of),
            portals: portals.clone(),
            cameras: cameras.clone(),
            lights: lights.clone(),
            materials: materials.clone(),
            textures: textures.clone(),
            images: images.iter().map(|image| ImageForm::of(image)).collect(),
            media: bare,
            grids,
            media_grids,
            medium: *medium,
            root: *root,
            nodes,
            meshes: meshes.forms,
            curves: curves.forms,
            motion,
        })
    }

    /// Converts the document to a scene.
    pub fn scene(self, input: &Input) -> Result<Scene, Flaw> {
        let limits = &input.options.limits;
        let mut meshes = Vec::with_capacity(self.meshes.len());
        for (i, mesh) in self.meshes.into_iter().enumerate() {
            meshes.push(Arc::new(
                mesh.mesh(limits).map_err(|(key, flaw)| (format!("/meshes/{i}/{key}"), flaw))?,
            ));
        }
        let mut curves = Vec::with_capacity(self.curves.len());
        for (i, form) in self.curves.into_iter().enumerate() {
            curves.push(Arc::new(
                form.curves(limits).map_err(|(key, flaw)| (format!("/curves/{i}/{key}"), flaw))?,
            ));
        }
        let mut images = Vec::with_capacity(self.images.len());
        for (i, image) in self.images.into_iter().enumerate() {
            images
                .push(Arc::new(image.image(input).map_err(|flaw| (format!("/images/{i}"), flaw))?));
        }
        let errors =
            snell_scene::texture::errors(&self.textures, images.len()).into_iter().enumerate();
        if let Some((i, error)) = errors.into_iter().find_map(|(i, error)| Some((i, error?))) {
            return Err((format!("/textures/{i}"), error.to_string()));
        }
        let mut nodes = Vec::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.into_iter().enumerate() {
            nodes.push(
                node.node(&meshes, &curves)
                    .map_err(|(key, flaw)| (format!("/nodes/{i}{key}"), flaw))?,
            );
        }
        let things = [self.cameras.len(), self.lights.len()];
        let motion = self.motion.map(|form| form.motion(&nodes, &meshes, things)).transpose();
        let motion =
            motion.map_err(|(place, flaw)| (format!("/motion{place}"), flaw))?.map(Arc::new);
        let mut media = self.media;
        add_grids(&mut media, self.grids, self.media_grids, limits)?;
        let environment = match self.environment {
            Some(form) => {
                Some(form.environment(input).map_err(|flaw| ("/environment".to_string(), flaw))?)
            }
            None => None,
        };
        let mut scene = Scene {
            name: self.name,
            nodes,
            root: self.root,
            materials: self.materials,
            textures: self.textures,
            images,
            media,
            medium: self.medium,
            lights: self.lights,
            cameras: self.cameras,
            environment,
            portals: self.portals,
            background: self.background,
            ambient: self.ambient,
            settings: self.settings,
            parameters: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            variants: Vec::new(),
            scenes: Vec::new(),
            motion,
        };
        scene.topological_order().map_err(|error| ("/nodes".to_string(), error.to_string()))?;
        scene.check_textures().map_err(|error| ("/materials".to_string(), error.to_string()))?;
        for (i, light) in scene.lights.iter().enumerate() {
            if let Some(flaw) = light.lost_direction() {
                return Err((format!("/lights/{i}"), flaw));
            }
        }
        // This comes before the check of ranges, which would report the same light again.
        scene.limit_light();
        scene.check_ranges();
        scene.cameras.iter_mut().for_each(Camera::square_up);
        Ok(scene)
    }
}

/// The growing table of grids; shared grids are stored once.
#[derive(Default)]
struct Grids {
    forms: Vec<GridForm>,
    scalars: HashMap<*const ScalarGrid, u32>,
    colors: HashMap<*const ColorGrid, [u32; 3]>,
}

impl Grids {
    fn add<T: CellValue>(forms: &mut Vec<GridForm>, grid: &CellGrid<T>, values: Vec<f32>) -> u32 {
        let (size, stepped, wrap) = (grid.size(), grid.is_stepped(), grid.wrap());
        forms.push(GridForm { size, values: Numbers(values), stepped, wrap });
        forms.len() as u32 - 1
    }

    /// The number of a grid in the table.
    fn scalars(&mut self, grid: &Arc<ScalarGrid>) -> u32 {
        let add = || Self::add(&mut self.forms, &**grid, grid.values().to_vec());
        *self.scalars.entry(Arc::as_ptr(grid)).or_insert_with(add)
    }

    /// The numbers of the grids of red, green and blue.
    fn colors(&mut self, grid: &Arc<ColorGrid>) -> [u32; 3] {
        let mut add = |channel: fn(&Rgb) -> f32| {
            Self::add(&mut self.forms, &**grid, grid.values().iter().map(channel).collect())
        };
        *self
            .colors
            .entry(Arc::as_ptr(grid))
            .or_insert_with(|| [add(|c| c.r), add(|c| c.g), add(|c| c.b)])
    }
}

/// All grids of the media, and the grids of each medium.
fn grids(media: &[Medium]) -> (Vec<GridForm>, Vec<MediumGrids>) {
    let (mut grids, mut uses) = (Grids::default(), Vec::new());
    for (i, medium) in media.iter().enumerate() {
        let Medium::Grid(grid) = medium else { continue };
        uses.push(MediumGrids {
            medium: MediumId(i as u32),
            density: grids.scalars(&grid.density),
            emission_scale: grid.emission_scale.as_ref().map(|grid| grids.scalars(grid)),
            temperature: grid.temperature.as_ref().map(|grid| grids.scalars(grid)),
            sigma_a_tint: grid.sigma_a_tint.as_ref().map(|tint| grids.colors(tint)),
            sigma_s_tint: grid.sigma_s_tint.as_ref().map(|tint| grids.colors(tint)),
            emission_tint: grid.emission_tint.as_ref().map(|tint| grids.colors(tint)),
        });
    }
    (grids.forms, uses)
}

/// Adds the grids to their media.
fn add_grids(
    media: &mut [Medium],
    forms: Vec<GridForm>,
    uses: Vec<MediumGrids>,
    limits: &Limits,
) -> Result<(), Flaw> {
    let mut grids = Vec::with_capacity(forms.len());
    for (i, GridForm { size, values, stepped, wrap }) in forms.into_iter().enumerate() {
        let found = values.0.len();
        let flaw = |text: String| (format!("/grids/{i}"), text);
        if found > limits.elements {
            return Err(flaw(format!("more values than the limit of {}", limits.elements)));
        }
        let grid = ScalarGrid::new(size, values.0);
        let grid = grid.ok_or_else(|| {
            flaw(format!("{found} values for {} x {} x {} cells", size[0], size[1], size[2]))
        })?;
        grids.push(Arc::new(grid.stepped(stepped).wrapped(wrap)));
    }
    for (i, used) in uses.into_iter().enumerate() {
        let medium = used.medium;
        let flaw = |text: String| (format!("/media_grids/{i}"), text);
        let count = grids.len();
        let get = |number: u32| {
            let grid = grids.get(number as usize).cloned();
            grid.ok_or_else(|| flaw(format!("grid is {number}, but there are {count}")))
        };
        let Some(Medium::Grid(owner)) = media.get_mut(medium.index()) else {
            return Err(flaw(format!("medium {} is not given on a grid", medium.0)));
        };
        let color = |numbers: [u32; 3]| {
            let [r, g, b] = [get(numbers[0])?, get(numbers[1])?, get(numbers[2])?];
            let colors = r
                .values()
                .iter()
                .zip(g.values())
                .zip(b.values())
                .map(|((r, g), b)| Rgb::new(*r, *g, *b));
            let are_alike = g.size() == r.size() && b.size() == r.size();
            let grid = are_alike.then(|| ColorGrid::new(r.size(), colors.collect())).flatten();
            grid.map(|grid| Arc::new(grid.stepped(r.is_stepped()).wrapped(r.wrap())))
                .ok_or_else(|| flaw("the grids of a tint are not of the same size".into()))
        };
        owner.density = get(used.density)?;
        owner.emission_scale = used.emission_scale.map(get).transpose()?;
        owner.temperature = used.temperature.map(get).transpose()?;
        owner.sigma_a_tint = used.sigma_a_tint.map(color).transpose()?;
        owner.sigma_s_tint = used.sigma_s_tint.map(color).transpose()?;
        owner.emission_tint = used.emission_tint.map(color).transpose()?;
    }
    Ok(())
}

/// The growing table of meshes.
#[derive(Default)]
pub(super) struct Meshes {
    forms: Vec<MeshForm>,
    known: HashMap<*const TriangleMesh, u32>,
}

impl Meshes {
    /// The number of a mesh in the table.
    pub(super) fn number(&mut self, mesh: &Arc<TriangleMesh>) -> u32 {
        *self.known.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
            self.forms.push(MeshForm::of(mesh));
            self.forms.len() as u32 - 1
        })
    }
}

/// The growing table of curves.
#[derive(Default)]
struct CurvesTable {
    forms: Vec<CurvesForm>,
    known: HashMap<*const Curves, u32>,
}

impl CurvesTable {
    /// The number of curves in the table.
    fn number(&mut self, curves: &Arc<Curves>) -> u32 {
        *self.known.entry(Arc::as_ptr(curves)).or_insert_with(|| {
            self.forms.push(CurvesForm {
                basis: curves.basis(),
                points: flat(curves.points(), |p: Vec4| p.to_array()),
                strands: Numbers(curves.strands().to_vec()),
                colors: flat(curves.colors(), |c| c),
                exact: Numbers(curves.exact_points().iter().flat_map(|p| p.to_array()).collect()),
            });
            self.forms.len() as u32 - 1
        })
    }
}

impl CurvesForm {
    fn curves(self, limits: &Limits) -> Result<Curves, (&'static str, String)> {
        if self.points.0.len() / 4 > limits.elements {
            return Err(("points", format!("more elements than the limit of {}", limits.elements)));
        }
        let points = vectors("points", self.points, Vec4::from_array)?;
        let colors = vectors("colors", self.colors, |color| color)?;
        let made = match self.exact.0.as_chunks::<4>().0 {
            [] => Curves::new(self.basis, points, self.strands.0),
            exact => {
                let exact = exact.iter().map(|&p| DVec4::from_array(p)).collect();
                Curves::exact(self.basis, exact, self.strands.0)
            }
        };
        made.map_err(|error| ("strands", error.to_string()))?
            .with_colors(colors)
            .map_err(|error| ("colors", error.to_string()))
    }
}

impl NodeForm {
    fn of(node: &Node, meshes: &mut Meshes, curves: &mut CurvesTable) -> Self {
        let surface = |surface: &Surface| {
            let materials = surface.materials.clone();
            let form = SurfaceForm { mesh: None, shape: None, curves: None, materials };
            match &surface.geometry {
                Geometry::Mesh(mesh) => SurfaceForm { mesh: Some(meshes.number(mesh)), ..form },
                Geometry::Shape(shape) => {
                    SurfaceForm { shape: Some(AnyShape::clone(shape)), ..form }
                }
                Geometry::Curves(strands) => {
                    SurfaceForm { curves: Some(curves.number(strands)), ..form }
                }
            }
        };
        Self {
            name: node.name.clone(),
            transform: rows(&node.transform),
            material: node.material,
            children: node.children.clone(),
            surfaces: node.surfaces.iter().map(surface).collect(),
        }
    }

    fn node(self, meshes: &[Arc<TriangleMesh>], curves: &[Arc<Curves>]) -> Result<Node, Flaw> {
        let mut surfaces = Vec::with_capacity(self.surfaces.len());
        for (i, surface) in self.surfaces.into_iter().enumerate() {
            let flaw = |text: String| (format!("/surfaces/{i}"), text);
            let geometry = match (surface.mesh, surface.shape, surface.curves) {
                (Some(number), None, None) => match meshes.get(number as usize) {
                    Some(mesh) => Geometry::Mesh(mesh.clone()),
                    None => {
                        return Err(flaw(format!(
                            "mesh is {number}, but there are {}",
                            meshes.len()
                        )));
                    }
                },
                (None, None, Some(number)) => match curves.get(number as usize) {
                    Some(curves) => Geometry::Curves(curves.clone()),
                    None => {
                        return Err(flaw(format!(
                            "curves is {number}, but there are {}",
                            curves.len()
                        )));
                    }
                },
                (None, Some(shape), None) => {
                    shape.validate().map_err(|error| flaw(error.to_string()))?;
                    Geometry::Shape(Arc::new(shape))
                }
                _ => return Err(flaw("a surface is a mesh, a shape or curves".into())),
            };
            surfaces.push(Surface { geometry, materials: surface.materials });
        }
        let (transform, children) = (affine(&self.transform), self.children);
        Ok(Node { name: self.name, transform, children, surfaces, material: self.material })
    }
}

/// Vectors of `N` numbers each.
pub(super) fn vectors<const N: usize, T>(
    key: &'static str,
    numbers: Numbers<f32>,
    make: impl Fn([f32; N]) -> T,
) -> Result<Vec<T>, (&'static str, String)> {
    let (all, rest) = numbers.0.as_chunks::<N>();
    if rest.is_empty() {
        return Ok(all.iter().map(|&numbers| make(numbers)).collect());
    }
    Err((key, format!("there are {} numbers, expected a multiple of {N}", numbers.0.len())))
}

pub(super) fn flat<const N: usize, T: Copy>(
    items: &[T],
    parts: impl Fn(T) -> [f32; N],
) -> Numbers<f32> {
    Numbers(items.iter().flat_map(|&item| parts(item)).collect())
}

impl MeshForm {
    fn of(mesh: &TriangleMesh) -> Self {
        let TriangleMesh {
            positions,
            indices,
            normals,
            tangents,
            uvs,
            colors,
            material_slots,
            exact,
        } = mesh;
        Self {
            positions: flat(positions, |p: Vec3| p.to_array()),
            indices: Numbers(indices.as_flattened().to_vec()),
            normals: flat(normals, |n: Vec3| n.to_array()),
            tangents: flat(tangents, |t: Vec4| t.to_array()),
            uvs: flat(&uvs[0], |uv: Vec2| uv.to_array()),
            second_uvs: flat(&uvs[1], |uv: Vec2| uv.to_array()),
            third_uvs: flat(&uvs[2], |uv: Vec2| uv.to_array()),
            fourth_uvs: flat(&uvs[3], |uv: Vec2| uv.to_array()),
            colors: flat(colors, |c: [f32; 4]| c),
            material_slots: Numbers(material_slots.clone()),
            exact: Numbers(exact.iter().flat_map(|p| p.to_array()).collect()),
        }
    }

    fn mesh(self, limits: &Limits) -> Result<TriangleMesh, (&'static str, String)> {
        let (indices, rest) = self.indices.0.as_chunks::<3>();
        if !rest.is_empty() {
            let found = self.indices.0.len();
            return Err((
                "indices",
                format!("there are {found} numbers, expected a multiple of 3"),
            ));
        }
        if indices.len().max(self.positions.0.len() / 3) > limits.elements {
            return Err((
                "positions",
                format!("more elements than the limit of {}", limits.elements),
            ));
        }
        let mesh = TriangleMesh {
            positions: vectors("positions", self.positions, Vec3::from_array)?,
            indices: indices.to_vec(),
            normals: vectors("normals", self.normals, Vec3::from_array)?,
            tangents: vectors("tangents", self.tangents, Vec4::from_array)?,
            uvs: [
                vectors("uvs", self.uvs, Vec2::from_array)?,
                vectors("second_uvs", self.second_uvs, Vec2::from_array)?,
                vectors("third_uvs", self.third_uvs, Vec2::from_array)?,
                vectors("fourth_uvs", self.fourth_uvs, Vec2::from_array)?,
            ],
            colors: vectors("colors", self.colors, |c| c)?,
            material_slots: self.material_slots.0,
            exact: self.exact.0.as_chunks::<3>().0.iter().map(|&p| p.into()).collect(),
        };
        mesh.validate().map_err(|error| ("", error.to_string()))?;
        Ok(mesh)
    }
}

impl ImageForm {
    fn of(image: &Image) -> Self {
        let Image { width, height, channels, pixels, encoding } = image;
        let pixels = match pixels {
            Pixels::U8(v) => PixelForm::U8(Numbers(v.clone())),
            Pixels::U16(v) => PixelForm::U16(Numbers(v.clone())),
            Pixels::F32(v) => PixelForm::F32(Numbers(v.clone())),
        };
        Self::Pixels(PixelsForm {
            width: *width,
            height: *height,
            channels: *channels,
            encoding: *encoding,
            pixels,
        })
    }

    fn image(self, input: &Input) -> Result<Image, String> {
        let PixelsForm { width, height, channels, encoding, pixels } = match self {
            Self::Pixels(form) => form,
            Self::Encoded(form) => {
                return read_image(&input.part("the picture", form.encoded.0))
                    .map_err(|error| error.problem);
            }
        };
        let (found, pixels) = match pixels {
            PixelForm::U8(Numbers(v)) => (v.len(), Pixels::U8(v)),
            PixelForm::U16(Numbers(v)) => (v.len(), Pixels::U16(v)),
            PixelForm::F32(Numbers(v)) => (v.len(), Pixels::F32(v)),
        };
        let area = u64::from(width) * u64::from(height);
        if area == 0 || area > input.options.limits.image_pixels || !(1..=4).contains(&channels) {
            let most = input.options.limits.image_pixels;
            return Err(format!(
                "{width} by {height} pixels of {channels} channels, expected 1 to {most} pixels of \
                    1 to 4"
            ));
        }
        let expected = area * u64::from(channels);
        if found as u64 != expected {
            return Err(format!("there are {found} values, expected {expected}"));
        }
        Ok(Image { width, height, channels, pixels, encoding })
    }
}

impl EnvironmentForm {
    fn of(environment: &Environment) -> Self {
        match environment {
            Environment::Constant(color) => Self::Constant(*color),
            Environment::Image { image, scale, world_from_environment } => Self::Image {
                image: ImageForm::of(image),
                scale: *scale,
                world_from_environment: rows(world_from_environment),
            },
        }
    }

    fn environment(self, input: &Input) -> Result<Environment, String> {
        Ok(match self {
            Self::Constant(color) => Environment::Constant(color),
            Self::Image { image, scale, world_from_environment } => Environment::Image {
                image: Arc::new(image.image(input)?),
                scale,
                world_from_environment: affine(&world_from_environment),
            },
        })
    }
}
