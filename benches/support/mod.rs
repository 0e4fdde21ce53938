//! A report and its promises, as a program.

use skyloop::measure::Report;
use std::process::ExitCode;

/// Measures and prints; fails where a promise is not kept.
pub fn kept<R: Report>() -> ExitCode {
    let report = R::measure(|part| eprintln!("{part} ...")).unwrap();
    print!("{report}");
    let broken = report.broken();
    for promise in &broken {
        println!("NOT kept: {promise}");
    }
    if broken.is_empty() {
        println!("all promises kept");
    }
    ExitCode::from(u8::from(!broken.is_empty()))
}
