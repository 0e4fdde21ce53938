//! Settings sent to the emulator before the first attitude.

use std::ops::ControlFlow;

use super::{FlightComputer, RunError, Watch};
use crate::event::Event;
use crate::exchange::Answer;

impl FlightComputer {
    pub(super) fn set_output(
        &mut self,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let waited = self.mission.timeout;
        let (output, positions) = (self.mission.output, self.mission.positions);
        let tick = || watch(Event::Tick);
        match self.links.set(output, positions, waited, tick)? {
            Answer::Done => Ok(ControlFlow::Continue(())),
            Answer::Refused(nack) => {
                self.links.release();
                Err(RunError::Refused { nack })
            }
            Answer::Silence => Err(self.no_answer()),
            Answer::Stopped => Ok(ControlFlow::Break(())),
        }
    }

    pub(super) fn start_faults(
        &mut self,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let waited = self.mission.timeout;
        for fault in &self.faults {
            match self
                .links
                .start_fault(*fault, waited, || watch(Event::Tick))?
            {
                Answer::Done => {}
                Answer::Refused(nack) => {
                    self.links.release();
                    return Err(RunError::FaultRefused { nack });
                }
                Answer::Silence => {
                    let (link, _) = self.links.unanswered();
                    return Err(RunError::FaultUnanswered { link, waited });
                }
                Answer::Stopped => return Ok(ControlFlow::Break(())),
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}
