//! A small emulator: one frame of synthetic stars per attitude, paced by credit, with faults on
//! request.

use std::collections::VecDeque;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use skyloop_protocols::command::Attitude;
use skyloop_protocols::credit::CreditAccount;
use skyloop_protocols::packet::identify;
use skyloop_protocols::reply::Mode;
use skyloop_protocols::{
    Ack, Command, Counters, DecodeError, Fault, Header, LabelLevel, Nack, Output, Packing,
    PixelLevel, Reason, Reply, Status, SyncState, Timing, WireTime, Withheld,
};

use super::wire::{Exposed, Sender, now};
use super::{Field, Noise, Star};

pub type Alter = fn(attitude: u32, packets: &mut Vec<Vec<u8>>);

/// Replies to each attitude with a frame of stars, paced by credit.
pub struct Emulator {
    pub field: Field,
    pub alter: Alter,
    pub refuses: fn(u32) -> bool,
    /// Whether this copy of an attitude gets no frame.
    pub drops: fn(copy: usize, attitude: u32) -> bool,
    /// Whether the frame of this copy is sent only with the next one.
    pub delays: fn(copy: usize, attitude: u32) -> bool,
    /// Whether pixels and labels go out on this link.
    pub brings: (bool, bool),
    /// Focal length, px: the frames show stars that are fixed in the sky from the first attitude
    /// on, in the middle of the exposure at the attitude's time. Without it the stars do not depend
    /// on the attitude.
    pub focal_px: Option<f64>,
    pub output: Output,
    pub positions: Vec<[u16; 2]>,
    pub refuses_output: Option<&'static str>,
    pub refuses_faults: bool,
    /// Faults, each with the number of attitudes before it.
    pub faults: Vec<(Fault, usize)>,
    pub expects_damage: bool,
    pub damaged: u64,
    sender: Sender,
    credit: CreditAccount,
    pub resets: u32,
    frames: u32,
    /// Packets without credit yet, with their frame's number.
    waiting: VecDeque<(u32, Vec<u8>)>,
    pub resends: bool,
    /// Unaltered packets of the last frames.
    stored: VecDeque<(u32, Vec<Vec<u8>>)>,
    pub resent: usize,
    pub attitudes: Vec<(Header, Attitude)>,
}

impl Emulator {
    pub fn new(alter: Alter) -> Self {
        Self {
            field: Field {
                width: 128,
                height: 96,
                ..Field::default()
            },
            alter,
            refuses: |_| false,
            drops: |_, _| false,
            delays: |_, _| false,
            brings: (true, true),
            focal_px: None,
            output: Output::default(),
            positions: Vec::new(),
            refuses_output: None,
            refuses_faults: false,
            faults: Vec::new(),
            expects_damage: false,
            damaged: 0,
            sender: Sender::default(),
            credit: CreditAccount::new(),
            resets: 0,
            frames: 0,
            waiting: VecDeque::new(),
            resends: true,
            stored: VecDeque::new(),
            resent: 0,
            attitudes: Vec::new(),
        }
    }

    pub fn answer(&mut self, packet: &[u8]) -> Vec<Vec<u8>> {
        let (header, command) = match Command::decode(packet) {
            Ok(decoded) => decoded,
            Err(error) => return self.reply_to_damage(packet, error),
        };
        if let Some((reason, why)) = self.refusal(&command) {
            let nack = Nack::new(header.apid, header.sequence_count, reason, why);
            return vec![self.sender.reply(&Reply::Nack(nack), now())];
        }
        let mut replies = vec![Reply::Ack(Ack {
            apid: header.apid,
            sequence_count: header.sequence_count,
        })];
        let mut out = Vec::new();
        match command {
            Command::Attitude(attitude) => {
                replies.clear();
                if self.expose(header, attitude) {
                    return out;
                }
            }
            Command::Reset => {
                self.resets += 1;
                self.credit = CreditAccount::new();
                self.waiting.clear();
                self.stored.clear();
            }
            Command::Output(output) => self.output = output,
            Command::Fault(fault) => self.faults.push((fault, self.attitudes.len())),
            Command::Positions(positions) => self.positions = positions.centres().to_vec(),
            Command::Credit { packets } => {
                replies.clear();
                if !self.credit.grant(packets) {
                    let (apid, count) = (header.apid, header.sequence_count);
                    let nack = Nack::new(apid, count, Reason::ValueOutOfRange, "Credit");
                    replies.push(Reply::Nack(nack));
                }
            }
            Command::Resend {
                frame,
                first,
                count,
            } => {
                replies.clear();
                let stored = self.stored.iter().filter(|(number, _)| *number == frame);
                let packets = stored.flat_map(|(_, packets)| packets);
                // Only packets sent before are resent.
                let unsent = self.waiting.iter().filter(|(of, _)| *of == frame).count();
                let sent = packets.clone().count().saturating_sub(unsent);
                let again = packets.take(sent).skip(first as usize);
                out.extend(again.take(count as usize).cloned());
                self.resent += out.len();
            }
            Command::Ping => replies.push(Reply::Status(self.status())),
            _ => {}
        }
        let replies = replies.iter();
        out.extend(replies.map(|reply| self.sender.reply(reply, now())));
        while !self.waiting.is_empty() && self.credit.may_send() {
            self.credit.spend();
            out.extend(self.waiting.pop_front().map(|(_, packet)| packet));
        }
        out
    }

