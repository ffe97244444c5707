//! The statements of MTL files.
//!
//! An invalid statement is a warning, never an error: a mesh with one odd material is better than
//! none.

use super::file::ObjFile;
use crate::mesh::notes::{Notes, listed};
use crate::mesh::text::{Number, Reader, Text, Word, decoded, number};
use crate::search::text_of;
use crate::{Input, ReadError};
use snell_math::Rgb;
use snell_math::spectrum::response::RGB_FROM_XYZ;
use std::collections::{BTreeMap, BTreeSet};

/// A material as its file states it; a field is `None` if the file lacks its statement. See
/// Bourke's page on MTL, and Exocortex' "PBR extension to MTL" for `Pr`, `Pm` and `norm`.
#[derive(Clone, Debug, Default)]
pub struct Mtl {
    pub ambient: Option<Rgb>,
    pub diffuse: Option<Rgb>,
    pub specular: Option<Rgb>,
    pub emission: Option<Rgb>,
    /// `Tf`: filter of transmitted light.
    pub transmission: Option<Rgb>,
    /// `Ns`: exponent of the highlight.
    pub shininess: Option<f32>,
    /// `Ni`: index of refraction.
    pub ior: Option<f32>,
    /// `d`: 1 is opaque.
    pub dissolve: Option<f32>,
    /// `Tr`: 0 is opaque.
    pub transparency: Option<f32>,
    pub illum: Option<u32>,
    /// `Pr`: roughness.
    pub roughness: Option<f32>,
    /// `Pm`: metalness.
    pub metallic: Option<f32>,
    pub diffuse_map: Option<Map>,
    pub specular_map: Option<Map>,
    pub emission_map: Option<Map>,
    pub alpha_map: Option<Map>,
    pub roughness_map: Option<Map>,
    pub metallic_map: Option<Map>,
    pub normal_map: Option<Map>,
    pub bump_map: Option<Map>,
    /// Index of the material's file in the list of libraries.
    pub library: usize,
}

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    pub file: String,
    /// `-s`: factor on u and v.
    pub scale: [f32; 2],
    /// `-o`: added to u and v after the scale.
    pub offset: [f32; 2],
    /// True for `-clamp on`: the image does not repeat.
    pub clamp: bool,
    /// `-bm`: strength of a normal or bump map.
    pub strength: f32,
}

/// The materials of all libraries that an OBJ file names, by name, and the libraries.
#[derive(Default)]
pub struct Library {
    pub materials: BTreeMap<String, Mtl>,
    pub inputs: Vec<Input>,
}

/// Reads the libraries. Missing ones are warnings.
pub fn read(input: &Input, file: &ObjFile, notes: &mut Notes) -> Result<Library, ReadError> {
    let mut library = Library::default();
    let mut names: Vec<&str> = Vec::new();
    for (line, _) in &file.libraries {
        // Names may hold spaces, and one line may hold several names.
        if input.resolve(line).is_ok_and(|path| path.is_file()) {
            names.push(line);
        } else {
            let split: Vec<&str> = line.split_whitespace().collect();
            let several = split.iter().any(|n| input.resolve(n).is_ok_and(|p| p.is_file()));
            names.extend(if several { split } else { vec![&line[..]] });
        }
    }
    names.truncate(input.options.limits.files);
    // Whoever renames a mesh and its materials leaves the old name in the mesh.
    let renamed = format!("{}.mtl", input.stem());
    for name in &mut names {
        let is_missing = |name: &str| !input.resolve(name).is_ok_and(|path| path.is_file());
        if !name.is_empty() && is_missing(name) && !is_missing(&renamed) {
            notes.say(
                snell_scene::WarningKind::Choice,
                format!(
                    "{}: its material library \"{name}\" does not exist; \"{renamed}\" was taken \
                    for it",
                    input.name
                ),
            );
            *name = &renamed;
        }
    }
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            continue;
        }
        let path = input.resolve(name)?;
        if name.is_empty() || !path.exists() {
            notes.say(
                snell_scene::WarningKind::Missing,
                format!(
                    "{}: its material library \"{name}\" does not exist; the default material was \
                        used",
                    input.name
                ),
            );
            continue;
        }
        let opened = input.open_relative(name)?;
        // Libraries are searched in the order in which they are named.
        for (name, mtl) in parse(&opened, library.inputs.len(), notes) {
            library.materials.entry(name).or_insert(mtl);
        }
        library.inputs.push(opened);
    }
    Ok(library)
}

