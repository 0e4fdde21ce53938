//! The Moon's disc at sizes of hundreds and thousands of pixels against the Lommel-Seeliger law,
//! pixel by pixel.

use super::frames::{all_e, expected, moments, moon, observer, only};
use crate::fixtures::{camera, cropped, towards};
use nalgebra::Vector3;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::sky::Corrections;
use skyloop::sky::moon::MoonDisc;
use skyloop::sky::shadow::Earth;
use std::f64::consts::PI;

/// 6 and 94 deg of phase.
const FULL: &str = "2026-06-29T12:00:00 UTC";
const QUARTER: &str = "2026-06-21T22:00:00 UTC";
/// 163 deg of phase: 28 h before new Moon, 2026-06-15 02:54 UTC (USNO).
const CRESCENT: &str = "2026-06-13T23:00:00 UTC";

/// The middle of the first partial phase of the eclipse of 3 March 2026. X-Val: penumbra 8:44,
/// umbra 9:50, totality 11:04 UTC (NASA).
const ECLIPSE: &str = "2026-03-03T10:27:00 UTC";

/// The Moon seen from a position (GCRF, m).
fn disc(epoch: &str, position_m: Vector3<f64>) -> MoonDisc {
    MoonDisc::seen_by(&observer(epoch, position_m), &Corrections::default())
}

/// Exposure time in which no pixel saturates, s: labels count unsaturated pixels only.
const SHORT_S: f64 = 1e-3;

/// A frame of `pixels` x `pixels` with the Moon `across_px` wide in its middle, moving by
/// `motion_px`. The observer is at `position`, or at the Earth's centre.
fn expose_from(
    position: Option<Vector3<f64>>,
    epoch: &str,
    across_px: f64,
    pixels: usize,
    [motion_px, exposure_s]: [f64; 2],
) -> ExposedFrame {
    let disc = disc(epoch, position.unwrap_or(Vector3::zeros()));
    let mut camera = cropped(camera("rigel-l"), pixels);
    camera.optics.focal_px = across_px / (2.0 * disc.angular_radius);
    camera.exposure_s = exposure_s;
    let rate = motion_px / (camera.optics.focal_px * camera.exposure_s);
    let mut config = Config::defaults().unwrap();
    config.camera = camera;
    let mut emulator = Emulator::new(&mut config);
    only(&mut emulator, &["moon", "smear"]);
    let q = towards(&disc.direction);
    let orbit = position.map(|position| (position.into(), [0.0; 3]));
    let epoch = epoch.parse().unwrap();
    let vehicle = VehicleState::new(0, epoch, q, [0.0, rate, 0.0], orbit).unwrap();
    emulator.expose(&vehicle, 0).unwrap()
}

fn expose(epoch: &str, across_px: f64, pixels: usize, motion_px: f64) -> ExposedFrame {
    expose_from(None, epoch, across_px, pixels, [motion_px, SHORT_S])
}

/// `mu0 / (mu0 + mu)` over its integral, at a position on the disc (in radii, camera axes).
fn law(disc: &MoonDisc, to_sun: &Vector3<f64>, [x, y]: [f64; 2]) -> f64 {
    let mu = (1.0 - x * x - y * y).max(0.0).sqrt();
    let mu0 = Vector3::new(x, y, -mu).dot(to_sun);
    // By hand, as in `sky::moon`: S = (pi / 2) (1 - sin(g/2) tan(g/2) ln cot(g/4)).
    let g = disc.phase;
    let all = PI / 2.0 * (1.0 - (g / 2.0).sin() * (g / 2.0).tan() * (1.0 / (g / 4.0).tan()).ln());
    mu0.max(0.0) / (mu0.max(0.0) + mu) / all
}

/// The maximum difference between pixels and the law, relative to the law in the middle. Pixels
/// near the limb and the terminator, where the law bends, are left out.
fn worst(exposed: &ExposedFrame, epoch: &str, across_px: f64) -> (f64, usize) {
    let disc = disc(epoch, Vector3::zeros());
    let q = exposed.label.q_icrf_to_body;
    let to_sun = Attitude::from_xyzw(q).unwrap().rotate(&disc.to_sun);
    let (pixels, radius) = (exposed.camera.detector.width, across_px / 2.0);
    let middle = (pixels as f64 - 1.0) / 2.0;
    let scale_e = all_e(exposed) / (radius * radius);
    let (mut worst, mut compared) = (0.0f64, 0);
    for (i, e) in expected(exposed).iter().enumerate() {
        let [x, y] = [i % pixels, i / pixels].map(|k| (k as f64 - middle) / radius);
        let wanted = law(&disc, &to_sun, [x, y]) * scale_e;
        let sunlit = Vector3::new(x, y, -(1.0 - x * x - y * y).max(0.0).sqrt()).dot(&to_sun);
        if x.hypot(y) < 1.0 - 12.0 / radius && sunlit > 0.1 {
            worst = worst.max((f64::from(*e) / wanted - 1.0).abs());
            compared += 1;
        }
    }
    (worst, compared)
}

