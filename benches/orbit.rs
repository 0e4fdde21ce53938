//! What a catalogue's orbits take, and whether it is as promised: the figures of `skyloop bench orbit`.
//!
//! `cargo bench --bench orbit`, on a quiet machine. Ends with 1 where a promise is not kept.

mod support;

fn main() -> std::process::ExitCode {
    support::kept::<skyloop::measure::orbits::Report>(&[])
}
