//! Writes OBJ, with MTL and pictures beside it.

use super::flat::{Digits, world_meshes};
use super::material::{metal_color, shown_name, without_spectrum};
use super::picture::Pictures;
use super::{Output, SceneWriter, plain_name};
use crate::mesh::obj::HEIGHT_OF_BUMPS;
use snell_intersect::TriangleMesh;
use snell_math::Rgb;
use snell_scene::material::{
    AlphaMode, BumpMap, ColorParam, ConductorSpectrum, HeightUnit, MaterialKind, ScalarParam,
};
use snell_scene::texture::Wrap;
use snell_scene::{Encoding, ImageTexture, Material, MaterialId, Scene, TextureId};
use std::collections::HashSet;
use std::fmt::Write;

/// The writer of OBJ files.
pub const WRITER: SceneWriter =
    SceneWriter { name: "obj", extensions: &["obj"], knows: |_| false, write };

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    let meshes = world_meshes(scene, output, Digits::Any)?;
    output.lose_all_but_surfaces(scene);
    let names = material_names(scene);
    let mut text = String::from("# OBJ with linear colours; see the MTL for the materials\n");
    let used: HashSet<MaterialId> = meshes
        .iter()
        .flat_map(|(placed, _)| placed.slots())
        .filter_map(|(_, material)| material)
        .collect();
    if !used.is_empty() {
        let mut library = Library { pictures: Pictures::new(scene), output, text: String::new() };
        for (i, material) in scene
            .materials
            .iter()
            .enumerate()
            .filter(|(i, _)| used.contains(&MaterialId(*i as u32)))
        {
            library.material(&names[i], &shown_name(i, material), material);
        }
        let bytes = library.text.into_bytes();
        let name = output.file("materials.mtl", bytes);
        _ = writeln!(text, "mtllib {name}");
    }
    // Numbers of the next vertex, texture coordinate and normal.
    let mut base = [1; 3];
    for (number, (placed, mesh)) in meshes.iter().enumerate() {
        let name = plain_name(if placed.name.is_empty() { "object" } else { placed.name });
        _ = writeln!(text, "o {name}.{number}");
        vertices(mesh, &mut text);
        // Without normals the mesh is flat.
        _ = writeln!(text, "s {}", if mesh.normals.is_empty() { "off" } else { "1" });
        for (slot, material) in placed.slots() {
            if let Some(name) = material.and_then(|id| names.get(id.index())) {
                _ = writeln!(text, "usemtl {name}");
            } else if !used.is_empty() {
                output.lose("a surface without a material takes that of the one before it");
            }
            faces(mesh, slot, base, &mut text);
        }
        base[0] += mesh.positions.len();
        base[1] += mesh.uvs[0].len();
        base[2] += mesh.normals.len();
        if mesh.uvs[1..].iter().any(|set| !set.is_empty()) || !mesh.tangents.is_empty() {
            output.lose("tangents and second texture coordinates are left out");
        }
    }
    output.main = text.into_bytes();
    Ok(())
}

fn vertices(mesh: &TriangleMesh, text: &mut String) {
    for (i, p) in mesh.positions.iter().enumerate() {
        _ = match mesh.exact.get(i) {
            Some(p) => write!(text, "v {} {} {}", p.x, p.y, p.z),
            None => write!(text, "v {} {} {}", p.x, p.y, p.z),
        };
        if let Some(&[r, g, b, a]) = mesh.colors.get(i) {
            let [r, g, b] = [r, g, b].map(snell_math::spectrum::linear_to_srgb);
            _ = write!(text, " {r} {g} {b} {a}");
        }
        text.push('\n');
    }
    for uv in &mesh.uvs[0] {
        _ = writeln!(text, "vt {} {}", uv.x, uv.y);
    }
    for n in &mesh.normals {
        _ = writeln!(text, "vn {} {} {}", n.x, n.y, n.z);
    }
}

