//! From a region in the picture to a direction in the world.
//!
//! For a pinhole camera w pixels wide with the horizontal field of view φ, the focal length is f = w / (2 tan(φ/2))
//! pixels. A point u pixels left of and v pixels above the middle of the picture lies at
//!
//! ```text
//! bearing = atan(u / f)          elevation = atan(v / √(f² + u²))
//! ```
//!
//! so a head that pans by the bearing and then tilts by the elevation looks straight at it. Lens distortion is not
//! undone; pixels are square.

use crate::blobs::Blob;
use crate::picture::Size;
use libm::{atan, hypot, tan};

/// A camera. The defaults are the web camera of the exploration experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Size of its picture. Default 320 × 240.
    pub size: Size,
    /// Angle between the left and the right edge of the picture (rad, in (0, π)). Default 60°: common for web cameras.
    pub horizontal_field_of_view: f64,
}

/// Where a region is, as seen from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Direction of the centre, counter-clockwise from the optical axis: left is positive (rad).
    pub bearing: f64,
    /// Angle of the centre above the plane through the optical axis and the row of the picture's middle (rad).
    pub elevation: f64,
    /// Share of the picture that the region covers (0..1).
    pub area_share: f64,
}

impl Default for Camera {
    fn default() -> Camera {
        Camera { size: Size::new(320, 240), horizontal_field_of_view: 60f64.to_radians() }
    }
}

impl Camera {
    /// Focal length (pixels).
    pub fn focal_length(&self) -> f64 {
        self.size.width as f64 / 2.0 / tan(self.horizontal_field_of_view / 2.0)
    }

    /// Bearing and elevation (rad) of the point (x, y) of the picture, in pixel indices: (0, 0) is the centre of the
    /// first pixel.
    pub fn direction(&self, x: f64, y: f64) -> (f64, f64) {
        let focal_length = self.focal_length();
        let left = (self.size.width as f64 - 1.0) / 2.0 - x;
        let up = (self.size.height as f64 - 1.0) / 2.0 - y;
        (atan(left / focal_length), atan(up / hypot(focal_length, left)))
    }
}

/// Where `blob` is, as seen from `camera`.
pub fn target(blob: &Blob, camera: &Camera) -> Target {
    let (bearing, elevation) = camera.direction(blob.x, blob.y);
    Target { bearing, elevation, area_share: f64::from(blob.area) / camera.size.pixels().max(1) as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_straight_ahead_and_the_edges_are_half_the_field_of_view_away() {
        let camera = Camera::default();
        let blob = Blob { area: 768, x: 159.5, y: 119.5, ..Blob::default() };
        assert_eq!(target(&blob, &camera), Target { bearing: 0.0, elevation: 0.0, area_share: 0.01 });
        // The edge of the picture is half a pixel beyond the centre of the outermost one.
        assert!((camera.direction(-0.5, 119.5).0 - 30f64.to_radians()).abs() < 1e-12);
        assert!((camera.direction(319.5, 119.5).0 + 30f64.to_radians()).abs() < 1e-12);
        // 4:3 of tan 30° is the tangent of half the vertical field of view.
        assert!((camera.direction(159.5, -0.5).1.tan() - 0.75 * 30f64.to_radians().tan()).abs() < 1e-12);
    }

    proptest::proptest! {
        #[test]
        fn a_point_in_space_is_seen_in_its_direction(forward in 0.5..10.0f64, left in -3.0..3.0f64, up in -2.0..2.0f64) {
            let camera = Camera { size: Size::new(640, 480), horizontal_field_of_view: 1.2 };
            let f = camera.focal_length();
            let (bearing, elevation) = camera.direction(319.5 - f * left / forward, 239.5 - f * up / forward);
            proptest::prop_assert!((bearing - left.atan2(forward)).abs() < 1e-9);
            proptest::prop_assert!((elevation - up.atan2(forward.hypot(left))).abs() < 1e-9);
        }
    }
}
