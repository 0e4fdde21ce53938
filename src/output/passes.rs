//! Passes through a camera's field as a table, CSV and JSON.

use crate::passes::{Lit, Pass, PassInstant};
use hifitime::{Epoch, Unit};
use serde::Serialize;
use skyloop_orbit::Object;
use skyloop_orbit::time::utc_text;
use skyloop_render::effect::counted;
use skyloop_render::label::why_hidden;
use std::fmt::Write;

/// A pass in the units of output files.
#[derive(Debug, Serialize)]
pub struct Row {
    id: String,
    name: String,
    enters: Moment,
    leaves: Moment,
    nearest: Moment,
    brightest: Option<Moment>,
    min_range_utc: String,
    min_range_km: f64,
    rate_px_s: f64,
    duration_s: f64,
    lit_s: f64,
    in_field_at_start: bool,
    in_field_at_end: bool,
    spans: Vec<Span>,
}

#[derive(Debug, Serialize)]
struct Moment {
    utc: String,
    place_px: [f64; 2],
    off_axis_deg: f64,
    range_km: f64,
    phase_deg: f64,
    /// Magnitude in full sunlight.
    mag: Option<f64>,
    /// Magnitude of the arriving light.
    band_mag: Option<f64>,
    reason: &'static str,
}

#[derive(Debug, Serialize)]
struct Span {
    from: String,
    to: String,
    seconds: f64,
    /// Why no light arrives; empty if light arrives.
    reason: &'static str,
}

/// UTC rounded to a millisecond, the accuracy of instants.
fn to_ms(epoch: Epoch) -> String {
    utc_text(epoch.round(Unit::Millisecond * 1))
}

/// The CSV header: a column for each value of a row except its spans.
const HEAD: &str = "id,name,enters_utc,enters_x_px,enters_y_px,enters_band_mag,leaves_utc,leaves_x_px,leaves_y_px,leaves_band_mag,\
                    nearest_utc,nearest_deg,nearest_x_px,nearest_y_px,brightest_utc,brightest_band_mag,min_range_utc,min_range_km,\
                    rate_px_s,duration_s,lit_s,in_field_at_start,in_field_at_end,reason";

impl Row {
    /// The row for a pass of `object`.
    pub fn new(pass: &Pass, object: &Object) -> Row {
        let seconds = |lit: &Lit| (lit.to - lit.from).to_seconds();
        let lit = pass.lit.iter().filter(|lit| lit.hidden.is_none());
        Row {
            id: object.id.to_string(),
            name: object
                .names
                .first()
                .map_or(String::new(), |name| name.to_string()),
            enters: Moment::new(&pass.entry),
            leaves: Moment::new(&pass.exit),
            nearest: Moment::new(&pass.nearest),
            brightest: pass.brightest.as_ref().map(Moment::new),
            min_range_utc: to_ms(pass.closest.0),
            min_range_km: pass.closest.1 * 1e-3,
            rate_px_s: pass.rate_px_s,
            duration_s: (pass.exit.point.epoch - pass.entry.point.epoch).to_seconds(),
            // An empty `sum()` would be -0.
            lit_s: lit.map(seconds).fold(0.0, |sum, s| sum + s),
            in_field_at_start: pass.in_field_at_start,
            in_field_at_end: pass.in_field_at_end,
            spans: pass
                .lit
                .iter()
                .map(|lit| Span {
                    from: to_ms(lit.from),
                    to: to_ms(lit.to),
                    seconds: seconds(lit),
                    reason: lit.hidden.map_or("", why_hidden),
                })
                .collect(),
        }
    }

    /// Reasons for darkness: `in the Earth's shadow, behind the Earth`.
    fn reasons(&self) -> String {
        let mut reasons: Vec<&str> = self.spans.iter().map(|span| span.reason).collect();
        reasons.retain(|reason| !reason.is_empty());
        if self.brightest.is_none() && reasons.is_empty() {
            reasons.push(self.nearest.reason);
        }
        reasons.dedup();
        reasons.join(" and ")
    }
}

impl Moment {
    fn new(at: &PassInstant) -> Moment {
        Moment {
            utc: to_ms(at.point.epoch),
            place_px: at.position_px,
            off_axis_deg: at.off_axis.to_degrees(),
            range_km: at.point.range_m * 1e-3,
            phase_deg: at.point.phase.to_degrees(),
            mag: at.point.mag.is_finite().then_some(at.point.mag),
            band_mag: at.point.band_mag(),
            reason: at.point.reason(),
        }
    }

    fn band_mag(&self) -> String {
        self.band_mag
            .map_or(String::new(), |mag| format!("{mag:.4}"))
    }
}

