//! The whole sky, turned with its camera, and exposed in two halves: stars, objects, the Moon, the
//! light of Earth, air, dust and faint stars, and stray light.

use super::properties::{Worst, check, rotations};
use super::stage::{camera, drawn, emulator, falling, noon, oem, orbiter};
use nalgebra::Vector3;
use proptest::prelude::*;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::camera::Camera;
use skyloop::effect::{area_kinds, name_of};
use skyloop::engine::Emulator;
use skyloop::fidelity::Fidelity;
use skyloop::plan::{Plan, allowed, simulated};
use skyloop::scene::{Area, Body, Edge, Faint, Radiance, View, add_areas, build_scene, build_view};
use skyloop::sky::bodies::Bodies;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Light with a rotated sky.
#[derive(Debug)]
struct Turned {
    of: Arc<dyn Radiance>,
    turn: Attitude,
}

impl Turned {
    fn unrotated(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.turn.inverse().rotate(direction)
    }
}

impl Radiance for Turned {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        self.of.toward(&self.unrotated(direction))
    }

    fn is_hidden_inside(&self) -> bool {
        self.of.is_hidden_inside()
    }

    fn edge(&self) -> Option<&dyn Edge> {
        self.of.edge().map(|_| self as &dyn Edge)
    }

    fn turning(&self) -> Vector3<f64> {
        self.turn.rotate(&self.of.turning())
    }

    fn detail(&self) -> f64 {
        self.of.detail()
    }

    fn is_of_pixels(&self) -> bool {
        self.of.is_of_pixels()
    }
}

impl Edge for Turned {
    fn angle(&self, direction: &Vector3<f64>) -> f64 {
        let edge = self.of.edge();
        edge.map_or(f64::NAN, |edge| edge.angle(&self.unrotated(direction)))
    }

    fn radius(&self) -> f64 {
        self.of.edge().map_or(f64::NAN, Edge::radius)
    }
}

/// The view of `vehicle` with all its contents.
fn view(emulator: &Emulator, vehicle: &VehicleState) -> View {
    let scene = emulator.scene(&emulator.camera(), vehicle, 0, &emulator.choice);
    scene.unwrap().view
}

/// That view with its contents and its observer rotated.
fn turned(emulator: &Emulator, original: &View, turn: &Attitude) -> View {
    let mut vehicle = original.vehicle.clone();
    vehicle.attitude = turn.inverse().then(&vehicle.attitude);
    if let Some(state) = &mut vehicle.orbit {
        state.position_m = turn.rotate(&state.position_m);
        state.velocity_m_s = turn.rotate(&state.velocity_m_s);
    }
    let all = Faint {
        snr: 0.0,
        unlit_snr: 0.0,
        star_snr: 0.0,
        floor_e: 0.0,
    };
    let (world, fidelity) = (emulator.world(), emulator.fidelity());
    let rotated = build_view(
        world,
        &original.camera,
        &vehicle,
        original.exposure,
        fidelity,
        original.key,
        all,
    );
    let mut rotated = rotated.unwrap();
    rotated.candidates.clone_from(&original.candidates);
    for candidate in &mut rotated.candidates {
        match &mut candidate.body {
            Body::Star(star) => star.direction = turn.rotate(&star.direction),
            Body::Rso(object) => {
                let mut seen = object.as_ref().clone();
                seen.lines_m = seen.lines_m.map(|line| turn.rotate(&line));
                *object = Arc::new(seen);
            }
            Body::Planet(body) => {
                body.directions = body.directions.map(|direction| turn.rotate(&direction));
                body.centre = turn.rotate(&body.centre);
                for element in &mut body.elements {
                    element.offset = turn.rotate(&element.offset);
                }
            }
        }
    }
    // The spread of its candidates is computed anew; its own sky light is replaced.
    let mut rotated = add_areas(rotated, world, area_kinds(), &allowed(&emulator.choice));
    let area = |area: &Area| Area {
        radiance: area.radiance.clone().map(|of| {
            let turn = *turn;
            Arc::new(Turned { of, turn }) as Arc<dyn Radiance>
        }),
        ..area.clone()
    };
    rotated.areas = original.areas.iter().map(area).collect();
    rotated.velocity_change_m_s = original
        .velocity_change_m_s
        .map(|change| turn.rotate(&change));
    rotated.sun = original.sun;
    rotated
}

