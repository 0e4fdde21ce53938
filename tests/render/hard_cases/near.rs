//! Objects at the sensor's own position, a metre away and a million kilometres away; and sunlight
//! grazing the Earth's limb.

use super::stage::{
    LOW_KM, LOW_KM_S, camera, check_numbers, emulator, falling, in_low_orbit, noon, oem,
};
use nalgebra::Vector3;
use skyloop::engine::ExposedFrame;
use skyloop::fidelity::{Fidelity, Orbits};
use skyloop::sky::shadow::{EARTH_RADIUS_M, Earth};
use std::f64::consts::PI;

/// An object `off_m` from the observer, at rest relative to it, 7,000 km from the Earth's centre.
fn exposed(off_m: Vector3<f64>, orbits: Orbits) -> ExposedFrame {
    let fidelity = Fidelity {
        orbits,
        ..Fidelity::REALTIME
    };
    let mut emulator = emulator(camera(""), fidelity, |config| {
        config.objects = oem("NEAR", noon(), falling(LOW_KM + off_m * 1e-3, LOW_KM_S));
    });
    let exposed = emulator.expose(&in_low_orbit(), 0).unwrap();
    check_numbers(&exposed, &format!("{off_m:?}"));
    exposed
}

/// The Sun's direction from the Earth's centre at [`noon`], km.
// X-Val: pyerfa 2.0.1.5: epv00 of TT (UTC and 69.184 s), and ab by the barycentric velocity.
const SUN_KM: [f64; 3] = [139_759_283.114_9, -45_306_996.999_3, -19_640_426.505_6];
/// The Sun's magnitude.
// X-Val: Clark et al. 2021, Eq. (9).
const SUN_MAG: f64 = -26.73;
/// An astronomical unit, km.
// X-Val: IAU 2012, Resolution B2.
const AU_KM: f64 = 149_597_870.7;

/// Reference: Eq. (9) of Clark et al. 2021 by hand from the label's own phase angle; 1e-7 mag.
/// Frames stay finite at any saturation.
#[test]
fn objects_from_a_metre_to_a_million_kilometres_have_the_magnitude_of_eq_9() {
    for orbits in [Orbits::Tracked, Orbits::Exact, Orbits::Scalar] {
        for range_m in [1.0, 1.000_001, 1.001, 2.0, 10.0, 1e3, 1e6, 3.5e7, 1e9] {
            let exposed = exposed(Vector3::new(range_m, 0.0, 0.0), orbits);
            let object = &exposed.label.objects[0];
            let rso = object.rso.as_ref().unwrap();
            // Messages give micrometres, and positions of 7,000 km are rounded.
            assert!(
                (rso.range_km * 1e3 - range_m).abs() < 2e-6 + 1e-15 * range_m,
                "{range_m}: {}",
                rso.range_km
            );
            let phase = rso.phase_deg.to_radians();
            let area = 0.2 * PI * 25.0 * 2.0 / (3.0 * PI * PI)
                * ((PI - phase) * phase.cos() + phase.sin());
            let to_sun = (Vector3::from(SUN_KM) - Vector3::from(rso.position_gcrf_km)).norm();
            let mag = SUN_MAG - 2.5 * (area / (rso.range_km * 1e3).powi(2)).log10()
                + 5.0 * (to_sun / AU_KM).log10();
            assert!(
                (object.mag - mag).abs() < 1e-7 + 2e-16 * range_m,
                "{range_m} m: {} {mag}",
                object.mag
            );
            // Straight ahead of the camera, within its motion of 100 um by gravity in the exposure.
            let miss = (object.x_px - 31.5).hypot(object.y_px - 31.5);
            assert!(miss < 1e-3, "{range_m} m: {miss} px");
        }
    }
}

