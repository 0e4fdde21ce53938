//! Prints Table A1 of Clark et al. 2021 with skyloop's pixels and the paper's.

mod table;

use table::{Pixel, Row, distance, mean, mean_distances, reproduce, scene};

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
    println!("\nmean distance, px               stars   RSOs");
    for (name, [stars, rsos]) in mean_distances(&fitted, &predicted) {
        println!("{name:30}  {stars:5.2}  {rsos:5.2}");
    }
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

fn pixel(pixel: Option<Pixel>) -> String {
    pixel.map_or(format!("{:^14}", "-"), |[x, y]| format!("{x:6.2}, {y:6.2}"))
}