/// Cameras of 7 to 9 deg.
fn cameras() -> [Camera; 3] {
    let keys = [
        "timing.exposure_s = 0.1",
        "timing.shutter = \"rolling\"; timing.row_us = 400.0",
        "optics.psf = { kind = \"moffat\", fwhm_px = 1.6, beta = 3.0 }; \
         optics.projection.model = \"brown-conrady\"; optics.projection.k = [-2.0]; \
         optics.vignetting.cos4 = true; optics.stray.pst = [[10.0, 1e-4], [180.0, 1e-6]]",
    ];
    keys.map(|keys| {
        camera(&format!(
            "optics.focal_length_mm = 5.0; optics.aperture_mm = 2.0; {keys}"
        ))
    })
}

/// From an altitude of 622 km: the day limb, the night limb, and the Moon over the terminator. Each
/// view has two objects in front and is taken by all cameras.
fn views(fidelity: Fidelity) -> Vec<(Emulator, VehicleState)> {
    let bodies = Bodies::at(noon()).unwrap();
    let [sun, moon] = [bodies.sun_apparent_m(), bodies.moon_geocentric_m].map(|m| m.normalize());
    let aside = sun.cross(&Vector3::z()).normalize();
    // X-Val: asin(6378.137 / 7000): the limb's angle from straight down.
    let (sin, cos) = 65.67_f64.to_radians().sin_cos();
    // Up, a direction, and one across it, away from the Earth.
    let over = |up: Vector3<f64>| (up, aside * sin - up * cos, up * sin + aside * cos);
    let views = [over(sun), over(-sun), (aside, moon, moon.cross(&aside))];
    let views = views
        .iter()
        .flat_map(|axes| cameras().map(|camera| (camera, *axes)));
    let views = views.map(|(camera, (up, towards, away))| {
        let (r, v) = (up * 7000.0, up.cross(&away).normalize() * 7.5);
        let object = |id: &str, off_km: Vector3<f64>, by_km_s: Vector3<f64>| {
            oem(id, noon(), falling(r + off_km, v + by_km_s))
        };
        let emulator = emulator(camera, fidelity, |config| {
            config.choice.off = vec!["shot noise"];
            let slow = object("SLOW", (towards + away * 0.04) * 300.0, aside * 0.01);
            let fast = object(
                "FAST",
                (towards + away * 0.05 + aside * 0.02) * 1000.0,
                up * 9.0 + aside,
            );
            config.objects = [slow, fast].concat();
        });
        (
            emulator,
            orbiter(&super::stage::towards(&towards), r * 1e3, v * 1e3),
        )
    });
    views.collect()
}

