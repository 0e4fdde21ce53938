//! A cone that is looked into from frame to frame, and how long nobody of a block comes into it.
//!
//! Whoever is a distance D away from a cone stays out of it while he and its apex together come less than D, less what its turning
//! sweeps at his range. That needs no place of his: most of a catalogue is not asked for one for minutes.

use crate::sgp4_batch::Row;
use std::f64::consts::FRAC_PI_2;

/// Faster than whatever the Earth holds, km/s.
pub const FASTEST_KM_S: f64 = 11.3;

/// A cone, as it stands for an instant, in the axes of the places that are tested.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    apex_km: [f64; 3],
    axis: [f64; 3],
    angle: f64,
    sin: f64,
    cos: f64,
    /// cos |cos|
    cos2: f64,
    /// 1 where all of it lies before its apex, else 0.
    before: f64,
    /// Who is no further from it than this is in it, too, km.
    pub way_km: f64,
}

impl Cone {
    /// The cone of that apex (km), axis (unit vector) and half angle (rad, up to pi), and what is no further than `way_km` from it.
    pub fn new(apex_km: [f64; 3], axis: [f64; 3], angle: f64, way_km: f64) -> Cone {
        let (sin, cos) = libm::sincos(angle);
        Cone {
            apex_km,
            axis,
            angle,
            sin,
            cos,
            cos2: cos * cos.abs(),
            before: f64::from(u8::from(angle <= FRAC_PI_2)),
            way_km,
        }
    }

    /// Its apex, km.
    pub fn apex_km(&self) -> [f64; 3] {
        self.apex_km
    }

    /// Whether that place (km) is no further from it than its way. With half angle A, a point `z` along the axis and `p` from it is
    /// `p cos A - z sin A` away from where the surface is nearest: p cos A <= w + z sin A, which holds for what is made of both by u |u|, too. Behind a
    /// cone that opens by less than a half space it is `-z` away at least.
    #[inline(always)]
    pub fn holds(&self, place_km: [f64; 3]) -> bool {
        let (along, range2) = self.seen(place_km);
        let bound = self.way_km + along * self.sin;
        ((range2 - along * along) * self.cos2 <= bound * bound.abs())
            & (-along * self.before <= self.way_km)
    }

    /// How far that place (km) is outside of it, at least, as [`Cone::holds`] has it, and the square of the range from its apex.
    fn outside_km(&self, place_km: [f64; 3]) -> (f64, f64) {
        let (along, range2) = self.seen(place_km);
        let across = (range2 - along * along).max(0.0).sqrt();
        let beside = across * self.cos - along * self.sin;
        (beside.max(-along * self.before), range2)
    }

    /// How far along the axis from its apex a place (km) is, and the square of the range.
    #[inline(always)]
    fn seen(&self, [x, y, z]: [f64; 3]) -> (f64, f64) {
        let (x, y, z) = (
            x - self.apex_km[0],
            y - self.apex_km[1],
            z - self.apex_km[2],
        );
        let along = x * self.axis[0] + y * self.axis[1] + z * self.axis[2];
        (along, x * x + y * y + z * z)
    }

    /// How far its apex comes to that of another, km, and what its axis and angle turn by, rad.
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

/// How far cones and whoever is tested may have come since the first of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moved {
    last: Option<(Cone, i64)>,
    /// Apex and objects together, km.
    km: f64,
    /// What the cone turned by, rad.
    rad: f64,
}

impl Moved {
    /// On to a cone at that time, ns.
    pub fn on_to(&mut self, cone: &Cone, ns: i64) {
        if let Some((last, then)) = &self.last {
            let (km, rad) = last.to(cone);
            let seconds = ns.abs_diff(*then) as f64 * 1e-9;
            self.km += km + FASTEST_KM_S * seconds;
            self.rad += rad;
        }
        self.last = Some((*cone, ns));
    }
}

/// Until when nobody of a block comes into the cone.
#[derive(Clone, Copy, Debug)]
pub struct Leeway {
    /// What [`Moved`] was when it was found, and the least distance, km.
    until_km: f64,
    /// What the cone had turned by then, rad.
    rad: f64,
    /// The greatest range, km.
    range_km: f64,
}

impl Leeway {
    /// None at all.
    pub const NONE: Leeway = Leeway {
        until_km: f64::NEG_INFINITY,
        rad: 0.0,
        range_km: 0.0,
    };

    /// That of who is at these places, km, give or take `error_km`.
    pub fn of(places_km: &[Row; 3], cone: &Cone, error_km: f64, moved: &Moved) -> Leeway {
        let [x, y, z] = places_km;
        let places = x.iter().zip(y).zip(z);
        let outside = places.map(|((x, y), z)| cone.outside_km([*x, *y, *z]));
        let (least, range2) = outside
            .fold((f64::INFINITY, 0.0f64), |(least, most), (km, square)| {
                (least.min(km), most.max(square))
            });
        Leeway {
            until_km: moved.km + least - error_km,
            rad: moved.rad,
            range_km: range2.sqrt(),
        }
    }

    /// Whether it lasts. Who is r away and an angle a beside a cone that turned by b, and comes d, meets it if asin(d / r) >= a - b: not while
    /// d < r sin(a) - r b, or d < r - r b where a is beyond a right angle. No distance above is greater than these.
    #[inline(always)]
    pub fn lasts(&self, moved: &Moved, cone: &Cone) -> bool {
        // What has moved since is added up in steps with rounding of their own, some 1e-16 of the sum each.
        const ROUNDING: f64 = 1e-9;
        let swept_km = (moved.rad - self.rad) * self.range_km;
        self.until_km - moved.km * (1.0 + ROUNDING) > swept_km + cone.way_km
    }
}
