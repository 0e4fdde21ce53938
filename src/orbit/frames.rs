//! Rotations from the frames of published orbits to the GCRF.
//!
//! TEME ("true equator, mean equinox") is the frame of SGP4: its z axis is the true pole of date,
//! its x axis the origin of IAU 1982 Greenwich mean sidereal time (Vallado et al., AIAA 2006-6753,
//! appendix C). Greenwich apparent sidereal time is counted from the true equinox. So TEME and the
//! true equator and equinox of date differ by a rotation about the pole.

use crate::StateVector;
use crate::time::{DAY_NS, J2000_NS, utc_duration};
use hifitime::{Duration, Epoch};
use nalgebra::{Matrix3, Vector3};
use sofars::consts::DJ00;

/// Rotation from TEME of date to GCRF: 3 x 3, `r_gcrf = teme_to_gcrf(t) * r_teme`.
///
/// Precession, nutation and frame bias are IAU 2006/2000A. The angle about the pole is GAST 2006 -
/// GMST 1982. UT1 is taken as UTC: an error of 1 s in UT1 changes this difference by 7e-12 rad, 0.3
/// mm at the geostationary belt. Observed corrections of the celestial pole (0.3 milliarcsecond)
/// are left out: 6 cm there. Measured error out to that belt (`tests/frames.rs`): at most 3.0 mm
/// over 1960 to 2060 (skyfield), 2.5 mm over 1975 to 2026 (astropy).
pub fn teme_to_gcrf(t: Epoch) -> Matrix3<f64> {
    let tt = days_of_tt(t);
    let ut1 = days_since_j2000(utc_duration(t).total_nanoseconds());
    // r_true = NPB r_gcrf  (Capitaine & Wallace 2006, IAU 2006/2000A)
    let npb = sofars::pnp::pnm06a(DJ00, tt);
    // Both give the Earth-fixed axes: R3(GMST82) r_teme = R3(GAST) r_true
    // r_teme = R3(GAST - GMST82) r_true
    let angle = sofars::erst::gst06(DJ00, ut1, DJ00, tt, &npb) - sofars::erst::gmst82(DJ00, ut1);
    // r_gcrf = (R3 NPB)^T r_teme
    (about_z(angle) * matrix(&npb)).transpose()
}

/// Rotation from EME2000 (mean equator and equinox of J2000.0) to GCRF: the frame bias of IAU 2000,
/// 23 milliarcseconds (0.8 m at 7,000 km).
pub fn eme2000_to_gcrf() -> Matrix3<f64> {
    // r_eme2000 = B r_gcrf
    let (bias, _, _) = sofars::pnp::bp06(DJ00, 0.0);
    matrix(&bias).transpose()
}

/// Mean angular velocity of the Earth, rad/s: 2 pi 1.00273781191135448 / 86400 (IERS Conventions
/// 2010, Eq. 5.15).
const EARTH_RATE: f64 = 7.292_115_146_706_98e-5;

/// Axes of geocentric reference frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Axes {
    /// GCRF; the geocentric ICRF has the same axes.
    Gcrf,
    /// Mean equator and equinox of J2000.0; also called J2000.
    Eme2000,
    /// Mean equator and equinox of date, IAU 2006.
    MeanOfDate,
    /// True equator and equinox of date, IAU 2006/2000A.
    TrueOfDate,
    /// True equator and mean equinox of date, the frame of SGP4.
    Teme,
    /// Earth-fixed, without polar motion.
    EarthFixed {
        /// UT1 - TAI, which has no leap seconds.
        ut1_tai: Duration,
    },
}

/// The frames of [`Axes::named`], for messages.
pub(crate) const FRAMES: &str =
    "GCRF, ICRF, EME2000, J2000, MOD, TOD, TEME, ITRF (of any year), WGS84, TDR, GTOD and PEF";

