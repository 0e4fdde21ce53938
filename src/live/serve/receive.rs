//! From the wire: packets to commands to the emulator's settings and the latched vehicle state.

use super::deliver::LISTEN;
use super::{Server, add};
use skyloop_link::{Inbound, LinkError, QUEUE};
use skyloop_protocols::apid::{ATTITUDE, CHALLENGE, COMMAND};
use skyloop_protocols::{Command, Reason, Reply, Withheld, packet};
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

/// Why a valid packet is refused.
pub(super) struct Refusal {
    pub reason: Reason,
    pub detail: String,
}

impl Refusal {
    /// A value is out of range.
    pub fn value(detail: impl Into<String>) -> Refusal {
        let (reason, detail) = (Reason::ValueOutOfRange, detail.into());
        Refusal { reason, detail }
    }

    /// Not now.
    pub fn busy(detail: impl Into<String>) -> Refusal {
        let (reason, detail) = (Reason::Busy, detail.into());
        Refusal { reason, detail }
    }

    /// Not here.
    pub fn not_supported(detail: impl Into<String>) -> Refusal {
        let (reason, detail) = (Reason::NotSupported, detail.into());
        Refusal { reason, detail }
    }
}

impl Server {
    /// Waits up to `timeout` for a packet or news of the renderer; acts on a packet that is there; false when a link has ended.
    pub(super) fn receive(&mut self, timeout: Duration) -> Result<bool, LinkError> {
        let timeout = if self.flush()? {
            timeout
        } else {
            timeout.min(LISTEN)
        };
        match self.take_one_each()? {
            None => return Ok(false),
            Some(true) => return Ok(true),
            Some(false) => {}
        }
        // Each queue unparks this thread, and so does the renderer: see `Server::serve`.
        std::thread::park_timeout(timeout);
        Ok(true)
    }

