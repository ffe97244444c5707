//! Shapes: those that pbrt has, and meshes for all others.

use super::material::Made;
use super::{File, transform};
use crate::write::AROUND;
use crate::write::flat::note_shape;
use crate::write::ply;
use snell_intersect::{AnyShape, Curves, Shape, TriangleMesh, first_uv_set};
use snell_math::{DAffine3, DMat3, DVec3, Vec2};
use snell_scene::Geometry;
use snell_scene::placed::Placed;
use std::fmt::Write;
use std::sync::Arc;

/// The transform from pbrt's round shapes to Snell's. pbrt's stand around z and count longitude
/// from x towards y; Snell's stand around y and count it from z towards x.
fn turned() -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X).transpose())
}

impl File<'_, '_> {
    /// The directives of a surface in its own coordinates; `None` if nothing is visible.
    pub fn parts(&mut self, surface: &Placed, made: &[(u16, Made)]) -> Option<String> {
        let mut text = String::new();
        match &surface.surface.geometry {
            Geometry::Mesh(mesh) => {
                for (slot, material) in made {
                    if let Some(name) = self.mesh_file(mesh, *slot, made.len() == 1) {
                        self.part(
                            &mut text,
                            material,
                            &format!("\"plymesh\" \"string filename\" [ \"{name}\" ]"),
                        );
                    }
                }
            }
            Geometry::Curves(curves) => {
                let (_, material) = made.first()?;
                self.curves(&mut text, curves, material);
            }
            Geometry::Shape(shape) => {
                let (_, material) = made.first()?;
                self.analytic(&mut text, shape, material);
            }
        }
        (!text.is_empty()).then_some(text)
    }

    /// Writes one shape with everything that pbrt takes from the directives around it.
    fn part(&mut self, text: &mut String, made: &Made, shape: &str) {
        text.push_str(&made.directives());
        _ = writeln!(text, "  Shape {shape}{}", made.shape_parameters);
    }

    fn analytic(&mut self, text: &mut String, shape: &Arc<AnyShape>, made: &Made) {
        match &**shape {
            AnyShape::Sphere(sphere) => {
                _ = writeln!(text, "  Concat{}", transform(&turned()));
                self.part(
                    text,
                    made,
                    &format!("\"sphere\" \"float radius\" [ {} ]", sphere.radius),
                );
            }
            AnyShape::Disk(disk) => {
                let inner = match disk.inner_radius {
                    0.0 => String::new(),
                    r => format!(" \"float innerradius\" [ {r} ]"),
                };
                self.part(
                    text,
                    made,
                    &format!("\"disk\" \"float radius\" [ {} ]{inner}", disk.radius),
                );
            }
            AnyShape::Cylinder(cylinder) => {
                _ = writeln!(text, "  Concat{}", transform(&turned()));
                let (radius, top) = (cylinder.radius, cylinder.height * 0.5);
                let side = format!(
                    "\"cylinder\" \"float radius\" [ {radius} ] \"float zmin\" [ {} ] \"float \
                        zmax\" [ {top} ]",
                    -top
                );
                self.part(text, made, &side);
                if cylinder.caps {
                    let cap = format!(
                        "\"disk\" \"float radius\" [ {radius} ] \"float height\" [ {top} ]"
                    );
                    self.part(text, made, &cap);
                    // The cap at the other end faces the other way.
                    _ = writeln!(text, "  Scale 1 -1 -1");
                    self.part(text, made, &cap);
                }
            }
            _ => {
                note_shape(shape.name(), self.output);
                let made_of = self.shapes.entry(Arc::as_ptr(shape));
                let Some(mesh) =
                    made_of.or_insert_with(|| shape.tessellate(AROUND).map(Arc::new)).clone()
                else {
                    return;
                };
                if let Some(name) = self.mesh_file(&mesh, 0, true) {
                    self.part(
                        text,
                        made,
                        &format!("\"plymesh\" \"string filename\" [ \"{name}\" ]"),
                    );
                }
            }
        }
    }

