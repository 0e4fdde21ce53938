//! Noise-free light: pixels against the label.

use crate::fixtures::noise_free;
use std::collections::HashSet;

use nalgebra::Vector3;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::engine::ExposedFrame;
use skyloop::fidelity::Fidelity;
use skyloop::flight;
use skyloop::sky::catalog::{Catalog, Selection};

use super::brute::{
    Box2, Image, builtin, emulator, epoch, expose, falling, image, in_camera, look_at, oem, orbit,
    unit,
};

/// The errors of a frame's objects.
#[derive(Default, Debug)]
pub struct Tally {
    /// Isolated and wholly on the detector.
    pub whole: usize,
    /// Isolated and partly off it.
    pub partly: usize,
    pub worst_centroid_px: f64,
    /// Of the total, against the label.
    pub worst_light: f64,
    /// The light on the detector of objects partly off it, against brute force, as a part of the
    /// object's total.
    pub worst_part: f64,
    /// Any pixel against brute force, as a part of the brightest pixel.
    pub worst_pixel: f64,
    /// The same, less `track_e` of live frames.
    pub worst_beyond: f64,
}

impl Tally {
    pub fn add(&mut self, exposed: &ExposedFrame) {
        let seen = Image::light_of(exposed);
        let truth = image(&exposed.label, &exposed.camera);
        let peak = truth.peak();
        for (a, b) in seen.e.iter().zip(&truth.e) {
            let off_e = (a - b).abs();
            self.worst_pixel = self.worst_pixel.max(off_e / peak);
            let beyond = (off_e - Fidelity::REALTIME.track_e) / peak;
            self.worst_beyond = self.worst_beyond.max(beyond);
        }
        let objects = || exposed.label.objects.iter().filter(|o| o.electrons > 0.0);
        let boxes = objects().map(|o| Box2::of(&exposed.label, o, &exposed.camera));
        let boxes: Vec<Box2> = boxes.collect();
        for (i, (object, region)) in objects().zip(&boxes).enumerate() {
            // Below a hundredth of an electron the background's last digit (float32) counts.
            let is_bright = object.electrons >= 0.01;
            let others = || boxes.iter().enumerate().filter(|(j, _)| *j != i);
            if !is_bright || others().any(|(_, other)| region.meets(other)) {
                continue;
            }
            let (light, centre) = seen.moments(region);
            if region.within(&seen) {
                let off = (centre[0] - object.x_px).hypot(centre[1] - object.y_px);
                self.whole += 1;
                self.worst_centroid_px = self.worst_centroid_px.max(off);
                self.worst_light = self.worst_light.max((light / object.electrons - 1.0).abs());
            } else {
                let (expected, _) = truth.moments(region);
                let off = (light - expected).abs() / object.electrons;
                self.partly += 1;
                self.worst_part = self.worst_part.max(off);
            }
        }
    }

    fn holds(&self, what: &str) {
        println!("{what}: {self:?}");
        assert!(self.worst_centroid_px <= 0.005, "{what}: {self:?}");
        assert!(self.worst_light <= 1e-3, "{what}: {self:?}");
        assert!(self.worst_part <= 1e-3, "{what}: {self:?}");
        assert!(self.worst_pixel <= 1e-4, "{what}: {self:?}");
    }
}

const CAMERAS: [(&str, Selection); 4] = [
    ("fai-nir", Selection::Bsc),
    ("fai-630", Selection::Bsc),
    ("rigel-l", Selection::Hipparcos),
    ("cots-wide", Selection::Hipparcos),
];
/// deg/s.
const RATES: [[f64; 3]; 6] = [
    [1e-3, 0.0, 0.0],
    [0.5, 0.0, 0.0],
    [0.0, -2.0, 0.0],
    [0.0, 0.0, 5.0],
    [5.0, 0.0, 0.0],
    [-3.0, 4.0, -5.0],
];
/// A low orbit, m and m/s.
const ORBIT: ([f64; 3], [f64; 3]) = ([2.1e6, -5.4e6, 3.9e6], [6.3e3, 3.7e3, 1.8e3]);

/// At rest at several epochs, and turning; every second turning camera has a rotated mounting.
#[test]
fn stars_match_their_labels() {
    const CLARK: [f64; 4] = [-0.070834, -0.644137, 0.733522, -0.204975];
    for (camera, stars) in CAMERAS {
        let mut emulator = emulator(camera, stars, Vec::new(), Fidelity::REALTIME);
        let mut tally = Tally::default();
        for (at, q, orbit) in [
            ("1995-03-02T04:05:06.789", [0.3, -0.5, 0.7, 0.2], None),
            ("2019-06-15T23:35:50", CLARK, None),
            ("2031-11-30T12:00:00.000000001", [0.9, 0.1, -0.2, 0.4], None),
            ("2026-02-11T18:22:41.25", [0.1, 0.2, -0.3, 0.9], Some(ORBIT)),
        ] {
            tally.add(&expose(&mut emulator, epoch(at), q, [0.0; 3], orbit));
        }
        tally.holds(camera);
        assert!(tally.whole > 60 && tally.partly > 3, "{camera}: {tally:?}");

        let mut tally = Tally::default();
        let at = epoch("2024-05-06T07:08:09.1");
        for (i, rates) in RATES.into_iter().enumerate() {
            let q = [0.2 * i as f64, -0.5, 0.3, 0.4];
            let mounting = [[0.0, 0.0, 0.0, 1.0], [0.5, -0.1, 0.7, 0.5]][i % 2];
            emulator.camera_mut().mounting = Attitude::from_xyzw(mounting).unwrap();
            tally.add(&expose(&mut emulator, at, q, rates, Some(ORBIT)));
        }
        tally.holds(&format!("{camera}, turning"));
        assert!(tally.whole > 60 && tally.partly > 3, "{camera}: {tally:?}");
    }
}

