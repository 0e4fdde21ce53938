//! The paper's Table A1, reproduced by frames of skyloop.

#[path = "../../examples/table_a1/table.rs"]
mod table;

use skyloop::attitude::Attitude;
use skyloop::config::Config;
use table::{distance, mean, mean_distances, reproduce, scene};

#[test]
fn distances_to_sbois_are_those_of_the_documents() {
    let fitted = reproduce(scene('B').unwrap()).unwrap();
    assert_eq!(fitted.len(), 36);
    let distances = mean_distances(&fitted, &reproduce(scene('A').unwrap()).unwrap());
    let [(_, [stars, rsos]), (_, [_, predicted]), ..] = distances;
    assert!(stars <= 0.2, "stars: {stars} px");
    assert!(rsos <= 0.5, "RSOs, set B: {rsos} px");
    assert!(predicted <= 4.2, "RSOs, set A: {predicted} px");
    for (name, [stars, rsos]) in distances {
        let row = format!("| {name} | {stars:.2} | {rsos:.2} |");
        assert!(
            include_str!("../../docs/explanation/accuracy.md")
                .lines()
                .any(|line| line == row),
            "docs/explanation/accuracy.md lacks the row {row}"
        );
    }
}

#[test]
fn the_papers_own_distances_are_reproduced() {
    let rows = reproduce(scene('B').unwrap()).unwrap();
    // X-Val: recomputed from the printed pixels and errors: STK-EOIR 6.98 as printed, 6.84
    // corrected.
    let printed = mean(&rows, |row| {
        Some(row.stk_error_printed[0].hypot(row.stk_error_printed[1]))
    });
    let corrected = mean(&rows, |row| Some(distance(row.stk, row.fai)));
    assert!(
        (printed - 6.98).abs() < 0.005 && (corrected - 6.84).abs() < 0.005,
        "{printed} {corrected}"
    );
    // X-Val: SBOIS, RSOs, 5.63.
    let sbois = mean(rows.iter().filter(|row| !row.is_star()), |row| {
        row.sbois.map(|sbois| distance(sbois, row.fai))
    });
    assert!((sbois - 5.63).abs() < 0.005, "{sbois}");
}

/// The check can fail: 0.1 degree is 0.93 px at a focal length of 530.8 px.
#[test]
fn a_tenth_of_a_degree_moves_the_star_columns() {
    let turned = |config: &mut Config| {
        let sequence = config.sequence.as_mut().unwrap();
        let first = &mut sequence.attitudes[0].attitude;
        let about_y = Attitude::identity().turned(&[0.0, 0.1f64.to_radians(), 0.0].into(), 1.0);
        *first = first.then(&about_y);
    };
    let straight = reproduce(scene('B').unwrap()).unwrap();
    let mut config = scene('B').unwrap();
    turned(&mut config);
    let moved = reproduce(config).unwrap();
    let stars = straight.iter().zip(&moved).filter(|(row, _)| row.is_star());
    for (before, after) in stars {
        let shift = distance(before.ours, after.ours);
        // Away from the axis a pixel covers a slightly smaller angle: 0.93 to 0.96 px.
        let expected = if before.epoch == "23:35:50" {
            0.94
        } else {
            0.0
        };
        assert!(
            (shift - expected).abs() < 0.03,
            "{} {}: {shift}",
            before.epoch,
            before.object
        );
    }
}
