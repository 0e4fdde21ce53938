//! To the wire: pictures as their packets, on every link that brings frames, paced by each client's credit.

use super::channel::{Channel, Deaf, Exchange};
use super::cut::{Cut, Next};
use super::leaving::Leaving;
use super::picture::Picture;
use super::withheld::{CLIENT_GONE, LAPSED, RESET, RUN_ENDED, name, standstill};
use super::{Server, add};
use crate::stats::Pending;
use bytes::Bytes;
use skyloop_link::{LinkError, SOON, patience};
use skyloop_protocols::packet::identify;
use skyloop_protocols::{MAX_PACKET, Reply, Withheld};
use std::time::{Duration, Instant};

/// A client that takes nothing, and grants nothing for what it has got, for this long has gone: its frame is abandoned.
const STALL: Duration = Duration::from_secs(2);
/// How long to listen while a frame waits for credit.
pub(super) const LISTEN: Duration = Duration::from_millis(5);
/// Packets that go over one link before it is the next one's turn, and that of what has come meanwhile.
const AT_ONCE: usize = 32;
/// How long to listen while packets wait for room in a link's queue.
const BREATH: Duration = Duration::from_micros(200);

/// A frame on its way over one link.
pub(super) struct Delivery {
    pub frame: u32,
    /// Its entry in the link's account.
    entry: Pending,
    /// None while too little is known of the frame.
    cut: Option<Cut>,
    /// Where in the link's queue its first packet comes: after so many.
    before: u32,
    /// What has to stay as it is for the frame to be delivered.
    exchange: u32,
    resets: u32,
    /// A packet that waits for room, and whether the link has refused it.
    waiting: Option<(Bytes, bool)>,
    watch: Watch,
    /// Whether the log says that it stands still.
    pub reported: bool,
    /// Packets that the link had removed for want of proof when the first one of this frame was queued.
    unproved: u32,
}

/// Since when nothing has moved, neither frame packets nor credit.
struct Watch {
    since: Instant,
    credit: u32,
    /// Bytes that had left the link.
    bytes: u32,
}

impl Watch {
    fn of(channel: &Channel) -> Watch {
        Watch {
            since: Instant::now(),
            credit: channel.exchange.credit.granted(),
            bytes: channel.wire.tally.bytes(),
        }
    }

    /// How long the client has done nothing. While bytes of frame packets leave, or such that a frame packet waits
    /// for (`blocked`), it can do nothing: on a slow line that takes longer than its patience. New credit makes no room on a link that `is_full`.
    fn standstill(&mut self, channel: &Channel, blocked: bool, is_full: bool) -> Duration {
        let now = Watch::of(channel);
        let moves = now.bytes != self.bytes && (blocked || channel.carries_frames());
        if moves || (now.credit != self.credit && !is_full) {
            *self = now;
        }
        self.since.elapsed()
    }
}

impl Delivery {
    /// Of a frame, over this link, to its present client.
    pub fn new(frame: u32, entry: Pending, channel: &Channel) -> Delivery {
        Delivery {
            frame,
            entry,
            cut: None,
            before: 0,
            exchange: channel.exchange.number,
            resets: channel.exchange.resets,
            waiting: None,
            watch: Watch::of(channel),
            reported: false,
            unproved: channel.wire.tally.unproved(),
        }
    }

    /// Whether the exchange is the one that it was begun for.
    pub fn is_for(&self, exchange: &Exchange) -> bool {
        (self.exchange, self.resets) == (exchange.number, exchange.resets)
    }

    /// Whether some of it has left.
    pub fn has_begun(&self) -> bool {
        self.cut.is_some()
    }
}

