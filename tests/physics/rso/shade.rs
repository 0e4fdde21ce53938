//! RCM-1 leaves the Earth's shadow around 23:35:30 of the 2019 scene: its light rises smoothly from
//! none to full.

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::load::Folder;
use skyloop::orbit::time::parse_utc;
use skyloop::orbit::two_body;
use skyloop::sky::bodies::{Bodies, SUN_RADIUS_M};
use skyloop::sky::shadow::{EARTH_FLATTENING, EARTH_RADIUS_M, Earth};

/// From the state at 23:35:30, the start of the ephemeris, forwards and backwards.
fn rcm_1(set: &str) -> (Epoch, impl Fn(f64) -> Vector3<f64>) {
    let folder = Folder::Embedded("scenes/rcm-2019-06-15");
    let (file, text) = folder.read(&format!("rcm-1-{set}.oem")).unwrap();
    let loaded = skyloop::orbit::parse(&text, &file).unwrap();
    let object = &loaded.objects[0];
    let start = parse_utc("2019-06-15T23:35:30").unwrap();
    let state = object.state(start).unwrap();
    (start, move |s| two_body::propagate_j2(&state, s).position_m)
}

/// The heights (km) above the Earth of the lowest and the highest ray to the Sun's limb. Space is
/// stretched along the axis, so that the ellipsoid becomes a sphere.
fn limb_rays(earth: &Earth, object_m: Vector3<f64>, sun_m: Vector3<f64>) -> [f64; 2] {
    let stretch = |v: Vector3<f64>| {
        v + earth.pole() * (v.dot(&earth.pole()) * (1.0 / (1.0 - EARTH_FLATTENING) - 1.0))
    };
    let line = sun_m - object_m;
    let first = line.cross(&Vector3::z()).normalize();
    let second = line.cross(&first).normalize();
    // The cone that touches the Sun meets it in a circle slightly nearer and smaller than its limb:
    // by 1e-5 of its radius.
    let heights = (0..3600).map(|i| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 3600.0).sin_cos();
        let ray = stretch(line + (first * cos + second * sin) * SUN_RADIUS_M);
        (stretch(object_m).cross(&ray).norm() / ray.norm() - EARTH_RADIUS_M) * 1e-3
    });
    heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| {
        [low.min(h), high.max(h)]
    })
}

/// Steps of 10 ms from 70 s before to 10 s after.
const STEP_S: f64 = 0.01;

#[test]
fn rcm_1_comes_out_of_the_shadow_smoothly() {
    for set in ["A", "B"] {
        let (epoch, position) = rcm_1(set);
        let earth = Earth::at(epoch);
        let sun_m = Bodies::at(epoch).unwrap().sun_apparent_m();
        let times: Vec<f64> = (0..8000).map(|i| f64::from(i) * STEP_S - 70.0).collect();
        let parts = times
            .iter()
            .map(|s| earth.illumination(position(*s), sun_m));
        let parts: Vec<f64> = parts.collect();
        assert_eq!((parts[0], parts[7999]), (0.0, 1.0), "set {set}");

        let slopes: Vec<f64> = parts.windows(2).map(|p| (p[1] - p[0]) / STEP_S).collect();
        let steepest = slopes.iter().copied().fold(0.0, f64::max);
        let rises = slopes.iter().all(|slope| *slope >= 0.0);
        assert!(rises, "set {set}: it falls back");
        // At the contacts the slope begins as the root of time: 0.04 of the steepest in the first
        // step.
        let kinks = slopes.windows(2).map(|s| (s[1] - s[0]).abs());
        let kink = kinks.fold(0.0, f64::max);
        assert!(kink < 0.05 * steepest, "set {set}: {kink} of {steepest}");

        // The contacts are where rays to the limb graze the Earth.
        let first_light = times[parts.iter().position(|part| *part > 0.0).unwrap()];
        let full_light = times[parts.iter().position(|part| *part >= 1.0).unwrap()];
        let [_, highest] = limb_rays(&earth, position(first_light), sun_m);
        let [lowest, _] = limb_rays(&earth, position(full_light), sun_m);
        let [at_start, _] = limb_rays(&earth, position(0.0), sun_m);
        println!(
            "set {set}: first light {first_light:.2} s, full light {full_light:.2} s after \
             23:35:30, when the lower limb stands {at_start:.3} km above the Earth's"
        );
        let is_near = highest.abs() < 0.05 && lowest.abs() < 0.05;
        assert!(is_near, "set {set}: {highest} {lowest} km");
        assert!((-40.0..-20.0).contains(&(first_light - full_light)));
    }
}
