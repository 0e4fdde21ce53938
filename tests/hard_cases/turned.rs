//! The whole sky turned with its camera: stars, objects, the Moon, the light of Earth, air, dust and faint stars, and what the optics scatter.

use crate::properties::{Worst, check, rotations};
use crate::stage::{camera, drawn, emulator, falling, noon, oem, orbiter};
use nalgebra::Vector3;
use proptest::prelude::*;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::camera::Camera;
use skyloop::engine::Emulator;
use skyloop::fidelity::Fidelity;
use skyloop::plan::{Plan, simulated};
use skyloop::scene::{Area, Body, Edge, Faint, KINDS, Radiance, Scene, View};
use skyloop::sky::bodies::Bodies;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Light whose sky is turned.
#[derive(Debug)]
struct Turned {
    of: Arc<dyn Radiance>,
    turn: Attitude,
}

impl Turned {
    fn there(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.turn.inverse().rotate(direction)
    }
}

impl Radiance for Turned {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        self.of.toward(&self.there(direction))
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
        edge.map_or(f64::NAN, |edge| edge.angle(&self.there(direction)))
    }

    fn radius(&self) -> f64 {
        self.of.edge().map_or(f64::NAN, Edge::radius)
    }
}

/// What `vehicle` has before it, all of it.
fn view(emulator: &Emulator, vehicle: &VehicleState) -> View {
    let scene = emulator.scene(&emulator.camera(), vehicle, 0, &emulator.choice);
    scene.unwrap().view
}

/// That view with all that is in it, and who looks, turned.
fn turned(emulator: &Emulator, here: &View, turn: &Attitude) -> View {
    let mut vehicle = here.vehicle.clone();
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
    let there = View::new(
        world,
        &here.camera,
        &vehicle,
        here.exposure,
        fidelity,
        here.key,
        all,
    );
    let mut there = there.unwrap();
    there.candidates.clone_from(&here.candidates);
    for candidate in &mut there.candidates {
        match &mut candidate.body {
            Body::Star(star) => star.direction = turn.rotate(&star.direction),
            Body::Rso(object) => {
                let mut seen = object.as_ref().clone();
                seen.lines_m = seen.lines_m.map(|line| turn.rotate(&line));
                *object = Arc::new(seen);
            }
            Body::Wanderer(body) => {
                body.directions = body.directions.map(|direction| turn.rotate(&direction));
                for element in &mut body.elements {
                    element.offset = turn.rotate(&element.offset);
                }
            }
        }
    }
    // How far its candidates swing is asked anew; the light of the sky as it stands is not its own.
    let mut there = there.where_shine(world, |name| !emulator.choice.off.contains(&name));
    let area = |area: &Area| Area {
        radiance: area.radiance.clone().map(|of| {
            let turn = *turn;
            Arc::new(Turned { of, turn }) as Arc<dyn Radiance>
        }),
        ..area.clone()
    };
    there.areas = here.areas.iter().map(area).collect();
    there.velocity_change_m_s = here.velocity_change_m_s.map(|change| turn.rotate(&change));
    there.sun = here.sun;
    there
}

/// Cameras of 60 px a side and 7 to 9 deg.
fn cameras() -> [Camera; 3] {
    let of = |keys: &[(&str, &str)]| {
        let mut all = vec![
            ("optics.focal_length_mm", "5.0"),
            ("optics.aperture_mm", "2.0"),
        ];
        all.extend(keys);
        camera(&all)
    };
    [
        of(&[]),
        of(&[
            ("timing.shutter", "\"rolling\""),
            ("timing.row_us", "400.0"),
        ]),
        of(&[
            (
                "optics.psf",
                "{ kind = \"moffat\", fwhm_px = 1.6, beta = 3.0 }",
            ),
            ("optics.projection.model", "\"brown-conrady\""),
            ("optics.projection.k", "[-2.0]"),
            ("optics.vignetting.cos4", "true"),
            ("optics.stray.pst", "[[10.0, 1e-4], [180.0, 1e-6]]"),
        ]),
    ]
}

