//! Writes pbrt-v4 scenes: text, with meshes as PLY and pictures beside it.
//!
//! pbrt's coordinates are left-handed. The camera's transform begins with a mirror, so that the
//! numbers of the world are ours and the picture is not mirrored.

mod environment;
mod light;
mod material;
mod medium;
mod nesting;
mod shape;
mod texture;
mod view;

use super::picture::Pictures;

use super::{Output, SceneWriter};
use snell_intersect::{AnyShape, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, DVec3, Rgb};
use snell_scene::framing::{self, FramingOptions};
use snell_scene::material::{AlphaMode, MaterialKind};
use snell_scene::placed::{Placed, placed};
use snell_scene::{Geometry, MaterialId, Scene};
use std::collections::HashMap;
use std::fmt::Write;
use std::sync::Arc;

/// The writer of pbrt files.
pub const WRITER: SceneWriter =
    SceneWriter { name: "pbrt", extensions: &["pbrt"], knows: texture::is_known, write };

/// Memory for the text of a surface, in a growing buffer.
const BYTES_OF_SURFACE: u64 = 800;

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    let framed = framed(scene, output)?;
    let scene = framed.as_ref().unwrap_or(scene);
    let surfaces = placed(scene)?;
    let (what, count) =
        (format!("the scene as {} surfaces", surfaces.len()), surfaces.len() as u64);
    let admitted = output.available.admit(&what, count * BYTES_OF_SURFACE);
    admitted
        .map_err(|problem| format!("{problem}; write a format with instances of nodes: .snell"))?;
    if !scene.ambient.is_black() {
        output.lose("the ambient light of local illumination is left out");
    }
    if scene.background != snell_scene::Background::Environment {
        output.lose("the background is left out: rays that leave the scene show its environment");
    }
    let mut file = File {
        scene,
        middle: middle(&surfaces),
        output,
        text: String::new(),
        pictures: Pictures::new(scene),
        meshes: HashMap::new(),
        shapes: HashMap::new(),
        mesh_count: 0,
        texture_count: 0,
        textures: HashMap::new(),
        materials: HashMap::new(),
        objects: HashMap::new(),
    };
    file.view();
    file.media();
    file.line("WorldBegin");
    file.environment();
    file.lights();
    let mut uses: HashMap<*const (), usize> = HashMap::new();
    for surface in &surfaces {
        if let Some(shared) = shared(surface) {
            *uses.entry(shared).or_default() += 1;
        }
    }
    let exteriors = file.exteriors(&surfaces);
    for (i, surface) in surfaces.iter().enumerate() {
        if i > 0 && surfaces[i - 1].node == surface.node && file.is_black_back(surface) {
            file.output.lose("black back sides are left out: both sides look like the front");
            continue;
        }
        let is_shared = shared(surface).is_some_and(|shared| uses[&shared] > 1);
        let exterior = exteriors[i].as_deref();
        if is_shared && !file.emits(surface) && exterior.is_none() {
            file.instance(surface);
        } else {
            file.place(surface, exterior);
        }
    }
    let text = std::mem::take(&mut file.text);
    output.main = text.into_bytes();
    Ok(())
}

/// The scene with the camera and the sky that Snell shows it with, if it lacks a camera or light.
fn framed(scene: &Scene, output: &mut Output) -> Result<Option<Scene>, String> {
    let mut framed = scene.clone();
    let options = FramingOptions { size: view::SIZE, ..FramingOptions::default() };
    framing::prepare(&mut framed, &options).map_err(|error| error.to_string())?;
    let has_camera = !scene.cameras.is_empty();
    let has_light = framed.environment.is_some() == scene.environment.is_some();
    if !has_camera {
        output.lose("the scene has no camera: the one that Snell looks through is written");
    }
    if !has_light {
        output.lose("the scene has no light: the sky that Snell shows it under is written");
    }
    Ok((!has_camera || !has_light).then_some(framed))
}

/// The middle of all surfaces that are not infinite.
fn middle(surfaces: &[Placed]) -> DVec3 {
    let bounds = surfaces.iter().map(|surface| {
        let own = surface.surface.geometry.bounds();
        if own.is_finite() { surface.world_from_surface.bounds(&own) } else { Bounds3d::EMPTY }
    });
    let all = bounds.fold(Bounds3d::EMPTY, |a, b| a.union(&b));
    if all.is_finite() { (all.min + all.max) * 0.5 } else { DVec3::ZERO }
}

/// The address of a surface's geometry, if it is large: geometry that several surfaces share is
/// written once.
fn shared(surface: &Placed) -> Option<*const ()> {
    match &surface.surface.geometry {
        Geometry::Mesh(mesh) => Some(Arc::as_ptr(mesh).cast()),
        Geometry::Curves(curves) => Some(Arc::as_ptr(curves).cast()),
        Geometry::Shape(_) => None,
    }
}

/// The materials of a mesh by slot; `None` is the default one.
type Slots = Vec<(u16, Option<MaterialId>)>;