fn faces(mesh: &TriangleMesh, slot: u16, base: [usize; 3], text: &mut String) {
    let (has_uvs, has_normals) = (!mesh.uvs[0].is_empty(), !mesh.normals.is_empty());
    for (t, corners) in mesh.indices.iter().enumerate() {
        if mesh.material_slots.get(t).is_some_and(|&s| s != slot) {
            continue;
        }
        text.push('f');
        for &i in corners {
            let [v, vt, vn] = base.map(|b| b + i as usize);
            _ = match (has_uvs, has_normals) {
                (true, true) => write!(text, " {v}/{vt}/{vn}"),
                (true, false) => write!(text, " {v}/{vt}"),
                (false, true) => write!(text, " {v}//{vn}"),
                (false, false) => write!(text, " {v}"),
            };
        }
        text.push('\n');
    }
}

/// A unique name without spaces for each material.
fn material_names(scene: &Scene) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut names = Vec::new();
    for (i, material) in scene.materials.iter().enumerate() {
        let name = if material.name.is_empty() {
            format!("material-{i}")
        } else {
            plain_name(&material.name)
        };
        let name = if taken.contains(&name) { format!("{name}.{i}") } else { name };
        taken.insert(name.clone());
        names.push(name);
    }
    names
}

struct Library<'a, 'o> {
    pictures: Pictures<'a>,
    output: &'o mut Output,
    text: String,
}

impl Library<'_, '_> {
    fn say(&mut self, key: &str, color: Rgb) {
        _ = writeln!(self.text, "{key} {} {} {}", color.r, color.g, color.b);
    }

    fn number(&mut self, key: &str, value: f32) {
        _ = writeln!(self.text, "{key} {value}");
    }