/// Positions to 1e-11 and signal-to-noise ratios to 1e-9, relative; each pixel to 1e-6 of its own
/// light.
#[test]
fn turning_the_whole_sky_changes_nothing() {
    let views = views(Fidelity::REALTIME);
    let [position, pixel] = [(); 2].map(|()| Worst::default());
    let lit = RefCell::new(BTreeSet::new());
    let rates = prop::array::uniform3(-1.0..1.0_f64);
    check(
        48,
        (0..views.len(), rates, rotations()),
        |(which, rates, turn)| {
            let (emulator, vehicle) = &views[which];
            let mut vehicle = vehicle.clone();
            vehicle.rates = Vector3::from(rates.map(f64::to_radians));
            let original = view(emulator, &vehicle);
            let rotated = turned(emulator, &original, &turn);
            let [original, rotated] = [original, rotated].map(|view| {
                let simulated = simulated(&view, emulator.fidelity(), &emulator.choice);
                build_scene(view, simulated, emulator.fidelity())
            });
            prop_assert_eq!(original.simulated, rotated.simulated);
            prop_assert_eq!(original.sources.len(), rotated.sources.len());
            for (a, b) in original.sources.iter().zip(&rotated.sources) {
                prop_assert!((a.electrons - b.electrons).abs() <= 1e-9 * a.electrons);
                for (a, b) in [(a.start, b.start), (a.end, b.end), (a.centroid, b.centroid)] {
                    let miss = (a[0] - b[0]).hypot(a[1] - b[1]) / (1.0 + a[0].hypot(a[1]));
                    prop_assert!(position.of(miss) < 1e-11, "{:e}", miss);
                }
                prop_assert!((a.snr - b.snr).abs() <= 1e-9 * a.snr, "{} {}", a.snr, b.snr);
            }
            let [a, b] = [&original, &rotated].map(|scene| {
                let plan = Plan::new(scene, emulator.fidelity(), &emulator.choice);
                drawn(&plan, scene).expected_e.unwrap()
            });
            for (a, b) in a.iter().zip(&b) {
                let miss = (a - b).abs() / a.max(f32::MIN_POSITIVE);
                prop_assert!(pixel.of(f64::from(miss)) <= 1e-6, "{:e} {:e}", a, b);
            }
            let areas = original.areas.iter().filter(|area| area.electrons > 0.0);
            lit.borrow_mut()
                .extend(areas.map(|area| name_of(area.effect)));
            let sources = original
                .sources
                .iter()
                .filter(|source| source.electrons > 0.0);
            lit.borrow_mut()
                .extend(sources.map(|source| source.body.identity().0));
            Ok(())
        },
    );
    println!("positions {position}, pixels {pixel} of their own light");
    let all = area_kinds()
        .map(|kind| name_of(kind.effect))
        .chain(["star", "rso", "Moon"]);
    assert_eq!(lit.into_inner(), all.collect());
}

/// The pixels near an edge of area light.
fn near_edges(emulator: &Emulator, vehicle: &VehicleState) -> Vec<bool> {
    // Blur, and the motion in a second at 1.7 deg/s.
    const NEAR_PX: f64 = 8.0;
    let (view, camera) = (view(emulator, vehicle), emulator.camera());
    let (scale, _) = camera.scale_and_corner_px();
    let near = NEAR_PX / scale + 1.7_f64.to_radians() * camera.exposure_s / 2.0;
    let pixels = 0..camera.detector.width * camera.detector.height;
    let is_near = pixels.map(|pixel| {
        let (x, y) = (pixel % camera.detector.width, pixel / camera.detector.width);
        let direction = super::stage::behind(&camera, &vehicle.attitude, [x as f64, y as f64]);
        let lights = view
            .areas
            .iter()
            .filter_map(|area| area.radiance.as_ref().ok());
        let mut edges = lights.filter_map(|radiance| radiance.edge());
        edges.any(|edge| edge.angle(&direction).abs() < near)
    });
    is_near.collect()
}

