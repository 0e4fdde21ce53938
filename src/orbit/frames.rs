//! From the frames in which orbits are published to the GCRF.
//!
//! TEME ("true equator, mean equinox") is the frame of SGP4: its z axis is the
//! true pole of date, and its x axis is the origin from which the IAU 1982
//! Greenwich mean sidereal time is counted (Vallado et al., AIAA 2006-6753,
//! appendix C). The true-of-date frame counts Greenwich APPARENT sidereal time
//! from the true equinox, so the two differ by a turn about the pole.

use hifitime::Epoch;
use nalgebra::Matrix3;
use sofars::consts::DJ00;

/// Nanoseconds from 1900-01-01T00:00, where hifitime counts from, to 2000-01-01T12:00.
pub(crate) const J2000_NS: i128 = 36_524 * DAY_NS + DAY_NS / 2;
/// Nanoseconds in a day of 86,400 s.
pub(crate) const DAY_NS: i128 = 86_400_000_000_000;

/// Rotation from TEME of date to GCRF: 3 x 3, `r_gcrf = teme_to_gcrf(t) * r_teme`.
///
/// Precession, nutation and frame bias are IAU 2006/2000A; the equinox turn is
/// GAST 2006 - GMST 1982. UT1 is taken equal to UTC: the two sidereal times
/// share the Earth's rotation, and what is left of a 1 s error in UT1 is
/// 7e-12 rad, 0.3 mm at the geostationary belt. The corrections to the celestial
/// pole observed since (0.3 milliarcsecond) are left out: 6 cm there.
/// Measured against two independent libraries out to that belt (`tests/frames.rs`):
/// at most 3.0 mm over 1960 to 2060 (skyfield), 2.5 mm over 1975 to 2026 (astropy).
pub fn teme_to_gcrf(t: Epoch) -> Matrix3<f64> {
    let tt = days_since_j2000(t.to_tt_duration().total_nanoseconds());
    let ut1 = days_since_j2000(t.to_utc_duration().total_nanoseconds());

    // r_true = NPB r_gcrf  (Capitaine & Wallace 2006, IAU 2006/2000A)
    let npb = sofars::pnp::pnm06a(DJ00, tt);
    // both reach the Earth-fixed axes: R3(GMST82) r_teme = R3(GAST) r_true
    // r_teme = R3(GAST - GMST82) r_true
    let angle = sofars::erst::gst06(DJ00, ut1, DJ00, tt, &npb) - sofars::erst::gmst82(DJ00, ut1);
    let (sin, cos) = libm::sincos(angle);
    #[rustfmt::skip]
    let equinox = Matrix3::new(
         cos, sin, 0.0,
        -sin, cos, 0.0,
         0.0, 0.0, 1.0,
    );
    // r_gcrf = (R3 NPB)^T r_teme
    (equinox * matrix(&npb)).transpose()
}

/// Rotation from EME2000 (mean equator and equinox of J2000.0) to GCRF: the
/// constant frame bias of IAU 2000, 23 milliarcseconds (0.8 m at 7,000 km).
pub fn eme2000_to_gcrf() -> Matrix3<f64> {
    // r_eme2000 = B r_gcrf
    let (bias, _, _) = sofars::pnp::bp06(DJ00, 0.0);
    matrix(&bias).transpose()
}

fn days_since_j2000(ns_since_1900: i128) -> f64 {
    (ns_since_1900 - J2000_NS) as f64 / DAY_NS as f64
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}
