//! Transmission off the boresight.
//!
//! Either the fourth power of the cosine of the field angle (the natural fall-off of a thin lens:
//! the projected pupil, the projected pixel, and the square of the distance; Born & Wolf,
//! Principles of Optics, 4.8.3), or a table of transmission by angle, linear between its points and
//! constant beyond them. The fourth power is the law of a uniform scene and is assumed for points
//! too. For a star's total light a thin lens has the cosine alone, which needs a table.

use nalgebra::Vector3;

/// The transmission of the optics against the field angle, relative to the boresight.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Vignetting {
    /// The same everywhere.
    #[default]
    None,
    /// `cos^4` of the field angle; 0 from 90 deg on.
    Cos4,
    /// Field angles (rad, rising) and the transmission (0..1) at each.
    Table(Vec<[f64; 2]>),
}

impl Vignetting {
    /// The transmission (0..1) for a direction of any length, camera axes.
    pub fn transmission(&self, direction: &Vector3<f64>) -> f64 {
        match self {
            Vignetting::None => 1.0,
            Vignetting::Cos4 => {
                let cos = (direction.z / direction.norm()).max(0.0);
                let square = cos * cos;
                square * square
            }
            Vignetting::Table(table) => {
                let across = libm::hypot(direction.x, direction.y);
                linear(table, libm::atan2(across, direction.z))
            }
        }
    }

    /// The field angle (rad) from which on the transmission is 0; pi if it never is.
    pub fn end(&self) -> f64 {
        match self {
            Vignetting::None => std::f64::consts::PI,
            Vignetting::Cos4 => std::f64::consts::FRAC_PI_2,
            Vignetting::Table(table) => {
                let dark = table.iter().rev().take_while(|[_, t]| *t <= 0.0).last();
                dark.map_or(std::f64::consts::PI, |[angle, _]| *angle)
            }
        }
    }

    /// Relative change of the transmission across a disc of `radius` rad around a direction (camera
    /// axes), outwards from the boresight.
    pub fn change_across(&self, direction: &Vector3<f64>, radius: f64) -> f64 {
        let across = libm::hypot(direction.x, direction.y);
        let angle = libm::atan2(across, direction.z);
        let at = |angle: f64| {
            let (sin, cos) = libm::sincos(angle.max(0.0));
            self.transmission(&Vector3::new(sin, 0.0, cos))
        };
        let [near, far] = [at(angle - radius), at(angle + radius)];
        2.0 * (near - far).abs() / (near + far).max(f64::MIN_POSITIVE)
    }

    /// Minimum and maximum transmission up to a field angle (rad) from the boresight.
    pub fn range(&self, angle: f64) -> [f64; 2] {
        match self {
            Vignetting::None => [1.0, 1.0],
            Vignetting::Cos4 => {
                let (sin, cos) = libm::sincos(angle);
                [self.transmission(&Vector3::new(sin, 0.0, cos)), 1.0]
            }
            Vignetting::Table(table) => {
                let ends = [linear(table, 0.0), linear(table, angle)];
                let inside = table.iter().filter(|[at, _]| *at <= angle).map(|[_, t]| *t);
                let all = inside.chain(ends);
                all.fold([1.0, 0.0], |[min, max], t| [t.min(min), t.max(max)])
            }
        }
    }
}

/// Linear interpolation in a table, constant beyond its ends; `table` rises in its first column.
pub(super) fn linear(table: &[[f64; 2]], at: f64) -> f64 {
    let next = table.partition_point(|[x, _]| *x < at);
    match (
        next.checked_sub(1).and_then(|i| table.get(i)),
        table.get(next),
    ) {
        (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (at - x0) / (x1 - x0),
        (Some([_, y]), None) | (None, Some([_, y])) => *y,
        (None, None) => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(vignetting: &Vignetting, deg: f64) -> f64 {
        let (sin, cos) = f64::sin_cos(deg.to_radians());
        vignetting.transmission(&(Vector3::new(0.6 * sin, -0.8 * sin, cos) * 7.0))
    }

    #[test]
    fn fourth_power_of_cosine_at_known_angles() {
        // X-Val: cos^4 of 0, 30, 45, 60 deg by hand: 1, 9/16, 1/4, 1/16.
        for (deg, expected) in [(0.0, 1.0), (30.0, 0.5625), (45.0, 0.25), (60.0, 0.0625)] {
            assert!((at(&Vignetting::Cos4, deg) - expected).abs() < 1e-14);
        }
        assert_eq!(at(&Vignetting::Cos4, 91.0), 0.0);
        assert_eq!(at(&Vignetting::None, 91.0), 1.0);
        let [min, max] = Vignetting::Cos4.range(30f64.to_radians());
        assert!((min - 0.5625).abs() < 1e-14 && max == 1.0);
    }

    #[test]
    fn table_is_linear_between_its_points_and_constant_beyond() {
        let points = [[0.0, 1.0], [10.0, 0.9], [20.0, 0.95], [100.0, 0.0]];
        let table = Vignetting::Table(
            points
                .map(|[deg, t]: [f64; 2]| [deg.to_radians(), t])
                .to_vec(),
        );
        for (deg, expected) in [
            (0.0, 1.0),
            (5.0, 0.95),
            (10.0, 0.9),
            (12.0, 0.91),
            (60.0, 0.475),
            (150.0, 0.0),
        ] {
            assert!((at(&table, deg) - expected).abs() < 1e-12, "{deg}");
        }
        let [min, max] = table.range(15f64.to_radians());
        assert!((min - 0.9).abs() < 1e-12 && (max - 1.0).abs() < 1e-12);
    }
}
