//! The batch against the verification cases of AIAA 2006-6753, the scalar twin, and PyPI sgp4's error codes.

mod support;

use support::{Answer, Tally, batch, distance, samples, scalar};

/// Last digits of the published vectors, and another order of operations: km, km/s.
const PUBLISHED: (f64, f64) = (5e-6, 2e-9);

fn answer(case: &samples::Case, minutes: f64) -> Answer {
    batch(&[case.set], minutes).remove(0)
}

#[test]
fn published_vectors_are_met() {
    let (mut worst, mut tally) = ((0.0_f64, 0.0_f64), Tally::default());
    let mut compared = 0;
    for case in samples::verification() {
        for [minutes, x, y, z, vx, vy, vz] in &case.vectors {
            let answer = answer(&case, *minutes);
            let state =
                answer.unwrap_or_else(|code| panic!("{} at {minutes} min: {code}", case.name));
            let (km, km_s) = distance(&state, &([*x, *y, *z], [*vx, *vy, *vz]));
            assert!(
                km <= PUBLISHED.0 && km_s <= PUBLISHED.1,
                "{} at {minutes} min: {km:e} km, {km_s:e} km/s",
                case.name
            );
            worst = (worst.0.max(km), worst.1.max(km_s));
            tally.hold(&case.name, &case.set, *minutes, &answer);
            compared += 1;
        }
    }
    println!(
        "published vectors: at most {:.2e} km, {:.2e} km/s",
        worst.0, worst.1
    );
    tally.print("against the scalar twin");
    assert_eq!(compared, 666);
    assert!(tally.sensitive.is_empty(), "{:?}", tally.sensitive);
    assert!(tally.brinks.is_empty(), "{:?}", tally.brinks);
}

#[test]
fn error_codes_are_those_of_the_reference() {
    let (mut steps, mut failures) = (0, 0);
    for case in samples::verification() {
        for (minutes, code) in &case.codes {
            let found = answer(&case, *minutes).err().unwrap_or(0);
            let twin = scalar(&case.set, *minutes).err().unwrap_or(0);
            assert_eq!(
                found, *code,
                "{} at {minutes} min, scalar {twin}",
                case.name
            );
            failures += usize::from(*code != 0);
            steps += 1;
        }
    }
    println!("{steps} steps, {failures} failures");
}
