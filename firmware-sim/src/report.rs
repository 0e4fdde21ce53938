//! Result of a run: counters, latencies, centroid residuals, refusals.

use std::fmt;

use skyloop_protocols::{Reason, Status};

use crate::contents::Contents;
use crate::control::ControlTelemetry;
use crate::reassembly::AssemblyCounts;
use crate::score::Score;
use crate::times::Times;
use crate::timings::Timings;

/// Maximum number of stored Nacks; further ones are counted only.
const MAX_NACKS: usize = 100;
/// Maximum number of stored residuals, 16 bytes each.
const MAX_RESIDUALS: usize = 1 << 20;

/// A refusal by the emulator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NackRecord {
    /// APID of the refused packet.
    pub apid: u16,
    /// Sequence count of the refused packet.
    pub sequence_count: u16,
    /// Reason.
    pub reason: Reason,
    /// Details as text from the emulator.
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

/// Result of a run.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Requested frames.
    pub requested: u32,
    /// Complete frames.
    pub frames: u32,
    /// Frames that timed out or arrived damaged.
    pub lost: u32,
    /// Frames refused by the emulator (`Nack` to the attitude).
    pub refused: u32,
    /// Complete frames received too late to count.
    pub late: u32,
    /// Times from the sending of an attitude to the last pixel block of its frame.
    pub latencies: Times,
    /// Times reported by the emulator.
    pub timings: Timings,
    /// Statistics of the frames' content.
    pub contents: Contents,
    /// Bytes of all received packets.
    pub bytes: u64,
    /// Sums of all scores.
    pub totals: Totals,
    /// Telemetry of the closed loop, if there was one.
    pub control: Option<ControlTelemetry>,
    /// Number of Nacks.
    pub nack_count: u64,
    /// The first hundred Nacks.
    pub nacks: Vec<NackRecord>,
    /// Undecodable packets: damaged or unknown.
    pub undecodable: u64,
    /// Packets dropped by the link.
    pub dropped: u64,
    /// Frame packets missing in the emulator's sequence counts.
    pub missing_packets: u64,
    /// Counters of repeated requests.
    pub recovery: RecoveryCounts,
    /// Counters of the reassembly.
    pub assembly: AssemblyCounts,
    /// Requested content that the frames lack, and the reason.
    pub warning: Option<String>,
    /// Error and remedy of a line that was gone at the end.
    pub gone: Option<String>,
    /// Final settings and counters of the emulator, if it answered.
    pub status: Option<Status>,
}

/// Counters of repeated requests and attitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecoveryCounts {
    /// Requests for missing packets; [`AssemblyCounts::recovered`] counts their success.
    pub requested: u64,
    /// Attitudes repeated without a reply.
    pub attitudes: u64,
    /// Duplicate frames: both copies of the attitude had arrived.
    pub duplicates: u64,
    /// Requests and repeated attitudes that the emulator refused as too late.
    pub refused: u64,
    /// Packets that the emulator received damaged (`Nack` BadCrc or BadLength): losses, not
    /// refusals.
    pub damaged: u64,
}

impl Report {
    pub(crate) fn nack(&mut self, nack: NackRecord) {
        self.nack_count += 1;
        if self.nacks.len() < MAX_NACKS {
            self.nacks.push(nack);
        }
    }
}

/// Sums of the scores of many frames.
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
    /// Bright, visible, isolated labels without a detection.
    pub missed: u64,
    /// Detections without labelled light.
    pub false_detections: u64,
    /// Frames with pixels and labels to compare.
    pub compared: u32,
    /// Frames with unreadable labels.
    pub unscored: u32,
    pub(crate) residuals_px: Vec<[f64; 2]>,
}

impl Totals {
    /// Adds a frame.
    pub(crate) fn add(&mut self, score: &Score) {
        self.compared += u32::from(score.is_compared);
        self.stars += score.stars as u64;
        self.rsos += score.rsos as u64;
        self.detections += score.detections as u64;
        self.matched += score.matches.len() as u64;
        self.missed += score.missed.len() as u64;
        self.false_detections += score.false_detections as u64;
        let room = MAX_RESIDUALS.saturating_sub(self.residuals_px.len());
        let counted = score.matches.iter().filter(|m| m.counts()).take(room);
        self.residuals_px
            .extend(counted.map(|m| [m.dx_px, m.dy_px]));
    }

    /// Residuals of the matches that count ([`crate::score::Match::counts`]); `None` without any.
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
            // Nearest rank; none without residuals.
            median_px: *distances.get(count.div_ceil(2).saturating_sub(1))?,
            rms_px: mean(|[x, y]| x * x + y * y).sqrt(),
            bias_px: [mean(|[x, _]| *x), mean(|[_, y]| *y)],
        })
    }
}

/// Detected minus labelled centroids of unsaturated, isolated objects within the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Number of objects.
    pub count: usize,
    /// Root mean square of the distance, px.
    pub rms_px: f64,
    /// Median of the distance, px.
    pub median_px: f64,
    /// Mean along columns and rows, px.
    pub bias_px: [f64; 2],
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            frames,
            requested,
            lost,
            refused,
            late,
            bytes,
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
        writeln!(f, "{timings}received         {bytes} bytes{contents}")?;
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
            let again = format!("{attitudes} attitudes sent again, {duplicates} duplicate frames");
            let failed = format!("{refused} too late, {damaged} damaged on the way there");
            writeln!(
                f,
                "requested again  {requested} times, {recovered} packets came; {again}; {failed}"
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
