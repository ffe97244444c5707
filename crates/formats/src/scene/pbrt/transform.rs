//! The directives that change the current transform.

use super::lexer::Lexer;
use super::state::State;
use crate::scene::fault::{Fault, Spot};
use snell_math::{DAffine3, DMat4, DVec3, Transform, rotation};

/// Reads the arguments of a transform directive and applies it.
pub fn read(directive: &str, lexer: &mut Lexer, at: Spot, state: &mut State) -> Result<(), Fault> {
    match directive {
        "Identity" => state.change_transform(|_| DAffine3::IDENTITY),
        "Translate" => {
            state.concatenate(DAffine3::from_translation(vector(lexer, "a translation")?))
        }
        "Scale" => state.concatenate(DAffine3::from_scale(vector(lexer, "a scale")?)),
        "Rotate" => {
            let angle = lexer.expect_number("an angle in degrees")?;
            let axis = vector(lexer, "an axis")?;
            let Some(axis) = axis.try_normalize() else {
                return Err(Fault::new(
                    at,
                    "the axis of the rotation is the zero vector",
                    "give an axis",
                ));
            };
            state.concatenate(DAffine3::from_mat3(rotation::about(axis, angle.to_radians())));
        }
        "LookAt" => state.concatenate(look_at(lexer, at)?),
        "Transform" => {
            let map = matrix(lexer, at)?;
            state.change_transform(|_| map);
        }
        _ => state.concatenate(matrix(lexer, at)?),
    }
    Ok(())
}

fn vector(lexer: &mut Lexer, what: &str) -> Result<DVec3, Fault> {
    Ok(DVec3::new(
        lexer.expect_number(what)?,
        lexer.expect_number(what)?,
        lexer.expect_number(what)?,
    ))
}

/// The transform from the world to a camera. The three arguments are the camera's position, the
/// point that it looks at, and an up vector.
fn look_at(lexer: &mut Lexer, at: Spot) -> Result<DAffine3, Fault> {
    let (eye, target) = (vector(lexer, "the eye")?, vector(lexer, "the target")?);
    let up = vector(lexer, "the up vector")?;
    let towards = (target - eye).try_normalize();
    let right = towards
        .and_then(|towards| Some((towards, up.try_normalize()?.cross(towards).try_normalize()?)));
    let Some((towards, right)) = right else {
        let problem = "LookAt has no direction: eye and target coincide, or the up vector points \
            along the view";
        return Err(Fault::new(at, problem, "choose another target or up vector"));
    };
    let world_from_camera = DAffine3::from_mat3_translation(
        snell_math::DMat3::from_cols(right, towards.cross(right), towards),
        eye,
    );
    Ok(world_from_camera.inverse())
}

/// Reads sixteen numbers in brackets, column by column.
fn matrix(lexer: &mut Lexer, at: Spot) -> Result<DAffine3, Fault> {
    const WHAT: &str = "a matrix of 16 numbers";
    let bracketed = lexer.take_bracket(b'[');
    let mut numbers = [0.0; 16];
    for number in &mut numbers {
        *number = lexer.expect_number(WHAT)?;
    }
    if bracketed && !lexer.take_bracket(b']') {
        let (token, spot) = lexer.expect("\"]\"")?;
        let problem = format!("{} follows the 16 numbers of a matrix", token.quoted());
        return Err(Fault::new(spot, problem, "close the matrix with ]"));
    }
    let matrix = DMat4::from_cols_array(&numbers);
    match Transform::from_matrix(matrix) {
        Some(map) => Ok(*map.matrix()),
        None => {
            let problem = "this matrix is singular or projective";
            Err(Fault::new(
                at,
                problem,
                "use an invertible affine matrix, whose numbers 4, 8 and 12 are 0",
            ))
        }
    }
}
