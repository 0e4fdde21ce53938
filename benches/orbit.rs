//! Times of a catalogue's orbits against their limits: the statistics of `skyloop bench orbit`.
//!
//! `cargo bench --bench orbit`, on a quiet machine. Exits with 1 where a limit is not met.

mod support;

fn main() -> std::process::ExitCode {
    support::report::<skyloop::measure::orbits::Report>(&[])
}
