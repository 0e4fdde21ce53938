//! Prints Table A1 of Clark et al. 2021 with skyloop's pixels beside the paper's.

mod table;

use table::{Pixel, Row, distance, mean, reproduce, scene};

fn main() -> anyhow::Result<()> {
    let fitted = reproduce(scene('B')?)?;
    println!(
        "Clark et al. 2021 (Sensors 21, 7868), Table A1: pixels (column, row) on the FAI detector."
    );
    println!(
        "Ours: state set B. SBOIS y of HR6195 at 23:36:00 is mended (172.8, printed 171.8).\n"
    );
    println!("epoch     object        ours            SBOIS           STK-EOIR        FAI");
    for row in &fitted {
        println!(
            "{}  {:7}  {}  {}  {}  {}",
            row.epoch,
            row.object,
            pixel(Some(row.ours)),
            pixel(row.sbois),
            pixel(Some(row.stk)),
            pixel(Some(row.fai))
        );
    }
    let predicted = reproduce(scene('A')?)?;
    println!("\nmean distance, px          stars   RSOs");
    let to_sbois = |row: &Row| row.sbois.map(|sbois| distance(row.ours, sbois));
    by_kind("ours (set B) to SBOIS", &fitted, to_sbois);
    by_kind("ours (set A) to SBOIS", &predicted, to_sbois);
    by_kind("ours (set B) to FAI", &fitted, |row| {
        Some(distance(row.ours, row.fai))
    });
    by_kind("ours (set A) to FAI", &predicted, |row| {
        Some(distance(row.ours, row.fai))
    });
    // The misprint of HR6195 moved both its pixel and its distance: undone for the printed comparison.
    by_kind("SBOIS to FAI", &fitted, |row| {
        let printed = row.sbois.map(|[x, y]| {
            if is_misprint(row) {
                [x, y - 1.0]
            } else {
                [x, y]
            }
        });
        printed.map(|sbois| distance(sbois, row.fai))
    });
    by_kind("STK-EOIR to FAI", &fitted, |row| {
        Some(distance(row.stk, row.fai))
    });
    let all = |value: &dyn Fn(&Row) -> f64| mean(&fitted, |row| Some(value(row)));
    println!(
        "\nSTK-EOIR to FAI, all rows: {:.2} by the errors as printed, {:.2} by the pixels (misprints mended)",
        all(&|row| row.stk_error_printed[0].hypot(row.stk_error_printed[1])),
        all(&|row| distance(row.stk, row.fai))
    );
    println!(
        "\nSet B was fitted to the table's SBOIS columns (one along-track time an object): agreement there is a\n\
         consistency check. Set A comes from public elements alone: agreement there is a prediction. The\n\
         attitudes of both were fitted to the SBOIS star columns."
    );
    Ok(())
}

fn is_misprint(row: &Row) -> bool {
    row.epoch == "23:36:00" && row.object == "HR6195"
}

fn pixel(pixel: Option<Pixel>) -> String {
    pixel.map_or(format!("{:^14}", "-"), |[x, y]| format!("{x:6.2}, {y:6.2}"))
}

fn by_kind(name: &str, rows: &[Row], value: impl Fn(&Row) -> Option<f64>) {
    let stars = mean(rows.iter().filter(|row| row.is_star()), &value);
    let rsos = mean(rows.iter().filter(|row| !row.is_star()), &value);
    println!("{name:25}  {stars:5.2}  {rsos:5.2}");
}
