//! The report of a long run: as a table, as JSON, as JUnit XML.

use super::limits::{Camera, Limits, Measured};
use crate::host::{HostReport, Memory};
use crate::realtime::Granted;
use crate::timing::row;
use serde::{Serialize, Serializer};
use skyloop_firmware_sim::verdict::{Suite, Verdict};
use std::path::Path;

/// Results of a long run.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The scene's name.
    pub scene: String,
    /// How long it ran, min.
    pub minutes: f64,
    /// Whether all limits were met.
    pub passed: bool,
    /// The limits.
    pub limits: Limits,
    /// The verdicts.
    pub verdicts: Vec<Verdict>,
    /// Measurements of each camera.
    pub cameras: Vec<Camera>,
    /// From the start of the command to the first frame at the client, s; `None`: there was none.
    pub first_frame_s: Option<f64>,
    /// Its memory.
    pub memory: Memory,
    /// Load of the machine meanwhile.
    pub host: HostReport,
    /// Real-time settings that were granted.
    pub realtime: Granted,
    /// The run's counters by name.
    #[serde(serialize_with = "as_map")]
    pub counters: Vec<(&'static str, u32)>,
}

impl Report {
    /// Assesses the limits of a run.
    #[must_use]
    pub fn new(
        scene: String,
        minutes: f64,
        limits: Limits,
        measured: Measured,
        host: HostReport,
        realtime: Granted,
        counters: Vec<(&'static str, u32)>,
    ) -> Self {
        let verdicts = limits.assess(&measured);
        Self {
            scene,
            minutes,
            passed: verdicts.iter().all(|verdict| verdict.passed),
            limits,
            verdicts,
            cameras: measured.cameras,
            first_frame_s: measured.first_frame_s,
            memory: measured.memory,
            host,
            realtime,
            counters,
        }
    }

    /// The rows of a table.
    #[must_use]
    pub fn rows(&self) -> Vec<(String, String)> {
        let first = self.first_frame_s;
        let first = first.map_or("none".to_string(), |s| format!("{s:.2} s"));
        let mut rows = Vec::new();
        for camera in &self.cameras {
            if self.cameras.len() > 1 {
                rows.push(row("camera", camera.name.clone()));
            }
            rows.extend(camera.latencies.rows());
            rows.push(row("drift of the clocks", camera.drift.describe()));
        }
        rows.push(row("start to the first frame", first));
        rows.push(row("memory", self.memory.describe()));
        rows
    }

    /// The suite of a JUnit file, with the load of the machine and the table of times.
    #[must_use]
    pub fn suite(&self) -> Suite {
        let mut properties = self.host.rows();
        properties.push(row("real time", self.realtime.to_string()));
        let rows = self.rows();
        Suite {
            seconds: self.minutes * 60.0,
            properties,
            table: rows
                .iter()
                .map(|(name, value)| format!("{name}: {value}\n"))
                .collect(),
            ..suite(Path::new(&self.scene))
        }
    }
}

/// The suite of a run of this file. The class name does not depend on the folder, because
/// collectors group by it.
#[must_use]
pub fn suite(scene: &Path) -> Suite {
    let file = scene.file_name().unwrap_or(scene.as_os_str());
    let file = file.to_string_lossy().replace(['.', ' '], "_");
    Suite {
        name: "skyloop soak",
        classname: format!("skyloop.soak.{file}"),
        ..Suite::default()
    }
}

fn as_map<S: Serializer>(
    counters: &[(&'static str, u32)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(counters.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Host;
    use crate::realtime::{Requested, ask};
    use crate::soak::fixture::{limits, run};

    #[test]
    fn report_has_all_measurements_and_a_case_per_verdict() {
        let limits = limits(1e-3, Some(12.0));
        let found = run(&limits, 1000, 512, 0..0);
        let host = Host::now();
        let report = Report::new(
            "some/where/leo 1.toml".to_string(),
            30.0,
            limits,
            found,
            host.since(&host),
            ask(&Requested::default()),
            vec![("attitudes", 1000), ("bad_crc", 0)],
        );
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["passed"], false);
        assert_eq!(json["limits"]["max_p99_ms"], 12.0);
        assert_eq!(json["verdicts"][1]["frame"], 512);
        assert_eq!(json["cameras"][0]["latencies"]["last_octet"]["count"], 1000);
        assert_eq!(json["counters"]["attitudes"], 1000);
        assert!(json["first_frame_s"].is_null() && json["memory"]["warm"].is_null());
        assert!(json["host"]["processor"].is_string());
        assert!(json["realtime"].as_array().unwrap().is_empty());
        let junit = report.suite().document(&report.verdicts);
        for part in [
            "tests=\"2\" failures=\"1\"",
            "classname=\"skyloop.soak.leo_1_toml\" time=\"1800.000\"",
            "frame 512",
            "\nto the last octet: ",
        ] {
            assert!(junit.contains(part), "no {part:?} in {junit}");
        }
    }
}