/// Every catalogue star whose path crosses the detector while the shutter is open is in the label.
#[test]
fn no_star_is_missing() {
    let catalog = Catalog::embedded(Selection::Hipparcos);
    let stars = Selection::Hipparcos;
    let mut emulator = emulator("fai-nir", stars, Vec::new(), Fidelity::REALTIME);
    let at = epoch("2020-05-06T07:08:09");
    for rates in [[0.0; 3], [20.0, 30.0, 100.0]] {
        let exposed = expose(&mut emulator, at, [0.6, 0.2, -0.3, 0.4], rates, Some(ORBIT));
        let label = &exposed.label;
        let listed: HashSet<&str> = label.objects.iter().map(|o| o.id.as_str()).collect();
        let optics = &exposed.camera.optics;
        let instants = (0..=40).map(|i| (f64::from(i) / 40.0 - 0.5) * label.exposure_s);
        let instants: Vec<f64> = instants.collect();
        let mut crossing = 0;
        for star in catalog.stars() {
            let direction = unit(star.ra_rad, star.dec_rad).into();
            let inside = instants.iter().any(|t| {
                let seen = in_camera(label, direction, *t);
                // One pixel (6 arcmin) of margin: proper motion and aberration are left out here.
                let on = |k: usize| {
                    let x = optics.principal_px[k] + optics.focal_px * seen[k] / seen[2];
                    (0.5..254.5).contains(&x)
                };
                seen[2] > 0.0 && on(0) && on(1)
            });
            if inside {
                crossing += 1;
                assert!(listed.contains(catalog.id(star).as_str()), "{star:?}");
            }
        }
        assert!(crossing > 500, "{crossing}");
    }
}

/// The three satellites of the built-in scene, seen by its own camera at rest and turning.
#[test]
fn objects_in_orbit_match_their_labels() {
    let config = builtin();
    let mission = flight::mission(&config).unwrap();
    let mut emulator = noise_free(config);
    let (mut tally, mut rsos) = (Tally::default(), 0);
    for number in [0, 13, 40] {
        let still = flight::vehicle(&mission, number).unwrap();
        for rates in [Vector3::zeros(), Vector3::new(0.02, -0.03, 0.08)] {
            let vehicle = VehicleState {
                rates,
                ..still.clone()
            };
            let exposed = emulator.expose(&vehicle, 0).unwrap();
            let objects = exposed.label.objects.iter();
            rsos += objects.filter(|o| o.kind == "rso").count();
            tally.add(&exposed);
        }
    }
    tally.holds("the scene's objects");
    assert_eq!(rsos, 18);
}

/// A nearby object that crosses the field at 30 degrees a second: long, uneven tracks.
#[test]
fn a_near_pass_is_a_long_streak_with_its_own_centre() {
    let at = epoch("2020-01-02T03:04:05.6");
    let (r, v) = (
        Vector3::new(6800.0, 1000.0, -300.0),
        Vector3::new(-0.9, 5.1, 5.5),
    );
    let aim = Vector3::new(0.3, -0.8, 0.4).normalize();
    let aside = aim.cross(&Vector3::x()).normalize();
    let stars = Selection::Bsc;
    for camera in ["fai-nir", "rigel-l"] {
        for (range, speed) in [(20.0, 1.0), (8.0, 4.0), (2.0, 0.9)] {
            let passing = falling(r + aim * range, v + aside * speed + aim * (0.4 * speed));
            let objects = oem("PASS", at, passing);
            let mut emulator = emulator(camera, stars, objects, Fidelity::REALTIME);
            let (q, rates) = (look_at(aim, 0.7), [0.2, 0.0, 1.0]);
            let exposed = expose(&mut emulator, at, q, rates, orbit(r, v));
            let object = exposed
                .label
                .objects
                .iter()
                .find(|o| o.kind == "rso")
                .unwrap();
            let length = (object.x1_px - object.x0_px).hypot(object.y1_px - object.y0_px);
            let mut tally = Tally::default();
            tally.add(&exposed);
            tally.holds(&format!("{camera}, {length:.1} px"));
            assert!(length > 2.0 && object.electrons > 1e3);
        }
    }
}
