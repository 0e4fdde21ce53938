//! A cone of view that moves from frame to frame, and how long the objects of a block stay outside.
//!
//! An object at distance D from the cone stays outside while object and apex together move less
//! than D, minus the arc that the cone's rotation sweeps at the object's range. This test needs no
//! new position, so most of a catalogue is not propagated for minutes.

use crate::sgp4_batch::Row;
use std::f64::consts::FRAC_PI_2;

/// Largest assumed speed of an object, km/s: more than the escape velocity.
pub const FASTEST_KM_S: f64 = 11.3;

/// A cone at an instant, in the axes of the tested positions.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    apex_km: [f64; 3],
    axis: [f64; 3],
    angle: f64,
    sin: f64,
    cos: f64,
    /// cos |cos|
    cos2: f64,
    /// 1 where the whole cone lies in front of its apex, else 0.
    before: f64,
    /// Objects within this distance of the cone count as inside, km.
    pub margin_km: f64,
}

impl Cone {
    /// Apex (km), axis (unit vector), half angle (rad, up to pi), and the margin `margin_km`.
    pub fn new(apex_km: [f64; 3], axis: [f64; 3], angle: f64, margin_km: f64) -> Cone {
        let (sin, cos) = libm::sincos(angle);
        Cone {
            apex_km,
            axis,
            angle,
            sin,
            cos,
            cos2: cos * cos.abs(),
            before: f64::from(u8::from(angle <= FRAC_PI_2)),
            margin_km,
        }
    }

    /// Apex, km.
    pub fn apex_km(&self) -> [f64; 3] {
        self.apex_km
    }

    /// Whether a position (km) is inside the cone or within its margin w. With half angle A, a
    /// point at `z` along the axis and `p` across is `p cos A - z sin A` from the surface. It is
    /// inside where p cos A <= w + z sin A. To avoid the root in p, u |u| of both sides is
    /// compared. Behind a cone narrower than a half space the distance is at least `-z`.
    #[inline(always)]
    pub fn holds(&self, position_km: [f64; 3]) -> bool {
        let (along, range2) = self.axial(position_km);
        let bound = self.margin_km + along * self.sin;
        ((range2 - along * along) * self.cos2 <= bound * bound.abs())
            & (-along * self.before <= self.margin_km)
    }

    /// Lower bound of the distance of a position (km) from the cone, and the squared range.
    fn outside_km(&self, position_km: [f64; 3]) -> (f64, f64) {
        let (along, range2) = self.axial(position_km);
        let across = (range2 - along * along).max(0.0).sqrt();
        let lateral = across * self.cos - along * self.sin;
        (lateral.max(-along * self.before), range2)
    }

    /// Coordinate of a position (km) along the axis, and the squared range from the apex.
    #[inline(always)]
    fn axial(&self, [x, y, z]: [f64; 3]) -> (f64, f64) {
        let (x, y, z) = (
            x - self.apex_km[0],
            y - self.apex_km[1],
            z - self.apex_km[2],
        );
        let along = x * self.axis[0] + y * self.axis[1] + z * self.axis[2];
        (along, x * x + y * y + z * z)
    }

    /// Distance between the apexes, km, and change of axis and half angle, rad.
    fn to(&self, other: &Cone) -> (f64, f64) {
        let between = |a: &[f64; 3], b: &[f64; 3]| {
            let [x, y, z] = [0, 1, 2].map(|i| a[i] - b[i]);
            (x * x + y * y + z * z).sqrt()
        };
        let half_chord = between(&self.axis, &other.axis) / 2.0;
        let turn = 2.0 * libm::asin(half_chord.min(1.0)) + (self.angle - other.angle).abs();
        (between(&self.apex_km, &other.apex_km), turn)
    }
}

/// Upper bound of the motion of cone and objects since the first frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moved {
    last: Option<(Cone, i64)>,
    /// Apex and objects together, km.
    km: f64,
    /// Rotation and opening of the cone, rad.
    rad: f64,
}

impl Moved {
    /// Adds the motion from the last cone to `cone`, which is that of the time `ns`.
    pub fn add_motion(&mut self, cone: &Cone, ns: i64) {
        if let Some((last, then)) = &self.last {
            let (km, rad) = last.to(cone);
            let seconds = ns.abs_diff(*then) as f64 * 1e-9;
            self.km += km + FASTEST_KM_S * seconds;
            self.rad += rad;
        }
        self.last = Some((*cone, ns));
    }
}

/// How long no object of a block can enter the cone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClearUntil {
    /// [`Moved`] at computation, plus the least distance of an object from the cone, km.
    until_km: f64,
    /// [`Moved`] at computation, rad.
    rad: f64,
    /// Largest range, km.
    range_km: f64,
}

impl ClearUntil {
    /// Expired from the start.
    pub const NONE: ClearUntil = ClearUntil {
        until_km: f64::NEG_INFINITY,
        rad: 0.0,
        range_km: 0.0,
    };

    /// For objects at these positions, km, with an error of up to `error_km`.
    pub fn of(positions_km: &[Row; 3], cone: &Cone, error_km: f64, moved: &Moved) -> ClearUntil {
        let [x, y, z] = positions_km;
        let positions = x.iter().zip(y).zip(z);
        let outside = positions.map(|((x, y), z)| cone.outside_km([*x, *y, *z]));
        let (least, range2) = outside
            .fold((f64::INFINITY, 0.0f64), |(least, range2), (km, square)| {
                (least.min(km), range2.max(square))
            });
        ClearUntil {
            until_km: moved.km + least - error_km,
            rad: moved.rad,
            range_km: range2.sqrt(),
        }
    }

    /// Whether it still holds. An object at range r and angle a from a cone that turned by b can
    /// enter it after moving d if asin(d / r) >= a - b. It cannot while d < r sin(a) - r b, or
    /// d < r - r b where a is above a right angle. The stored distances are not greater than these.
    #[inline(always)]
    pub fn lasts(&self, moved: &Moved, cone: &Cone) -> bool {
        // Motion is summed in steps, each rounded to some 1e-16 of the sum.
        const ROUNDING: f64 = 1e-9;
        let swept_km = (moved.rad - self.rad) * self.range_km;
        self.until_km - moved.km * (1.0 + ROUNDING) > swept_km + cone.margin_km
    }
}
