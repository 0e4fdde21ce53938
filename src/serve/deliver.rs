//! To the wire: a shot as its packets, on every link that brings frames, paced by each client's credit.

use super::channel::Channel;
use super::cut::{Cut, closing};
use super::{Server, Undelivered};
use crate::engine::Shot;
use crate::link::LinkError;
use bytes::Bytes;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{MAX_PACKET, Reply};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A client that takes nothing, and grants nothing for what it has got, for this long has gone: its frame is abandoned.
const STALL: Duration = Duration::from_secs(2);
/// How long to listen while a frame waits for credit.
pub(super) const LISTEN: Duration = Duration::from_millis(5);
/// How long to listen while packets wait for room in a link's queue.
const BREATH: Duration = Duration::from_micros(200);

/// A frame on its way over one link.
struct Delivery<'a> {
    /// Which link.
    at: usize,
    cut: Cut<'a>,
    /// What has to stay as it is for the frame to be delivered.
    exchange: u32,
    resets: u32,
    /// A packet that waits for room, and whether the link has refused it.
    waiting: Option<(Bytes, bool)>,
    watch: Watch,
}

/// Since when nothing has moved, neither frame packets nor credit.
struct Watch {
    since: Instant,
    credit: u32,
    /// Octets that had left the link.
    octets: u32,
}

impl Watch {
    fn of(channel: &Channel) -> Watch {
        Watch {
            since: Instant::now(),
            credit: channel.exchange.credit.granted(),
            octets: channel.wire.tally.octets(),
        }
    }

    /// How long the client has done nothing. While octets of frame packets leave, or such that a frame packet waits
    /// for (`blocked`), it can do nothing: on a slow line that takes longer than its patience.
    fn standstill(&mut self, channel: &Channel, blocked: bool) -> Duration {
        let now = Watch::of(channel);
        let moves = now.octets != self.octets && (blocked || channel.carries_frames());
        if moves || now.credit != self.credit {
            *self = now;
        }
        self.since.elapsed()
    }
}

/// What became of an attempt to send.
enum Step {
    Moved,
    NoCredit,
    NoRoom,
    Done,
}

impl Server {
    /// Sends what each client wants of a shot; complete only if all of them got all of it.
    pub(super) fn deliver(&mut self, shot: &Shot, stop: &AtomicBool) -> Result<(), Undelivered> {
        let mut under_way = self.cut(shot)?;
        let mut whole = !under_way.is_empty();
        while !under_way.is_empty() {
            let mut pause = Some(LISTEN);
            let mut at = 0;
            while let Some(delivery) = under_way.get_mut(at) {
                match self.step(delivery)? {
                    Step::Done => {
                        under_way.remove(at);
                        continue;
                    }
                    Step::Moved => pause = None,
                    Step::NoRoom => pause = pause.map(|pause| pause.min(BREATH)),
                    Step::NoCredit => {}
                }
                at += 1;
            }
            let Some(pause) = pause.filter(|_| !under_way.is_empty()) else {
                continue;
            };
            let alive = self.receive(pause).map_err(Undelivered::Link)?;
            under_way.retain_mut(|delivery| {
                let stands = alive && !stop.load(Ordering::Relaxed) && self.stands(delivery);
                if !stands {
                    whole = false;
                    self.give_up(delivery);
                }
                stands
            });
        }
        if whole {
            Ok(())
        } else {
            Err(Undelivered::Abandoned)
        }
    }