/// From 622 km up: the day's limb, the night's, and the Moon; two objects before each. Places to 1e-11 and signal-to-noise ratios to 1e-9, relative, and each pixel to 1e-6 of its own light.
#[test]
fn turning_the_whole_sky_changes_nothing() {
    let bodies = Bodies::at(noon()).unwrap();
    let [sun, moon] = [bodies.sun_apparent_m(), bodies.moon_geocentric_m].map(|m| m.normalize());
    let aside = sun.cross(&Vector3::z()).normalize();
    // X-Val: asin(6378.137 / 7000): the limb's angle from straight down.
    let (sin, cos) = 65.67_f64.to_radians().sin_cos();
    let over = |up: Vector3<f64>| (up, aside * sin - up * cos);
    let looks = [over(sun), over(-sun), (moon, moon)];
    let looks = looks
        .iter()
        .flat_map(|(up, towards)| cameras().map(|camera| (camera, *up, *towards)));
    let looks = looks.map(|(camera, up, towards)| {
        let (r, v) = (up * 7000.0, up.cross(&aside) * 7.5);
        let object = |id: &str, off_km: Vector3<f64>, by_km_s: Vector3<f64>| {
            oem(id, noon(), falling(r + off_km, v + by_km_s))
        };
        let emulator = emulator(camera, Fidelity::REALTIME, |config| {
            config.choice.off = vec!["shot noise"];
            let slow = object("SLOW", towards * 300.0, aside * 0.01);
            let fast = object("FAST", (towards + aside * 0.02) * 200.0, up * 9.0 + aside);
            config.objects = [slow, fast].concat();
        });
        (
            emulator,
            orbiter(&crate::stage::towards(&towards), r * 1e3, v * 1e3),
        )
    });
    let looks: Vec<(Emulator, VehicleState)> = looks.collect();
    let [way, pixel] = [(); 2].map(|()| Worst::default());
    let lit = RefCell::new(BTreeSet::new());
    let rates = prop::array::uniform3(-1.0..1.0_f64);
    check(
        48,
        (0..looks.len(), rates, rotations()),
        |(which, rates, turn)| {
            let (emulator, vehicle) = &looks[which];
            let mut vehicle = vehicle.clone();
            vehicle.rates = Vector3::from(rates.map(f64::to_radians));
            let here = view(emulator, &vehicle);
            let there = turned(emulator, &here, &turn);
            let [here, there] = [here, there].map(|view| {
                let simulated = simulated(&view, emulator.fidelity(), &emulator.choice);
                Scene::new(view, simulated, emulator.fidelity())
            });
            prop_assert_eq!(here.simulated, there.simulated);
            prop_assert_eq!(here.sources.len(), there.sources.len());
            for (a, b) in here.sources.iter().zip(&there.sources) {
                prop_assert!((a.electrons - b.electrons).abs() <= 1e-9 * a.electrons);
                for (a, b) in [(a.start, b.start), (a.end, b.end), (a.centroid, b.centroid)] {
                    let miss = (a[0] - b[0]).hypot(a[1] - b[1]) / (1.0 + a[0].hypot(a[1]));
                    prop_assert!(way.of(miss) < 1e-11, "{:e}", miss);
                }
                prop_assert!((a.snr - b.snr).abs() <= 1e-9 * a.snr, "{} {}", a.snr, b.snr);
            }
            let [a, b] = [&here, &there].map(|scene| {
                let plan = Plan::new(scene, emulator.fidelity(), &emulator.choice);
                drawn(&plan, scene).expected_e.unwrap()
            });
            for (a, b) in a.iter().zip(&b) {
                let miss = (a - b).abs() / a.max(f32::MIN_POSITIVE);
                prop_assert!(pixel.of(f64::from(miss)) <= 1e-6, "{:e} {:e}", a, b);
            }
            let areas = here.areas.iter().filter(|area| area.electrons > 0.0);
            lit.borrow_mut().extend(areas.map(|area| area.kind.effect));
            let sources = here.sources.iter().filter(|source| source.electrons > 0.0);
            lit.borrow_mut()
                .extend(sources.map(|source| source.body.identity().0));
            Ok(())
        },
    );
    println!("places {way}, pixels {pixel} of their own light");
    let all = KINDS
        .iter()
        .map(|kind| kind.effect)
        .chain(["star", "rso", "Moon"]);
    assert_eq!(lit.into_inner(), all.collect());
}
