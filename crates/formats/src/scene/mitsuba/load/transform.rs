//! Vectors and transforms.

use super::super::value::{self, shortened};
use super::{File, Loader};
use crate::scene::fault::Fault;
use roxmltree::Node;
use snell_math::{DAffine3, DVec3, Transform, rotation};

impl Loader<'_> {
    /// Reads a vector: `value="1, 2, 3"`, or `x="1" y="2" z="3"`.
    pub(super) fn vector(
        &mut self,
        file: &File,
        node: &Node,
        default: DVec3,
    ) -> Result<DVec3, Fault> {
        let at = file.at(node);
        let fault = |problem: String| Fault::new(at, problem, "give three numbers");
        if let Some(text) = self.attribute(file, node, "value")? {
            return value::triple(&text).map_err(fault);
        }
        let mut vector = default;
        for (i, name) in ["x", "y", "z"].into_iter().enumerate() {
            if let Some(text) = self.attribute(file, node, name)? {
                vector[i] = value::number(&text).map_err(fault)?;
            }
        }
        Ok(vector)
    }

    /// The nested transforms, composed in order.
    pub(super) fn transform(&mut self, file: &File, node: &Node) -> Result<DAffine3, Fault> {
        if node.tag_name().name() == "animation" {
            self.note("animation", file.at(node), || {
                "a transform that changes over time; the first was used".into()
            });
            let first =
                node.children().find(|c| c.is_element() && c.tag_name().name() == "transform");
            return first.map_or(Ok(DAffine3::IDENTITY), |first| self.transform(file, &first));
        }
        let mut map = DAffine3::IDENTITY;
        for step in node.children().filter(Node::is_element) {
            map = self.step(file, &step)? * map;
        }
        let is_usable = map.is_finite() && Transform::new(map).is_some();
        let is_flat = map.is_finite() && map.matrix3.determinant() == 0.0;
        if is_usable || is_flat {
            return Ok(map);
        }
        Err(Fault::new(file.at(node), "the transform is out of range", "use smaller numbers"))
    }

    fn step(&mut self, file: &File, node: &Node) -> Result<DAffine3, Fault> {
        let (at, tag) = (file.at(node), node.tag_name().name().to_string());
        let fault =
            |problem: String| Fault::new(at, format!("<{tag}>: {problem}"), "correct the numbers");
        Ok(match tag.to_ascii_lowercase().as_str() {
            "translate" => DAffine3::from_translation(self.vector(file, node, DVec3::ZERO)?),
            "scale" => DAffine3::from_scale(self.vector(file, node, DVec3::ONE)?),
            "rotate" => {
                let axis = self.vector(file, node, DVec3::ZERO)?;
                let angle = value::number(&self.required(file, node, "angle")?).map_err(fault)?;
                let axis = axis
                    .try_normalize()
                    .ok_or_else(|| fault("the axis is the zero vector".into()))?;
                DAffine3::from_mat3(rotation::about(axis, angle.to_radians()))
            }
            "matrix" => value::matrix(&self.required(file, node, "value")?).map_err(fault)?,
            "lookat" => {
                let mut point =
                    |name: &str| value::triple(&self.required(file, node, name)?).map_err(fault);
                let (origin, target) = (point("origin")?, point("target")?);
                let up = if node.has_attribute("up") { point("up")? } else { DVec3::Y };
                let view = value::look_at(origin, target, up);
                view.ok_or_else(|| {
                    fault("origin and target coincide, or up points along the view".into())
                })?
            }
            _ => {
                let problem = format!("<{}> is not a transform", shortened(&tag));
                return Err(Fault::new(
                    at,
                    problem,
                    "use translate, rotate, scale, matrix or lookat",
                ));
            }
        })
    }
}
