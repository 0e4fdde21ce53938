//! A fuzz target for every decoder: a bounded number of random bytes and of mutations of the corpus
//! and the golden vectors.
//!
//! `cargo test -p skyloop-protocols --test fuzz` runs each target with its corpus and 20,000
//! inputs. Ten million take four minutes, in the development profile, which checks arithmetic:
//!
//! ```text
//! SKYLOOP_FUZZ_INPUTS=10000000 cargo test -p skyloop-protocols --test fuzz -- \
//!     --ignored --nocapture ten_million
//! ```
//!
//! `SKYLOOP_FUZZ_SEED=N` sets the seed. A failing input is printed in hexadecimal digits; store it
//! in `tests/corpus/<target>/`, whose files run first. `SKYLOOP_FUZZ_KEEP=1` writes the shortest
//! inputs with new features there.

mod bus;
mod bytes;
#[path = "../common/mod.rs"]
mod common;
mod harness;

use harness::Target;

/// All decoders.
const TARGETS: [Target; 7] = [
    bytes::SLIP,
    bytes::PACKET,
    bytes::SLCAN,
    bytes::RICE,
    bus::FORM,
    bus::RECEIVER,
    bus::CHANNEL,
];

/// Inputs of a target in the usual test run.
const INPUTS: u64 = 20_000;

macro_rules! usual {
    ($($name:ident: $target:expr,)+) => {
        $(#[test]
        fn $name() {
            harness::fuzz(&$target, INPUTS);
        })+

        #[test]
        fn every_target_is_run() {
            let run = [$($target.name),+];
            assert_eq!(run, TARGETS.map(|target| target.name));
        }
    };
}

usual! {
    slip: bytes::SLIP,
    space_packets: bytes::PACKET,
    slcan: bytes::SLCAN,
    rice: bytes::RICE,
    can_form: bus::FORM,
    isotp_receiver: bus::RECEIVER,
    isotp_channel: bus::CHANNEL,
}

#[test]
#[ignore = "takes minutes: the head of this file has the command"]
fn ten_million() {
    let wanted = std::env::var("SKYLOOP_FUZZ_INPUTS")
        .map_or(10_000_000, |text| text.parse().expect("a number of inputs"));
    let (start, memory) = (std::time::Instant::now(), harness::resident_kib());
    let mut inputs = 0;
    for target in &TARGETS {
        inputs += harness::fuzz(target, u64::div_ceil(wanted, TARGETS.len() as u64));
    }
    println!(
        "{inputs} inputs in {:.0} s; resident {} KiB at the start, {} at the end, {} at most",
        start.elapsed().as_secs_f64(),
        memory.now,
        harness::resident_kib().now,
        harness::resident_kib().peak,
    );
}
