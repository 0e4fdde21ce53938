//! To the wire: a shot as its packets (`FrameHeader`, then `PixelBlock`s, then `Labels`), paced by credit.

use super::{Server, Undelivered};
use crate::engine::Shot;
use crate::link::Outbound;
use bytes::Bytes;
use skyloop_firmware_sim::time::to_wire;
use skyloop_protocols::crc::Crc32;
use skyloop_protocols::pixels::{
    BlockSlice, blocks, blocks_in_frame, label_parts, label_texts, pack, packed_length,
};
use skyloop_protocols::{
    FrameHeader, LabelLevel, LabelPart, MAX_PACKET, Packing, PixelBlock, PixelLevel, Reply,
    WireTime,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A client that takes nothing for this long has gone: its frame is abandoned.
const STALL: Duration = Duration::from_secs(2);
/// How long to listen while a frame waits for credit.
pub(super) const LISTEN: Duration = Duration::from_millis(5);
/// How long to listen while packets wait for room in the link's queue.
pub(super) const BREATH: Duration = Duration::from_micros(200);

impl Server {
    /// Sends all packets of a shot.
    pub(super) fn deliver(&mut self, shot: &Shot, stop: &AtomicBool) -> Result<(), Undelivered> {
        let detector = &shot.camera.detector;
        let packing = Packing::for_bits(detector.bits);
        let text = shot.json.as_bytes();
        let instant =
            |epoch| to_wire(epoch).ok_or_else(|| unencodable("a time beyond the time code"));
        let time = instant(shot.exposure.mid)?;
        let frame = shot.number;
        let parts = u32::try_from(text.len()).ok().and_then(label_parts);
        let parts = parts.ok_or_else(|| unencodable("more labels than packets can number"))?;
        let header = FrameHeader {
            frame,
            attitude_sequence: shot.key.sequence,
            width: detector.width as u16,
            height: detector.height as u16,
            bits: detector.bits,
            packing,
            pixel_level: PixelLevel::Frame,
            label_level: LabelLevel::Text,
            window_size: 0,
            windows: 0,
            blocks: blocks_in_frame(detector.pixels() as u32, packing),
            label_parts: parts,
            label_bytes: text.len() as u32,
            exposure_start: instant(shot.exposure.start)?,
            exposure_end: instant(shot.exposure.end)?,
            seed: shot.key.seed,
            gain_e_per_dn: detector.gain_e_per_dn,
            offset_dn: detector.offset_dn,
            pixels_crc32: Crc32::new().update_pixels(&shot.frame.digits).finish(),
        };
        let run = Delivery {
            exchange: self.exchange.number,
            resets: self.exchange.resets,
            stop,
        };
        self.send_in_frame(&run, &Reply::FrameHeader(header), time)?;
        let mut packed = [0; MAX_PACKET];
        for BlockSlice {
            index,
            first_pixel,
            pixels,
        } in blocks(&shot.frame.digits, packing)
        {
            let data = &mut packed[..packed_length(packing, pixels.len())];
            pack(packing, pixels, data).map_err(unencodable)?;
            let count = pixels.len() as u16;
            let block = PixelBlock {
                frame,
                index,
                first_pixel,
                count,
                packing,
                data,
            };
            self.send_in_frame(&run, &Reply::PixelBlock(block), time)?;
        }
        for (part, text) in label_texts(text).take(usize::from(parts)).enumerate() {
            let label = LabelPart {
                frame,
                part: part as u16,
                parts,
                text,
            };
            self.send_in_frame(&run, &Reply::Labels(label), time)?;
        }
        Ok(())
    }

    /// Sends one packet that takes credit, listening while it has to wait.
    fn send_in_frame(
        &mut self,
        run: &Delivery<'_>,
        reply: &Reply<'_>,
        time: WireTime,
    ) -> Result<(), Undelivered> {
        let mut since = Instant::now();
        while !self.exchange.credit.may_send() {
            let before = self.exchange.credit;
            self.listen(run, LISTEN, since)?;
            if self.exchange.credit != before {
                since = Instant::now();
            }
        }
        let mut buffer = [0; MAX_PACKET];
        let count = self.counts.next(reply.apid());
        let length = (self.personality.encode_reply)(reply, count, time, &mut buffer)
            .map_err(unencodable)?;
        let packet = Bytes::copy_from_slice(&buffer[..length]);
        let mut waiting = Some(Outbound::Packet {
            exchange: run.exchange,
            packet,
        });
        let since = Instant::now();
        while let Some(packet) = waiting.take() {
            waiting = match self.flush() {
                Ok(true) => self.wire.outbox.offer(packet),
                Ok(false) => Ok(Some(packet)),
                Err(error) => Err(error),
            }
            .map_err(Undelivered::Link)?;
            if waiting.is_some() {
                self.listen(run, BREATH, since).inspect_err(|_| {
                    self.counters.lost_outbound = self.counters.lost_outbound.wrapping_add(1);
                })?;
            }
        }
        self.exchange.credit.spend();
        Ok(())
    }

    /// Handles what arrives within `pause`; gives the frame up when its client has.
    fn listen(
        &mut self,
        run: &Delivery<'_>,
        pause: Duration,
        since: Instant,
    ) -> Result<(), Undelivered> {
        let alive = self.receive(pause).map_err(Undelivered::Link)?;
        let stands = self.exchange.number == run.exchange && self.exchange.resets == run.resets;
        if alive && stands && since.elapsed() < STALL && !run.stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        Err(Undelivered::Abandoned)
    }
}

/// What has to stay as it is for a frame to be delivered.
struct Delivery<'a> {
    exchange: u32,
    resets: u32,
    stop: &'a AtomicBool,
}

/// A packet that the wire language cannot hold: the frame is given up, and the log says why.
fn unencodable(error: impl std::fmt::Display) -> Undelivered {
    tracing::error!(%error, "a packet of a frame could not be encoded");
    Undelivered::Abandoned
}