    /// Writes strands, one curve per segment: in pbrt the width of a curve varies linearly from one
    /// end to the other.
    fn curves(&mut self, text: &mut String, curves: &Curves, made: &Made) {
        text.push_str(&made.directives());
        let mut uneven = 0;
        if !curves.colors().is_empty() {
            self.output.lose("colours of points and lines are left out");
        }
        for controls in (0..curves.segment_count()).filter_map(|segment| curves.bezier(segment)) {
            let [a, b, c, d] = controls.map(|p| p.w);
            if controls.iter().all(|control| *control == controls[0]) {
                let at = controls[0].truncate().as_vec3();
                _ = writeln!(
                    text,
                    "  AttributeBegin\n  Translate {} {} {}\n  Shape \"sphere\" \"float radius\" \
                        [ {} ]{}\n  AttributeEnd",
                    at.x, at.y, at.z, a as f32, made.shape_parameters
                );
                continue;
            }
            let off = (b - (a + (d - a) / 3.0)).abs().max((c - (d + (a - d) / 3.0)).abs());
            uneven += u64::from(off > 1e-3 * a.max(d));
            let numbers: Vec<_> = controls.iter().map(|p| p.truncate().as_vec3()).collect();
            let numbers: Vec<_> =
                numbers.iter().map(|p| format!("{} {} {}", p.x, p.y, p.z)).collect();
            let [width0, width1] = [a, d].map(|r| (2.0 * r) as f32);
            _ = writeln!(
                text,
                "  Shape \"curve\" \"string type\" \"cylinder\" \"point3 P\" [ {} ] \"float \
                    width0\" [ {width0} ] \
                 \"float width1\" [ {width1} ]{}",
                numbers.join("  "),
                made.shape_parameters
            );
        }
        let is_long = curves.strands().len() < curves.segment_count();
        if is_long {
            self.output
                .lose("strands are written segment by segment: texture coordinates run along each");
        }
        if uneven > 0 {
            self.output.lose("radii of curves that do not vary linearly along a segment now do");
        }
    }

    /// The file of the triangles of a slot, written once; `None` if there are none.
    fn mesh_file(&mut self, mesh: &Arc<TriangleMesh>, slot: u16, is_whole: bool) -> Option<String> {
        let key = (Arc::as_ptr(mesh), slot);
        if let Some(name) = self.meshes.get(&key) {
            return Some(name.clone());
        }
        if !mesh.colors.is_empty() {
            self.output.lose("vertex colours are left out");
        }
        let part = if is_whole { (**mesh).clone() } else { part_of(mesh, slot) };
        if part.indices.is_empty() {
            return None;
        }
        // In pbrt v points up.
        let uvs = part.uvs[0].iter().map(|uv| Vec2::new(uv.x, 1.0 - uv.y)).collect();
        let part = TriangleMesh { uvs: first_uv_set(uvs), colors: Vec::new(), ..part };
        let name = self.output.file(&format!("mesh-{}.ply", self.mesh_count), ply::encoded(&part));
        self.mesh_count += 1;
        self.meshes.insert(key, name.clone());
        Some(name)
    }
}

/// The triangles of a slot, with only the vertices they use.
fn part_of(mesh: &TriangleMesh, slot: u16) -> TriangleMesh {
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut part = TriangleMesh::default();
    for (triangle, _) in mesh.indices.iter().zip(&mesh.material_slots).filter(|(_, s)| **s == slot)
    {
        part.indices.push(triangle.map(|i| {
            let i = i as usize;
            if number[i] == u32::MAX {
                number[i] = part.positions.len() as u32;
                part.positions.push(mesh.positions[i]);
                part.normals.extend(mesh.normals.get(i));
                part.uvs[0].extend(mesh.uvs[0].get(i));
                part.colors.extend(mesh.colors.get(i));
            }
            number[i]
        }));
    }
    part
}
