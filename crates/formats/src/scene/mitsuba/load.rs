//! Loads XML as objects: substitutes parameters, includes files and reads properties.

mod spectrum;
mod transform;

use super::object::{Child, Content, Object, Property};
use super::value::{self, Hue, Value, shortened};
use super::xml;
use crate::Input;
use crate::input::CONFINED;
use crate::scene::fault::{Fault, Spot};
use crate::scene::notes::Notes;
use roxmltree::Node;
use snell_math::{DVec3, Rgb};
use std::cell::Cell;
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

/// Elements that are objects.
const CLASSES: [&str; 14] = [
    "scene",
    "integrator",
    "sensor",
    "sampler",
    "film",
    "rfilter",
    "bsdf",
    "shape",
    "texture",
    "emitter",
    "medium",
    "phase",
    "volume",
    "subsurface",
];
/// Names of such elements in older versions, with their present names.
const OLD_CLASSES: [(&str, &str); 2] = [("camera", "sensor"), ("luminaire", "emitter")];

/// Maximum depth of includes; each takes some of the thread's stack.
const MAX_FILE_DEPTH: usize = 16;
/// Maximum depth of objects; each takes some of the thread's stack.
const MAX_DEPTH: usize = 128;

/// Maximum number of properties of an object: each is compared with all before it.
const MAX_PROPERTIES: usize = 4096;

/// State while files are read.
pub struct Loader<'a> {
    main: &'a Input,
    /// Names of all files so far.
    pub files: Vec<String>,
    open: Vec<PathBuf>,
    /// Parameter values by name: those of the command line, and the defaults of files.
    pub parameters: HashMap<String, String>,
    /// Names of the parameters that files declare or use, in order.
    pub declared: Vec<String>,
    /// Aliases of ids.
    pub aliases: HashMap<String, String>,
    /// Version of the main file, such as `0.6`.
    pub version: String,
    pub notes: Notes,
    /// The folders that `<path>` elements name, each as a file without content in that folder.
    pub searched: Vec<Input>,
    /// The names of `<path>` elements that lead out of the folder of a confined scene.
    pub refused: Vec<String>,
    /// The other folders of included files, each as a file without content.
    pub included: Vec<Input>,
    /// The nesting depth of the object being read.
    depth: usize,
}

/// Maximum number of `<path>` elements: each is asked for every file that is named.
const MAX_SEARCHED: usize = 64;

/// The file from whose folder a name leads to a file: one of the search folders, the last first,
/// or else the main file.
pub fn home<'a>(main: &'a Input, searched: &'a [Input], name: &str) -> &'a Input {
    searched.iter().rev().find(|folder| folder.has_file(name)).unwrap_or(main)
}

/// As [`home`], or else one of the folders of included files if it has a file of this name.
pub fn home_among<'a>(
    main: &'a Input,
    searched: &'a [Input],
    included: &'a [Input],
    name: &str,
) -> &'a Input {
    let first = home(main, searched, name);
    if first.has_file(name) {
        return first;
    }
    included.iter().find(|folder| folder.has_file(name)).unwrap_or(first)
}

/// The error for a file that cannot be opened. It may lie in one of the folders of `<path>`
/// elements that were refused.
pub fn missing(at: Spot, problem: String, remedy: String, refused: &[String]) -> Fault {
    if refused.is_empty() || remedy == CONFINED {
        return Fault::new(at, problem, remedy);
    }
    let names: Vec<_> = refused.iter().map(|name| format!("\"{name}\"")).collect();
    let problem = format!(
        "{problem}; <path> {} was refused, because it lies outside of the scene's folder",
        names.join(", ")
    );
    Fault::new(at, problem, CONFINED)
}

/// A file while it is being read.
struct File<'t> {
    number: u32,
    text: &'t str,
    lines: Vec<usize>,
    input: &'t Input,
    /// The offset that was located last, and its column. Counting continues from there, because a
    /// file may be one long line.
    last: Cell<(usize, usize)>,
}

impl File<'_> {
    fn spot(&self, offset: usize) -> Spot {
        let line = self.lines.partition_point(|start| *start <= offset);
        let start = self.lines[line - 1];
        let (from, before) = Some(self.last.get())
            .filter(|(at, _)| (start..=offset).contains(at))
            .unwrap_or((start, 1));
        let column = self.text.get(from..offset).map_or(0, |t| t.chars().count()) + before;
        self.last.set((offset, column));
        Spot { file: self.number, line: line as u32, column: column as u32 }
    }

    fn at(&self, node: &Node) -> Spot {
        self.spot(node.range().start)
    }
}

