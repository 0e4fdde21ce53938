//! `docs/explanation/cost.md` has the bounds of the knobs, and all pages the same figures of what `reference` takes.

use super::{DEFAULT_TOML, TOLERANCES, Value, cells, section};
use skyloop::fidelity::{Fidelity, Tolerance};

const COST: &str = include_str!("../../docs/explanation/cost.md");

/// The rows of a section's first table.
fn rows(heading: &str) -> Vec<Vec<&'static str>> {
    let lines = section(COST, heading).lines();
    let table = lines.skip_while(|line| !line.starts_with("| "));
    let rows = table.take_while(|line| line.starts_with('|')).skip(2);
    rows.map(cells).collect()
}

/// What a preset's value of a knob stands for, with so many digits as the table has.
fn bound(tolerance: &Tolerance, preset: &Fidelity) -> String {
    let bound = match (tolerance.get)(preset) {
        Value::Number(value) => (tolerance.bound)(value),
        Value::Word(_) => (tolerance.bound)(0.0),
    };
    format!("{bound:.1e}")
}

#[test]
fn the_table_of_knobs_has_their_bounds() {
    let rows = rows("## What each tolerance bounds, and what is measured");
    // It says itself why that one is not among them.
    let tolerances: Vec<&Tolerance> = TOLERANCES
        .iter()
        .filter(|of| of.name != "poisson_tv")
        .collect();
    assert_eq!(rows.len(), tolerances.len());
    for (row, tolerance) in rows.iter().zip(tolerances) {
        assert_eq!(row[0].split('`').nth(1), Some(tolerance.name));
        for (at, preset) in [(2, Fidelity::FAST), (4, Fidelity::REALTIME)] {
            let [said, measured]: [f64; 2] = [at, at + 1].map(|at| row[at].parse().unwrap());
            assert_eq!(
                format!("{said:.1e}"),
                bound(tolerance, &preset),
                "{}",
                tolerance.name
            );
            let is_near = measured <= said && said <= 10.0 * measured;
            assert!(is_near, "{}: {measured} of {said}", tolerance.name);
        }
    }
}

#[test]
fn all_say_how_long_reference_takes() {
    // Median times of `realtime` and `reference`, ms.
    let ratios = rows("## What it says").into_iter().map(|row| {
        let ms = |cell: &str| -> f64 { cell.split(' ').next().unwrap().parse().unwrap() };
        ms(row[3]) / ms(row[2])
    });
    let [least, most] = ratios.fold([f64::MAX, 0.0], |[least, most], ratio| {
        [ratio.min(least), ratio.max(most)]
    });
    let said = format!("takes {least:.1} to {most:.1} times as long");
    assert!(COST.contains(&format!("`reference` {said}")), "{said}");
    assert!(DEFAULT_TOML.contains(&said), "{said}");
}
