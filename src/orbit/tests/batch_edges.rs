//! The batch against scalar SGP4 at the bounds of the model's cases, up to a century from the
//! epoch.
//!
//! The sets are the same in every run. Random sets, for a minute:
//!
//!     cargo test --release -p skyloop-orbit --test orbit batch_edges -- --ignored --nocapture

use crate::support::{Tally, batch, samples};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use skyloop_orbit::elements::{Elements, MAX_ELAPSED_DAYS};
use std::cell::RefCell;
use std::f64::consts::{PI, TAU};

/// WGS72: Earth radius, km, and gravitational parameter, km^3/min^2.
const EARTH_KM: f64 = 6378.135;
const MU: f64 = 398_600.8 * 3600.0;
const CENTURY_MIN: f64 = MAX_ELAPSED_DAYS * 1440.0;

/// One of a few numbers, or a value close to one.
fn near(numbers: &'static [f64]) -> impl Strategy<Value = f64> {
    let offset = prop_oneof![Just(0.0), Just(1e-15), Just(1e-9), Just(1e-5), Just(1e-3)];
    (prop::sample::select(numbers), offset, any::<bool>())
        .prop_map(|(number, by, up)| number * (1.0 + if up { by } else { -by }))
}

/// Eccentricity, and the mean motion (rad/min) for it.
fn shapes() -> impl Strategy<Value = (f64, f64)> {
    let of_perigee = |(e, altitude_km): (f64, f64)| {
        let a: f64 = (EARTH_KM + altitude_km) / (1.0 - e);
        (e, (MU / (a * a * a)).sqrt())
    };
    let of_period = |(e, minutes): (f64, f64)| (e, TAU / minutes);
    let any_e = || {
        prop_oneof![
            Just(0.0),
            Just(1e-5),
            Just(1e-4),
            Just(0.99),
            0.0..0.3,
            0.3..0.99
        ]
    };
    let resonant_e = || {
        prop_oneof![
            near(&[0.5, 0.65, 0.7, 0.715]),
            0.5..0.8,
            Just(0.0),
            Just(0.99)
        ]
    };
    prop_oneof![
        (any_e(), near(&[98.0, 156.0, 220.0])).prop_map(of_perigee),
        (any_e(), -200.0..2000.0).prop_map(of_perigee),
        (any_e(), near(&[225.0])).prop_map(of_period),
        // Half a day, and the ends of its resonance: 0.00826 to 0.00924 rad/min.
        (resonant_e(), near(&[718.0, TAU / 0.00826, TAU / 0.00924])).prop_map(of_period),
        // A day: 0.0034906585 to 0.0052359877 rad/min.
        (
            any_e(),
            near(&[1436.0, TAU / 0.003_490_658_5, TAU / 0.005_235_987_7])
        )
            .prop_map(of_period),
        (any_e(), 80.0..20_000.0).prop_map(of_period),
    ]
}

fn inclinations() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(PI),
        near(&[63.4 * PI / 180.0, PI / 2.0]),
        // Lyddane's bound, and three degrees, a bound of the one-day resonance.
        near(&[0.2, 3.0 * PI / 180.0]),
        0.0..0.2,
        0.0..PI,
    ]
}

fn sets() -> impl Strategy<Value = Elements> {
    let angle = || prop_oneof![Just(0.0), 0.0..TAU];
    let drag = prop_oneof![
        Just(0.0),
        Just(-0.0),
        -1e-3..1e-3,
        -0.1..0.1,
        near(&[1e-4, -1e-4])
    ];
    (inclinations(), shapes(), angle(), angle(), angle(), drag).prop_map(
        |(inclination, (eccentricity, mean_motion), node, perigee, mean_anomaly, drag)| Elements {
            norad: 0,
            epoch: samples::epoch(),
            inclination: inclination.min(PI),
            node,
            eccentricity,
            perigee,
            mean_anomaly,
            mean_motion,
            drag,
        },
    )
}

fn times() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(-0.0),
        // Either side of a step of the resonance integrator.
        near(&[720.0, -720.0, 1440.0, -7200.0]),
        -2000.0..2000.0,
        -1e6..1e6,
        Just(CENTURY_MIN),
        Just(-CENTURY_MIN),
        -CENTURY_MIN..CENTURY_MIN,
    ]
}

/// Compares many small catalogues, each at one time.
fn hold(cases: u32, times: impl Strategy<Value = f64>, rng: TestRng) -> Tally {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let tally = RefCell::new(Tally::default());
    let catalogues = (prop::collection::vec(sets(), 1..20), times);
    TestRunner::new_with_rng(config, rng)
        .run(&catalogues, |(mut sets, minutes)| {
            sets.retain(|set| set.constants().is_ok());
            for (set, answer) in sets.iter().zip(batch(&sets, minutes)) {
                (tally.borrow_mut()).hold("a made-up set", set, minutes, &answer);
            }
            Ok(())
        })
        .unwrap();
    tally.into_inner()
}

fn fixed_seed() -> TestRng {
    TestRng::deterministic_rng(RngAlgorithm::ChaCha)
}

#[test]
fn bounds_of_the_models_cases_are_those_of_scalar_sgp4() {
    let tally = hold(2000, -20_000.0..20_000.0, fixed_seed());
    tally.print("two weeks");
    assert!(tally.states > 15_000);
    assert!(tally.sensitive.len() < tally.states / 50);
    assert!(tally.brinks.len() <= 1, "{:?}", tally.brinks);
    // Every failure that such sets can have occurs.
    assert!(tally.codes.keys().eq(&[1, 3, 4, 6]), "{:?}", tally.codes);
}

#[test]
fn states_over_a_century_agree_within_rounding() {
    let tally = hold(150, times(), fixed_seed());
    tally.print("a century");
    assert!(tally.states > 1000);
    assert!(tally.sensitive.len() < tally.states / 10);
    assert!(tally.brinks.is_empty(), "{:?}", tally.brinks);
}

#[test]
#[ignore = "a minute; other sets in every run"]
fn other_sets_than_before() {
    let seed = std::time::SystemTime::UNIX_EPOCH
        .elapsed()
        .unwrap()
        .as_nanos();
    println!("seed {seed}");
    let rng = || {
        let bytes: Vec<u8> = [seed, seed].map(u128::to_le_bytes).concat();
        TestRng::from_seed(RngAlgorithm::ChaCha, &bytes)
    };
    hold(30_000, -20_000.0..20_000.0, rng()).print("two weeks");
    hold(2000, times(), rng()).print("a century");
}
