//! One `.scn` file: its own list of materials, its groups, and the files it names.

use super::Builder;
use crate::mesh::{MeshRead, read_named_mesh};
use crate::scene::shapes::surface;
use crate::scene::tokens::{Token, Tokens};
use crate::{Input, Place, ReadError};
use snell_intersect::{AnyShape, TriangleMesh};
use snell_math::{DAffine3, DMat4, DVec3, Transform};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Warning};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file being read.
pub struct File<'a> {
    pub tokens: Tokens<'a>,
    /// The materials of the file, by the numbers that the file gives them.
    pub materials: Vec<MaterialId>,
    /// The innermost open group.
    group: Group<'a>,
    /// The groups around the innermost one; the first is the file itself.
    outer: Vec<Group<'a>>,
}

/// An open group.
struct Group<'a> {
    node: NodeId,
    world_from_group: DAffine3,
    /// The meaning of `-1`; `None` for the default material.
    material: Option<MaterialId>,
    /// Triangles of the group by material, one mesh each.
    triangles: BTreeMap<Option<MaterialId>, TriangleMesh>,
    /// The command that opened the group; `None` for the file itself.
    begin: Option<Token<'a>>,
}

impl Group<'_> {
    fn new(node: NodeId, world_from_group: DAffine3) -> Self {
        Self { node, world_from_group, material: None, triangles: BTreeMap::new(), begin: None }
    }
}

impl<'a> File<'a> {
    /// A file whose content goes into `node`.
    pub fn new(input: &'a Input, node: NodeId, world_from_node: DAffine3) -> Self {
        let group = Group::new(node, world_from_node);
        Self { tokens: Tokens::new(input), materials: Vec::new(), group, outer: Vec::new() }
    }

    /// The transform from the innermost group to the world.
    pub fn world_from_group(&self) -> DAffine3 {
        self.group.world_from_group
    }
}

impl Builder {
    /// Reads a file into `node`.
    pub fn read_file(
        &mut self,
        input: &Input,
        node: NodeId,
        world_from_node: DAffine3,
    ) -> Result<(), ReadError> {
        self.open_files.push(identity(Path::new(&input.name)));
        let mut file = File::new(input, node, world_from_node);
        while let Some(keyword) = file.tokens.take() {
            if keyword.text().starts_with('#') {
                file.tokens.skip_line();
                continue;
            }
            self.count_command(&file.tokens, &keyword)?;
            self.read_command(&mut file, &keyword)?;
        }
        if let Some(begin) = &file.group.begin {
            let problem = "this `begin` has no `end`";
            return Err(file.tokens.error(
                begin,
                problem,
                "close the group with `end`; is the file cut off?",
            ));
        }
        self.close_group(&mut file);
        self.open_files.pop();
        Ok(())
    }