/// A table for the terminal. If no pass crosses midnight, nearest and leaving times omit the date.
pub fn table(rows: &[Row]) -> String {
    let within_a_day = rows.iter().all(|row| {
        let [day, others @ ..] = [&row.enters, &row.nearest, &row.leaves].map(|at| date(&at.utc));
        others.iter().all(|other| *other == day)
    });
    let (when, width): (fn(&str) -> &str, usize) = if within_a_day {
        (time_of_day, 12)
    } else {
        (|utc| utc, 24)
    };
    let mut text = format!(
        "{:<24} {:<24} {:<width$} {:<width$} {:>8} {:>7} {:>9} {:>9} {:>8} {:>8} {:>9} {:>8} {:>13} {:>13}  {}\n",
        "object",
        "enters, UTC",
        "nearest",
        "leaves",
        "s",
        "lit, s",
        "off, deg",
        "peak mag",
        "mag in",
        "mag out",
        "least km",
        "px/s",
        "px in",
        "px out",
        "dark"
    );
    for row in rows {
        let mag = |at: Option<&Moment>| {
            let mag = at.and_then(|at| at.band_mag);
            mag.map_or("-".to_string(), |mag| format!("{mag:.2}"))
        };
        let place = |at: &Moment| format!("{:.1},{:.1}", at.place_px[0], at.place_px[1]);
        let name = match row.name.as_str() {
            "" => row.id.as_str(),
            name => name,
        };
        let _ = writeln!(
            text,
            "{:<24} {:<24} {:<width$} {:<width$} {:>8} {:>7.1} {:>9.3} {:>9} {:>8} {:>8} {:>9.1} {:>8.2} {:>13} {:>13}  {}",
            name.chars().take(24).collect::<String>(),
            row.enters.utc,
            when(&row.nearest.utc),
            when(&row.leaves.utc),
            // A pass cut by the ends of the search lasts longer.
            if row.in_field_at_start || row.in_field_at_end {
                format!(">{:.1}", row.duration_s)
            } else {
                format!("{:.1}", row.duration_s)
            },
            row.lit_s,
            row.nearest.off_axis_deg,
            mag(row.brightest.as_ref()),
            mag(Some(&row.enters)),
            mag(Some(&row.leaves)),
            row.min_range_km,
            row.rate_px_s,
            place(&row.enters),
            place(&row.leaves),
            row.reasons(),
        );
    }
    text
}

/// The date of a date and time, `2019-06-15`.
fn date(utc: &str) -> &str {
    utc.split_once('T').unwrap_or_default().0
}

/// The time of a date and time, `23:35:50.000`.
fn time_of_day(utc: &str) -> &str {
    let (_, time) = utc.split_once('T').unwrap_or_default();
    time.trim_end_matches('Z')
}

/// CSV with a header; a magnitude is empty if no light arrives.
pub fn csv(rows: &[Row]) -> String {
    let mut text = format!("{HEAD}\n");
    for row in rows {
        let place = |at: &Moment| format!("{:.4},{:.4}", at.place_px[0], at.place_px[1]);
        let (enters, leaves, nearest) = (&row.enters, &row.leaves, &row.nearest);
        let brightest = row.brightest.as_ref();
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{:.6},{},{},{},{},{:.6},{:.4},{:.6},{:.6},{},{},{}",
            quoted(&row.id),
            quoted(&row.name),
            enters.utc,
            place(enters),
            enters.band_mag(),
            leaves.utc,
            place(leaves),
            leaves.band_mag(),
            nearest.utc,
            nearest.off_axis_deg,
            place(nearest),
            brightest.map_or("", |at| at.utc.as_str()),
            brightest.map_or(String::new(), Moment::band_mag),
            row.min_range_utc,
            row.min_range_km,
            row.rate_px_s,
            row.duration_s,
            row.lit_s,
            row.in_field_at_start,
            row.in_field_at_end,
            quoted(&row.reasons()),
        );
    }
    text
}

/// A field of CSV (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_string()
    }
}

/// The searched interval, and what is missing in the list of passes.
#[derive(Debug, Serialize)]
pub struct Searched {
    /// The scene's file.
    pub scene: String,
    /// The first instant, UTC.
    pub from: String,
    /// The last one.
    pub to: String,
    /// Number of searched objects.
    pub objects: usize,
    /// Number of omitted passes, which stay fainter than the limit.
    pub fainter: usize,
    /// Objects without a state at some time.
    pub without_state: Vec<String>,
    /// Times that were not searched, since the pointing has no direction: first and last instants,
    /// UTC.
    pub not_searched: Vec<[String; 2]>,
    /// Leap seconds between the first and the last instant: the search is longer than the
    /// difference of these texts by this number of seconds.
    pub leap_seconds: i32,
}

impl Searched {
    /// In one line, with the number of listed passes.
    pub fn line(&self, passes: usize) -> String {
        let passes = match passes {
            1 => "1 pass".to_string(),
            count => format!("{count} passes"),
        };
        let fainter = match self.fainter {
            0 => String::new(),
            left => format!(", {left} more stay fainter than --mag-limit"),
        };
        let leap = match self.leap_seconds {
            0 => "",
            _ => ", with a leap second in between: durations are SI seconds",
        };
        let objects = counted(self.objects, "object");
        format!(
            "{passes} of {objects} from {} to {}{fainter}{leap}",
            self.from, self.to
        )
    }
}

/// JSON: an object with the search and an array of passes.
pub fn json(searched: &Searched, rows: &[Row]) -> String {
    #[derive(Serialize)]
    struct All<'a> {
        #[serde(flatten)]
        searched: &'a Searched,
        passes: &'a [Row],
    }
    let all = All {
        searched,
        passes: rows,
    };
    let text = serde_json::to_string_pretty(&all);
    text.unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}")) + "\n"
}
