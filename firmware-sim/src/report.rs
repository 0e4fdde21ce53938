//! What a run amounts to: counts, latencies, centroid residuals, refusals.

use std::fmt;

use skyloop_protocols::{Reason, Status};

use crate::contents::Contents;
use crate::control::ControlTelemetry;
use crate::reassembly::AssemblyCounts;
use crate::score::Score;
use crate::times::Times;
use crate::timings::Timings;

/// Nacks kept with their details; the count goes on.
const NACKS_KEPT: usize = 100;
/// Residuals kept: 16 octets each, bounded for runs without end.
const RESIDUALS_KEPT: usize = 1 << 20;

/// A refusal by the emulator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NackRecord {
    /// APID of the refused packet.
    pub apid: u16,
    /// Sequence count of the refused packet.
    pub sequence_count: u16,
    /// Why.
    pub reason: Reason,
    /// What and where, in the emulator's words.
    pub detail: String,
}

impl fmt::Display for NackRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "packet {:#05x}/{} refused ({:?}): {}",
            self.apid, self.sequence_count, self.reason, self.detail
        )
    }
}

/// The outcome of a run.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Frames asked for.
    pub requested: u32,
    /// Frames received whole.
    pub frames: u32,
    /// Frames that did not arrive in time, or damaged.
    pub lost: u32,
    /// Frames that the emulator refused to take (a `Nack` to the attitude).
    pub refused: u32,
    /// Whole frames that came too late to count.
    pub late: u32,
    /// Attitude sent to last pixel block received.
    pub latencies: Times,
    /// What the emulator says of its frames' times.
    pub timings: Timings,
    /// What the frames brought.
    pub contents: Contents,
    /// Octets of all packets that came.
    pub bytes: u64,
    /// The scores of all frames added up.
    pub totals: Totals,
    /// What came of the closed loop, if one was flown.
    pub control: Option<ControlTelemetry>,
    /// How many Nacks came.
    pub nack_count: u64,
    /// The first hundred of them.
    pub nacks: Vec<NackRecord>,
    /// Packets that were none of ours: damaged or unknown.
    pub undecodable: u64,
    /// Packets that the link itself dropped.
    pub dropped: u64,
    /// Frame packets missing in the emulator's sequence counts.
    pub missing_packets: u64,
    /// What was asked for again.
    pub recovery: RecoveryCounts,
    /// What the reassembly met.
    pub assembly: AssemblyCounts,
    /// What the frames did not bring although it was asked for, and why.
    pub warning: Option<String>,
    /// The line that had gone at the end, and what to do.
    pub gone: Option<String>,
    /// The emulator's settings and counters at the end, if it answered.
    pub status: Option<Status>,
}

/// What was asked for again, and what came of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecoveryCounts {
    /// Requests for missing packets. What came of them: [`AssemblyCounts::recovered`].
    pub requested: u64,
    /// Attitudes sent again because nothing came of them.
    pub attitudes: u64,
    /// Frames that came a second time: both copies of the attitude had arrived.
    pub duplicates: u64,
    /// Requests and repeated attitudes that the emulator refused: they came too late.
    pub refused: u64,
    /// Packets that the emulator got damaged (`Nack` BadCrc or BadLength): losses, not refusals.
    pub damaged: u64,
}

impl Report {
    pub(crate) fn nack(&mut self, nack: NackRecord) {
        self.nack_count += 1;
        if self.nacks.len() < NACKS_KEPT {
            self.nacks.push(nack);
        }
    }
}

/// Scores of many frames added up.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    /// Visible labelled stars.
    pub stars: u64,
    /// Visible labelled RSOs.
    pub rsos: u64,
    /// Detections.
    pub detections: u64,
    /// Labels with a detection.
    pub matched: u64,
    /// Bright, visible, isolated labels without one.
    pub missed: u64,
    /// Detections without labelled light.
    pub false_detections: u64,
    /// Frames whose pixels were compared with labels.
    pub compared: u32,
    /// Frames whose labels could not be read.
    pub unscored: u32,
    pub(crate) residuals_px: Vec<[f64; 2]>,
}

impl Totals {
    /// Adds a frame.
    pub fn add(&mut self, score: &Score) {
        self.compared += u32::from(score.is_compared);
        self.stars += score.stars as u64;
        self.rsos += score.rsos as u64;
        self.detections += score.detections as u64;
        self.matched += score.matches.len() as u64;
        self.missed += score.missed.len() as u64;
        self.false_detections += score.false_detections as u64;
        let room = RESIDUALS_KEPT.saturating_sub(self.residuals_px.len());
        let counted = score.matches.iter().filter(|m| m.counts()).take(room);
        self.residuals_px
            .extend(counted.map(|m| [m.dx_px, m.dy_px]));
    }

