//! The batch against scalar SGP4 on whole catalogues, up to a year from each epoch.
//!
//! Public catalogues are read from the folder `SKYLOOP_CATALOGUES`, or from `../shared/data/tle`
//! next to the repository. Without them synthetic sets are used.

use crate::support::{Answer, DECAYED, Tally, answers, batch, samples, scalar};
use skyloop_orbit::elements::Elements;
use skyloop_orbit::sgp4_batch::{Batch, States, TOO_FAR};
use skyloop_orbit::time::parse_utc;
use std::process::Command;

/// Days from each epoch, with both signs of zero.
const DAYS: [f64; 10] = [-365.0, -30.0, -7.0, -1.0, -0.0, 0.0, 1.0, 7.0, 30.0, 365.0];

#[test]
fn states_of_the_catalogues_agree_with_scalar_sgp4() {
    for (name, sets) in samples::catalogues() {
        let mut tally = Tally::default();
        for days in DAYS {
            let answers = batch(&sets, days * 1440.0);
            for (set, answer) in sets.iter().zip(&answers) {
                let label = format_args!("{} at {days} d", set.norad);
                tally.hold(label, set, days * 1440.0, answer);
            }
        }
        tally.print(format_args!("{name}, {} sets", sets.len()));
        // Sensitive states are near decay or far from their epoch.
        assert!(tally.states > sets.len() * DAYS.len() * 8 / 10);
        assert!(tally.sensitive.len() <= tally.states / 500);
        // One object has a negative radius.
        assert!(tally.brinks.len() <= 1, "{:?}", tally.brinks);
    }
}

#[test]
fn failures_of_the_catalogues_are_those_of_the_reference() {
    let catalogues = samples::catalogues();
    for known in samples::catalogue_codes() {
        let name = known.catalogue;
        let Some((_, sets)) = catalogues.iter().find(|(one, _)| one == name) else {
            samples::not_tested(&format!("error codes of {name}, which is not there"));
            continue;
        };
        assert_eq!(sets.len(), known.sets, "{name} is another file");
        let mut failures = 0;
        for (days, codes) in &known.days {
            let answers = batch(sets, days * 1440.0);
            for ((set, expected), answer) in sets.iter().zip(codes).zip(answers) {
                let found = answer.err().unwrap_or(0);
                assert_eq!(found, *expected, "{name}: {} at {days} d", set.norad);
                failures += usize::from(found != 0);
            }
        }
        println!(
            "{name}: {} answers, {failures} failures, all as the reference's",
            known.days.len() * known.sets
        );
        assert!(failures > 200);
    }
}

/// Where a folder is named but empty, tests fail with instructions.
#[test]
fn a_named_folder_without_catalogues_fails() {
    let empty = std::env::temp_dir().join(format!("skyloop-no-catalogues-{}", std::process::id()));
    std::fs::create_dir_all(&empty).unwrap();
    for folder in [empty.clone(), empty.join("nowhere")] {
        let run = Command::new(std::env::current_exe().unwrap())
            .arg("failures_of_the_catalogues_are_those_of_the_reference")
            .env(samples::FOLDER, &folder)
            .output()
            .unwrap();
        let output = String::from_utf8_lossy(&run.stdout);
        assert!(!run.status.success(), "{output}");
        assert!(output.contains("no public catalogue"), "{output}");
    }
    std::fs::remove_dir(empty).unwrap();
}

#[test]
fn states_of_synthetic_sets_agree_with_scalar_sgp4() {
    let synthetic = samples::synthetic();
    let sets: Vec<Elements> = synthetic.iter().map(|one| one.set).collect();
    let mut tally = Tally::default();
    for days in DAYS {
        for (one, answer) in synthetic.iter().zip(batch(&sets, days * 1440.0)) {
            let label = format_args!("{}, {}", one.set.norad, one.kind);
            tally.hold(label, &one.set, days * 1440.0, &answer);
        }
    }
    tally.print(format_args!("{} made-up sets", sets.len()));
    assert!(tally.states > 4000);
    assert!(tally.sensitive.len() <= 40);
    assert!(tally.brinks.len() <= 1, "{:?}", tally.brinks);
}

#[test]
fn failures_of_synthetic_sets_are_those_of_the_reference() {
    let synthetic = samples::synthetic();
    let sets: Vec<Elements> = synthetic.iter().map(|one| one.set).collect();
    let (mut failures, mut unseen) = (0, 0);
    for (i, days) in samples::DAYS.iter().enumerate() {
        for (one, answer) in synthetic.iter().zip(batch(&sets, days * 1440.0)) {
            let code = |answer: Answer| answer.err().unwrap_or(0);
            let (found, expected) = (code(answer), one.codes[i]);
            let label = format_args!("{}, {} at {days} d", one.set.norad, one.kind);
            assert_eq!(found, expected, "{label}");
            failures += usize::from(expected != 0);
            // Scalar SGP4 does not detect a negative radius.
            let scalar = code(scalar(&one.set, days * 1440.0));
            assert!(
                scalar == expected || (scalar, expected) == (0, DECAYED),
                "{label}: {scalar}"
            );
            unseen += usize::from(scalar != expected);
        }
    }
    println!("{failures} failures, {unseen} of them not detected by scalar SGP4");
    assert!(failures > 500 && unseen < 20);
}

#[test]
fn an_instant_equals_minutes_after_each_epoch() {
    let synthetic = samples::synthetic();
    let sets: Vec<Elements> = synthetic.iter().map(|one| one.set).collect();
    let mut batch = Batch::new(&sets).unwrap();
    let (mut states, mut tally) = (States::default(), Tally::default());
    // Next to a leap second, before and after all epochs, and too far from most of them.
    for utc in [
        "2016-12-31T23:59:59.999Z",
        "2017-01-01T00:00:00.000Z",
        "1970-01-01T00:00:00.000Z",
        "2026-07-11T12:34:56.789Z",
        "2110-01-01T00:00:00.000Z",
    ] {
        let t = parse_utc(utc).unwrap();
        batch.propagate(t, &mut states);
        for (one, answer) in synthetic.iter().zip(answers(&batch, &states)) {
            let label = format_args!("{}, {}, at {utc}", one.set.norad, one.kind);
            tally.hold(label, &one.set, one.set.minutes_to(t), &answer);
        }
    }
    tally.print("instants");
    assert!(tally.states > 1500);
    assert!(tally.codes[&TOO_FAR] > 200);
    assert!(tally.brinks.is_empty(), "{:?}", tally.brinks);
}
