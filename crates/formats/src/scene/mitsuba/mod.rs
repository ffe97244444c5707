//! Mitsuba scenes: the XML of versions 2 and 3, and of 0.6 where the meaning is clear.
//!
//! The format is that of <https://mitsuba.readthedocs.io>. `load.rs` turns XML into objects with
//! properties (`object.rs`), with parameters substituted and files included; one file each converts
//! sensors, shapes, BSDFs, textures, emitters and media. Features that Snell lacks are approximated
//! with a warning that names file, line and column; unused properties are reported, too.
//!
//! Coordinates are right-handed, as ours; cameras look along their `+z` with `+x` to the left and
//! `+y` up. If the camera's transform is a mirror, the whole scene is mirrored in x (by the root
//! node) so that the picture is mirrored.

mod bsdf;
mod color;
mod emitter;
mod load;
mod medium;
mod object;
mod sensor;
mod serialized;
mod shape;
#[cfg(test)]
mod tests;
mod texture;
mod value;
mod xml;

use crate::scene::fault::{Fault, Spot};
use crate::scene::keep_dark;
use crate::scene::notes::Notes;
use crate::{Input, ReadError, SceneReader, textures};
use bsdf::Look;
use load::Loader;
use medium::Media;
use object::{Child, Content, Object};
use shape::Shapes;
use snell_math::DAffine3;
use snell_scene::graph::ImageId;
use snell_scene::light::Slide;
use snell_scene::{MediumId, Scene, WarningKind};
use std::collections::HashMap;
use std::rc::Rc;
use texture::Textures;

/// The reader of Mitsuba scenes.
pub const READER: SceneReader = SceneReader {
    name: "mitsuba",
    description: "Mitsuba 2 and 3 scene, and those of 0.6",
    extensions: &["xml"],
    recognises,
    read,
};

/// Maximum depth of nested and referenced objects; each takes some of the thread's stack.
const MAX_DEPTH: usize = 64;

/// State while the scene is built.
struct Builder<'a> {
    /// The file that the user named; names in all files are relative to its folder, or to one of
    /// those that are searched.
    main: &'a Input,
    searched: Vec<Input>,
    scene: Scene,
    /// Version of the file, such as `0.6`.
    version: String,
    /// Objects by id.
    ids: HashMap<String, Rc<Object>>,
    aliases: HashMap<String, String>,
    /// Transform from the file's world to the scene's: a mirror or the identity.
    world_from_file: DAffine3,
    images: textures::Textures,
    textures: Textures,
    looks: HashMap<*const Object, Look>,
    /// The pictures of spot lights, by the debug text of what they are made of.
    slides: HashMap<String, Slide>,
    /// Means over layers of microfacets.
    means: bsdf::facets::Means,
    /// The attributes of meshes that the BSDF being built shows.
    attributes: texture::Attributes,
    shapes: Shapes,
    media: Media,
    around_camera: Option<MediumId>,
    /// Objects that are being built, the innermost last.
    building: Vec<*const Object>,
    /// The number of files opened besides the main one.
    opened: usize,
    notes: Notes,
    /// True if the file has emitters, even if they are off.
    has_lamps: bool,
    /// True if surfaces that emit are not seen.
    hides_emitters: bool,
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let mut loader = Loader::new(input);
    match loader.scene(input, Spot::default()) {
        Ok(root) => {
            let root = Rc::new(root);
            let (files, parameters) = (std::mem::take(&mut loader.files), parameters(&loader));
            let mut builder = Builder {
                main: input,
                searched: loader.searched,
                scene: Scene::new(""),
                version: loader.version,
                ids: HashMap::new(),
                aliases: loader.aliases,
                world_from_file: DAffine3::IDENTITY,
                images: textures::Textures::default(),
                textures: Textures::default(),
                looks: HashMap::new(),
                slides: HashMap::new(),
                means: bsdf::facets::Means::default(),
                attributes: texture::Attributes::default(),
                shapes: Shapes::default(),
                media: Media::default(),
                around_camera: None,
                building: Vec::new(),
                opened: 0,
                notes: loader.notes,
                has_lamps: false,
                hides_emitters: false,
            };
            builder.scene.parameters = parameters;
            builder.build(&root).map_err(|fault| fault.into_error(&files))?;
            builder.notes.finish(&mut builder.scene, &files);
            Ok(builder.scene)
        }
        Err(fault) => Err(fault.into_error(&loader.files)),
    }
}