impl Axes {
    /// Axes by their name in CCSDS messages, such as `ITRF2014` or `ITRF-97`; case is ignored.
    /// Realisations of the ITRF differ by less than 0.2 m.
    pub fn named(name: &str, ut1_tai: Duration) -> Option<Axes> {
        let name = name.to_ascii_uppercase();
        let year = name.strip_prefix("ITRF");
        let year = year.map(|year| year.trim_start_matches(['-', '_', ' ']));
        if year.is_some_and(|year| year.bytes().all(|b| b.is_ascii_digit())) {
            return Some(Axes::EarthFixed { ut1_tai });
        }
        match name.as_str() {
            "GCRF" | "ICRF" => Some(Axes::Gcrf),
            "EME2000" | "J2000" => Some(Axes::Eme2000),
            "MOD" => Some(Axes::MeanOfDate),
            "TOD" => Some(Axes::TrueOfDate),
            "TEME" => Some(Axes::Teme),
            "WGS84" | "WGS-84" | "TDR" | "GTOD" | "PEF" => Some(Axes::EarthFixed { ut1_tai }),
            _ => None,
        }
    }

    /// Whether precession or nutation moves the axes, so that an epoch may fix them (CCSDS
    /// 502.0-B-3, REF_FRAME_EPOCH).
    pub fn are_of_date(self) -> bool {
        matches!(self, Axes::MeanOfDate | Axes::TrueOfDate | Axes::Teme)
    }

    /// Rotation from these axes to GCRF: 3 x 3, `r_gcrf = axes.to_gcrf(t) * r`.
    pub fn to_gcrf(self, t: Epoch) -> Matrix3<f64> {
        match self {
            Axes::Gcrf => Matrix3::identity(),
            Axes::Eme2000 => eme2000_to_gcrf(),
            Axes::MeanOfDate => matrix(&sofars::pnp::pmat06(DJ00, days_of_tt(t))).transpose(),
            Axes::TrueOfDate => matrix(&sofars::pnp::pnm06a(DJ00, days_of_tt(t))).transpose(),
            Axes::Teme => teme_to_gcrf(t),
            Axes::EarthFixed { ut1_tai } => {
                let ut1 = t.to_tai_duration() + ut1_tai;
                let ut1_ns = ut1.total_nanoseconds() - J2000_NS;
                // A sum of day and fraction would be rounded to 0.2 us: 0.5 mm at the geostationary
                // belt.
                let day = ut1_ns.div_euclid(DAY_NS) as f64;
                let fraction = ut1_ns.rem_euclid(DAY_NS) as f64 / DAY_NS as f64;
                let tt = days_of_tt(t);
                let npb = sofars::pnp::pnm06a(DJ00, tt);
                let angle = sofars::erst::gst06(DJ00 + day, fraction, DJ00, tt, &npb);
                // r_fixed = R3(GAST) NPB r_gcrf
                (about_z(angle) * matrix(&npb)).transpose()
            }
        }
    }

    /// Rotates a state in these axes at `t` to GCRF. In Earth-fixed axes the velocity is relative
    /// to the rotating Earth.
    pub fn state(self, t: Epoch, mut state: StateVector) -> StateVector {
        if let Axes::EarthFixed { .. } = self {
            // v_inertial = v_fixed + w x r
            state.velocity_m_s += Vector3::new(0.0, 0.0, EARTH_RATE).cross(&state.position_m);
        }
        state.rotated(&self.to_gcrf(t))
    }
}

/// R3: coordinate rotation about z by `angle`, rad.
fn about_z(angle: f64) -> Matrix3<f64> {
    let (sin, cos) = libm::sincos(angle);
    #[rustfmt::skip]
    let rotation = Matrix3::new(
         cos, sin, 0.0,
        -sin, cos, 0.0,
         0.0, 0.0, 1.0,
    );
    rotation
}

fn days_of_tt(t: Epoch) -> f64 {
    days_since_j2000(t.to_tt_duration().total_nanoseconds())
}

fn days_since_j2000(ns_since_1900: i128) -> f64 {
    (ns_since_1900 - J2000_NS) as f64 / DAY_NS as f64
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}