/// What became of an attempt to send.
enum Step {
    Moved,
    NoCredit,
    NoRoom,
    /// There is nothing to send until the renderer reports, or for so long.
    NotYet(Option<Duration>),
    /// All of the frame is in the link's queue, or it is withheld for a cause.
    Over(Option<&'static str>),
}

/// What a round over all links came to.
#[derive(Default)]
pub(super) struct Round {
    pub moved: bool,
    /// How soon another may come to more, where that is known.
    pub pause: Option<Duration>,
}

impl Round {
    fn soon(&mut self, pause: Duration) {
        self.pause = Some(self.pause.map_or(pause, |other| other.min(pause)));
    }
}

impl Server {
    /// Sends some packets over each link, where there are some, and room and credit for them.
    pub(super) fn deliver(&mut self) -> Result<Round, LinkError> {
        let mut round = Round::default();
        for at in 0..self.channels.len() {
            let Some(mut delivery) = self.channels[at].deliveries.pop_front() else {
                continue;
            };
            let mut step = Ok(Step::Moved);
            for _ in 0..AT_ONCE {
                step = self.step(at, &mut delivery);
                if !matches!(step, Ok(Step::Moved)) {
                    break;
                }
            }
            let step = match step {
                Ok(step) => step,
                Err(error) => {
                    self.channels[at].deliveries.push_front(delivery);
                    return Err(error);
                }
            };
            match step {
                Step::Over(cause) => {
                    round.moved = true;
                    self.end(at, delivery, cause);
                    continue;
                }
                Step::Moved => round.moved = true,
                Step::NotYet(pause) => {
                    delivery.watch = Watch::of(&self.channels[at]);
                    pause.into_iter().for_each(|pause| round.soon(pause));
                }
                Step::NoCredit | Step::NoRoom => {
                    let is_full = matches!(step, Step::NoRoom);
                    round.soon(if is_full { BREATH } else { LISTEN });
                    let blocked = delivery.waiting.is_some();
                    let channel = &self.channels[at];
                    let standstill = delivery.watch.standstill(channel, blocked, is_full);
                    if standstill >= STALL {
                        self.give_up(at, delivery, !is_full);
                        continue;
                    }
                    // One packet of a slow link may take longer.
                    let carries = is_full && !channel.wire.tally.awaits_proof();
                    let airtime = channel.wire.airtime.as_ref().filter(|_| carries);
                    if standstill >= patience(airtime, SOON) {
                        self.report_standstill(at, &mut delivery, !is_full);
                    }
                }
            }
            self.channels[at].deliveries.push_front(delivery);
        }
        Ok(round)
    }

    /// Sends one packet, if link, client and renderer let it.
    fn step(&mut self, at: usize, delivery: &mut Delivery) -> Result<Step, LinkError> {
        let channel = &mut self.channels[at];
        // Its client has gone, or another has come: the one that this is for will never have all of it.
        if channel.has_gone(delivery.exchange) {
            return Ok(Step::Over(Some(CLIENT_GONE)));
        }
        if channel.exchange.resets != delivery.resets {
            return Ok(Step::Over(Some(RESET)));
        }
        let Some(picture) = Picture::of(&mut self.pictures, delivery.frame) else {
            return Ok(Step::Over(Some(name(Withheld::Refused))));
        };
        if !delivery.has_begun() {
            delivery.unproved = channel.wire.tally.unproved();
        } else if delivery.unproved != channel.wire.tally.unproved() {
            return Ok(self.withhold(at, delivery.frame, Withheld::NoProof, LAPSED));
        }
        if delivery.cut.is_none() {
            let wait = picture.asked.release.checked_duration_since(Instant::now());
            if let Some(wait) = wait.filter(|wait| !wait.is_zero()) {
                return Ok(Step::NotYet(Some(wait)));
            }
            let exchange = &channel.exchange;
            let positions = exchange.positions.as_ref();
            match Cut::open(picture, &exchange.output, positions, channel.roles) {
                Ok(None) => return Ok(Step::NotYet(None)),
                Ok(cut) => delivery.cut = cut,
                Err(why) => {
                    return Ok(self.withhold(at, delivery.frame, Withheld::TooLong, &why));
                }
            }
            channel.keep(delivery.frame);
            delivery.before = channel.wire.tally.departed.place();
            if let Some(cut) = &delivery.cut {
                self.report_slow(at, delivery.frame, cut);
                return Ok(Step::Moved);
            }
        }
        let Some(cut) = &mut delivery.cut else {
            return Ok(Step::NotYet(None));
        };
        if delivery.waiting.is_none() {
            if cut.is_over() {
                return Ok(Step::Over(None));
            }
            // Frames wait here, not in the link's queue: those that are given up are never sent.
            if channel.wire.tally.awaits_proof() {
                return Ok(Step::NoRoom);
            }
            if !channel.exchange.credit.may_send() {
                return Ok(Step::NoCredit);
            }
            let (personality, backlog) = (self.personality, channel.backlog());
            let (counts, paper) = (&channel.counts, &mut channel.paper);
            let time = cut.time;
            let packet = cut.next(picture, backlog, |reply: &Reply<'_>| {
                let count = counts.peek(reply.apid());
                paper.resize(MAX_PACKET, 0);
                let length = (personality.encode_reply)(reply, count, time, paper)?;
                let packet = paper.split_to(length).freeze();
                paper.clear();
                Ok(packet)
            });
            match packet {
                Next::Over => return Ok(Step::Over(None)),
                Next::NotYet => return Ok(Step::NotYet(None)),
                Next::Packet(Ok(packet)) => delivery.waiting = Some((packet, false)),
                Next::Packet(Err(error)) => {
                    let why = error.to_string();
                    return Ok(self.withhold(at, delivery.frame, Withheld::TooLong, &why));
                }
            }
        }
        let Some((packet, refused)) = &mut delivery.waiting else {
            return Ok(Step::Over(None));
        };
        let sent = match channel.flush() {
            Ok(true) => channel.offer(packet),
            other => other,
        };
        if !sent? {
            *refused = true;
            return Ok(Step::NoRoom);
        }
        picture.first_octet.get_or_insert_with(Instant::now);
        // What is given up before it leaves takes no count.
        if let Some((apid, _)) = identify(packet) {
            channel.counts.next(apid);
        }
        channel.exchange.credit.spend();
        let packet = delivery.waiting.take().map(|(packet, _)| packet);
        if let Some(kept) = channel.exchange.kept.back_mut() {
            kept.packets.extend(packet);
        }
        delivery.watch = Watch::of(channel);
        // Who has got the last packet may ask at once what was delivered.
        Ok(if cut.is_over() {
            Step::Over(None)
        } else {
            Step::Moved
        })
    }