/// The materials of one library, by name. Of several of one name the last is taken, as in Blender
/// and three.js.
fn parse(input: &Input, library: usize, notes: &mut Notes) -> BTreeMap<String, Mtl> {
    let bytes = decoded(&input.bytes);
    let text = Text::new(&bytes, 0).with_continuations().with_comments(b'#');
    let mut statements = Statements { reader: Reader::new(input, &bytes, text), notes };
    let mut materials = BTreeMap::new();
    let mut repeated = BTreeSet::new();
    let mut current: Option<(String, Mtl)> = None;
    while let Some(keyword) = statements.reader.text.word_on_any_line() {
        if keyword.bytes.eq_ignore_ascii_case(b"newmtl") {
            let name = text_of(statements.reader.text.rest_of_line().bytes);
            let mtl = Mtl { library, ..Mtl::default() };
            if let Some((name, mtl)) = current.replace((name.clone(), mtl)) {
                materials.insert(name, mtl);
            }
            if materials.contains_key(&name) {
                repeated.insert(name);
            }
        } else if let Some((_, mtl)) = &mut current {
            statements.statement(keyword, mtl);
        }
        statements.reader.text.next_line();
    }
    statements.reader.note_commas(statements.notes);
    materials.extend(current);
    if !repeated.is_empty() {
        let names: Vec<&str> = repeated.iter().map(String::as_str).collect();
        let message = format!(
            "{}: of several materials of one name the last was taken: {}",
            input.name,
            listed(&names)
        );
        notes.say(snell_scene::WarningKind::Changed, message);
    }
    materials
}

struct Statements<'a, 'n> {
    reader: Reader<'a>,
    notes: &'n mut Notes,
}

impl Statements<'_, '_> {
    fn statement(&mut self, keyword: Word, mtl: &mut Mtl) {
        match keyword.bytes.to_ascii_lowercase().as_slice() {
            b"ka" => mtl.ambient = self.color(keyword),
            b"kd" => mtl.diffuse = self.color(keyword),
            b"ks" => mtl.specular = self.color(keyword),
            b"ke" => mtl.emission = self.color(keyword),
            b"tf" => mtl.transmission = self.color(keyword),
            b"ns" => mtl.shininess = self.scalar(keyword),
            b"ni" => mtl.ior = self.scalar(keyword),
            b"d" => mtl.dissolve = self.dissolve(keyword),
            b"tr" => mtl.transparency = self.scalar(keyword),
            b"illum" => mtl.illum = self.scalar(keyword).map(|x| x as u32),
            b"pr" => mtl.roughness = self.scalar(keyword),
            b"pm" => mtl.metallic = self.scalar(keyword),
            b"map_kd" => mtl.diffuse_map = self.map(keyword),
            b"map_ks" => mtl.specular_map = self.map(keyword),
            b"map_ke" => mtl.emission_map = self.map(keyword),
            b"map_d" | b"map_tr" => mtl.alpha_map = self.map(keyword),
            b"map_pr" => mtl.roughness_map = self.map(keyword),
            b"map_pm" => mtl.metallic_map = self.map(keyword),
            b"norm" | b"map_kn" => mtl.normal_map = self.map(keyword),
            b"map_bump" | b"bump" => mtl.bump_map = self.map(keyword),
            b"disp" | b"map_disp" => {
                self.warn(
                    "displacement",
                    keyword,
                    "displacement maps are not supported (bump and normal maps are)",
                );
            }
            // No warning for statements with little visible effect: sharpness of reflections, maps
            // of ambient light, anti-aliasing, and so on.
            b"map_ka" | b"sharpness" | b"map_aat" | b"km" | b"pcr" | b"anisor" => {}
            // Exporters write these also where they are 0.
            b"ps" | b"pc" | b"aniso" => {
                if self.scalar(keyword).is_some_and(|amount| amount != 0.0) {
                    self.warn(
                        "other lobes",
                        keyword,
                        "sheen, clear coat and anisotropy are not supported in MTL; use glTF for \
                            them",
                    );
                }
            }
            _ => self.warn(
                "unsupported",
                keyword,
                "not supported in a material; statements like this were skipped",
            ),
        }
    }

    fn warn(&mut self, kind: &'static str, at: Word, what: &str) {
        let reader = &self.reader;
        self.notes.add(kind, || format!("{}: {}: {what}", reader.location(at.start), at.quoted()));
    }