    /// Residuals between detections and labels, over those that count ([`crate::score::Match::counts`]); `None` if there
    /// are none.
    #[must_use]
    pub fn residual(&self) -> Option<Residual> {
        let count = self.residuals_px.len();
        let residuals = self.residuals_px.iter();
        let mean =
            |value: fn(&[f64; 2]) -> f64| residuals.clone().map(value).sum::<f64>() / count as f64;
        let distances = residuals.clone().map(|[x, y]| libm::hypot(*x, *y));
        let mut distances: Vec<f64> = distances.collect();
        distances.sort_by(f64::total_cmp);
        Some(Residual {
            count,
            // By nearest rank; none without any.
            median_px: *distances.get(count.div_ceil(2).saturating_sub(1))?,
            rms_px: mean(|[x, y]| x * x + y * y).sqrt(),
            bias_px: [mean(|[x, _]| *x), mean(|[_, y]| *y)],
        })
    }
}

/// Detected minus labelled centroids: unsaturated, isolated, whole objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// How many.
    pub count: usize,
    /// Root mean square of the distance, px.
    pub rms_px: f64,
    /// Median of the distance, px.
    pub median_px: f64,
    /// Mean along columns and rows, px.
    pub bias_px: [f64; 2],
}

impl fmt::Display for Report {
    /// A short table.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            frames,
            requested,
            lost,
            refused,
            late,
            bytes: octets,
            timings,
            contents,
            totals,
            nack_count,
            ..
        } = self;
        writeln!(
            f,
            "frames           {frames} of {requested} whole, {lost} lost, {refused} refused, {late} after their time-out"
        )?;
        let ms = |fraction| Some(self.latencies.quantile(fraction)?.as_secs_f64() * 1e3);
        if let (Some(p50), Some(p99), Some(max)) = (ms(0.5), ms(0.99), ms(1.0)) {
            writeln!(
                f,
                "last block after p50 {p50:.2} ms, p99 {p99:.2} ms, max {max:.2} ms"
            )?;
        }
        writeln!(f, "{timings}received         {octets} octets{contents}")?;
        write!(f, "{totals}")?;
        if let Some(control) = &self.control {
            write!(f, "{control}")?;
        }
        self.write_packets(f)?;
        if totals.unscored > 0 {
            let frames = totals.unscored;
            writeln!(f, "labels           unreadable in {frames} frames")?;
        }
        writeln!(f, "refusals         {nack_count}")?;
        for nack in self.nacks.iter().take(5) {
            writeln!(f, "  {nack}")?;
        }
        if let Some(status) = &self.status {
            let counters = status.counters.iter().filter(|(_, value)| *value > 0);
            let counters: Vec<String> = counters.map(|(name, n)| format!("{name} {n}")).collect();
            let head = if counters.is_empty() {
                ""
            } else {
                "emulator counts  "
            };
            writeln!(f, "{head}{}", counters.join(", "))?;
        }
        match &self.warning {
            Some(warning) => writeln!(f, "warning          {warning}"),
            None => Ok(()),
        }
    }
}

impl Report {
    /// The lines about packets.
    fn write_packets(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let AssemblyCounts {
            duplicates,
            out_of_order,
            refused,
            bad_pixels,
            incomplete,
            recovered,
        } = self.assembly;
        let (missing, damaged) = (self.missing_packets, self.undecodable + self.dropped);
        writeln!(
            f,
            "packets          {missing} missing, {duplicates} repeated, {out_of_order} out of order, {damaged} damaged, \
             {refused} contradictory or early; {bad_pixels} frames damaged, {incomplete} incomplete"
        )?;
        let RecoveryCounts {
            requested,
            attitudes,
            duplicates,
            refused,
            damaged,
        } = self.recovery;
        if self.recovery != RecoveryCounts::default() {
            writeln!(
                f,
                "asked again      {requested} times, {recovered} packets came; {attitudes} attitudes sent again, \
                 {duplicates} duplicate frames; {refused} too late, {damaged} damaged on the way there"
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for Totals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            stars,
            rsos,
            detections,
            matched,
            missed,
            false_detections,
            ..
        } = self;
        writeln!(
            f,
            "visible labels   {stars} stars, {rsos} RSOs\n\
             detections       {detections}: {matched} matched, {false_detections} false; {missed} bright labels missed"
        )?;
        match self.residual() {
            Some(Residual {
                count,
                rms_px,
                median_px,
                bias_px: [x, y],
            }) => writeln!(
                f,
                "residual         rms {rms_px:.3} px, median {median_px:.3} px, bias {x:+.3} {y:+.3} px \
                 ({count} isolated, unsaturated objects)"
            ),
            None => writeln!(
                f,
                "residual         none: no isolated, unsaturated object was matched"
            ),
        }
    }
}
