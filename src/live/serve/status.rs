//! The answer to Ping.

use super::state::State;
use crate::timing::FrameTimes;
use hifitime::Epoch;
use skyloop_firmware_sim::time::to_wire;
use skyloop_protocols::{Counters, Packing, Status, Timing, Withheld};
use skyloop_render::scene::Exposure;
use std::time::Instant;

/// The Status for the client of a link.
pub(super) fn status(state: &State, link: usize) -> Status {
    let channel = &state.session.channels[link];
    // A link without frames reports the first link with frames.
    let source = if channel.roles.bring_frames() {
        Some(channel)
    } else {
        state.session.outgoing().next()
    };
    let exchange = &channel.exchange;
    let camera = state.client.camera();
    let detector = &camera.detector;
    let sync = state.client.sync(Instant::now());
    let last = source.and_then(|source| source.last.as_ref());
    let exposed = |at: fn(&Exposure) -> Epoch| {
        let exposure = last.and_then(|last| last.exposure.as_ref());
        let time = exposure.and_then(|exposure| to_wire(at(exposure)));
        time.unwrap_or_default()
    };
    let latency_s = |quantile| {
        let latency = source.and_then(|source| source.latencies.last_byte.quantile(quantile));
        latency.map_or(0.0, |latency| latency.as_secs_f32())
    };
    Status {
        mode: state.client.clock.mode(),
        width: detector.width as u16,
        height: detector.height as u16,
        bits: detector.bits,
        packing: Packing::for_bits(detector.bits),
        output: exchange.output,
        exposure_s: camera.exposure_s,
        gain_e_per_dn: detector.gain_e_per_dn,
        frame_rate_hz: camera.rate_hz,
        next_frame: state.frames.next_frame,
        packets_sent: exchange.credit.sent(),
        sync: sync.state,
        clock_offset_s: sync.offset_s,
        exposure_start: exposed(|exposure| exposure.start),
        exposure_end: exposed(|exposure| exposure.end),
        timing: last.map(|last| timing(&last.times)).unwrap_or_default(),
        latency_p50_s: latency_s(0.5),
        latency_p99_s: latency_s(0.99),
        latency_max_s: latency_s(1.0),
        withheld: source.map_or(Withheld::None, |source| source.exchange.withheld),
        counters: Counters {
            deadlines_missed: source.map_or(0, |source| source.latencies.missed as u32),
            ..state.counters()
        },
    }
}

/// The times of a frame that has left, for the wire.
fn timing(times: &FrameTimes) -> Timing {
    Timing {
        attitude_age_s: times.attitude_age_s as f32,
        first_pixel_s: times.first_pixel.as_secs_f32(),
        last_pixel_s: times.last_pixel.as_secs_f32(),
        first_octet_s: times.first_byte.as_secs_f32(),
        last_octet_s: times.last_byte.as_secs_f32(),
        spare_s: if times.spare_s.is_finite() {
            times.spare_s as f32
        } else {
            0.0
        },
    }
}
