//! Cameras from the matrices of other fields, and back.

use crate::arrays::{array, contiguous, from_vec, shown, slice, whole};
use crate::camera::{Camera, made_for, projection};
use crate::names::Name;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use snell_math::{DMat3, DMat4, DVec3, DVec4, rotation::about};
use snell_scene::Projection;
use snell_scene::camera::{CameraAxes, Intrinsics};

/// The names of [`CameraAxes`] in Python.
const AXES: [(&str, CameraAxes); 4] = [
    ("opencv", CameraAxes::OpenCv),
    ("opengl", CameraAxes::OpenGl),
    ("blender", CameraAxes::OpenGl),
    ("ros", CameraAxes::Ros),
];

fn axes(name: &str) -> PyResult<CameraAxes> {
    let found = AXES.iter().find(|(known, _)| *known == name);
    found.map(|&(_, axes)| axes).ok_or_else(|| {
        let known: Vec<String> = AXES.iter().map(|(known, _)| format!("{known:?}")).collect();
        PyValueError::new_err(format!("axes is {name:?}, expected {}", known.join(", ")))
    })
}

/// Reads the size of a picture: two whole numbers from 1.
fn pixels(size: &Bound<'_, PyAny>) -> Option<[u32; 2]> {
    let [width, height] = size.extract::<[Bound<'_, PyAny>; 2]>().ok()?;
    let side = |value| u32::try_from(whole(&value)?).ok().filter(|&side| side > 0);
    Some([side(width)?, side(height)?])
}

/// Reads numbers of one of these shapes.
fn numbers(value: &Bound<'_, PyAny>, name: &str, shapes: &[&[usize]]) -> PyResult<Vec<f64>> {
    let array = array(value, name)?;
    let shape = numpy::PyUntypedArrayMethods::shape(&array).to_vec();
    if !shapes.contains(&&shape[..]) {
        let expected: Vec<String> = shapes.iter().map(|shape| shown(shape)).collect();
        return Err(PyValueError::new_err(format!(
            "{name}: shape is {}, expected {}",
            shown(&shape),
            expected.join(" or ")
        )));
    }
    let values = contiguous::<f64>(&array)?;
    let values = slice(&values)?.to_vec();
    if let Some(place) = values.iter().position(|value| !value.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "{name}: number {place} is {}, expected finite numbers",
            values[place]
        )));
    }
    Ok(values)
}

fn vector(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DVec3> {
    Ok(DVec3::from_slice(&numbers(value, name, &[&[3], &[3, 1], &[1, 3]])?))
}

fn matrix4(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DMat4> {
    let rows = numbers(value, name, &[&[4, 4], &[3, 4]])?;
    let mut all = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    all[..rows.len()].copy_from_slice(&rows);
    Ok(DMat4::from_cols_array(&all).transpose())
}

/// The largest difference from perpendicular axes of one length: digits that are rounded in a file.
const RIGID: f64 = 1e-3;

/// Fails if the axes of a pose are not perpendicular, or, if the pose must not scale, not of length
/// 1: then it is something else, or its numbers are wrong.
fn check_pose(pose: DMat4, may_scale: bool, name: &str) -> PyResult<DMat4> {
    let is_affine = pose.row(3) == DVec4::W;
    if !is_affine {
        // The camera itself refuses it.
        return Ok(pose);
    }
    let axes = [0, 1, 2].map(|i| pose.col(i).truncate());
    let lengths = axes.map(DVec3::length);
    let is_sheared = [(0, 1), (1, 2), (2, 0)]
        .iter()
        .any(|&(i, j)| axes[i].dot(axes[j]).abs() > RIGID * lengths[i] * lengths[j]);
    if is_sheared {
        return Err(PyValueError::new_err(format!(
            "{name}: its axes (the first three columns) are not perpendicular, expected a rotation"
        )));
    }
    if !may_scale && lengths.iter().any(|length| (length - 1.0).abs() > RIGID) {
        return Err(PyValueError::new_err(format!(
            "{name}: its axes (the first three columns) have the lengths {}, {} and {}, expected \
             1; divide the scale out",
            lengths[0], lengths[1], lengths[2]
        )));
    }
    Ok(pose)
}

/// The rotation of a vector whose length is the angle in radians.
fn rotation(vector: DVec3) -> DMat3 {
    let angle = vector.length();
    if angle == 0.0 {
        return DMat3::IDENTITY;
    }
    about(vector / angle, angle)
}

/// The coefficients of a lens as OpenCV gives them: 4, 5, 8, 12 or 14 numbers.
fn coefficients(value: &Bound<'_, PyAny>) -> PyResult<[f64; 12]> {
    let array = array(value, "distortion")?;
    let values = contiguous::<f64>(&array)?;
    let values = slice(&values)?;
    if ![0, 4, 5, 8, 12, 14].contains(&values.len()) || values.iter().any(|k| !k.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "distortion has {} numbers, expected 4, 5, 8, 12 or 14 finite ones: k1, k2, p1, p2, \
             k3, k4, k5, k6, s1, s2, s3, s4",
            values.len()
        )));
    }
    let (known, tilt) = values.split_at(values.len().min(12));
    if tilt.iter().any(|&angle| angle != 0.0) {
        return Err(PyValueError::new_err(
            "distortion: a tilted sensor (numbers 13 and 14) is not supported, expected 0",
        ));
    }
    let mut all = [0.0; 12];
    all[..known.len()].copy_from_slice(known);
    Ok(all)
}

