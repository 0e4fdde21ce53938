//! The batch against the scalar twin on whole catalogues, up to a year from each epoch.
//!
//! Public catalogues are read where they are: in the folder that `SKYLOOP_CATALOGUES` names, else in
//! `../shared/data/tle` beside the repository. Everywhere else the made-up sets stand for them.

use crate::support::{Answer, DECAYED, Tally, answers, batch, samples, scalar};
use skyloop_orbit::elements::Elements;
use skyloop_orbit::sgp4_batch::{Batch, States, TOO_FAR};
use skyloop_orbit::time::parse_utc;
use std::process::Command;

/// Days from each epoch; both signs of zero.
const DAYS: [f64; 10] = [-365.0, -30.0, -7.0, -1.0, -0.0, 0.0, 1.0, 7.0, 30.0, 365.0];

#[test]
fn every_object_of_the_catalogues_is_where_the_scalar_twin_has_it() {
    for (name, sets) in samples::catalogues() {
        let mut tally = Tally::default();
        for days in DAYS {
            let answers = batch(&sets, days * 1440.0);
            for (set, answer) in sets.iter().zip(&answers) {
                let what = format_args!("{} at {days} d", set.norad);
                tally.hold(what, set, days * 1440.0, answer);
            }
        }
        tally.print(format_args!("{name}, {} sets", sets.len()));
        // what the last digit moves is near decay or far from its epoch
        assert!(tally.states > sets.len() * DAYS.len() * 8 / 10);
        assert!(tally.sensitive.len() <= tally.states / 500);
        // the one whose radius is negative
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

/// A folder without catalogues is no proof: where one is named, tests fail and say how to give them.
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
        let said = String::from_utf8_lossy(&run.stdout);
        assert!(!run.status.success(), "{said}");
        assert!(said.contains("no public catalogue"), "{said}");
    }
    std::fs::remove_dir(empty).unwrap();
}

#[test]
fn made_up_sets_are_where_the_scalar_twin_has_them() {
    let synthetic = samples::synthetic();
    let sets: Vec<Elements> = synthetic.iter().map(|one| one.set).collect();
    let mut tally = Tally::default();
    for days in DAYS {
        for (one, answer) in synthetic.iter().zip(batch(&sets, days * 1440.0)) {
            let what = format_args!("{}, {}", one.set.norad, one.kind);
            tally.hold(what, &one.set, days * 1440.0, &answer);
        }
    }
    tally.print(format_args!("{} made-up sets", sets.len()));
    assert!(tally.states > 4000);
    assert!(tally.sensitive.len() <= 40);
    assert!(tally.brinks.len() <= 1, "{:?}", tally.brinks);
}

#[test]
fn failures_of_made_up_sets_are_those_of_the_reference() {
    let synthetic = samples::synthetic();
    let sets: Vec<Elements> = synthetic.iter().map(|one| one.set).collect();
    let (mut failures, mut unseen) = (0, 0);
    for (i, days) in samples::DAYS.iter().enumerate() {
        for (one, answer) in synthetic.iter().zip(batch(&sets, days * 1440.0)) {
            let code = |answer: Answer| answer.err().unwrap_or(0);
            let (found, expected) = (code(answer), one.codes[i]);
            let what = format_args!("{}, {} at {days} d", one.set.norad, one.kind);
            assert_eq!(found, expected, "{what}");
            failures += usize::from(expected != 0);
            // the twin does not see that a radius is negative
            let twin = code(scalar(&one.set, days * 1440.0));
            assert!(
                twin == expected || (twin, expected) == (0, DECAYED),
                "{what}: {twin}"
            );
            unseen += usize::from(twin != expected);
        }
    }
    println!("{failures} failures, {unseen} of them not seen by the scalar twin");
    assert!(failures > 500 && unseen < 20);
}

#[test]
fn an_instant_is_so_many_minutes_after_each_epoch() {
    let synthetic = samples::synthetic();
    let sets: Vec<Elements> = synthetic.iter().map(|one| one.set).collect();
    let mut batch = Batch::new(&sets).unwrap();
    let (mut states, mut tally) = (States::default(), Tally::default());
    // beside a leap second, before and after all epochs, and too far from most of them
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
            let what = format_args!("{}, {}, at {utc}", one.set.norad, one.kind);
            tally.hold(what, &one.set, one.set.minutes_to(t), &answer);
        }
    }
    tally.print("instants");
    assert!(tally.states > 1500);
    assert!(tally.codes[&TOO_FAR] > 200);
    assert!(tally.brinks.is_empty(), "{:?}", tally.brinks);
}