    /// Acts on the packets that have come; false when a link has ended. As many as a full queue holds: a
    /// flood does not stop the frames.
    pub(super) fn receive_waiting(&mut self) -> Result<bool, LinkError> {
        self.flush()?;
        for _ in 0..QUEUE {
            match self.take_one_each()? {
                Some(true) => {}
                Some(false) => break,
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Acts on the next packet of each link; whether there was any, or none when a link has ended.
    fn take_one_each(&mut self) -> Result<Option<bool>, LinkError> {
        let mut took = false;
        for at in 0..self.channels.len() {
            match self.channels[at].wire.inbox.try_recv() {
                Ok(inbound) => {
                    self.handle(at, inbound)?;
                    took = true;
                }
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => {
                    self.channels[at].gone = true;
                    return Ok(None);
                }
            }
        }
        Ok(Some(took))
    }

    fn handle(&mut self, at: usize, inbound: Inbound) -> Result<(), LinkError> {
        let newer = inbound
            .exchange
            .wrapping_sub(self.channels[at].exchange.number);
        if newer > u32::MAX / 2 {
            // Of a client that another has followed: it was late.
            add(&mut self.counters.foreign_packets, 1);
            return Ok(());
        }
        if newer != 0 {
            self.open_exchange(at, inbound.exchange);
        }
        if let Some(deaf) = &mut self.channels[at].exchange.deaf {
            deaf.heard = true;
        }
        let (header, command) = match (self.personality.decode_command)(&inbound.packet) {
            Ok(decoded) => decoded,
            Err(error) => {
                let (apid, count) = packet::identify(&inbound.packet).unwrap_or((0, 0));
                self.see_refused(at, apid, count);
                // One that proves the address stays in the link.
                if matches!(
                    (self.personality.decode_reply)(&inbound.packet),
                    Ok((_, Reply::Challenge(_)))
                ) {
                    const WRONG: &str = "this Challenge is not of this address or time";
                    self.counters.refuse(Reason::ValueOutOfRange);
                    if self.channels[at].wire.tally.awaits_proof() {
                        self.report(at, Withheld::NoProof, WRONG);
                    }
                    return self.nack(at, apid, count, Reason::ValueOutOfRange, WRONG);
                }
                self.counters.refuse_undecodable(&error);
                // What was damaged on the way requests nothing: it may have been anything.
                let is_value = matches!(
                    error.reason(),
                    Reason::QuaternionNotUnit | Reason::NotFinite | Reason::ValueOutOfRange
                );
                if is_value && apid == ATTITUDE {
                    self.fail_refused("Attitude");
                }
                // Of another version all packets are refused: no frame will come.
                let is_foreign = apid != CHALLENGE && error.reason() == Reason::BadVersion;
                // What cannot be identified may be the first attitude.
                let may_be_first =
                    ![COMMAND, CHALLENGE].contains(&apid) && self.truth.history.latest().is_none();
                let is_needed = apid == ATTITUDE && self.is_requested_by("Attitude");
                if is_foreign || may_be_first || is_needed {
                    self.report(at, Withheld::Refused, &error.to_string());
                }
                return self.nack(at, apid, count, error.reason(), &error.to_string());
            }
        };
        self.channels[at].exchange.heard = true;
        // A Reset begins the counts anew. What the first camera's client says of the vehicle is only a part of its packets: it has counted them.
        let is_handed_on = self.is_led && self.channels[at].roles.truth;
        let missing = match command {
            Command::Reset => 0,
            _ if is_handed_on => 0,
            _ => {
                let gaps = &mut self.channels[at].exchange.gaps;
                gaps.missing(header.apid, header.sequence_count)
            }
        };
        add(&mut self.counters.sequence_gaps, u32::from(missing));
        let done = match command {
            command if !self.channels[at].roles.truth && self.is_truth(&command) => {
                Err(self.not_the_truth())
            }
            Command::Attitude(attitude) => self.latch(header, &attitude, &inbound),
            command => self.obey(at, header, command, inbound.arrived),
        };
        if self.channels[at].roles.truth && Self::is_of_the_vehicle(&command) && done.is_ok() {
            self.told.iter().for_each(|head| head.bring(&inbound));
        }
        if let Err(Refusal { reason, detail }) = done {
            self.counters.refuse(reason);
            let requests = match command {
                Command::Attitude(_) => Some("Attitude"),
                Command::Trigger { .. } => Some("Trigger"),
                _ => None,
            };
            if let Some(what) = requests {
                self.fail_refused(what);
                if what == "Trigger" {
                    self.channels[at].messages.note_trigger();
                }
                // By a cadence frames come by the attitude before.
                let is_first = what == "Attitude" && self.truth.history.latest().is_none();
                if is_first || self.is_requested_by(what) {
                    self.report(at, Withheld::Refused, &detail);
                }
            }
            return self.nack(at, header.apid, header.sequence_count, reason, &detail);
        }
        match command {
            Command::Attitude(_) => add(&mut self.counters.attitudes, 1),
            _ => add(&mut self.counters.commands, 1),
        }
        match command {
            Command::Attitude(_)
            | Command::Trigger { .. }
            | Command::Credit { .. }
            | Command::Resend { .. } => Ok(()),
            Command::Ping => {
                self.ack(at, &header)?;
                if let Some(cadence) = self.clock.cadence() {
                    cadence.advance(Instant::now());
                }
                self.channels[at].exchange.is_in_status = true;
                self.send(at, &Reply::Status(self.status(at)), self.now())
            }
            _ => self.ack(at, &header),
        }
    }

    /// A refused packet that states the expected count is not missing; what else a damaged header states is
    /// not believed.
    fn see_refused(&mut self, at: usize, apid: u16, count: u16) {
        let known = &mut self.channels[at].exchange.gaps;
        let mut gaps = known.clone();
        if gaps.missing(apid, count) == 0 {
            *known = gaps;
        }
    }

    /// Another client: nothing of the last one's is left.
    fn open_exchange(&mut self, at: usize, number: u32) {
        self.channels[at].open_exchange(number, self.output);
        if self.channels[at].roles.truth {
            self.clear_truth(false, Instant::now());
        }
        self.cancel_unwanted();
    }

    fn not_the_truth(&self) -> Refusal {
        let truth = self.channels.iter().find(|channel| channel.roles.truth);
        let address = truth.map_or("another link", |channel| &channel.wire.address);
        Refusal::not_supported(format!(
            "this link takes no Attitude, Trigger, Pause or Resume, and no settings of the first camera: send them over {address}"
        ))
    }
}
