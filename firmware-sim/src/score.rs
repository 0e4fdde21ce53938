//! Compares detections with labels, once the detections are fixed.

use serde::Deserialize;
use skyloop_protocols::{LabelLevel, ObjectRecord};
use thiserror::Error;

use crate::detector::{Detection, Detections};
use crate::received::{Content, ReceivedFrame, SealError};

/// Maximum distance between a detection and its label, px.
pub(crate) const MATCH_RADIUS_PX: f64 = 2.0;
/// A label is isolated if all other labels within this distance, px, ...
pub(crate) const ISOLATION_RADIUS_PX: f64 = 5.0;
/// ... have together less than this fraction of its electrons.
pub(crate) const ISOLATION_LIGHT: f64 = 0.05;
/// Isolated, visible labels with at least this signal to noise should be detected.
pub const BRIGHT_SNR: f64 = 10.0;

/// Fields of a labelled object for the score.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Label {
    /// `star`, `rso`, `planet` or `moon`; others, such as `radiation` and `defect`, are no light
    /// sources.
    pub kind: String,
    /// The object's identifier.
    pub id: String,
    /// Centroid along columns, px.
    pub x_px: f64,
    /// Centroid along rows, px.
    pub y_px: f64,
    /// Total signal, e-.
    pub electrons: f64,
    /// Signal to noise by the label's definition.
    pub snr: f64,
    /// Whether the centroid is in the frame.
    pub in_frame: bool,
    /// In frame, lit, not occulted, snr >= 3.
    pub visible: bool,
}

impl Label {
    /// Whether it is a light source, which should be detected.
    fn is_source(&self) -> bool {
        matches!(self.kind.as_str(), "star" | "rso" | "planet" | "moon")
    }
}

impl From<ObjectRecord> for Label {
    fn from(object: ObjectRecord) -> Self {
        let id = String::from_utf8_lossy(&object.id);
        Self {
            kind: if object.is_rso { "rso" } else { "star" }.into(),
            id: id.trim_end_matches('\0').into(),
            x_px: object.x_px,
            y_px: object.y_px,
            electrons: object.electrons.into(),
            snr: object.snr.into(),
            in_frame: object.in_frame,
            visible: object.visible,
        }
    }
}

/// Labels of a frame; other fields are ignored.
#[derive(Deserialize)]
struct Labels {
    objects: Vec<Label>,
}

/// Error when a frame has no score.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ScoreError {
    #[error(transparent)]
    Sealed(#[from] SealError),
    #[error("labels of frame {frame}: {reason}")]
    BadLabels {
        frame: u32,
        reason: serde_json::Error,
    },
}

/// A label and its detection.
#[derive(Clone, Debug, PartialEq)]
pub struct Match {
    /// The label.
    pub label: Label,
    /// Detected minus labelled, along columns, px.
    pub dx_px: f64,
    /// Detected minus labelled, along rows, px.
    pub dy_px: f64,
    /// Whether the labels nearby have little light compared with it.
    pub isolated: bool,
    /// Whether its brightest pixel is near full scale.
    pub saturated: bool,
    /// Whether the frame's edge cuts it.
    pub edge: bool,
}

impl Match {
    /// Whether it counts for centroid errors: isolated, not saturated, not cut by the frame.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.isolated && !self.saturated && !self.edge
    }
}

/// Comparison of a frame's detections with its labels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Whether there were pixels and labels to compare.
    pub is_compared: bool,
    /// Visible labelled stars.
    pub stars: usize,
    /// Visible labelled RSOs.
    pub rsos: usize,
    /// Detections.
    pub detections: usize,
    /// Labels with their detections.
    pub matches: Vec<Match>,
    /// Identifiers of visible, isolated labels of snr >= [`BRIGHT_SNR`] without a detection, where
    /// pixels were sent.
    pub missed: Vec<String>,
    /// Detections without a label nearby. If only the brightest objects are labelled, only
    /// detections more than twice as bright as the faintest of these count.
    pub false_detections: usize,
}

/// Opens the labels of a frame, text or objects, and compares its detections with them.
///
/// # Errors
/// [`ScoreError`]: detections of another frame, or labels that cannot be read.
pub fn score(frame: &ReceivedFrame, detections: &Detections) -> Result<Score, ScoreError> {
    let (labels, complete) = match frame.header.label_level {
        LabelLevel::None => {
            return Ok(Score {
                detections: detections.list().len(),
                ..Score::default()
            });
        }
        LabelLevel::Objects => {
            let objects = frame.objects(detections)?;
            (objects.into_iter().map(Label::from).collect(), false)
        }
        LabelLevel::Text => {
            let text = frame.labels(detections)?;
            let labels: Result<Labels, _> = serde_json::from_str(text);
            let labels = labels.map_err(|reason| ScoreError::BadLabels {
                frame: frame.header.frame,
                reason,
            })?;
            (labels.objects, true)
        }
    };
    Ok(compare(labels, complete, frame, detections))
}

