//! The clocks of a run: stepped, this machine's, the client's.

mod cadence;
mod discipline;
pub(super) mod due;
pub(super) mod exposure_clock;
mod paced;
mod stepped;

use cadence::Cadence;
pub(super) use discipline::CONFIRM_S;
use exposure_clock::ExposureClock;
use paced::Paced;
use skyloop_config::{Clock as Kind, Run, Trigger};
use std::time::Duration;
use stepped::Stepped;

/// The clock of `kind`, with the settings of `run`.
pub(super) fn of(kind: Kind, run: &Run, rate_hz: f64) -> Box<dyn ExposureClock> {
    let cadence = Cadence::new(rate_hz, run.latency_s.map(Duration::from_secs_f64));
    let packets = run.trigger == Trigger::Packet;
    match kind {
        Kind::Stepped => Box::new(Stepped::new(packets)),
        Kind::Wall => Box::new(Paced::wall(cadence)),
        Kind::External => {
            let holdover = Duration::from_secs_f64(run.holdover_s);
            Box::new(Paced::external(cadence, packets, holdover))
        }
    }
}
