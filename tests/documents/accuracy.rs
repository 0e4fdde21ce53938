//! `docs/explanation/cost.md` has the error bounds of the tolerances, and all pages agree on the
//! time of `reference`.

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

/// The error bound of a preset's tolerance, with as many digits as in the table.
fn bound(tolerance: &Tolerance, preset: &Fidelity) -> String {
    let bound = match (tolerance.get)(preset) {
        Value::Number(value) => (tolerance.bound)(value),
        Value::Word(_) => (tolerance.bound)(0.0),
    };
    format!("{bound:.1e}")
}

#[test]
fn the_table_of_tolerances_has_their_bounds() {
    let rows = rows("## What each tolerance bounds, and what is measured");
    // The page explains why this one is missing.
    let tolerances: Vec<&Tolerance> = TOLERANCES
        .iter()
        .filter(|of| of.name != "poisson_tv")
        .collect();
    assert_eq!(rows.len(), tolerances.len());
    for (row, tolerance) in rows.iter().zip(tolerances) {
        assert_eq!(row[0].split('`').nth(1), Some(tolerance.name));
        for (at, preset) in [(2, Fidelity::FAST), (4, Fidelity::REALTIME)] {
            let [listed, measured]: [f64; 2] = [at, at + 1].map(|at| row[at].parse().unwrap());
            assert_eq!(
                format!("{listed:.1e}"),
                bound(tolerance, &preset),
                "{}",
                tolerance.name
            );
            let is_near = measured <= listed && listed <= 10.0 * measured;
            assert!(is_near, "{}: {measured} of {listed}", tolerance.name);
        }
    }
}

#[test]
fn all_pages_agree_on_the_time_of_reference() {
    // Median times of `realtime` and `reference`, ms.
    let ratios = rows("## What it says").into_iter().map(|row| {
        let ms = |cell: &str| -> f64 { cell.split(' ').next().unwrap().parse().unwrap() };
        ms(row[3]) / ms(row[2])
    });
    let [min, max] = ratios.fold([f64::MAX, 0.0], |[min, max], ratio| {
        [ratio.min(min), ratio.max(max)]
    });
    let text = format!("takes {min:.1} to {max:.1} times as long");
    assert!(COST.contains(&format!("`reference` {text}")), "{text}");
    assert!(DEFAULT_TOML.contains(&text), "{text}");
}