fn compare(
    labels: Vec<Label>,
    complete: bool,
    frame: &ReceivedFrame,
    detections: &Detections,
) -> Score {
    /// With incomplete labels, a detection this much brighter than the faintest label should have
    /// one.
    const MIN_RATIO: f64 = 2.0;
    let (labels, artifacts): (Vec<Label>, Vec<Label>) =
        labels.into_iter().partition(Label::is_source);
    let faintest = labels.iter().map(|label| label.electrons);
    let faintest = faintest.min_by(f64::total_cmp).unwrap_or(f64::INFINITY);
    let due_e = if complete {
        f64::MIN
    } else {
        MIN_RATIO * faintest
    };
    // Artifacts such as particle hits and defects count as neither found, missed nor false.
    let (field, artifacts) = (Field::new(labels), Field::new(artifacts));
    let found = detections.list();
    let (mut used, mut labelled) = (vec![false; found.len()], vec![false; field.0.len()]);
    let mut matches = Vec::new();
    for (_, detection, label) in field.pairs(found) {
        if !used[detection] && !labelled[label] {
            (used[detection], labelled[label]) = (true, true);
            matches.push(field.matched(label, &found[detection]));
        }
    }
    let visible = field.0.iter().filter(|label| label.visible);
    let count = |kind: &str| visible.clone().filter(|label| label.kind == kind).count();
    let is_false = |(at, used): &(&Detection, &bool)| {
        let has_light = |field: &Field| field.has_light(at.x_px, at.y_px);
        !**used && at.flux_e > due_e && !has_light(&field) && !has_light(&artifacts)
    };
    let is_missed = |index: &usize| {
        let label = &field.0[*index];
        let bright = label.visible && label.snr >= BRIGHT_SNR && !labelled[*index];
        bright && field.is_isolated(*index) && frame.shows(label.x_px, label.y_px)
    };
    let missed = (0..field.0.len()).filter(is_missed);
    Score {
        is_compared: frame.content != Content::None,
        stars: count("star"),
        rsos: count("rso"),
        detections: found.len(),
        false_detections: found.iter().zip(&used).filter(is_false).count(),
        missed: missed.map(|index| field.0[index].id.clone()).collect(),
        matches,
    }
}

/// Labels sorted by x, for neighbour searches.
struct Field(Vec<Label>);

impl Field {
    fn new(mut labels: Vec<Label>) -> Self {
        labels.sort_by(|a, b| a.x_px.total_cmp(&b.x_px));
        Self(labels)
    }

    /// Indices and distances of the labels within a radius.
    fn near(&self, x: f64, y: f64, radius: f64) -> impl Iterator<Item = (usize, f64)> {
        let first = self.0.partition_point(|label| label.x_px < x - radius);
        let columns = self.0.iter().enumerate().skip(first);
        let columns = columns.take_while(move |(_, label)| label.x_px <= x + radius);
        let near =
            columns.map(move |(index, label)| (index, libm::hypot(label.x_px - x, label.y_px - y)));
        near.filter(move |(_, d)| *d <= radius)
    }

    /// Pairs within the match radius, nearest first: distance, detection, visible label.
    fn pairs(&self, found: &[Detection]) -> Vec<(f64, usize, usize)> {
        let mut pairs = Vec::new();
        for (detection, at) in found.iter().enumerate() {
            let near = self.near(at.x_px, at.y_px, MATCH_RADIUS_PX);
            let near = near.filter(|(label, _)| self.0[*label].visible);
            pairs.extend(near.map(|(label, d)| (d, detection, label)));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs
    }

    fn matched(&self, index: usize, at: &Detection) -> Match {
        let label = self.0[index].clone();
        Match {
            dx_px: at.x_px - label.x_px,
            dy_px: at.y_px - label.y_px,
            isolated: self.is_isolated(index),
            saturated: at.saturated,
            edge: at.edge,
            label,
        }
    }

    fn is_isolated(&self, index: usize) -> bool {
        let label = &self.0[index];
        let near = self.near(label.x_px, label.y_px, ISOLATION_RADIUS_PX);
        let others = near.filter(|(other, _)| *other != index);
        let light: f64 = others.map(|(other, _)| self.0[other].electrons).sum();
        light < ISOLATION_LIGHT * label.electrons
    }

    fn has_light(&self, x: f64, y: f64) -> bool {
        self.near(x, y, MATCH_RADIUS_PX)
            .any(|(label, _)| self.0[label].electrons > 0.0)
    }
}