    fn material(&mut self, name: &str, shown: &str, material: &Material) {
        _ = writeln!(self.text, "newmtl {name}");
        self.kind(shown, material);
        let emission = without_spectrum(material.emission, true);
        if material.is_emissive() {
            self.color("Ke", "map_Ke", emission);
            if material.emits_on_both_sides {
                self.output.lose(format!("{shown}: it emits on its outer side only"));
            }
        }
        match material.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Sheet(_) => {
                self.output.lose(format!("{shown}: the light that it lets through is left out"));
            }
            mode => {
                if matches!(mode, AlphaMode::Mask(_)) {
                    self.output.lose(format!("{shown}: the cut-off of its opacity is left out"));
                }
                self.number("d", material.alpha.factor);
                if let Some((id, channel)) = material.alpha.texture {
                    let file = self.pictures.channel(self.output, id, channel);
                    self.map("map_d", id, &file, "");
                }
            }
        }
        if let Some(map) = material.normal_map {
            let file = self.pictures.color(self.output, map.texture, Encoding::Linear);
            self.map("norm", map.texture, &file, &format!("-bm {} ", map.scale));
        }
        match material.bump_map {
            Some(BumpMap { texture, channel, height, unit: HeightUnit::Picture }) => {
                let file = self.pictures.channel(self.output, texture, channel.unwrap_or(1));
                self.map("map_bump", texture, &file, &format!("-bm {} ", height / HEIGHT_OF_BUMPS));
            }
            Some(_) => self
                .output
                .lose(format!("{shown}: bumps of a height in units of the scene are left out")),
            None => {}
        }
        if !material.double_sided {
            self.output.lose(format!("{shown}: it is visible from both sides"));
        }
        if material.interior.is_some_and(|i| i.medium.is_some()) {
            self.output.lose(format!("{shown}: the medium inside is left out"));
        }
        self.text.push('\n');
    }

    fn kind(&mut self, shown: &str, material: &Material) {
        match &material.kind {
            MaterialKind::Black(_) => {
                self.say("Kd", Rgb::BLACK);
                _ = writeln!(self.text, "illum 1");
            }
            MaterialKind::Diffuse(diffuse) => {
                self.color("Kd", "map_Kd", without_spectrum(diffuse.reflectance, false));
                _ = writeln!(self.text, "illum 1");
            }
            MaterialKind::Phong(phong) if phong.transmission.factor.is_black() => {
                self.color("Kd", "map_Kd", without_spectrum(phong.diffuse, false));
                self.say("Ka", phong.ambient.factor);
                let mirrors = !phong.reflection.factor.is_black();
                let specular = if mirrors { phong.reflection } else { phong.specular };
                self.color("Ks", "map_Ks", without_spectrum(specular, false));
                self.number("Ns", phong.shininess);
                _ = writeln!(self.text, "illum {}", if mirrors { 3 } else { 2 });
            }
            MaterialKind::Dielectric(glass) => {
                if !glass.absorption.is_black()
                    || glass.roughness.factor != 0.0
                    || glass.ior.is_dispersive()
                {
                    self.output.lose(format!(
                        "{shown}: absorption, roughness and dispersion of glass are left out"
                    ));
                }
                self.say("Kd", Rgb::BLACK);
                self.say("Tf", without_spectrum(glass.tint, false).factor);
                self.number("Ni", glass.ior.at_line_d());
                _ = writeln!(self.text, "illum 7");
            }
            kind => self.metallic_roughness(shown, material, kind),
        }
    }

    /// Writes the PBR extension.
    fn metallic_roughness(&mut self, shown: &str, material: &Material, kind: &MaterialKind) {
        let surface = super::material::open_pbr(material, shown, self.output);
        if let MaterialKind::Conductor(c) = kind
            && let ConductorSpectrum::Color(_) = c.spectrum
        {
            self.color("Kd", "map_Kd", without_spectrum(metal_color(&c.spectrum), false));
        } else {
            self.color("Kd", "map_Kd", without_spectrum(surface.base_color, false));
        }
        self.scalar("Pr", "map_Pr", surface.specular_roughness);
        self.scalar("Pm", "map_Pm", surface.base_metalness);
        self.number("Ni", surface.specular_ior.factor.clamp(1.0, 9.9));
        let extras = [
            (&surface.transmission_weight, "transmission"),
            (&surface.coat_weight, "the coat"),
            (&surface.fuzz_weight, "the fuzz"),
            (&surface.thin_film_weight, "the thin film"),
            (&surface.subsurface_weight, "scattering under the surface"),
            (&surface.specular_roughness_anisotropy, "anisotropy"),
        ];
        for (_, what) in extras.into_iter().filter(|(param, _)| param.factor != 0.0) {
            self.output.lose(format!("{shown}: {what} is left out"));
        }
    }

    fn color(&mut self, key: &str, map_key: &str, color: ColorParam) {
        self.say(key, color.factor);
        if let Some(id) = color.texture {
            let file = self.pictures.color(self.output, id, Encoding::Srgb);
            self.map(map_key, id, &file, "");
        }
    }

    fn scalar(&mut self, key: &str, map_key: &str, scalar: ScalarParam) {
        self.number(key, scalar.factor);
        if let Some((id, channel)) = scalar.texture {
            let file = self.pictures.channel(self.output, id, channel);
            self.map(map_key, id, &file, "");
        }
    }

    /// Writes a texture statement. The file name is relative to the MTL, which is in the same
    /// folder.
    fn map(&mut self, key: &str, id: TextureId, file: &str, options: &str) {
        let texture = self.pictures.texture(id);
        let file = file.rsplit('/').next().unwrap_or(file);
        let placement = self.placement(&texture);
        _ = writeln!(self.text, "{key} {options}{placement}{file}");
    }

    /// The options `-s` (scale) and `-o` (offset) of a texture, by `v' = 1 - (scale v + offset)`.
    fn placement(&mut self, texture: &ImageTexture) -> String {
        let [[a, b, c], [d, e, f]] = texture.uv_transform;
        if b != 0.0 || d != 0.0 {
            self.output.lose("the rotation of a texture is left out");
        }
        if texture.uv_set != 0 {
            self.output.lose("a texture on the second coordinates now uses the first");
        }
        let (scale, offset) = ([a, -e], [c, 1.0 - f]);
        let mut text = String::new();
        if scale != [1.0; 2] {
            _ = write!(text, "-s {} {} 1 ", scale[0], scale[1]);
        }
        if offset != [0.0; 2] {
            _ = write!(text, "-o {} {} 0 ", offset[0], offset[1]);
        }
        match texture.wrap {
            [Wrap::Repeat, Wrap::Repeat] => {}
            [Wrap::Clamp, Wrap::Clamp] => text += "-clamp on ",
            _ => {
                self.output.lose("a texture that is mirrored, or differs by direction, now repeats")
            }
        }
        text
    }
}
