//! The key `fidelity` of a configuration: a preset, or single tolerances.

use crate::table::check_refusals;
use skyloop::config::{Config, OnOverrun, Run};
use skyloop::fidelity::{Allowed, Fidelity, Orbits, PRESETS, TOLERANCES};
use skyloop::load::Folder;

fn parse(text: &str) -> Result<Config, String> {
    Config::parse("run.toml", text, &Folder::current()).map_err(|error| error.to_string())
}

fn read(text: &str) -> Result<Fidelity, String> {
    parse(text).map(|config| config.fidelity)
}

#[test]
fn presets_and_single_tolerances_are_read() {
    assert_eq!(read("").unwrap(), Fidelity::REALTIME);
    for (name, fidelity) in PRESETS {
        for key in ["fidelity", "fidelity.preset"] {
            let text = format!("{key} = \"{name}\"");
            assert_eq!(read(&text).unwrap(), *fidelity, "{text}");
        }
    }
    let turned = read("[fidelity]\nwing_e = 1\npreset = \"fast\"\norbits = \"exact\"").unwrap();
    let wanted = Fidelity {
        wing_e: 1.0,
        orbits: Orbits::Exact,
        ..Fidelity::FAST
    };
    assert_eq!(turned, wanted);
}

#[test]
fn every_tolerance_accepts_only_its_range() {
    for tolerance in TOLERANCES {
        for (name, fidelity) in PRESETS {
            let value = (tolerance.get)(fidelity);
            let text = match tolerance.allowed {
                Allowed::Numbers(_) => format!("fidelity.{} = {value}", tolerance.name),
                Allowed::Words(_) => format!("fidelity.{} = \"{value}\"", tolerance.name),
            };
            let read = read(&text).unwrap_or_else(|error| panic!("{name}, {text}: {error}"));
            assert_eq!((tolerance.get)(&read), value, "{text}");
        }
        let Allowed::Numbers([min, max]) = tolerance.allowed else {
            continue;
        };
        assert!(min < max, "{}", tolerance.name);
        for beyond in [max * 1.01, -1.0, f64::NAN] {
            let (name, value) = (tolerance.name, format!("{beyond:?}").to_lowercase());
            let error = read(&format!("[fidelity]\n{name} = {value}")).unwrap_err();
            let key = format!("run.toml:2:{}: fidelity.{name} = ", name.len() + 4);
            let is_range_given = error.starts_with(&key) && error.contains(&format!(" to {max}"));
            assert!(is_range_given, "{error}");
        }
    }
}

const REFUSED: &str = r#"
fidelity = "best" | fidelity = "best" | one of fast, realtime, reference
[fidelity]\npreset = "best" | fidelity.preset = "best" | one of fast, realtime, reference
[fidelity]\nwings_e = 1 | run.toml:2:1: fidelity.wings_e: unknown key `wings_e` | `wing_e`
[fidelity]\nquality = 9 | unknown key `quality`, known: preset, psf_loss,  | , orbits
[fidelity]\nwing_e = "much" | run.toml:2:10: fidelity.wing_e = "much":  | must be 0.001 to 1000 e-
[fidelity]\norbits = "guessed" | fidelity.orbits = "guessed" | one of tracked, exact, scalar
[fidelity]\norbits = 1 | run.toml:2:10: fidelity.orbits = 1 | one of tracked, exact, scalar
fidelity = 3 | run.toml:1:12: fidelity: must be one of "fast", "realtime", "reference" or a table of keys | not 3
[run]\ncoarsen = [] | run.coarsen = [] | at least one
[run]\ncoarsen = ["faster"] | run.coarsen[0] = "faster" | one of fast, realtime, reference, or a tolerance
[run]\ncoarsen = ["fast", "wings_e = 1"] | run.coarsen[1]: unknown tolerance `wings_e` | `wing_e`
[run]\ncoarsen = ["psf_loss = 2"] | run.coarsen[0]: psf_loss = 2 | to 0.01
[run]\ncoarsen = ["wing_e = much"] | run.coarsen[0]: wing_e = "much" | 0.001 to 1000 e-
[run]\non_overrun = "hurry" | run.on_overrun: must be | coarsen
"#;

#[test]
fn invalid_values_are_refused() {
    check_refusals(REFUSED, |text| {
        let error = read(text).unwrap_err();
        assert_eq!(error.lines().count(), 1, "{error}");
        error
    });
}

/// The fidelities after each step of `run.coarsen`.
fn coarsened(run: &Run, fidelity: Fidelity) -> Vec<Fidelity> {
    let steps = run.coarsen.iter().scan(fidelity, |before, step| {
        *before = step.than(before);
        Some(*before)
    });
    steps.collect()
}

#[test]
fn steps_for_late_frames_keep_their_order() {
    let usual = parse("").unwrap().run;
    assert_eq!(usual.on_overrun, OnOverrun::Late);
    assert_eq!(coarsened(&usual, Fidelity::REALTIME), [Fidelity::FAST]);
    let text = "fidelity = \"reference\"\n[run]\non_overrun = \"coarsen\"\n\
                coarsen = [\"orbits = tracked\", \"realtime\", \"wing_e = 0.5\", \"skip_px=0.1\"]";
    let run = parse(text).unwrap().run;
    assert_eq!(run.on_overrun, OnOverrun::Coarsen);
    let wing_e = 0.5;
    let wanted = [
        Fidelity {
            orbits: Orbits::Tracked,
            ..Fidelity::REFERENCE
        },
        Fidelity::REALTIME,
        Fidelity {
            wing_e,
            ..Fidelity::REALTIME
        },
        Fidelity {
            wing_e,
            skip_px: 0.1,
            ..Fidelity::REALTIME
        },
    ];
    assert_eq!(coarsened(&run, Fidelity::REFERENCE), wanted);
}

#[test]
fn labels_list_differences_from_the_nearest_preset() {
    for (name, fidelity) in PRESETS {
        assert_eq!(fidelity.nearest_preset(), (*name, Vec::new()));
    }
    let turned = Fidelity {
        wing_e: 0.5,
        orbits: Orbits::Scalar,
        ..Fidelity::REALTIME
    };
    let (preset, tolerances) = turned.nearest_preset();
    assert_eq!((preset, tolerances.len()), ("realtime", 1));
    let (name, value) = (tolerances[0].0, tolerances[0].1.to_string());
    assert_eq!((name, value.as_str()), ("wing_e", "0.5"));
}