#[test]
fn a_large_disc_follows_its_law() {
    for (epoch, across_px, pixels) in [
        (QUARTER, 200.0, 220),
        (FULL, 450.0, 460),
        (QUARTER, 1000.0, 512),
        (FULL, 2000.0, 512),
    ] {
        let exposed = expose(epoch, across_px, pixels, 0.0);
        let (worst, compared) = worst(&exposed, epoch, across_px);
        println!("{epoch}, {across_px} px: {worst:.2e} over {compared} pixels");
        assert!(worst < 2e-3, "{epoch}, {across_px}: {worst}");
        assert!(compared > 8_000, "{compared}");
    }
}

/// The Moon is made of points below some size, and rasterized as an area above it. Light and centre
/// are the same, and the sky next to the disc is dark.
#[test]
fn a_large_disc_has_the_light_and_the_centre_of_its_label() {
    // A moving area takes its light at mid-exposure, which is inexact towards the terminator. A
    // crescent of 10 px at its widest is coarse for areas.
    for (epoch, motion_px, off_px, tolerance) in [
        (FULL, 0.0, 0.01, 1e-3),
        (FULL, 26.0, 0.1, 1e-3),
        (CRESCENT, 0.0, 0.25, 3e-3),
    ] {
        for (across_px, pixels) in [(200.0, 260), (480.0, 560)] {
            let exposed = expose(epoch, across_px, pixels, motion_px);
            let (sum, centre) = moments(&exposed);
            let moon = moon(&exposed);
            let off = (centre[0] - moon.x_px).hypot(centre[1] - moon.y_px);
            let light = sum / moon.electrons - 1.0;
            let what = format!("{epoch}, {across_px} px, {motion_px} px/s: {light} {off} px");
            println!("{what}");
            assert!(light.abs() < tolerance && off < off_px, "{what}");
            assert!((moon.electrons / all_e(&exposed) - 1.0).abs() < 1e-6);
            // Ten pixels from the limb, across the motion.
            let row = (pixels as f64 / 2.0 - across_px / 2.0 - 10.0) as usize;
            let e = expected(&exposed);
            let sky = e[row * pixels + centre[0] as usize];
            let brightest = e.iter().copied().fold(0.0, f32::max);
            assert!(sky < 1e-3 * brightest, "{sky} {brightest}");
        }
    }
}

/// Half occulted, and half in the Earth's shadow: the rasterized light and its centre are the
/// label's.
#[test]
fn occulted_and_eclipsed_discs_match_the_label() {
    // 700 km high, so far around the Earth that its limb crosses the middle of the Moon.
    let geocentric = disc(FULL, Vector3::zeros()).direction;
    let across = geocentric.cross(&Vector3::z()).normalize();
    let at = |depth: f64| (across * depth.cos() - geocentric * depth.sin()) * 7078e3;
    let earth = Earth::at(FULL.parse().unwrap());
    let is_up = |depth: f64| earth.limb_angle(at(depth), &disc(FULL, at(depth)).direction) > 0.0;
    let [mut up, mut down] = [0.0, 1.0];
    for _ in 0..40 {
        let middle = 0.5 * (up + down);
        *(if is_up(middle) { &mut up } else { &mut down }) = middle;
    }
    let position = at(up);
    for (position, epoch) in [(Some(position), FULL), (None, ECLIPSE)] {
        let exposed = expose_from(position, epoch, 480.0, 560, [0.0, SHORT_S]);
        let (sum, centre) = moments(&exposed);
        let moon = moon(&exposed);
        let part = moon.electrons / all_e(&exposed);
        let off = (centre[0] - moon.x_px).hypot(centre[1] - moon.y_px);
        let light = sum / moon.electrons - 1.0;
        let what = format!("{epoch}: {part}, {light} {off} px");
        println!("{what}");
        let is_part = (0.05..0.95).contains(&part);
        assert!(is_part && light.abs() < 2e-3 && off < 0.1, "{what}");
    }
}

#[test]
fn a_moon_that_fills_the_frame_is_in_the_label() {
    for (exposure_s, is_full) in [(SHORT_S, false), (1.0, true)] {
        let exposed = expose_from(None, FULL, 1000.0, 256, [0.0, exposure_s]);
        let max = (1u32 << exposed.camera.detector.bits) - 1;
        let full = exposed.frame.dn.iter().all(|dn| u32::from(*dn) == max);
        assert_eq!(full, is_full);
        assert_eq!(moon(&exposed).snr == 0.0, is_full);
    }
}
