//! The effect of each directive.

use super::lexer::{Lexer, Token, quoted};
use super::params::Params;
use super::spectrum::ColorSpace;
use super::state::{Block, Motion, Target};
use super::{Builder, identity, transform};
use crate::Input;
use crate::scene::fault::{Fault, Spot};
use snell_math::Transform;
use snell_scene::Node;
use std::path::Path;

/// All directives of pbrt-v4, and those of pbrt-v3 that were removed.
pub const NAMES: &[&str] = &[
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
    "WorldEnd",
];

impl Builder<'_> {
    /// Executes the directives of a file. `at` is where the file is named.
    pub(super) fn read_file(&mut self, input: &Input, at: Spot) -> Result<(), Fault> {
        let path = identity(Path::new(&input.name));
        if self.open_files.contains(&path) {
            let problem =
                format!("the file includes itself through {}", quoted(input.name.as_bytes()));
            return Err(Fault::new(at, problem, "remove this directive"));
        }
        let limit = input.options.limits.depth.min(MAX_FILE_DEPTH);
        if self.open_files.len() >= limit {
            let problem = format!("files are nested deeper than {limit}, the limit");
            return Err(Fault::new(at, problem, "flatten the scene"));
        }
        self.open_files.push(path);
        let is_same = |other: &Input| other.directory == input.directory;
        if !is_same(self.main) && !self.included.iter().any(is_same) {
            let folder = self.main.part(&self.main.name, Vec::new());
            self.included.push(Input { directory: input.directory.clone(), ..folder });
        }
        let file = self.files.len() as u32;
        self.files.push(input.name.clone());
        let depth = self.stack.depth();
        let mut lexer = Lexer::new(input, file);
        while let Some((token, at)) = lexer.token()? {
            let Token::Word(word) = token else {
                let problem = format!("found {}, expected a directive", token.quoted());
                return Err(Fault::new(
                    at,
                    problem,
                    "put it after the directive it belongs to, or remove it",
                ));
            };
            self.count_directive(at)?;
            let name = std::str::from_utf8(word).unwrap_or_default();
            self.directive(name, word, at, &mut lexer)?;
        }
        if self.open_files.len() == 1 {
            self.stack.check_closed(depth.min(self.stack.depth()))?;
        }
        self.open_files.pop();
        Ok(())
    }

    fn count_directive(&mut self, at: Spot) -> Result<(), Fault> {
        self.directives += 1;
        let limit = self.main.options.limits.elements;
        if self.directives <= limit {
            return Ok(());
        }
        Err(Fault::new(
            at,
            format!("the scene has more than {limit} directives, the limit"),
            "split the scene",
        ))
    }

    fn directive(
        &mut self,
        name: &str,
        word: &[u8],
        at: Spot,
        lexer: &mut Lexer,
    ) -> Result<(), Fault> {
        match name {
            "AttributeBegin" => self.begin(Block::Attribute, at),
            "AttributeEnd" => self.stack.end(Block::Attribute, at, &mut self.state),
            "TransformBegin" => self.begin(Block::Transform, at),
            "TransformEnd" => self.stack.end(Block::Transform, at, &mut self.state),
            "WorldBegin" => self.begin_world(at),
            "WorldEnd" => {
                self.is_v3 = true;
                Ok(())
            }
            "Identity" | "Translate" | "Scale" | "Rotate" | "LookAt" | "Transform"
            | "ConcatTransform" => transform::read(name, lexer, at, &mut self.state),
            "CoordinateSystem" => {
                let (name, _) = lexer.expect_string("the name of a coordinate system")?;
                self.coordinate_systems.insert(name.into(), self.state.transform);
                Ok(())
            }
            "CoordSysTransform" => self.use_coordinate_system(lexer),
            "ActiveTransform" => self.choose_transform(lexer),
            "TransformTimes" => {
                let start = lexer.expect_number("the time at the start")?;
                self.moving.times = [start, lexer.expect_number("the time at the end")?];
                Ok(())
            }
            "ReverseOrientation" => {
                self.state.reverse_orientation = !self.state.reverse_orientation;
                Ok(())
            }
            "ColorSpace" => self.choose_color_space(lexer),
            "Include" => self.include(lexer, false),
            "Import" => self.include(lexer, true),
            "Attribute" => self.attribute(lexer),
            "Option" => self.option(lexer),
            "Camera" | "Film" | "Sampler" | "PixelFilter" | "Integrator" | "Accelerator" => {
                let params = self.params(name, lexer, at)?;
                self.render_option(name, params)
            }
            // These four directives belong to pbrt 1 and 2.
            "SurfaceIntegrator" => {
                self.is_v3 = true;
                let params = self.params(name, lexer, at)?;
                self.render_option("Integrator", params)
            }
            "Renderer" | "Volume" | "VolumeIntegrator" => {
                let params = self.params(name, lexer, at)?;
                let owner = params.owner.clone();
                self.note(owner.clone(), at, || format!("{owner} of pbrt 2 is left out"));
                Ok(())
            }
            "Shape" => {
                let params = self.params_for(name, lexer, at, Target::Shape)?;
                self.shape(params)
            }
            "LightSource" => {
                let params = self.params_for(name, lexer, at, Target::Light)?;
                self.light(params)
            }
            "AreaLightSource" => {
                let params = self.params_for(name, lexer, at, Target::Light)?;
                self.area_light(params)
            }
            "Material" => {
                let params = self.params_for(name, lexer, at, Target::Material)?;
                self.material(params)
            }
            "MakeNamedMaterial" => {
                let params = self.params_for(name, lexer, at, Target::Material)?;
                self.make_named_material(params)
            }
            "NamedMaterial" => self.named_material(lexer),
            "Texture" => self.texture(lexer, at),
            "MakeNamedMedium" => {
                let params = self.params_for(name, lexer, at, Target::Medium)?;
                self.make_named_medium(params)
            }
            "MediumInterface" => self.medium_interface(lexer),
            "ObjectBegin" => self.begin_object(lexer, at),
            "ObjectEnd" => self.end_object(at),
            "ObjectInstance" => self.place_object(lexer, at),
            _ => Err(unknown(word, at)),
        }
    }

    fn begin(&mut self, block: Block, at: Spot) -> Result<(), Fault> {
        self.stack.begin(block, at, &self.state, self.main.options.limits.depth)
    }

    fn begin_world(&mut self, at: Spot) -> Result<(), Fault> {
        if self.in_world {
            return Err(Fault::new(at, "a second WorldBegin", "remove it"));
        }
        self.in_world = true;
        self.start_world()?;
        self.state.transform = Motion::IDENTITY;
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".into(), Motion::IDENTITY);
        Ok(())
    }

    /// Reads the kind, such as `"sphere"`, and the parameters of a directive.
    fn params(&mut self, directive: &str, lexer: &mut Lexer, at: Spot) -> Result<Params, Fault> {
        let (kind, _) = lexer.expect_string(&format!("the kind or name of {directive}"))?;
        Params::read(
            lexer,
            format!("{directive} {}", quoted(kind.as_bytes())),
            at,
            self.main.options.limits.elements,
        )
    }

    fn params_for(
        &mut self,
        directive: &str,
        lexer: &mut Lexer,
        at: Spot,
        target: Target,
    ) -> Result<Params, Fault> {
        Ok(self.params(directive, lexer, at)?.with_defaults(self.state.defaults(target)))
    }

    fn use_coordinate_system(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (name, at) = lexer.expect_string("the name of a coordinate system")?;
        match self.coordinate_systems.get(name) {
            Some(transform) => self.state.transform = *transform,
            None => {
                let name = quoted(name.as_bytes());
                self.note(format!("coordinate system {name}"), at, || {
                    format!("there is no coordinate system {name}; the transform was left as it is")
                });
            }
        }
        Ok(())
    }

    fn choose_transform(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (token, at) = lexer.expect("StartTime, EndTime or All")?;
        self.state.active = match token {
            Token::Word(b"StartTime") => [true, false],
            Token::Word(b"EndTime") => [false, true],
            Token::Word(b"All") => [true, true],
            _ => {
                let problem =
                    format!("found {}, expected StartTime, EndTime or All", token.quoted());
                return Err(Fault::new(at, problem, "write one of these"));
            }
        };
        Ok(())
    }

    fn choose_color_space(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (name, at) = lexer.expect_string("the name of a colour space")?;
        let Some(space) = ColorSpace::named(name) else {
            let problem = format!("{} is not a colour space of pbrt", quoted(name.as_bytes()));
            return Err(Fault::new(at, problem, "use srgb, rec2020, dci-p3 or aces2065-1"));
        };
        self.state.color_space = space;
        Ok(())
    }

    fn include(&mut self, lexer: &mut Lexer, is_import: bool) -> Result<(), Fault> {
        let (name, at) = lexer.expect_string("the name of a file")?;
        let input = self.open(name, at)?;
        if !is_import {
            return self.read_file(&input, at);
        }
        // An imported file changes only its own state.
        let (state, depth) = (self.state.clone(), self.stack.depth());
        self.read_file(&input, at)?;
        self.stack.check_closed(depth)?;
        self.state = state;
        Ok(())
    }

    fn attribute(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (name, at) = lexer.expect_string("shape, light, material, medium or texture")?;
        let Some(target) = Target::named(name) else {
            let problem = format!("{} cannot be set by Attribute", quoted(name.as_bytes()));
            return Err(Fault::new(at, problem, "use shape, light, material, medium or texture"));
        };
        let owner = format!("Attribute {}", quoted(name.as_bytes()));
        let params = Params::read(lexer, owner, at, self.main.options.limits.elements)?;
        self.state.add_defaults(target, params.into_own());
        Ok(())
    }

    /// Reads `Option`: one parameter without a list around it. None of pbrt's options changes the
    /// converged picture, except for options that cause a warning.
    fn option(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let at = if lexer.something_follows() { lexer.spot() } else { Spot::default() };
        let params = Params::read(lexer, "Option".into(), at, self.main.options.limits.elements)?;
        let names = [
            "disablepixeljitter",
            "disabletexturefiltering",
            "disablewavelengthjitter",
            "displacementedgescale",
        ];
        self.mention_ignored(&params, &names, "it is an aid for debugging pbrt");
        self.mention_ignored(
            &params,
            &["forcediffuse", "pixelstats", "wavefront"],
            "it is an aid for debugging pbrt",
        );
        self.mention_ignored(
            &params,
            &["msereferenceimage", "msereferenceout"],
            "use snell compare instead",
        );
        self.mention_ignored(&params, &["rendercoordsys"], "the picture does not depend on it");
        self.mention_ignored(&params, &["seed"], "use --seed instead");
        self.note_unused(&params);
        Ok(())
    }

    fn begin_object(&mut self, lexer: &mut Lexer, at: Spot) -> Result<(), Fault> {
        let (name, _) = lexer.expect_string("the name of an object")?;
        if let Some((open, _)) = &self.object {
            let problem =
                format!("ObjectBegin within the definition of {}", quoted(open.as_bytes()));
            return Err(Fault::new(at, problem, "write ObjectEnd first"));
        }
        self.begin(Block::Object, at)?;
        let node = self.scene.add_node(Node::named(name));
        self.object = Some((name.into(), node));
        Ok(())
    }

    fn end_object(&mut self, at: Spot) -> Result<(), Fault> {
        self.stack.end(Block::Object, at, &mut self.state)?;
        if let Some((name, node)) = self.object.take()
            && self.objects.insert(name.clone(), node).is_some()
        {
            let name = quoted(name.as_bytes());
            self.note(format!("object {name}"), at, || {
                format!("the object {name} is defined again; later instances show the new one")
            });
        }
        Ok(())
    }

    fn place_object(&mut self, lexer: &mut Lexer, at: Spot) -> Result<(), Fault> {
        let (name, named_at) = lexer.expect_string("the name of an object")?;
        let Some(&object) = self.objects.get(name) else {
            let name = quoted(name.as_bytes());
            self.note(format!("no object {name}"), named_at, || {
                format!(
                    "there is no object {name} so far; its instances were left out: define it \
                    above with ObjectBegin and ObjectEnd"
                )
            });
            return Ok(());
        };
        let [transform, _] = self.state.transform.0;
        if Transform::new(transform).is_none() {
            self.note_singular(at);
            return Ok(());
        }
        let parent = self.parent();
        let node = self.scene.add_child(
            parent,
            Node { transform, children: vec![object], ..Node::named("instance") },
        );
        self.note_motion(node, snell_math::DAffine3::IDENTITY);
        Ok(())
    }

    /// The node to which new nodes are added.
    pub(super) fn parent(&self) -> snell_scene::NodeId {
        self.object.as_ref().map_or(self.scene.root, |(_, node)| *node)
    }

    /// Warns that something has no extent.
    pub(super) fn note_singular(&mut self, at: Spot) {
        self.note("singular", at, || {
            "the current transform is singular, so this is flat and was left out".into()
        });
    }
}

/// Maximum depth of nested files; each takes some of the thread's stack.
const MAX_FILE_DEPTH: usize = 64;

fn unknown(word: &[u8], at: Spot) -> Fault {
    let name = String::from_utf8_lossy(word);
    let problem = format!("{} is not a directive of pbrt", quoted(word));
    let remedy = match NAMES.iter().find(|n| n.eq_ignore_ascii_case(&name)) {
        Some(known) => format!("write {known}"),
        None => "correct it; perhaps a value lacks brackets, or this is not a pbrt file".into(),
    };
    Fault::new(at, problem, remedy)
}
