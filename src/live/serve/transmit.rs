//! Sends the packets of one frame over one link, paced by the client's credit.

use super::channel::Channel;
use super::delivery::{Delivery, Stall};
use super::diagnosis::report_slow;
use super::frame_job::FrameJob;
use super::frame_packets::{FramePackets, Next};
use super::reasons::{CLIENT_GONE, LAPSED, RESET, name};
use bytes::Bytes;
use skyloop_link::LinkError;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{EncodeError, MAX_PACKET, Personality, Reply, Withheld};
use std::time::{Duration, Instant};

/// Result of an attempt to send a packet.
pub(super) enum Step {
    Sent,
    NoCredit,
    NoRoom,
    /// Nothing to send until the renderer reports, or for this long.
    NotYet(Option<Duration>),
    /// All packets are in the link's queue, or the frame is withheld for a cause.
    Over(Option<&'static str>),
}

/// Sends one packet, if link, client and renderer permit.
pub(super) fn send_packet(
    channel: &mut Channel,
    delivery: &mut Delivery,
    job: Option<&mut FrameJob>,
    personality: &Personality,
) -> Result<Step, LinkError> {
    // Another client would get an incomplete frame.
    if channel.has_gone(delivery.exchange) {
        return Ok(Step::Over(Some(CLIENT_GONE)));
    }
    if channel.exchange.resets != delivery.resets {
        return Ok(Step::Over(Some(RESET)));
    }
    let Some(job) = job else {
        return Ok(Step::Over(Some(name(Withheld::Refused))));
    };
    let unproved = channel.wire.tally.unproved();
    let Some(packets) = &mut delivery.packets else {
        delivery.unproved = unproved;
        return Ok(open(channel, delivery, job));
    };
    if delivery.unproved != unproved {
        return Ok(withhold(channel, delivery.frame, Withheld::NoProof, LAPSED));
    }
    if delivery.waiting.is_none() {
        if packets.is_over() {
            return Ok(Step::Over(None));
        }
        // Frames wait here and not in the link's queue, so that withheld frames are never sent.
        if channel.wire.tally.awaits_proof() {
            return Ok(Step::NoRoom);
        }
        if !channel.exchange.credit.may_send() {
            return Ok(Step::NoCredit);
        }
        match encode(channel, packets, job, personality) {
            Next::Over => return Ok(Step::Over(None)),
            Next::NotYet => return Ok(Step::NotYet(None)),
            Next::Packet(Ok(packet)) => delivery.waiting = Some((packet, false)),
            Next::Packet(Err(error)) => {
                let why = error.to_string();
                return Ok(withhold(channel, delivery.frame, Withheld::TooLong, &why));
            }
        }
    }
    offer(channel, delivery, job)
}

/// Opens a frame when the device's delay is over and enough of it is rendered.
fn open(channel: &mut Channel, delivery: &mut Delivery, job: &FrameJob) -> Step {
    let wait = job.source.release.checked_duration_since(Instant::now());
    if let Some(wait) = wait.filter(|wait| !wait.is_zero()) {
        return Step::NotYet(Some(wait));
    }
    let exchange = &channel.exchange;
    let positions = exchange.positions.as_ref();
    match FramePackets::open(job, &exchange.output, positions, channel.roles) {
        Ok(None) => Step::NotYet(None),
        Ok(Some(packets)) => {
            channel.exchange.begin_frame(delivery.frame);
            delivery.first_place = channel.wire.tally.tx_complete.place();
            report_slow(channel, delivery.frame, &packets);
            delivery.packets = Some(packets);
            Step::Sent
        }
        Err(why) => withhold(channel, delivery.frame, Withheld::TooLong, &why),
    }
}

/// Encodes the next packet of a frame.
fn encode(
    channel: &mut Channel,
    packets: &mut FramePackets,
    job: &FrameJob,
    personality: &Personality,
) -> Next<Bytes> {
    let backlog = channel.backlog();
    let (counts, buffer) = (&channel.counts, &mut channel.packet_buffer);
    let time = packets.time;
    packets.next(job, backlog, |reply: &Reply<'_>| {
        let count = counts.peek(reply.apid());
        buffer.resize(MAX_PACKET, 0);
        let length = (personality.encode_reply)(reply, count, time, buffer)?;
        let packet = buffer.split_to(length).freeze();
        buffer.clear();
        Ok::<_, EncodeError>(packet)
    })
}

/// Offers the waiting packet to the link, after the answers.
fn offer(
    channel: &mut Channel,
    delivery: &mut Delivery,
    job: &mut FrameJob,
) -> Result<Step, LinkError> {
    let Some((packet, refused)) = &mut delivery.waiting else {
        return Ok(Step::Over(None));
    };
    if !(channel.flush()? && channel.offer(packet)?) {
        *refused = true;
        return Ok(Step::NoRoom);
    }
    job.first_byte.get_or_insert_with(Instant::now);
    // A packet that is never sent takes no sequence count.
    if let Some((apid, _)) = identify(packet) {
        channel.counts.next(apid);
    }
    channel.exchange.credit.spend();
    let packet = delivery.waiting.take().map(|(packet, _)| packet);
    if let Some(sent) = channel.exchange.sent_frames.back_mut() {
        sent.packets.extend(packet);
    }
    delivery.stall = Stall::at(channel.progress());
    // A client with the last packet may request a Status at once.
    let is_over = delivery.packets.as_ref().is_some_and(FramePackets::is_over);
    Ok(if is_over {
        Step::Over(None)
    } else {
        Step::Sent
    })
}

/// Reports a frame that is withheld on a link.
fn withhold(channel: &mut Channel, frame: u32, why: Withheld, detail: &str) -> Step {
    channel.report(why, &format!("frame {frame}: {detail}"));
    Step::Over(Some(name(why)))
}