    /// Reports a frame that is withheld on a link.
    fn withhold(&mut self, at: usize, frame: u32, why: Withheld, detail: &str) -> Step {
        self.report(at, why, &format!("frame {frame}: {detail}"));
        Step::Over(Some(name(why)))
    }

    /// Puts a frame on its way over each link that brings frames and whose client has said something.
    pub(super) fn begin(&mut self, frame: u32) {
        let most = self.most_under_way();
        let Some(picture) = Picture::of(&mut self.pictures, frame) else {
            return;
        };
        let Some(request) = picture.request.take() else {
            return;
        };
        let (mut passed_over, mut without) = (Vec::new(), Vec::new());
        for (at, channel) in self.channels.iter_mut().enumerate() {
            if !channel.roles.bring_frames() {
                continue;
            }
            let entry = channel.frames.open(&request);
            let number = channel.exchange.number;
            // A proof that comes late is as good as a packet.
            let has_gone = channel.has_gone(number);
            let is_deaf = channel.is_deaf();
            if has_gone || is_deaf || !channel.exchange.heard {
                without.push((at, entry));
                continue;
            }
            let delivery = Delivery::new(frame, entry, channel);
            channel.deliveries.push_back(delivery);
            picture.open += 1;
            let older = channel.make_way(most);
            passed_over.extend(older.map(|older| (at, older)));
        }
        // Where nobody wants it nobody has all of it.
        picture.whole = picture.open > 0;
        for (at, entry) in without {
            let channel = &self.channels[at];
            let exchange = &channel.exchange;
            let (why, detail) = match exchange.deaf.map(|deaf| deaf.why) {
                _ if !exchange.heard => (Withheld::NoClient, "no valid packet has come yet"),
                _ if channel.has_gone(exchange.number) => {
                    (Withheld::NoClient, "the client has gone")
                }
                None | Some(Withheld::NotRead) => (Withheld::NotRead, "the client takes nothing"),
                Some(why) => (why, "nothing is sent until the client sends a packet"),
            };
            let cause = match why {
                Withheld::NoClient if exchange.heard => CLIENT_GONE,
                why => name(why),
            };
            self.channels[at].frames.withhold(entry, cause);
            self.report(at, why, &format!("frame {frame}: {detail}"));
        }
        for (at, older) in passed_over {
            let cause = self.report_passed(at, older.frame);
            add(&mut self.counters.frames_dropped, 1);
            self.end(at, older, Some(cause));
        }
    }