    /// The numbers up to the end of the line or the first other word, at most three.
    fn numbers(&mut self) -> ([f32; 3], usize) {
        let mut values = [0.0; 3];
        let mut count = 0;
        while count < 3 {
            let before = self.reader.text.clone();
            let word = self.reader.text.word();
            match word.map(|word| (word.start, number(word.bytes))) {
                Some((_, Number::Exact(value))) if value.is_finite() => values[count] = value,
                Some((start, Number::Comma(value))) if value.is_finite() => {
                    self.reader.found_comma(start);
                    values[count] = value;
                }
                _ => {
                    self.reader.text = before;
                    break;
                }
            }
            count += 1;
        }
        (values, count)
    }

    fn scalar(&mut self, keyword: Word) -> Option<f32> {
        let ([value, ..], count) = self.numbers();
        if count == 0 {
            self.warn("no number", keyword, "a number should follow; the statement was skipped");
        }
        (count > 0).then_some(value)
    }

    /// Reads a colour: red, green and blue, or after the word `xyz` a CIE XYZ colour. A single
    /// number is all three.
    fn color(&mut self, keyword: Word) -> Option<Rgb> {
        let before = self.reader.text.clone();
        let form = self.reader.text.word().map(|word| word.bytes.to_ascii_lowercase());
        if form.as_deref() == Some(b"spectral") {
            self.warn(
                "spectral",
                keyword,
                "curves of reflectance (spectral) are not supported; the statement was skipped",
            );
            return None;
        }
        let is_xyz = form.as_deref() == Some(b"xyz");
        if !is_xyz {
            self.reader.text = before;
        }
        let ([r, g, b], count) = self.numbers();
        let color = match count {
            0 => {
                self.warn(
                    "no color",
                    keyword,
                    "a colour of three numbers should follow; the statement was skipped",
                );
                return None;
            }
            3 => Rgb::new(r, g, b),
            _ => Rgb::splat(r),
        };
        let color = if is_xyz {
            let xyz = color.to_array().map(f64::from);
            let row = |row: [f64; 3]| (0..3).map(|k| row[k] * xyz[k]).sum::<f64>() as f32;
            let [r, g, b] = RGB_FROM_XYZ.map(row);
            Rgb::new(r, g, b)
        } else {
            color
        };
        Some(color.map(|x| x.max(0.0)))
    }

    /// Reads `d 0.5` or `d -halo 0.5`.
    fn dissolve(&mut self, keyword: Word) -> Option<f32> {
        let before = self.reader.text.clone();
        if self.reader.text.word().is_none_or(|w| w.bytes != b"-halo") {
            self.reader.text = before;
        }
        self.scalar(keyword)
    }

    /// Reads options and a file name, which may contain spaces.
    fn map(&mut self, keyword: Word) -> Option<Map> {
        let mut map = Map {
            file: String::new(),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp: false,
            strength: 1.0,
        };
        loop {
            let before = self.reader.text.clone();
            let Some(option) = self.reader.text.word() else { break };
            match option.bytes {
                b"-s" => {
                    let ([u, v, _], count) = self.numbers();
                    map.scale = [if count > 0 { u } else { 1.0 }, if count > 1 { v } else { 1.0 }];
                }
                b"-o" => {
                    let ([u, v, _], _) = self.numbers();
                    map.offset = [u, v];
                }
                b"-mm" => {
                    if !matches!(self.numbers(), ([0.0, 1.0, _], 2)) {
                        self.warn(
                            "range of a map",
                            option,
                            "the range of a map is not supported; the picture is shown as it is",
                        );
                    }
                }
                b"-t" | b"-texres" | b"-boost" => _ = self.numbers(),
                b"-bm" => {
                    let ([strength, ..], count) = self.numbers();
                    map.strength = if count > 0 { strength } else { 1.0 };
                }
                b"-clamp" => map.clamp = self.reader.text.word().is_some_and(|w| w.bytes == b"on"),
                b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-type" | b"-colorspace" => {
                    _ = self.reader.text.word();
                }
                _ => {
                    self.reader.text = before;
                    let name = self.reader.text.rest_of_line();
                    map.file = text_of(name.bytes).trim_matches('"').to_owned();
                    break;
                }
            }
        }
        if map.file.is_empty() {
            self.warn(
                "no file",
                keyword,
                "the name of an image should follow; the statement was skipped",
            );
            return None;
        }
        Some(map)
    }
}