    /// The frame for each link that brings frames and whose client has said something.
    fn cut<'a>(&mut self, shot: &'a Shot) -> Result<Vec<Delivery<'a>>, Undelivered> {
        let mut under_way = Vec::new();
        for (at, channel) in self.channels.iter_mut().enumerate() {
            let exchange = &channel.exchange;
            if !channel.roles.bring_frames() || exchange.deaf {
                continue;
            }
            if !exchange.heard {
                if !std::mem::replace(&mut channel.told, true) {
                    tracing::warn!(
                        "{} has no client yet, and gets nothing of frame {}: a client says Ping or Credit first",
                        channel.wire.address,
                        shot.number
                    );
                }
                continue;
            }
            let positions = exchange.positions.as_ref();
            let closing = closing(shot);
            let cut = Cut::new(shot, &exchange.output, positions, channel.roles, closing);
            under_way.push(Delivery {
                at,
                cut: cut.map_err(unencodable)?,
                exchange: exchange.number,
                resets: exchange.resets,
                waiting: None,
                watch: Watch::of(channel),
            });
            channel.keep(shot.number);
        }
        Ok(under_way)
    }

    /// Sends one packet, if its link and its client let it.
    fn step(&mut self, delivery: &mut Delivery<'_>) -> Result<Step, Undelivered> {
        let channel = &mut self.channels[delivery.at];
        if channel.exchange.number != delivery.exchange
            || channel.exchange.resets != delivery.resets
        {
            // The pause notices, and gives the frame up.
            return Ok(Step::NoCredit);
        }
        if delivery.waiting.is_none() {
            if !channel.exchange.credit.may_send() {
                if delivery.cut.is_over() {
                    return Ok(Step::Done);
                }
                return Ok(Step::NoCredit);
            }
            let (personality, counts) = (self.personality, &channel.counts);
            let time = delivery.cut.time;
            let mut buffer = [0; MAX_PACKET];
            let packet = delivery.cut.next(|reply: &Reply<'_>| {
                let count = counts.peek(reply.apid());
                let length = (personality.encode_reply)(reply, count, time, &mut buffer)?;
                Ok(Bytes::copy_from_slice(&buffer[..length]))
            });
            match packet {
                None => return Ok(Step::Done),
                Some(packet) => delivery.waiting = Some((packet.map_err(unencodable)?, false)),
            }
        }
        let Some((packet, refused)) = &mut delivery.waiting else {
            return Ok(Step::Done);
        };
        let sent = match channel.flush() {
            Ok(true) => channel.offer(packet),
            other => other,
        };
        if !sent.map_err(Undelivered::Link)? {
            *refused = true;
            return Ok(Step::NoRoom);
        }
        // What is given up before it leaves takes no count.
        if let Some((apid, _)) = identify(packet) {
            channel.counts.next(apid);
        }
        channel.exchange.credit.spend();
        if let Some(kept) = channel.exchange.kept.back_mut() {
            kept.packets
                .extend(delivery.waiting.take().map(|(packet, _)| packet));
        }
        delivery.watch = Watch::of(channel);
        Ok(Step::Moved)
    }

    /// Whether the client is still there and takes what it gets.
    fn stands(&self, delivery: &mut Delivery<'_>) -> bool {
        let channel = &self.channels[delivery.at];
        let blocked = delivery.waiting.is_some();
        channel.exchange.number == delivery.exchange
            && channel.exchange.resets == delivery.resets
            && delivery.watch.standstill(channel, blocked) < STALL
    }

    /// A packet that the link has refused is lost with its frame. A client that takes nothing must not hold up the frames
    /// of others again.
    fn give_up(&mut self, delivery: &Delivery<'_>) {
        let others = self.channels.iter().enumerate();
        let mut others =
            others.filter(|(at, channel)| *at != delivery.at && channel.roles.bring_frames());
        if delivery.watch.since.elapsed() >= STALL && others.next().is_some() {
            let channel = &mut self.channels[delivery.at];
            channel.exchange.deaf = true;
            tracing::warn!(
                "the client at {} takes nothing: it gets no frames until it says something",
                channel.wire.address
            );
        }
        if let Some((_, true)) = delivery.waiting {
            let channel = &mut self.channels[delivery.at];
            channel.lost = channel.lost.wrapping_add(1);
        }
    }

    /// Sends packets of a kept frame once more; false if there are none such.
    pub(super) fn resend(
        &mut self,
        at: usize,
        frame: u32,
        first: u32,
        count: u32,
    ) -> Result<bool, LinkError> {
        let channel = &mut self.channels[at];
        let Some(kept) = channel
            .exchange
            .kept
            .iter()
            .find(|kept| kept.frame == frame)
        else {
            return Ok(false);
        };
        let asked = kept.packets.iter().skip(first as usize);
        let again: Vec<Bytes> = asked
            .take((count as usize).min(channel.room()))
            .cloned()
            .collect();
        for packet in again {
            self.counters.resent_blocks = self.counters.resent_blocks.wrapping_add(1);
            channel.answer(packet)?;
        }
        Ok(true)
    }
}

/// A packet that the wire language cannot hold: the frame is given up, and the log says why.
fn unencodable(error: impl std::fmt::Display) -> Undelivered {
    tracing::error!(%error, "a packet of a frame could not be encoded");
    Undelivered::Abandoned
}