/// The parameters that the files declare or use, with their values.
fn parameters(loader: &Loader) -> Vec<(String, String)> {
    let value = |name: &String| loader.parameters.get(name).cloned().unwrap_or_default();
    loader.declared.iter().map(|name| (name.clone(), value(name))).collect()
}

impl Builder<'_> {
    fn build(&mut self, root: &Rc<Object>) -> Result<(), Fault> {
        self.collect_ids(root)?;
        let mut children = Vec::new();
        for child in root.children_where(|_| true) {
            children.push(self.resolve(child)?);
        }
        // Sensors come first: they decide whether the world is mirrored.
        for class in ["sensor", "integrator", "shape", "emitter"] {
            for object in children.iter().filter(|o| o.class == class) {
                match class {
                    "sensor" => self.sensor(object)?,
                    "integrator" => self.integrator(object)?,
                    "shape" => self.shape(object, self.scene.root)?,
                    _ => self.emitter(object)?,
                }
            }
        }
        for other in children.iter().filter(|o| !KNOWN_AT_TOP.contains(&o.class.as_str())) {
            let owner = other.owner();
            self.note(owner.clone(), other.at, || {
                format!("{owner} is not inside an object that uses it; it was ignored")
            });
        }
        for property in &root.properties {
            let name = property.name.clone();
            self.note(format!("scene {name}"), property.at, || {
                format!("the property \"{name}\" of the scene itself is not known; it was ignored")
            });
        }
        if self.has_lamps {
            keep_dark(&mut self.scene);
        }
        self.camera_medium(self.around_camera);
        self.scene.nodes[self.scene.root.index()].transform = self.world_from_file;
        Ok(())
    }

    fn collect_ids(&mut self, object: &Rc<Object>) -> Result<(), Fault> {
        for child in &object.children {
            let Content::Object(inner) = &child.content else { continue };
            if let Some(id) = &inner.id
                && let Some(first) = self.ids.insert(id.clone(), inner.clone())
            {
                let problem = format!(
                    "the id \"{id}\" is that of {} in line {} too",
                    first.owner(),
                    first.at.line
                );
                return Err(Fault::new(inner.at, problem, "give one of them another id"));
            }
            self.collect_ids(inner)?;
        }
        Ok(())
    }

    /// Adds a warning: what was found, and what was done instead. Only the first of each kind is
    /// reported.
    fn note(&mut self, kind: impl Into<String>, at: Spot, message: impl FnOnce() -> String) {
        self.notes.add(WarningKind::Changed, kind.into(), at, message);
    }

    /// Adds a note about a choice that the file leaves open, or about a feature of another program,
    /// where nothing is wrong.
    fn mention(&mut self, kind: impl Into<String>, at: Spot, message: impl FnOnce() -> String) {
        self.notes.add(WarningKind::Choice, kind.into(), at, message);
    }

    /// Warns of unused properties.
    fn note_unused(&mut self, object: &Object) {
        let owner = object.owner();
        for property in object.properties.iter().filter(|p| !p.used.get()) {
            let what = format!("\"{}\" of {owner}", property.name);
            self.note(format!("unused {what}"), property.at, || {
                format!("{what} is not known; it was ignored")
            });
        }
        for child in object.children.iter().filter(|c| !c.used.get()) {
            let what = match &child.content {
                Content::Object(inner) => inner.owner(),
                Content::Reference(id) => format!("the reference to \"{id}\""),
            };
            self.note(format!("unused {what} in {owner}"), child.at, || {
                format!("{what} has no meaning in {owner}; it was ignored")
            });
        }
    }

    /// Marks everything in an object as used, because another note explains it.
    fn ignore_all(&mut self, object: &Object) {
        object.properties.iter().for_each(|p| p.used.set(true));
        object.children.iter().for_each(|c| c.used.set(true));
    }

    /// The nested object that a child holds or refers to.
    fn resolve(&self, child: &Child) -> Result<Rc<Object>, Fault> {
        let id = match &child.content {
            Content::Object(object) => return Ok(object.clone()),
            Content::Reference(id) => id,
        };
        let known = self.ids.get(id).or_else(|| self.ids.get(self.aliases.get(id)?));
        known.cloned().ok_or_else(|| {
            let id = value::shortened(id);
            Fault::new(
                child.at,
                format!("there is no object with the id \"{id}\""),
                "correct it, or add the object",
            )
        })
    }

    /// The first nested object that satisfies a condition.
    fn inner(
        &self,
        object: &Object,
        is: impl Fn(&Object) -> bool,
    ) -> Result<Option<Rc<Object>>, Fault> {
        for child in &object.children {
            let inner = self.resolve(child)?;
            if is(&inner) {
                child.used.set(true);
                return Ok(Some(inner));
            }
        }
        Ok(None)
    }

    /// The nested object of this name.
    fn child_named(&self, object: &Object, name: &str) -> Result<Option<Rc<Object>>, Fault> {
        let Some(child) = object.children.iter().find(|c| c.name == name) else { return Ok(None) };
        child.used.set(true);
        self.resolve(child).map(Some)
    }

    /// Begins to build an object; fails if it contains itself.
    fn enter(&mut self, object: &Object) -> Result<(), Fault> {
        let address: *const Object = object;
        if self.building.contains(&address) {
            return Err(object.fault("it contains itself by a reference", "remove the reference"));
        }
        if self.building.len() >= MAX_DEPTH {
            let problem =
                format!("objects refer to each other more than {MAX_DEPTH} deep, the limit");
            return Err(object.fault(problem, "simplify it"));
        }
        self.building.push(address);
        Ok(())
    }

    fn leave(&mut self) {
        self.building.pop();
    }

    /// Opens a file that the scene names at `at`.
    fn open(&mut self, name: &str, at: Spot) -> Result<Input, Fault> {
        self.opened += 1;
        let limit = self.main.options.limits.files;
        if self.opened > limit {
            return Err(Fault::new(
                at,
                format!("the scene names more than {limit} files, the limit"),
                "split it",
            ));
        }
        self.home(name).open_relative(name).map_err(|error| {
            let is_own = error.file == self.main.name;
            let problem =
                if is_own { error.problem } else { format!("{}: {}", error.file, error.problem) };
            Fault::new(at, problem, error.remedy)
        })
    }

    /// The file from whose folder a name leads to a file.
    fn home(&self, name: &str) -> &Input {
        load::home(self.main, &self.searched, name)
    }

    /// The id of an image, which is read only once.
    fn image(&mut self, name: &str) -> ImageId {
        let home = load::home(self.main, &self.searched, name);
        self.images.image(&mut self.scene, home, name)
    }
}

/// Classes of objects that may stand at the top level, including those that others refer to.
const KNOWN_AT_TOP: [&str; 8] =
    ["sensor", "integrator", "shape", "emitter", "bsdf", "texture", "medium", "volume"];

/// True if the text starts, after comments, with the element `scene`.
fn recognises(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let mut rest = text.trim_start_matches('\u{feff}').trim_start();
    loop {
        let end = match rest {
            _ if rest.starts_with("<?") => "?>",
            _ if rest.starts_with("<!--") => "-->",
            _ => break,
        };
        let Some((_, after)) = rest.split_once(end) else { return false };
        rest = after.trim_start();
    }
    // Embree's scenes begin with the same element, but without a version.
    let Some(tag) = rest.strip_prefix("<scene").and_then(|r| r.split('>').next()) else {
        return false;
    };
    tag.contains("version")
}