    /// Reads `begin`.
    pub fn begin_group<'a>(
        &mut self,
        file: &mut File<'a>,
        begin: &Token<'a>,
    ) -> Result<(), ReadError> {
        self.descend(&file.tokens, begin)?;
        let material = self.material_argument(file)?;
        let first = file.tokens.peek();
        let matrix =
            DMat4::from_cols_array(&file.tokens.numbers::<16>("an element of the group's matrix")?)
                .transpose();
        let last = matrix.row(3);
        if last.truncate() != DVec3::ZERO || last.w == 0.0 {
            let problem = format!("the last row of the group's matrix is {last}, a projection");
            let remedy = "use an affine matrix: four rows of four numbers, the last row 0 0 0 1";
            return Err(file.tokens.error(&first.unwrap_or(*begin), problem, remedy));
        }
        let group_from_child = DAffine3::from_mat4(matrix * (1.0 / last.w));
        let world_from_child = file.group.world_from_group * group_from_child;
        let mut node = Node { transform: group_from_child, ..Node::named("group") };
        node.material = material;
        let is_solid = Transform::new(group_from_child).is_some()
            && Transform::new(world_from_child).is_some();
        let node = if is_solid {
            self.scene.add_child(file.group.node, node)
        } else {
            self.scene.warn(
                "a group with a singular matrix is flat, has no surface to hit and is left out",
            );
            // The node is stored without a parent, so its surfaces are left out, but it may still
            // define materials, lights and a camera.
            self.scene.add_node(node)
        };
        let mut group = Group::new(node, world_from_child);
        group.material = material.or(file.group.material);
        group.begin = Some(*begin);
        file.outer.push(std::mem::replace(&mut file.group, group));
        Ok(())
    }

    /// Reads `end`.
    pub fn end_group(&mut self, file: &mut File, end: &Token) -> Result<(), ReadError> {
        self.close_group(file);
        let Some(outer) = file.outer.pop() else {
            return Err(file.tokens.error(end, "this `end` has no `begin`", "remove it"));
        };
        file.group = outer;
        self.depth -= 1;
        Ok(())
    }

    /// Stores the triangles of the innermost group.
    fn close_group(&mut self, file: &mut File) {
        for (material, mesh) in std::mem::take(&mut file.group.triangles) {
            let surface = surface(Geometry::Mesh(Arc::new(mesh)), material);
            self.scene.nodes[file.group.node.index()].surfaces.push(surface);
        }
    }

    /// Reads a material id of the file; `None` if the material is to be inherited.
    pub fn material_argument(&mut self, file: &mut File) -> Result<Option<MaterialId>, ReadError> {
        let token = file.tokens.peek();
        let number = file.tokens.integer("a material id")?;
        if number < 0 {
            return Ok(None);
        }
        let known = usize::try_from(number).ok().and_then(|n| file.materials.get(n));
        known.copied().map(Some).ok_or_else(|| {
            let problem = match file.materials.len() {
                0 => format!("material {number} is used, but this file has defined none so far"),
                1 => format!(
                    "material {number} is used, but so far this file has defined only material 0"
                ),
                n => format!(
                    "material {number} is used, but so far this file has defined only 0 to {}",
                    n - 1
                ),
            };
            let place = token.map_or(Place::Whole, |t| file.tokens.place(&t));
            let remedy =
                "define the material above its first use, or use -1 for the group's material";
            file.tokens.input().error(place, problem, remedy)
        })
    }

    /// Reads the material id of a surface; ensures that there is a material to inherit.
    pub fn surface_material(&mut self, file: &mut File) -> Result<Option<MaterialId>, ReadError> {
        let material = self.material_argument(file)?;
        if material.is_none() && file.group.material.is_none() {
            let default = self.default_material();
            let node = file.outer.first().map_or(file.group.node, |g| g.node);
            self.scene.nodes[node.index()].material = Some(default);
        }
        Ok(material)
    }

    /// Adds a shape at a transform of the innermost group.
    pub fn add_shape(
        &mut self,
        file: &File,
        place: DAffine3,
        shape: AnyShape,
        material: Option<MaterialId>,
    ) {
        self.shapes.place(&mut self.scene, file.group.node, place, shape, material);
    }

    /// Adds geometry in the coordinates of the innermost group.
    pub fn add_surface(&mut self, file: &File, geometry: Geometry, material: Option<MaterialId>) {
        self.scene.nodes[file.group.node.index()].surfaces.push(surface(geometry, material));
    }

    /// Adds geometry whose zero is at a place in the coordinates of the innermost group.
    pub fn add_placed_surface(
        &mut self,
        file: &File,
        origin: DVec3,
        geometry: Geometry,
        material: Option<MaterialId>,
    ) {
        if origin == DVec3::ZERO {
            return self.add_surface(file, geometry, material);
        }
        let (transform, surfaces) =
            (DAffine3::from_translation(origin), vec![surface(geometry, material)]);
        self.scene.add_child(file.group.node, Node { transform, surfaces, ..Node::default() });
    }

    /// Adds a triangle in the coordinates of the innermost group.
    pub fn add_triangle(
        &mut self,
        file: &mut File,
        corners: [DVec3; 3],
        material: Option<MaterialId>,
    ) {
        let mesh = file.group.triangles.entry(material).or_default();
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners.map(|p| p.as_vec3()));
        mesh.indices.push([first, first + 1, first + 2]);
    }

    /// Reads `include`.
    pub fn include(&mut self, file: &mut File, keyword: &Token) -> Result<(), ReadError> {
        let name = file.tokens.expect("the name of a scene file")?;
        self.descend(&file.tokens, keyword)?;
        let (input, path) = self.open(file, &name)?;
        if self.open_files.contains(&path) {
            let problem = format!("the file includes itself through {}", name.quoted());
            return Err(file.tokens.error(&name, problem, "remove this include"));
        }
        let node = self.scene.add_child(file.group.node, Node::named(input.stem()));
        self.read_file(&input, node, file.group.world_from_group)?;
        self.depth -= 1;
        Ok(())
    }

    /// Reads `mesh`: the triangles of a file, which is read once for all its uses, and the place of
    /// their zero.
    pub fn mesh(&mut self, file: &mut File) -> Result<(Arc<TriangleMesh>, DVec3), ReadError> {
        let name = file.tokens.expect("the name of a mesh file")?;
        let path = named_path(file, &name)?;
        if let Some(mesh) = self.meshes.get(&path) {
            return Ok(mesh.clone());
        }
        let (mut input, _) = self.open(file, &name)?;
        if ["jpg", "jpeg", "bmp", "ppm", "png"].contains(&input.extension().as_str()) {
            let problem = format!(
                "{} is a picture; height fields are not supported as meshes",
                name.quoted()
            );
            return Err(file.tokens.error(
                &name,
                problem,
                "convert the height field to a triangle mesh (.off, .ply)",
            ));
        }
        let MeshRead { mut mesh, origin, warnings, .. } = read_named_mesh(&mut input)?;
        for (_, Warning { message, count, kind }) in warnings {
            Warning::note_of(kind, &mut self.scene.warnings, message, count);
        }
        // The command sets one material for the whole mesh.
        mesh.material_slots.clear();
        mesh.colors.clear();
        // In mesh files v points up; on shapes, and therefore in the textures of these scenes,
        // down.
        for uv in &mut mesh.uvs[0] {
            uv.y = 1.0 - uv.y;
        }
        let read = (Arc::new(mesh), origin);
        self.meshes.insert(path, read.clone());
        Ok(read)
    }

    /// Opens a file that this one names. Also returns its canonical path, which is the same for
    /// every name of the file.
    pub fn open(&mut self, file: &File, name: &Token) -> Result<(Input, PathBuf), ReadError> {
        self.files += 1;
        let limit = file.tokens.input().options.limits.files;
        if self.files > limit {
            let problem = format!("the scene names more than {limit} files, the limit");
            return Err(file.tokens.error(name, problem, "split the scene"));
        }
        let path = identity(&named_path(file, name)?);
        let input = file.tokens.input().open_relative(&name.text()).map_err(|error| {
            // The error is either about this file, which refers to the outside, or about the other
            // one, which cannot be opened.
            let is_own = error.file == file.tokens.input().name;
            let problem =
                if is_own { error.problem } else { format!("{}: {}", error.file, error.problem) };
            file.tokens.error(name, problem, error.remedy)
        })?;
        Ok((input, path))
    }
}

/// The path of a file named by this one; it need not exist.
pub fn named_path(file: &File, name: &Token) -> Result<PathBuf, ReadError> {
    let text = name.utf8().ok_or_else(|| file.tokens.unexpected(name, "a file name in UTF-8"))?;
    Ok(file.tokens.input().directory.join(text))
}

/// A path that is the same for every name of a file.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}