/// An object nearer than one metre is the vehicle itself: it has no image, hides nothing and costs
/// nothing. Reference: the frame without it, bit by bit.
#[test]
fn an_object_at_the_sensors_own_place_is_the_sensor() {
    let far = exposed(Vector3::new(-1e6, 0.0, 0.0), Orbits::Tracked);
    for orbits in [Orbits::Tracked, Orbits::Exact, Orbits::Scalar] {
        for off_m in [0.0, 1e-6, 0.5, 0.999, 0.999_999] {
            for axis in [Vector3::x(), -Vector3::x(), Vector3::z()] {
                let own = exposed(axis * off_m, orbits);
                assert!(own.label.objects.is_empty(), "{off_m}");
                assert_eq!(own.frame.dn, far.frame.dn);
                assert_eq!(own.unknown.count, 0);
            }
        }
    }
}

/// Grazing sunlight past the Earth, for an object at 7,000 km, 150 million km from the Sun: a part
/// of the Sun's radius; the covered share when the disc dips behind the limb by this part; the
/// visible share when it emerges by this part.
// X-Val: mpmath 1.4.1, 50 digits: the intersection of two caps of the sphere, radii asin(6378137 /
// 7e6) and asin(6.957e8 / 1.5e11), by Gauss and Bonnet: 2 (pi - C - A cos a - B cos b), over the
// Sun's.
const GRAZING: [(f64, f64, f64); 8] = [
    (0.5, 0.195_357_047_700_375_95, 0.195_646_139_870_903_15),
    (0.1, 0.018_674_716_913_590_222, 0.018_711_578_867_820_825),
    (1e-2, 5.986_891_612_154_814e-4, 5.999_386_392_844_91e-4),
    (1e-3, 1.895_773_017_606_098_5e-5, 1.899_751_050_104_924e-5),
    (1e-4, 5.995_766_844_611_153e-7, 6.008_354_984_704_456e-7),
    (1e-6, 5.995_855_516_655_777e-10, 6.008_444_591_512_853e-10),
    (1e-8, 5.995_856_403_368_211e-13, 6.008_445_487_573_042e-13),
    (1e-9, 1.896_056_278_344_001e-14, 1.900_037_296_345_165_5e-14),
];

/// 1e-5 of the covered or visible part: the limb drawn as a plane circle has an error of a quarter
/// of the Sun's squared radius, 5.4e-6 (a straight limb: 1e-3). And 3e-16 of the whole, the last
/// digit.
#[test]
fn the_penumbra_begins_and_ends_as_the_closed_form_says() {
    let earth = Earth::at(noon());
    let pole = earth.pole();
    // In the plane of the equator the ellipsoid's stretch changes no line.
    let x = pole.cross(&Vector3::y()).normalize();
    let y = pole.cross(&x);
    let (d, sun_d): (f64, f64) = (7e6, 1.5e11);
    let (limb, sun) = ((EARTH_RADIUS_M / d).asin(), (6.957e8 / sun_d).asin());
    let lit = |separation: f64| {
        // The Earth's centre is at -x of the object.
        let to_sun = x * -separation.cos() + y * separation.sin();
        earth.illumination(x * d, x * d + to_sun * sun_d)
    };
    for (part, outer, inner) in GRAZING {
        let covered = 1.0 - lit(limb + sun * (1.0 - part));
        let left = lit(limb - sun * (1.0 - part));
        for (found, due) in [(covered, outer), (left, inner)] {
            let bound = 1e-5 * due + 3e-16;
            assert!((found - due).abs() <= bound, "{part}: {found:e} {due:e}");
        }
    }
    // On either side of the contacts light is whole or zero, and always in range.
    for beyond in [0.0, 1e-15, 1e-9, 1e-3, 0.1] {
        assert_eq!(lit(limb + sun * (1.0 + 1e-12) + beyond), 1.0);
        assert_eq!(lit(limb - sun * (1.0 + 1e-12) - beyond), 0.0);
    }
    for k in -1000..=1000 {
        let found = lit(limb + sun * (1.0 + f64::from(k) * 1e-13));
        assert!((0.0..=1.0).contains(&found), "{found}");
    }
}