/// The name of a parameter that a text begins with, as far as it can be told.
fn parameter_name(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

impl<'a> Loader<'a> {
    pub fn new(main: &'a Input) -> Self {
        Self {
            main,
            files: Vec::new(),
            open: Vec::new(),
            parameters: main.options.parameters.iter().cloned().collect(),
            declared: Vec::new(),
            aliases: HashMap::new(),
            version: String::new(),
            notes: Notes::default(),
            searched: Vec::new(),
            refused: Vec::new(),
            included: Vec::new(),
            depth: 0,
        }
    }

    /// Reads the scene of a file.
    pub fn scene(&mut self, input: &Input, named_at: Spot) -> Result<Object, Fault> {
        let path =
            input.directory.join(std::path::Path::new(&input.name).file_name().unwrap_or_default());
        let path = path.canonicalize().unwrap_or(path);
        if self.open.contains(&path) {
            return Err(Fault::new(
                named_at,
                format!("{} includes itself", input.name),
                "remove the include",
            ));
        }
        if self.open.len() >= MAX_FILE_DEPTH || self.files.len() >= self.main.options.limits.files {
            let problem =
                format!("files are included deeper than {MAX_FILE_DEPTH}, or too many of them");
            return Err(Fault::new(named_at, problem, "put them together"));
        }
        let number = self.files.len() as u32;
        self.files.push(input.name.clone());
        let is_same = |other: &Input| other.directory == input.directory;
        if !is_same(self.main) && !self.included.iter().any(is_same) {
            let folder = self.main.part(&self.main.name, Vec::new());
            self.included.push(Input { directory: input.directory.clone(), ..folder });
        }
        let text = std::str::from_utf8(&input.bytes).map_err(|error| {
            let before = &input.bytes[..error.valid_up_to()];
            let line = before.iter().filter(|b| **b == b'\n').count() as u32 + 1;
            let column = before.iter().rev().take_while(|b| **b != b'\n').count() as u32 + 1;
            Fault::new(
                Spot { file: number, line, column },
                "the text is not valid UTF-8",
                "save the file as UTF-8",
            )
        })?;
        let text = text.trim_start_matches('\u{feff}');
        let nodes_limit = u32::try_from(self.main.options.limits.elements).unwrap_or(u32::MAX);
        let document = xml::parse(text, nodes_limit).map_err(|flaw| {
            let spot = Spot { file: number, line: flaw.line, column: flaw.column };
            Fault::new(spot, flaw.problem, "correct the XML")
        })?;
        let lines =
            std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        let file = File { number, text, lines, input, last: Cell::new((0, 1)) };
        let root = document.root_element();
        if root.tag_name().name() != "scene" {
            let problem = format!(
                "the element <{}>, where <scene> was expected",
                shortened(root.tag_name().name())
            );
            return Err(Fault::new(file.at(&root), problem, "give a Mitsuba scene"));
        }
        if number == 0 {
            let missing = || {
                let problem = "<scene> has no version, as Mitsuba's scenes have";
                Fault::new(
                    file.at(&root),
                    problem,
                    "write <scene version=\"3.0.0\">, or convert it if it is another program's",
                )
            };
            self.version = root.attribute("version").ok_or_else(missing)?.to_string();
        }
        self.open.push(path);
        let scene = self.object(&file, &root, "scene")?;
        self.open.pop();
        Ok(scene)
    }

    fn note(&mut self, kind: impl Into<String>, at: Spot, message: impl FnOnce() -> String) {
        self.notes.add(snell_scene::WarningKind::Changed, kind.into(), at, message);
    }

    /// An attribute with parameters substituted.
    fn attribute(&mut self, file: &File, node: &Node, name: &str) -> Result<Option<String>, Fault> {
        let Some(attribute) = node.attribute_node(name) else { return Ok(None) };
        let text = attribute.value();
        if !text.contains('$') {
            return Ok(Some(text.to_string()));
        }
        let mut filled = String::new();
        let mut rest = text;
        while let Some(start) = rest.find('$') {
            filled.push_str(&rest[..start]);
            rest = &rest[start + 1..];
            let Some((name, value)) = self.parameter_at(rest) else {
                let name = parameter_name(rest);
                let at = file.spot(attribute.range().start);
                let remedy = format!(
                    "give -D {name}=VALUE, or add <default name=\"{name}\" value=\"…\"/> above"
                );
                return Err(Fault::new(
                    at,
                    format!("the parameter \"${name}\" has no value"),
                    remedy,
                ));
            };
            filled.push_str(value);
            rest = &rest[name.len()..];
            let name = name.clone();
            if !self.declared.contains(&name) {
                self.declared.push(name);
            }
            if filled.len() > 1 << 20 {
                return Err(Fault::new(
                    file.at(node),
                    "parameters make a text of more than 1 MiB",
                    "shorten them",
                ));
            }
        }
        filled.push_str(rest);
        Ok(Some(filled))
    }

    /// The parameter whose name a text begins with, and its value. The longest name is taken:
    /// `$spp2` is not `$spp` followed by 2 if both are known.
    fn parameter_at(&self, text: &str) -> Option<(&String, &String)> {
        let is_known = |(name, _): &(&String, &String)| !name.is_empty() && text.starts_with(*name);
        self.parameters.iter().filter(is_known).max_by_key(|(name, _)| name.len())
    }

    /// The name of a parameter without a value in the `value` of an element.
    fn unset_parameter(&self, node: &Node) -> Option<String> {
        let places = node.attribute("value")?.split('$').skip(1);
        places.filter(|rest| self.parameter_at(rest).is_none()).map(parameter_name).next()
    }

    fn required(&mut self, file: &File, node: &Node, name: &str) -> Result<String, Fault> {
        let tag = node.tag_name().name();
        self.attribute(file, node, name)?.ok_or_else(|| {
            let problem = format!("<{tag}> has no attribute \"{name}\"");
            Fault::new(file.at(node), problem, format!("write <{tag} {name}=\"…\"/>"))
        })
    }

    fn object(&mut self, file: &File, node: &Node, class: &str) -> Result<Object, Fault> {
        let kind =
            if class == "scene" { String::new() } else { self.required(file, node, "type")? };
        let mut object = Object {
            class: class.into(),
            kind: kind.to_ascii_lowercase(),
            name: value::snake_case(&self.attribute(file, node, "name")?.unwrap_or_default()),
            id: self.attribute(file, node, "id")?,
            at: file.at(node),
            ..Object::default()
        };
        if self.depth >= MAX_DEPTH {
            let problem = format!("objects are nested deeper than {MAX_DEPTH}, the limit");
            return Err(Fault::new(object.at, problem, "flatten the scene"));
        }
        self.depth += 1;
        for child in node.children().filter(Node::is_element) {
            self.member(file, &child, &mut object)?;
        }
        self.depth -= 1;
        Ok(object)
    }

    /// Reads an element inside an object.
    fn member(&mut self, file: &File, node: &Node, object: &mut Object) -> Result<(), Fault> {
        let (at, tag) = (file.at(node), node.tag_name().name());
        let class = OLD_CLASSES.iter().find(|(old, _)| *old == tag).map_or(tag, |(_, new)| new);
        match class {
            "default" => {
                let (name, value) =
                    (self.required(file, node, "name")?, self.required(file, node, "value")?);
                if !self.declared.contains(&name) {
                    self.declared.push(name.clone());
                }
                self.parameters.entry(name).or_insert(value);
            }
            "include" => {
                let name = self.required(file, node, "filename")?;
                let input = self.open_file(file, &name, at)?;
                let scene = self.scene(&input, at)?;
                object.properties.extend(scene.properties);
                object.children.extend(scene.children);
            }
            "alias" => {
                let (id, alias) =
                    (self.required(file, node, "id")?, self.required(file, node, "as")?);
                self.aliases.insert(alias, id);
            }
            "path" => {
                let value = self.required(file, node, "value")?;
                self.search(file, &value, at)?;
            }
            "ref" => {
                let id = self.required(file, node, "id")?;
                let name =
                    value::snake_case(&self.attribute(file, node, "name")?.unwrap_or_default());
                object.children.push(Child {
                    name,
                    at,
                    content: Content::Reference(id),
                    used: Cell::new(false),
                });
            }
            "spectrum" if node.has_attribute("type") => self.property(file, node, object)?,
            class if CLASSES.contains(&class) && class != "scene" => {
                let inner = self.object(file, node, class)?;
                let name = inner.name.clone();
                let content = Content::Object(Rc::new(inner));
                object.children.push(Child { name, at, content, used: Cell::new(false) });
            }
            _ => self.property(file, node, object)?,
        }
        Ok(())
    }

    /// Adds a folder to those that are searched for files. The name is relative to the folder of
    /// the file that names it, or else to that of the main file.
    fn search(&mut self, file: &File, name: &str, at: Spot) -> Result<(), Fault> {
        if self.searched.len() >= MAX_SEARCHED {
            let problem = format!("more than {MAX_SEARCHED} <path> elements, the limit");
            return Err(Fault::new(at, problem, "put the files together"));
        }
        let homes = [file.input, self.main];
        let home = homes.into_iter().find(|input| input.has_folder(name)).unwrap_or(file.input);
        match home.resolve_folder(name) {
            Ok(directory) if directory.is_dir() => {
                let folder = self.main.part(&self.main.name, Vec::new());
                self.searched.push(Input { directory, ..folder });
            }
            Ok(_) => {
                let name = shortened(name);
                self.note(format!("path {name}"), at, || {
                    format!("<path>: there is no folder \"{name}\"; it was not searched for files")
                });
            }
            Err(refusal) => {
                let name = shortened(name);
                self.refused.push(name.to_string());
                self.note(format!("path {name}"), at, || {
                    format!("<path>: {}; it was not searched for files", refusal.problem)
                });
            }
        }
        Ok(())
    }

    /// Opens a file that another one names. The name is relative to a search folder or the main
    /// file's folder, or else to the folder of the file that names it.
    fn open_file(&self, file: &File, name: &str, at: Spot) -> Result<Input, Fault> {
        let beside = |input: &Input| {
            input.open_relative(name).map_err(|error| {
                let is_own = error.file == input.name;
                let problem = if is_own {
                    error.problem
                } else {
                    format!("{}: {}", error.file, error.problem)
                };
                missing(at, problem, error.remedy, &self.refused)
            })
        };
        let first = home(self.main, &self.searched, name);
        // A file of this name is meant rather than one that the search finds.
        if file.number != 0 && !first.has_file(name) && file.input.has_file(name) {
            return beside(file.input);
        }
        beside(first)
            .or_else(|fault| if file.number == 0 { Err(fault) } else { beside(file.input) })
    }

    fn property(&mut self, file: &File, node: &Node, object: &mut Object) -> Result<(), Fault> {
        let (at, tag) = (file.at(node), node.tag_name().name());
        if let Some(parameter) = self.unset_parameter(node) {
            let name = self.required(file, node, "name")?;
            let owner = object.owner();
            self.note(format!("parameter {parameter}"), at, || {
                format!(
                    "the parameter \"${parameter}\" has no value: \"{}\" of {owner} has its \
                        default; give -D {parameter}=VALUE",
                    shortened(&name)
                )
            });
            return Ok(());
        }
        let Some(value) = self.value(file, node, tag)? else {
            let problem = format!("<{}>", shortened(tag));
            self.note(format!("element {tag}"), at, || {
                format!(
                    "{problem} is not an element of Mitsuba's scenes; it was ignored with all \
                    that is in it"
                )
            });
            return Ok(());
        };
        let name = value::snake_case(&self.required(file, node, "name")?);
        if object.properties.iter().any(|p| p.name == name) {
            let problem = format!("{} has \"{name}\" twice", object.owner());
            return Err(Fault::new(at, problem, "remove one of them"));
        }
        if object.properties.len() >= MAX_PROPERTIES {
            let problem =
                format!("{} has more than {MAX_PROPERTIES} properties, the limit", object.owner());
            return Err(Fault::new(at, problem, "no plugin knows as many: remove some"));
        }
        object.properties.push(Property { name, at, value, used: Cell::new(false) });
        Ok(())
    }

    /// The value of an element; `None` if its kind is not known.
    fn value(&mut self, file: &File, node: &Node, tag: &str) -> Result<Option<Value>, Fault> {
        let at = file.at(node);
        let fault =
            |problem: String| Fault::new(at, format!("<{tag}>: {problem}"), "correct the value");
        Ok(Some(match tag {
            "float" => {
                Value::Float(value::number(&self.required(file, node, "value")?).map_err(fault)?)
            }
            "integer" | "int" => {
                let text = self.required(file, node, "value")?;
                let whole = text.trim().parse::<i64>();
                Value::Integer(whole.map_err(|_| {
                    fault(format!("\"{}\" is not a whole number", shortened(&text)))
                })?)
            }
            "boolean" | "bool" => {
                match self.required(file, node, "value")?.trim().to_ascii_lowercase().as_str() {
                    "true" => Value::Bool(true),
                    "false" => Value::Bool(false),
                    other => {
                        return Err(fault(format!(
                            "\"{}\" is neither true nor false",
                            shortened(other)
                        )));
                    }
                }
            }
            "string" => Value::String(self.required(file, node, "value")?),
            "vector" | "point" => Value::Vector(self.vector(file, node, DVec3::ZERO)?),
            "rgb" | "srgb" => {
                let text = self.required(file, node, "value")?;
                let color = match value::hex_color(&text) {
                    Some(color) => color,
                    None => {
                        let v = value::triple(&text).map_err(fault)?.as_vec3();
                        let color = Rgb::new(v.x, v.y, v.z);
                        if tag == "srgb" { value::from_srgb(color) } else { color }
                    }
                };
                Value::Color(Hue::Rgb(color))
            }
            "spectrum" | "blackbody" => Value::Color(self.spectrum(file, node)?),
            "transform" | "animation" => Value::Transform(self.transform(file, node)?),
            _ => return Ok(None),
        }))
    }
}