#[pymethods]
impl Camera {
    /// A calibrated camera as OpenCV describes it.
    ///
    /// The centre of the first pixel is (0, 0), so :meth:`project` gives the numbers of
    /// `cv2.projectPoints`, and :meth:`rays` and pictures show each pixel through its centre.
    ///
    /// Parameters
    /// ----------
    /// K : array (3, 3)
    ///     The camera matrix `[[fx, s, cx], [0, fy, cy], [0, 0, 1]]`, in pixels.
    /// T_world_cam : array (4, 4), optional
    ///     The pose of the camera: the matrix from camera coordinates (x right, y down, z forward)
    ///     to the world. Alternatively `T_cam_world`, its inverse (the extrinsic matrix), or `rvec`
    ///     and `tvec` as `cv2.solvePnP` returns them. The camera is at the origin if all are left
    ///     out.
    /// distortion : sequence of 4, 5, 8, 12 or 14 numbers, optional
    ///     `k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4`, as `cv2.calibrateCamera` returns them.
    ///     What lies beyond the rim where the polynomial turns back is not seen.
    /// size : two whole numbers
    ///     Width and height in pixels of the pictures that `K` belongs to.
    /// fisheye : sequence of 4 numbers, optional
    ///     `k1` to `k4` of `cv2.fisheye`, in place of `distortion`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> K = [[800, 0, 320], [0, 800, 240], [0, 0, 1]]
    /// >>> camera = snell.Camera.from_opencv(K, distortion=[-0.1, 0, 0, 0], size=(640, 480))
    /// >>> camera.project([[0, 0, 2], [1, 0, 2]], (640, 480)).round(6).tolist()
    /// [[320.0, 240.0], [710.0, 240.0]]
    #[staticmethod]
    #[pyo3(signature = (
        K, T_world_cam=None, *, distortion=None, size=None, T_cam_world=None, rvec=None,
        tvec=None, fisheye=None, name=None
    ))]
    #[allow(non_snake_case)]
    fn from_opencv(
        K: &Bound<'_, PyAny>,
        T_world_cam: Option<&Bound<'_, PyAny>>,
        distortion: Option<&Bound<'_, PyAny>>,
        size: Option<&Bound<'_, PyAny>>,
        T_cam_world: Option<&Bound<'_, PyAny>>,
        rvec: Option<&Bound<'_, PyAny>>,
        tvec: Option<&Bound<'_, PyAny>>,
        fisheye: Option<&Bound<'_, PyAny>>,
        name: Option<Name>,
    ) -> PyResult<Self> {
        let k = numbers(K, "K", &[&[3, 3]])?;
        if k[3] != 0.0 || k[6..] != [0.0, 0.0, 1.0] || k[0] == 0.0 || k[4] == 0.0 {
            return Err(PyValueError::new_err(
                "K: expected [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx and fy not 0 \
                 (transpose it if cx and cy are in the last row)",
            ));
        }
        if k[0] < 0.0 || k[4] < 0.0 {
            return Err(PyValueError::new_err(format!(
                "K: fx is {} and fy is {}, expected positive numbers; a picture that is mirrored \
                 or upside down has another pose",
                k[0], k[4]
            )));
        }
        let size = size.and_then(pixels).ok_or_else(|| {
            let given = size.and_then(|size| size.repr().ok());
            let found = given.map_or(String::from("size:"), |given| format!("size is {given},"));
            PyTypeError::new_err(format!(
                "{found} expected the width and height in pixels that K belongs to: two whole \
                    numbers from 1"
            ))
        })?;
        // Wider than 178 degrees: a matrix in other units than pixels.
        let widest = 100.0 * k[0].max(k[4]);
        if fisheye.is_none() && widest < f64::from(size[0].max(size[1])) {
            crate::encoding::warn(
                K.py(),
                format!(
                    "K: fx is {} and fy is {} for a picture of {} x {} pixels; if they are \
                     relative to its size, multiply the first row by the width and the second by \
                     the height",
                    k[0], k[4], size[0], size[1]
                ),
            )?;
        }
        if distortion.is_some() && fisheye.is_some() {
            return Err(PyTypeError::new_err("a lens takes distortion or fisheye, not both"));
        }
        let fisheye = match fisheye {
            Some(given) => {
                let k = numbers(given, "fisheye", &[&[4], &[4, 1], &[1, 4]])?;
                Some([k[0], k[1], k[2], k[3]])
            }
            None => None,
        };
        let projection = Projection::Intrinsics(Intrinsics {
            skew: k[1],
            pixel_center: 0.0,
            distortion: distortion.map_or(Ok([0.0; 12]), coefficients)?,
            fisheye,
            ..Intrinsics::new([k[0], k[4]], [k[2], k[5]], size)
        });
        let mut camera = match (T_world_cam, T_cam_world, rvec, tvec) {
            (None, None, None, None) => {
                snell_scene::Camera::from_matrix(DMat4::IDENTITY, CameraAxes::OpenCv, projection)
            }
            (Some(pose), None, None, None) => snell_scene::Camera::from_matrix(
                check_pose(matrix4(pose, "T_world_cam")?, false, "T_world_cam")?,
                CameraAxes::OpenCv,
                projection,
            ),
            (None, Some(extrinsic), None, None) => snell_scene::Camera::from_extrinsics(
                check_pose(matrix4(extrinsic, "T_cam_world")?, false, "T_cam_world")?,
                CameraAxes::OpenCv,
                projection,
            ),
            (None, None, Some(rvec), Some(tvec)) => {
                let inverse = rotation(vector(rvec, "rvec")?).transpose();
                let eye = inverse * -vector(tvec, "tvec")?;
                let pose = DMat4::from_mat3_translation(inverse, eye);
                snell_scene::Camera::from_matrix(pose, CameraAxes::OpenCv, projection)
            }
            _ => {
                return Err(PyTypeError::new_err(
                    "a pose is given by T_world_cam, by T_cam_world, or by rvec and tvec",
                ));
            }
        }
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
        camera.resolution = Some(size);
        camera.name = name.map_or(String::new(), |name| name.0);
        Ok(Self(camera))
    }

    /// A camera with a pose.
    ///
    /// Parameters
    /// ----------
    /// T_world_cam : array (4, 4)
    ///     The matrix from the camera's own axes to the world: a rotation and a place. A scale is
    ///     ignored.
    /// axes : str
    ///     What those axes are: `"opengl"` or `"blender"` (x right, y up, -z forward), `"opencv"`
    ///     (x right, y down, z forward; ROS' optical frames, too) or `"ros"` (x forward, y left, z
    ///     up: a robot's body).
    /// projection : str
    ///     One of :data:`PROJECTIONS`, with `fov` or `**parameters` as in :class:`Camera`.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> pose = np.eye(4)
    /// >>> pose[:3, 3] = 1, 2, 3
    /// >>> camera = snell.Camera.from_matrix(pose, "ros", fov=60)
    /// >>> camera.eye, camera.towards, camera.up
    /// ((1.0, 2.0, 3.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    #[staticmethod]
    #[pyo3(signature = (
        T_world_cam, axes, *, projection="perspective", fov=None, resolution=None, name=None,
        **parameters
    ))]
    #[allow(non_snake_case)]
    fn from_matrix(
        py: Python<'_>,
        T_world_cam: &Bound<'_, PyAny>,
        axes: &str,
        projection: &str,
        fov: Option<f64>,
        resolution: Option<[u32; 2]>,
        name: Option<Name>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let projection = self::projection(py, projection, fov, parameters)?;
        let pose = check_pose(matrix4(T_world_cam, "T_world_cam")?, true, "T_world_cam")?;
        let mut camera = snell_scene::Camera::from_matrix(pose, self::axes(axes)?, projection)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        camera.resolution = made_for(resolution, &camera.projection)?;
        camera.name = name.map_or(String::new(), |name| name.0);
        Ok(Self(camera))
    }

    /// The pose of the camera: the matrix (4, 4) from its own axes to the world. `axes` are those
    /// of :meth:`from_matrix`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.Camera(eye=(0, 0, 5)).matrix("opengl")[:3, 3].tolist()
    /// [0.0, 0.0, 5.0]
    fn matrix<'py>(&self, py: Python<'py>, axes: &str) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.0.matrix(self::axes(axes)?).transpose().to_cols_array();
        // A turned axis has zeros with a sign.
        from_vec(py, rows.map(|value| value + 0.0).to_vec(), &[4, 4])
    }
}
