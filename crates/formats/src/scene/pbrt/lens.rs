//! Lenses of pbrt's `realistic` camera: as much of them as a perspective camera can show.

use super::Builder;
use super::params::Params;
use crate::scene::fault::Fault;
use snell_math::real;

/// Diagonal in mm of a film that names none.
const DIAGONAL: f64 = 35.0;
/// Distance in m of what is sharp, for a camera that names none.
const FOCUS_DISTANCE: f64 = 10.0;

impl Builder<'_> {
    /// Half of the film's shorter side over its distance to a thin lens with the focal length of
    /// the camera's lenses; `None`, with a warning, if they cannot be read.
    pub(super) fn tan_behind_lenses(
        &mut self,
        params: &Params,
        [w, h]: [f64; 2],
    ) -> Result<Option<f64>, Fault> {
        let focus = 1000.0 * params.float_or("focusdistance", FOCUS_DISTANCE)?;
        let file = self.file_name(params, "lensfile")?;
        let input = file.and_then(|(name, at)| self.open(name, at).ok());
        let text = input.map(|input| String::from_utf8_lossy(&input.bytes).into_owned());
        let owner = params.owner.clone();
        let Some(length) = text.and_then(|text| focal_length(&text)) else {
            self.note(owner.clone(), params.at, || {
                format!("{owner}: its lenses cannot be read; a perspective camera was used instead")
            });
            return Ok(None);
        };
        self.note(owner.clone(), params.at, || {
            format!(
                "{owner}: a perspective camera with the focal length of its lenses, {length:.1} \
                mm, was used instead; everything is sharp"
            )
        });
        let distance = if focus > length { length * focus / (focus - length) } else { length };
        let shorter = self.options.diagonal.unwrap_or(DIAGONAL) * w.min(h) / real::hypot(w, h);
        Ok(Some(0.5 * shorter / distance).filter(|tan| *tan > 0.0 && tan.is_finite()))
    }
}

/// The focal length in mm of the lenses in a file of pbrt, for rays near the axis: four numbers for
/// each surface from the front, its radius of curvature (0 for the stop), the distance to the next
/// one, the index of refraction behind it and its diameter. `None` for other files and for lenses
/// that do not focus.
fn focal_length(text: &str) -> Option<f64> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let numbers: Result<Vec<f64>, _> =
        lines.flat_map(str::split_ascii_whitespace).map(str::parse).collect();
    let numbers = numbers.ok().filter(|n| !n.is_empty() && n.len().is_multiple_of(4))?;
    // A ray that arrives along the axis at the height 1.
    let (mut height, mut slope, mut index) = (1.0, 0.0, 1.0);
    for surface in numbers.chunks_exact(4) {
        let [radius, thickness, eta] = [surface[0], surface[1], surface[2]];
        let behind = if eta == 0.0 { 1.0 } else { eta };
        if radius != 0.0 {
            slope = (index * slope - height * (behind - index) / radius) / behind;
            index = behind;
        }
        height += thickness * slope;
    }
    Some(-1.0 / slope).filter(|length| *length > 0.0 && length.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_focal_length_is_that_of_the_lensmaker() {
        // A symmetric thick lens of index 1.5, with a stop behind it.
        let text = "# radius thickness eta diameter\n50 6 1.5 20\n-50\t5 1 20 # back\n0 40 0 10\n";
        let power: f64 = 0.5 * (1.0 / 50.0 + 1.0 / 50.0 - 0.5 * 6.0 / (1.5 * 50.0 * 50.0));
        let found = focal_length(text).expect("it focuses");
        assert!((found * power - 1.0).abs() < 1e-12, "{found}");
        for bad in ["", "50 6 1.5", "50 6 1.5 x", "0 1 0 1", "-50 6 1.5 20"] {
            assert_eq!(focal_length(bad), None, "{bad}");
        }
    }
}
