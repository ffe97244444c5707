//! Spheres, cones, cylinders and polygons.

use super::Builder;
use crate::ReadError;
use crate::mesh::polygon::Triangulator;
use crate::scene::tokens::{Token, Tokens};
use snell_intersect::shape::{Cylinder, Frustum, Sphere};
use snell_intersect::{AnyShape, TriangleMesh};
use snell_math::glam::DQuat;
use snell_math::{DAffine3, DVec3, Vec3};
use snell_scene::{Geometry, Surface};
use std::sync::Arc;

/// Polygons of one material: a mesh is traced faster than many single triangles.
#[derive(Default)]
pub struct Polygons {
    /// Polygons without normals.
    flat: TriangleMesh,
    /// Polygons with normals.
    smooth: TriangleMesh,
}

impl Builder {
    pub fn read_sphere(&mut self, tokens: &mut Tokens) -> Result<(), ReadError> {
        tokens.set_usage("s x y z radius");
        let center = tokens.vector("the center of the sphere")?;
        // A negative radius means that the inside is visible; here both sides are.
        let radius = tokens.number("the radius of the sphere")?.abs();
        if radius == 0.0 {
            self.scene.warn("a sphere of radius 0 is not visible");
            return Ok(());
        }
        self.place(DAffine3::from_translation(center), Sphere { radius }.into());
        Ok(())
    }

    /// Reads a cone or cylinder between two circles, without caps.
    pub fn read_cone(&mut self, tokens: &mut Tokens, keyword: &Token) -> Result<(), ReadError> {
        tokens.set_usage("c base_x base_y base_z base_radius apex_x apex_y apex_z apex_radius");
        let base = tokens.vector("the center of the base")?;
        let bottom_radius = tokens.number("the radius of the base")?;
        let apex = tokens.vector("the center of the apex")?;
        let top_radius = tokens.number("the radius of the apex")?;
        if bottom_radius * top_radius < 0.0 {
            let problem = "one radius of the cone is negative, the other positive";
            return Err(tokens.error(keyword, problem, "give both the same sign"));
        }
        let (bottom_radius, top_radius) = (bottom_radius.abs(), top_radius.abs());
        let height = (apex - base).length();
        let axis = (apex - base).try_normalize();
        let Some(axis) = axis.filter(|_| bottom_radius > 0.0 || top_radius > 0.0) else {
            self.scene.warn("a cone without length or without radius is not visible");
            return Ok(());
        };
        let rotation = DQuat::from_rotation_arc(DVec3::Y, axis);
        let place = DAffine3::from_rotation_translation(rotation, (base + apex) / 2.0);
        let shape = if bottom_radius == top_radius {
            Cylinder { radius: bottom_radius, height, caps: false }.into()
        } else {
            Frustum { bottom_radius, top_radius, height, caps: false }.into()
        };
        self.place(place, shape);
        Ok(())
    }

    fn place(&mut self, place: DAffine3, shape: AnyShape) {
        let material = self.current_fill();
        let root = self.scene.root;
        self.shapes.place(&mut self.scene, root, place, shape, Some(material));
    }

    /// Reads a polygon with or without normals at its corners.
    pub fn read_polygon(
        &mut self,
        tokens: &mut Tokens,
        keyword: &Token,
        has_normals: bool,
    ) -> Result<(), ReadError> {
        tokens.set_usage(if has_normals {
            "pp n, then n times x y z nx ny nz"
        } else {
            "p n, then n times x y z"
        });
        let token = tokens.peek();
        let count = tokens.integer("the number of corners")?;
        if let (true, Some(token)) = (count < 3, token) {
            return Err(tokens.error(
                &token,
                format!("a polygon has {count} corners"),
                "use at least 3",
            ));
        }
        let material = self.current_fill();
        let (mut corners, mut normals) = (Vec::new(), Vec::new());
        for _ in 0..count {
            self.count(tokens, keyword, 1)?;
            corners.push(tokens.vector("a corner of the polygon")?.as_vec3());
            if has_normals {
                normals.push(tokens.vector("a normal of the polygon")?);
            }
        }
        let polygons = self.polygons.entry(material).or_default();
        let mesh = if has_normals { &mut polygons.smooth } else { &mut polygons.flat };
        if mesh.positions.len() + corners.len() > u32::MAX as usize {
            let problem = "the polygons of one fill have more than 4294967295 corners";
            return Err(tokens.error(keyword, problem, "split the scene"));
        }
        let first = mesh.positions.len() as u32;
        let mut triangulator = Triangulator::default();
        let triangles = triangulator.triangulate(corners.iter().copied());
        mesh.indices.extend(triangles.iter().map(|t| t.map(|i| first + i as u32)));
        if has_normals {
            let face = face_normal(&corners);
            mesh.normals
                .extend(normals.iter().map(|n| n.try_normalize().map_or(face, |n| n.as_vec3())));
        }
        mesh.positions.extend(corners);
        Ok(())
    }

    /// Adds the polygons as meshes, at most two per material.
    pub fn finish_polygons(&mut self) {
        for (material, polygons) in std::mem::take(&mut self.polygons) {
            for mesh in [polygons.flat, polygons.smooth] {
                if !mesh.indices.is_empty() {
                    let surface = Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material);
                    self.scene.nodes[self.scene.root.index()].surfaces.push(surface);
                }
            }
        }
    }
}

/// Unit normal of a polygon at its first corner, as the format defines it.
fn face_normal(corners: &[Vec3]) -> Vec3 {
    let [a, b, c] = [corners[0], corners[1], corners[2]].map(|p| p.as_dvec3());
    (b - a).cross(c - b).normalize_or(DVec3::Z).as_vec3()
}
