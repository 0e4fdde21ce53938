//! What frames take, and whether it is as promised: the figures of `skyloop bench frame`.
//!
//! `cargo bench --bench frame`, on a quiet machine. Ends with 1 where a promise is not kept.

use mimalloc::MiMalloc;
use skyloop::measure::frames::Report;

/// As in the program.
#[global_allocator]
static MEMORY: MiMalloc = MiMalloc;

fn main() {
    let report = Report::measure(|part| eprintln!("{part} ...")).unwrap();
    print!("{report}");
    let broken = report.broken();
    for promise in &broken {
        println!("NOT kept: {promise}");
    }
    if broken.is_empty() {
        println!("all promises kept");
    }
    std::process::exit(i32::from(!broken.is_empty()));
}
