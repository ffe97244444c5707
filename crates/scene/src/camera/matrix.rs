//! Cameras from matrices: poses in the conventions of computer vision and of computer graphics.

use super::{Camera, Projection};
use snell_math::{DMat4, DVec3};

/// A convention for the axes of a camera's own coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraAxes {
    /// `x` right, `y` down, `z` forward.
    OpenCv,
    /// `x` right, `y` up, `-z` forward, as in OpenGL, glTF and Blender.
    OpenGl,
    /// `x` forward, `y` left, `z` up: the body of a robot in ROS (REP 103). Its optical frames are
    /// [`Self::OpenCv`].
    Ros,
}

/// The reason why a matrix is not the pose of a camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// The matrix is not finite, not affine or not invertible.
    #[error(
        "the camera's 4x4 matrix must be finite and invertible with the last row 0 0 0 1 \
         (points are columns: p' = M p; transpose it if the translation is in the last row)"
    )]
    NotAPose,
    /// The matrix mirrors the world.
    #[error(
        "the camera's matrix mirrors the world (its determinant is negative); is it given for axes \
            of another convention?"
    )]
    Mirrored,
}

impl Camera {
    /// The camera with this pose. `world_from_camera` maps points in the camera's own axes to the
    /// world. Its scale is ignored, and axes that are not quite perpendicular are made so; the view
    /// direction is kept.
    pub fn from_matrix(
        world_from_camera: DMat4,
        axes: CameraAxes,
        projection: Projection,
    ) -> Result<Self, CameraError> {
        let m = world_from_camera;
        let determinant = m.determinant();
        let affine = m.row(3).truncate() == DVec3::ZERO && m.row(3).w == 1.0;
        if !m.is_finite() || !affine || determinant == 0.0 || !determinant.is_finite() {
            return Err(CameraError::NotAPose);
        }
        if determinant < 0.0 {
            return Err(CameraError::Mirrored);
        }
        let column = |i: usize| m.col(i).truncate();
        let (up, towards) = match axes {
            CameraAxes::OpenCv => (-column(1), column(2)),
            CameraAxes::OpenGl => (column(1), -column(2)),
            CameraAxes::Ros => (column(2), column(0)),
        };
        Ok(Self::from_direction(column(3), towards, up, projection))
    }

    /// The camera whose extrinsic matrix maps points in the world to the camera's own axes.
    pub fn from_extrinsics(
        camera_from_world: DMat4,
        axes: CameraAxes,
        projection: Projection,
    ) -> Result<Self, CameraError> {
        let inverse = camera_from_world.inverse();
        let affine = camera_from_world.row(3) == snell_math::DVec4::W;
        if !affine || !inverse.is_finite() {
            return Err(CameraError::NotAPose);
        }
        // The inversion may leave rounding errors in the last row, so that row is set.
        let columns =
            [0, 1, 2, 3].map(|i| inverse.col(i).truncate().extend(if i == 3 { 1.0 } else { 0.0 }));
        Self::from_matrix(
            DMat4::from_cols(columns[0], columns[1], columns[2], columns[3]),
            axes,
            projection,
        )
    }

    /// The pose as a matrix: `world_from_camera` with unit axes of this convention.
    pub fn matrix(&self, axes: CameraAxes) -> DMat4 {
        let [x, y, z] = match axes {
            CameraAxes::OpenCv => [self.right(), -self.up, self.towards],
            CameraAxes::OpenGl => [self.right(), self.up, -self.towards],
            CameraAxes::Ros => [self.towards, -self.right(), self.up],
        };
        DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), self.eye.extend(1.0))
    }
}
