//! Clipping by a plane: the part of a ray that lies in a half-space.

use snell_math::{DRay, DVec3, Ray};

/// The part of a ray on the side of the plane `[a, b, c, d]` where `a x + b y + c z + d >= 0`. The
/// interval is empty if there is none.
pub fn clipped(ray: &DRay, [a, b, c, d]: [f64; 4]) -> DRay {
    let normal = DVec3::new(a, b, c);
    let (height, rate) = (normal.dot(ray.origin) + d, normal.dot(ray.direction));
    let crossing = -height / rate;
    if rate > 0.0 {
        DRay { t_min: ray.t_min.max(crossing), ..*ray }
    } else if rate < 0.0 {
        DRay { t_max: ray.t_max.min(crossing.max(ray.t_min)), ..*ray }
    } else if height < 0.0 {
        DRay { t_max: ray.t_min, ..*ray }
    } else {
        *ray
    }
}

/// [`clipped`] in single precision.
pub fn clipped_single(ray: &Ray, plane: [f64; 4]) -> Ray {
    let DRay { t_min, t_max, .. } = clipped(&DRay::from(ray), plane);
    Ray { t_min: t_min as f32, t_max: t_max as f32, ..*ray }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_begins_or_ends_at_the_plane_or_is_nothing() {
        let ray = DRay::new(DVec3::new(0.0, 5.0, 0.0), DVec3::NEG_Y);
        let interval = |plane| {
            let DRay { t_min, t_max, .. } = clipped(&ray, plane);
            (t_min, t_max)
        };
        // What is below y = 2 is left: the ray begins there. Above: it ends there.
        assert_eq!(interval([0.0, -1.0, 0.0, 2.0]), (3.0, f64::INFINITY));
        assert_eq!(interval([0.0, 2.0, 0.0, -4.0]), (0.0, 3.0));
        // The plane lies behind the eye: all or nothing is left.
        assert_eq!(interval([0.0, -1.0, 0.0, 9.0]), (0.0, f64::INFINITY));
        assert_eq!(interval([0.0, 1.0, 0.0, -9.0]), (0.0, 0.0));
        // Along the plane.
        assert_eq!(interval([1.0, 0.0, 0.0, 1.0]), (0.0, f64::INFINITY));
        assert_eq!(interval([1.0, 0.0, 0.0, -1.0]), (0.0, 0.0));
    }
}