/// The growing file.
struct File<'a, 'o> {
    scene: &'a Scene,
    /// The middle of its surfaces.
    middle: DVec3,
    output: &'o mut Output,
    text: String,
    pictures: Pictures<'a>,
    /// Names of mesh files, by mesh and slot.
    meshes: HashMap<(*const TriangleMesh, u16), String>,
    /// Triangles of shapes that pbrt lacks.
    shapes: HashMap<*const AnyShape, Option<Arc<TriangleMesh>>>,
    mesh_count: usize,
    texture_count: usize,
    /// Names of textures by their text.
    textures: HashMap<String, String>,
    /// The text for each material, made on first use.
    materials: HashMap<Option<MaterialId>, material::Made>,
    /// Names of objects, by mesh or curves and materials.
    objects: HashMap<(*const (), Slots), String>,
}

/// A colour as three numbers.
fn rgb(color: Rgb) -> String {
    format!("[ {} {} {} ]", color.r, color.g, color.b)
}

fn point(p: DVec3) -> String {
    format!("[ {} {} {} ]", p.x, p.y, p.z)
}

/// A `Transform` statement: the columns of the matrix.
fn transform(map: &DAffine3) -> String {
    let m = &map.matrix3;
    let columns = [(m.x_axis, 0), (m.y_axis, 0), (m.z_axis, 0), (map.translation, 1)];
    let numbers: Vec<_> =
        columns.iter().map(|(v, w)| format!("{} {} {} {w}", v.x, v.y, v.z)).collect();
    format!("Transform [ {} ]", numbers.join("  "))
}

/// A string in quotes; characters that would end it are replaced.
fn quoted(text: &str) -> String {
    let text: String = text
        .chars()
        .map(|c| if c == '"' || c == '\\' || c.is_control() { '_' } else { c })
        .collect();
    format!("\"{text}\"")
}

impl File<'_, '_> {
    fn line(&mut self, line: impl AsRef<str>) {
        self.text += line.as_ref();
        self.text.push('\n');
    }

    fn media(&mut self) {
        for (i, medium) in self.scene.media.iter().enumerate() {
            if let Some(text) = medium::medium(self.output, i, medium) {
                self.text += &text;
            }
        }
    }

    /// True if some part of a surface emits: pbrt has no emission within objects.
    fn emits(&self, surface: &Placed) -> bool {
        let material = |(_, id): (u16, Option<MaterialId>)| self.scene.materials.get(id?.index());
        surface.slots().into_iter().filter_map(material).any(|m| m.is_emissive())
    }

    /// True for a surface that is black and seen from one side only: readers make such ones as the
    /// backs of others.
    fn is_black_back(&self, surface: &Placed) -> bool {
        let is_black = |(_, id): (u16, Option<MaterialId>)| {
            let material = id.and_then(|id| self.scene.materials.get(id.index()));
            material.is_some_and(|m| {
                let is_black = match &m.kind {
                    MaterialKind::Diffuse(diffuse) => diffuse.reflectance.factor.is_black(),
                    MaterialKind::Black(_) => true,
                    _ => false,
                };
                is_black && !m.double_sided && !m.is_emissive() && m.alpha_mode == AlphaMode::Opaque
            })
        };
        surface.slots().into_iter().all(is_black)
    }

    /// Writes one surface in place. `exterior` is the name of the medium around it, if it lies
    /// within another body.
    fn place(&mut self, surface: &Placed, exterior: Option<&str>) {
        let slots = surface.slots();
        let mut made: Vec<_> = slots.iter().map(|&(slot, id)| (slot, self.material(id))).collect();
        if let Some(exterior) = exterior {
            for (_, made) in &mut made {
                let [inside, _] = made.interface.take().unwrap_or_default();
                made.interface = Some([inside, exterior.into()]);
            }
        }
        if let Some(parts) = self.parts(surface, &made) {
            self.line("AttributeBegin");
            let map = surface.world_from_surface.matrix();
            if *map != DAffine3::IDENTITY {
                self.line(format!("  {}", transform(map)));
            }
            self.text += &parts;
            self.line("AttributeEnd");
        }
    }

    /// Writes one surface as an instance of an object, which is defined on first use.
    fn instance(&mut self, surface: &Placed) {
        let Some(shared) = shared(surface) else { return };
        let slots = surface.slots();
        let key = (shared, slots.clone());
        let name = match self.objects.get(&key) {
            Some(name) => name.clone(),
            None => {
                let made: Vec<_> =
                    slots.iter().map(|&(slot, id)| (slot, self.material(id))).collect();
                let name = format!("object-{}", self.objects.len());
                let parts = self.parts(surface, &made).unwrap_or_default();
                _ = write!(self.text, "ObjectBegin \"{name}\"\n{parts}ObjectEnd\n");
                self.objects.insert(key, name.clone());
                name
            }
        };
        let map = transform(surface.world_from_surface.matrix());
        self.line(format!("AttributeBegin\n  {map}\n  ObjectInstance \"{name}\"\nAttributeEnd"));
    }
}