    /// Gives up the frames that no link has begun to send: their client has gone, or begins anew.
    pub(super) fn forsake(&mut self, is_reset: bool) {
        let cause = if is_reset { RESET } else { CLIENT_GONE };
        for at in 0..self.pictures.len() {
            let picture = &mut self.pictures[at];
            if let Some(request) = picture.request.take() {
                picture.whole = false;
                self.fail(request, cause);
            }
        }
    }

    /// A frame's way over a link is over: all of it is in the link's queue, or it is withheld for a `cause`.
    fn end(&mut self, at: usize, delivery: Delivery, cause: Option<&'static str>) {
        if let Some((_, true)) = delivery.waiting {
            // A packet that the link has refused is lost with its frame.
            add(&mut self.channels[at].lost, 1);
        }
        let Delivery {
            frame,
            entry,
            exchange,
            before,
            ..
        } = delivery;
        let picture = Picture::of(&mut self.pictures, frame);
        // A frame without a picture was refused while it was made.
        let cause = cause.or(picture.is_none().then_some(name(Withheld::Refused)));
        let channel = &mut self.channels[at];
        let queued = match cause {
            None => {
                if !channel.flow.in_status {
                    channel.exchange.withheld = Withheld::None;
                }
                Some((channel.wire.tally.departed.mark(before), entry))
            }
            Some(cause) => {
                channel.withhold(frame, entry, cause);
                None
            }
        };
        if let Some(picture) = picture {
            picture.open = picture.open.saturating_sub(1);
            picture.whole &= cause.is_none();
            // After a Reset and at the run's end nobody waits for it: it misses no deadline.
            if !matches!(cause, Some(RESET | RUN_ENDED)) {
                self.leaving
                    .push(Leaving::of(picture, at, exchange, queued));
            }
        }
    }

    /// A client that takes nothing gets nothing more of this frame, and where there are others of none.
    fn give_up(&mut self, at: usize, delivery: Delivery, has_room: bool) {
        let others = self.channels.iter().enumerate();
        let mut others =
            others.filter(|(other, channel)| *other != at && channel.roles.bring_frames());
        let is_alone = others.next().is_none();
        let channel = &mut self.channels[at];
        let (why, detail) = standstill(channel, has_room);
        channel.exchange.deaf = (!is_alone).then_some(Deaf {
            why,
            bytes: channel.wire.tally.bytes(),
            heard: false,
        });
        let detail = format!("frame {} is given up: {detail}", delivery.frame);
        self.report(at, why, &detail);
        self.end(at, delivery, Some(name(why)));
    }

    /// The run's end: nothing is sent any more.
    pub(super) fn give_all_up(&mut self) {
        for at in 0..self.channels.len() {
            while let Some(delivery) = self.channels[at].deliveries.pop_front() {
                self.end(at, delivery, Some(RUN_ENDED));
            }
        }
    }

    /// Ends the deliveries of a frame whose clients have gone, been followed by others, or begun anew.
    pub(super) fn end_unwanted(&mut self, frame: u32) {
        for at in 0..self.channels.len() {
            let channel = &mut self.channels[at];
            let is_unwanted = |one: &Delivery| one.frame == frame && !one.is_for(&channel.exchange);
            let place = channel.deliveries.iter().position(is_unwanted);
            let Some(delivery) = place.and_then(|place| channel.deliveries.remove(place)) else {
                continue;
            };
            let has_gone = channel.has_gone(delivery.exchange);
            let cause = if has_gone { CLIENT_GONE } else { RESET };
            self.end(at, delivery, Some(cause));
        }
    }

    /// Sends packets of a kept frame once more; how many, none if nothing of that frame is kept.
    pub(super) fn resend(
        &mut self,
        at: usize,
        frame: u32,
        first: u32,
        count: u32,
    ) -> Result<Option<usize>, LinkError> {
        let channel = &mut self.channels[at];
        let mut kept = channel.exchange.kept.iter();
        let Some(kept) = kept.find(|kept| kept.frame == frame && !kept.packets.is_empty()) else {
            return Ok(None);
        };
        let asked = kept.packets.iter().skip(first as usize);
        let again: Vec<Bytes> = asked
            .take((count as usize).min(channel.room()))
            .cloned()
            .collect();
        let sent = again.len();
        for packet in again {
            add(&mut self.counters.resent_blocks, 1);
            channel.answer(packet)?;
        }
        Ok(Some(sent))
    }
}