/// The frame of an exposure is the sum of those of its halves, within the tolerances of three
/// frames. Per kind of area light: 8 times `area_e` and `area_part`. Of sources: `track_e`,
/// `loss_e`, twice `wing_e` and their profile. Of an effect: `skip_e`. And f32. Next to the Earth's
/// edge each has an error of up to 0.7 % of the step for such a PSF (docs/explanation/limits.md).
#[test]
fn two_halves_of_the_whole_sky_add_up() {
    for fidelity in [Fidelity::REALTIME, Fidelity::REFERENCE] {
        let views = RefCell::new(views(fidelity));
        let indices = 0..views.borrow().len();
        let rates = prop::array::uniform3(-1.0..1.0_f64);
        let [worst, off, step] = [(); 3].map(|()| Worst::default());
        check(
            16,
            (indices, rates, -3.0..0.0_f64),
            |(which, rates, power)| {
                let exposure_s = 10f64.powf(power);
                let (emulator, vehicle) = &mut views.borrow_mut()[which];
                let mut vehicle = vehicle.clone();
                vehicle.rates = Vector3::from(rates.map(f64::to_radians));
                let mut exposed = |exposure_s: f64, off_s: f64| {
                    emulator.camera_mut().exposure_s = exposure_s;
                    let at = vehicle.epoch + skyloop::orbit::time::seconds(off_s);
                    emulator.expose(&vehicle.at(at), 0).unwrap()
                };
                let [first, second] =
                    [-0.25, 0.25].map(|part| exposed(exposure_s / 2.0, part * exposure_s));
                let whole = exposed(exposure_s, 0.0);
                let is_near = near_edges(emulator, &vehicle);
                let points = ["stars", "rsos", "planets", "moon"];
                emulator.choice.off.extend(points);
                let areas = emulator
                    .expose(&vehicle, 0)
                    .unwrap()
                    .frame
                    .expected_e
                    .unwrap();
                emulator.choice.off.retain(|name| !points.contains(name));

                let most_of = |is_meant: fn(&str) -> bool| {
                    let points = whole.label.objects.iter();
                    let points = points.filter(|object| is_meant(object.kind));
                    points.map(|object| object.electrons).fold(0.0, f64::max)
                };
                let (brightest, object) = (most_of(|_| true), most_of(|kind| kind == "rso"));
                // X-Val: 1 / (2 pi 0.8^2): the brightest pixel's share; step^4 / 3086.
                let profile = 0.25 * brightest * fidelity.track_step_sigma.powi(4) / 3086.0;
                // Objects have the brightness of mid-exposure (docs/explanation/limits.md). The
                // error is the square of their path in a quarter of the exposure: 9 km/s of 1,000
                // km.
                let swept = object * (9.0 * exposure_s / 4.0 / 1000.0).powi(2);
                let source =
                    fidelity.track_e + fidelity.loss_e + 2.0 * fidelity.wing_e + profile + swept;
                let [whole, first, second] =
                    [whole, first, second].map(|exposed| exposed.frame.expected_e.unwrap());
                let max = f64::from(whole.iter().copied().fold(0.0, f32::max));
                // Light that moves by no more than a pixel is drawn at rest (`scene::area`). For
                // air that falls by 1 / e within d px this leaves out path^2 / 24 d^2. 1 px of 2
                // mrad is 5.8 km at the limb, less than a scale height.
                let path_px = (rates.iter().map(|w| w * w).sum::<f64>().sqrt().to_radians()
                    + 1.1e-3)
                    * exposure_s
                    * 500.0;
                let frozen = match path_px {
                    2.0.. => 0.0,
                    _ => path_px.min(1.0).powi(2) * 1.25 / 24.0,
                };
                // Area light, too, is that of mid-exposure, turned. Over the flattened Earth (21.4
                // km in a quarter of an orbit) its limb moves vertically by up to 23 m/s, of a
                // scale height of 8 km.
                let sunk = 23.0 * exposure_s / 4.0 / 8e3;
                for (i, whole) in whole.iter().enumerate() {
                    let [whole, a, b, area] =
                        [*whole, first[i], second[i], areas[i]].map(f64::from);
                    let miss = (whole - a - b).abs();
                    if is_near[i] {
                        prop_assert!(step.of(miss / max) < 2.0 * 7e-3, "{} of {}", miss, max);
                        continue;
                    }
                    let drawn = 8.0 * (3.0 * fidelity.area_e + 2.0 * fidelity.area_part * area);
                    let bound = drawn
                        + (sunk + frozen) * area
                        + 3.0 * (source + fidelity.skip_e)
                        + 1e-6 * whole;
                    off.of(miss);
                    prop_assert!(
                        worst.of(miss / bound) <= 1.0,
                        "view {}: {} of {}",
                        which,
                        miss,
                        whole
                    );
                }
                Ok(())
            },
        );
        println!("{off} e-, {worst} of what is allowed; near edges {step} of the step");
    }
}
