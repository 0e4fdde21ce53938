//! A whole catalogue before a camera: the same frames whichever way its orbits are worked out.

use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Orbits;
use skyloop::flight;
use skyloop::label::Label;
use skyloop::orbit::synth::population;
use skyloop::sky::photometry::Sphere;
use skyloop::sky::population::Look;
use std::collections::BTreeSet;

const OBJECTS: usize = 20_000;
const FRAMES: u32 = 12;

/// Labels of the built-in scene's camera before a synthetic catalogue; every third object is as large as a house.
fn labels(orbits: Orbits, off: Option<&'static str>) -> Vec<Label> {
    let mut config = Config::builtin().unwrap();
    let mission = flight::mission(&config).unwrap();
    let start = flight::vehicle(&mission, 0).unwrap();
    config.fidelity.orbits = orbits;
    config.objects.clear();
    for (i, one) in population(OBJECTS, 7, start.epoch).into_iter().enumerate() {
        let diameter_m = if i % 3 == 0 { 10.0 } else { one.diameter_m };
        let sphere = Sphere {
            diameter_m,
            ..Sphere::default()
        };
        let object = one.object();
        config.looks.insert(object.id.clone(), Look::Sphere(sphere));
        config.objects.push(object);
    }
    let mut emulator = Emulator::new(&mut config);
    emulator.choice.off = vec!["stars", "zodiacal light", "limb", "earth", "starlight"];
    emulator.choice.off.extend(off);
    // Forward, and back again: a jump in time.
    let numbers = (0..FRAMES).chain([3, 40]);
    let vehicles = numbers.map(|number| flight::vehicle(&mission, number).unwrap());
    vehicles
        .map(|vehicle| emulator.shoot(&vehicle, 0).unwrap().label)
        .collect()
}

#[test]
fn tracks_sgp4_in_lanes_and_the_scalar_sgp4_give_the_same_labels() {
    let [tracked, exact, scalar] =
        [Orbits::Tracked, Orbits::Exact, Orbits::Scalar].map(|orbits| labels(orbits, None));
    let (mut compared, mut worst_px) = (0, 0.0f64);
    for ((tracked, exact), scalar) in tracked.iter().zip(&exact).zip(&scalar) {
        // To the last bit: tracks only say whom to ask.
        assert_eq!(tracked, exact);
        assert_eq!(exact.unseen, scalar.unseen);
        assert_eq!(exact.objects.len(), scalar.objects.len());
        for (a, b) in exact.objects.iter().zip(&scalar.objects) {
            assert_eq!((&a.id, &a.reason), (&b.id, &b.reason));
            let off = (a.x_px - b.x_px).hypot(a.y_px - b.y_px);
            worst_px = worst_px.max(off);
            compared += 1;
        }
    }
    println!("{compared} objects: at most {worst_px:.1e} px");
    assert!(worst_px <= 1e-6, "{worst_px} px");
    assert!(compared > 500, "{compared}");
}

#[test]
fn whoever_is_before_the_camera_stands_in_the_label_once() {
    for label in labels(Orbits::Tracked, None) {
        let seen = label.objects.iter().map(|object| &object.id);
        let unseen = label.unseen.values().flatten();
        let ids: Vec<&String> = seen.chain(unseen).collect();
        let once: BTreeSet<&String> = ids.iter().copied().collect();
        assert_eq!(ids.len(), once.len());
        assert!(label.unseen.contains_key("too faint"));
    }
}

#[test]
fn without_read_noise_fewer_are_too_faint() {
    let faint = |off| -> usize {
        let labels = labels(Orbits::Tracked, off);
        labels
            .iter()
            .map(|label| label.unseen["too faint"].len())
            .sum()
    };
    let (read, noiseless) = (faint(None), faint(Some("read noise")));
    assert!(noiseless < read, "{noiseless} {read}");
}
