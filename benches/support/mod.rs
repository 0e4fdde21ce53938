//! Runs a report and checks its limits.

use skyloop::measure::{Report, Row};
use std::process::ExitCode;

/// Measures and prints a report, with `more` rows; fails where a limit is not met.
pub fn report<R: Report>(more: &[Row]) -> ExitCode {
    let report = R::measure(|part| eprintln!("{part} ...")).unwrap();
    print!("{report}");
    more.iter().for_each(|row| println!("{row}"));
    let mut broken = report.broken();
    broken.extend(more.iter().filter_map(Row::broken));
    for promise in &broken {
        println!("NOT met: {promise}");
    }
    if broken.is_empty() {
        println!("all promises kept");
    }
    ExitCode::from(u8::from(!broken.is_empty()))
}