    fn refusal(&self, command: &Command) -> Option<(Reason, &'static str)> {
        match command {
            Command::Attitude(attitude) if (self.refuses)(attitude.sequence) => {
                Some((Reason::TimeBackwards, "as the test asks"))
            }
            Command::Output(_) => Some((Reason::ValueOutOfRange, self.refuses_output?)),
            Command::Fault(_) if self.refuses_faults => {
                Some((Reason::NotSupported, "no faults here"))
            }
            Command::Resend { .. } if !self.resends => Some((Reason::NotSupported, "no Resend")),
            Command::Resend { frame, .. } => {
                let is_stored = self.stored.iter().any(|(number, _)| number == frame);
                (!is_stored).then_some((Reason::ValueOutOfRange, "not stored"))
            }
            _ => None,
        }
    }

    /// Makes the frame of an attitude. True: send nothing now.
    fn expose(&mut self, header: Header, attitude: Attitude) -> bool {
        let sequence = attitude.sequence;
        let same = |(_, other): &&(Header, Attitude)| other.sequence == sequence;
        let copy = self.attitudes.iter().filter(same).count();
        self.attitudes.push((header, attitude));
        if (self.drops)(copy, sequence) {
            return true;
        }
        let frame = self.frames;
        let mut packets = self.frame(&header);
        self.stored.push_back((frame, packets.clone()));
        if self.stored.len() > 2 {
            self.stored.pop_front();
        }
        (self.alter)(sequence, &mut packets);
        let packets = packets.into_iter().map(|packet| (frame, packet));
        self.waiting.extend(packets);
        (self.delays)(copy, sequence)
    }

    /// Replies to a damaged packet as the emulator does.
    fn reply_to_damage(&mut self, packet: &[u8], error: DecodeError) -> Vec<Vec<u8>> {
        assert!(
            self.expects_damage,
            "the flight computer's packets: {error}"
        );
        self.damaged += 1;
        let (apid, count) = identify(packet).unwrap_or((0, 0));
        let nack = Nack::new(apid, count, error.reason(), "damaged");
        vec![self.sender.reply(&Reply::Nack(nack), now())]
    }

    fn frame(&mut self, command: &Header) -> Vec<Vec<u8>> {
        let (field, frame) = (self.field, self.frames);
        self.frames += 1;
        let attitude = self.attitudes.last().unwrap().1.sequence;
        let mut noise = Noise::new(u64::from(attitude) + 100);
        let stars = match self.focal_px {
            None => field.grid(16, 4000.0, &mut noise),
            Some(focal_px) => self.sky(focal_px),
        };
        let pixels = field.expose(&field.electrons(&stars, (0.0, 0.0)), &mut noise);
        let exposed = Exposed {
            attitude,
            ..Exposed::new(field, frame, stars, pixels)
        };
        let mut output = self.output;
        if !self.brings.0 {
            output.pixels = PixelLevel::None;
        }
        if !self.brings.1 {
            output.labels = LabelLevel::None;
        }
        // The same time on every link.
        let time = match self.focal_px {
            None => WireTime(u64::from(frame) << 32),
            Some(_) => command.time,
        };
        exposed.packets(&mut self.sender, &output, &self.positions, time)
    }

    /// Current positions of stars that were on a grid at the first attitude.
    fn sky(&self, focal_px: f64) -> Vec<Star> {
        let at = |index: usize| {
            let [x, y, z, w] = self.attitudes[index].1.q_icrf_to_body;
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
        };
        let turned = at(self.attitudes.len() - 1) * at(0).inverse();
        let [x0, y0] = [self.field.width, self.field.height].map(|end| (end as f64 - 1.0) / 2.0);
        let stars = self.field.grid(16, 4000.0, &mut Noise::new(1));
        let moved = stars.into_iter().map(|star| {
            let from = Vector3::new((star.x - x0) / focal_px, (star.y - y0) / focal_px, 1.0);
            let to = turned * from;
            Star {
                x: x0 + focal_px * to.x / to.z,
                y: y0 + focal_px * to.y / to.z,
                ..star
            }
        });
        moved.collect()
    }

    fn status(&self) -> Status {
        Status {
            mode: Mode::Stepped,
            width: self.field.width as u16,
            height: self.field.height as u16,
            bits: 12,
            packing: Packing::Bits12,
            output: self.output,
            exposure_s: 0.1,
            gain_e_per_dn: 4.0,
            frame_rate_hz: 2.0,
            next_frame: self.frames,
            packets_sent: self.credit.sent(),
            sync: SyncState::Free,
            clock_offset_s: 0.0,
            exposure_start: WireTime::default(),
            exposure_end: WireTime::default(),
            timing: Timing::default(),
            latency_p50_s: 0.0,
            latency_p99_s: 0.0,
            latency_max_s: 0.0,
            withheld: Withheld::None,
            counters: Counters {
                attitudes: self.attitudes.len() as u32,
                ..Counters::default()
            },
        }
    }
}
