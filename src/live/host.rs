//! Load of the machine during a run, from Linux' `/proc` and `/sys`: other load can make frames
//! late. A value that cannot be read is unknown.

mod memory;

pub use memory::Memory;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// State of the machine at one instant.
#[derive(Debug, Clone)]
pub struct Host {
    at: Instant,
    processor: String,
    kernel: Option<String>,
    governor: Option<String>,
    load: Option<[f64; 2]>,
    time: Option<MachineTime>,
    /// Processor time of this process, clock ticks.
    own: Option<u64>,
    switches: Option<Switches>,
}

/// Time of all processors since the machine started, clock ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MachineTime {
    processors: usize,
    all: u64,
    busy: u64,
    stolen: u64,
}

/// Context switches of the threads of this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Switches {
    voluntary: u64,
    involuntary: u64,
}

impl Host {
    /// This machine, now.
    #[must_use]
    pub fn now() -> Self {
        Self {
            at: Instant::now(),
            processor: processor(),
            kernel: read("/proc/sys/kernel/osrelease").map(|text| text.trim().to_string()),
            governor: governor(Path::new("/sys/devices/system/cpu")),
            load: load(),
            time: read("/proc/stat").and_then(|text| machine_time(&text)),
            own: read("/proc/self/stat").and_then(|text| own_time(&text)),
            switches: switches(),
        }
    }

    /// The load since an `earlier` instant.
    #[must_use]
    pub fn since(&self, earlier: &Host) -> HostReport {
        let switched = |count: fn(&Switches) -> u64| {
            let [now, then] = [self, earlier].map(|host| host.switches.as_ref().map(count));
            Some(now?.saturating_sub(then?))
        };
        let time = self.time.zip(earlier.time);
        let passed = |count: fn(&MachineTime) -> u64| {
            time.map(|(now, then)| count(&now).saturating_sub(count(&then)) as f64)
        };
        let all = passed(|time| time.all).filter(|ticks| *ticks > 0.0);
        let share = |ticks: Option<f64>| Some((ticks? / all?).clamp(0.0, 1.0));
        let own = self.own.zip(earlier.own);
        let own = own.map(|(now, then)| now.saturating_sub(then) as f64);
        let others = passed(|time| time.busy)
            .zip(own)
            .map(|(busy, own)| busy - own);
        HostReport {
            processor: self.processor.clone(),
            processors: self.time.map(|time| time.processors),
            kernel: self.kernel.clone(),
            governor: self.governor.clone(),
            seconds: self.at.saturating_duration_since(earlier.at).as_secs_f64(),
            load_1_min: self.load.map(|[load, _]| load),
            load_5_min: self.load.map(|[_, load]| load),
            voluntary_switches: switched(|switches| switches.voluntary),
            involuntary_switches: switched(|switches| switches.involuntary),
            own: share(own),
            others: share(others),
            stolen: share(passed(|time| time.stolen)),
        }
    }
}

/// Load of the machine over an interval; `None`: could not be read.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HostReport {
    /// The processor, as the system calls it.
    pub processor: String,
    /// Number of processors of the machine; this process may be restricted to fewer.
    pub processors: Option<usize>,
    /// The release of the kernel.
    pub kernel: Option<String>,
    /// The frequency governor, such as `performance`; `none` if there is none.
    pub governor: Option<String>,
    /// Length of the interval, s.
    pub seconds: f64,
    /// Mean number of runnable threads over the last minute.
    pub load_1_min: Option<f64>,
    /// Mean number of runnable threads over the last five minutes.
    pub load_5_min: Option<f64>,
    /// How often a thread of this process blocked.
    pub voluntary_switches: Option<u64>,
    /// How often a thread was preempted.
    pub involuntary_switches: Option<u64>,
    /// This process's share (0 to 1) of the time of all processors.
    pub own: Option<f64>,
    /// Share of other programs and the kernel. Ticks of 10 ms make it coarse for runs of a few
    /// seconds.
    pub others: Option<f64>,
    /// Share taken by the hypervisor (steal time).
    pub stolen: Option<f64>,
}

impl HostReport {
    /// The rows of a table.
    #[must_use]
    pub fn rows(&self) -> Vec<(String, String)> {
        let load = |load: Option<f64>| or_unknown(load.map(|load| format!("{load:.2}")));
        let count = |count: Option<u64>| or_unknown(count.map(|count| count.to_string()));
        let percent =
            |share: Option<f64>| or_unknown(share.map(|share| format!("{:.1} %", share * 1e2)));
        let processors = or_unknown(self.processors.map(|count| count.to_string()));
        let switched = format!(
            "{} voluntary, {} involuntary",
            count(self.voluntary_switches),
            count(self.involuntary_switches)
        );
        let used = format!(
            "{} by this process, {} by others, {} stolen",
            percent(self.own),
            percent(self.others),
            percent(self.stolen)
        );
        let loads = format!("{} / {}", load(self.load_1_min), load(self.load_5_min));
        let named = format!("{}, {processors} of them", self.processor);
        let rows = [
            ("processor", named),
            ("kernel", or_unknown(self.kernel.clone())),
            ("clock governor", or_unknown(self.governor.clone())),
            ("load 1 / 5 min", loads),
            ("context switches", switched),
            ("processors used", used),
        ];
        rows.map(|(name, value)| (name.to_string(), value)).into()
    }
}

fn or_unknown(value: Option<String>) -> String {
    value.unwrap_or_else(|| "unknown".to_string())
}

fn read(path: impl AsRef<Path>) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

/// Name of the processor, or its architecture.
pub fn processor() -> String {
    let text = read("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':'));
    name.map_or(std::env::consts::ARCH, |(_, name)| name.trim())
        .to_string()
}

/// The machine's load over the last minute and the last five.
pub fn load() -> Option<[f64; 2]> {
    let text = read("/proc/loadavg")?;
    let mut values = text.split_whitespace().map(str::parse);
    Some([values.next()?.ok()?, values.next()?.ok()?])
}

/// The frequency governor of the processors in a folder: `performance`, `none`, or, if they differ,
/// each governor with its number of processors.
fn governor(folder: &Path) -> Option<String> {
    let entries = std::fs::read_dir(folder).ok()?;
    let mut counts = std::collections::BTreeMap::<String, usize>::new();
    for entry in entries.flatten() {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix("cpu"));
        if number.is_some_and(|number| number.parse::<usize>().is_ok()) {
            let governor = read(entry.path().join("cpufreq/scaling_governor"));
            let name = governor.map_or("none".to_string(), |text| text.trim().to_string());
            *counts.entry(name).or_default() += 1;
        }
    }
    match counts.len() {
        0 => None,
        1 => counts.into_keys().next(),
        _ => {
            let each = counts
                .iter()
                .map(|(name, count)| format!("{name} ({count})"));
            Some(each.collect::<Vec<_>>().join(", "))
        }
    }
}

/// The times in the first line of `/proc/stat`, and the number of processors in the lines after it.
fn machine_time(text: &str) -> Option<MachineTime> {
    let mut lines = text.lines();
    let mut words = lines.next()?.split_whitespace();
    if words.next() != Some("cpu") {
        return None;
    }
    let ticks: Vec<u64> = words.map(str::parse).collect::<Result<_, _>>().ok()?;
    // `user` and `nice` include the time of guests, which later columns repeat.
    let [user, nice, system, idle, wait, irq, soft_irq, stolen] = *ticks.first_chunk::<8>()?;
    let sum = |ticks: &[u64]| ticks.iter().copied().fold(0, u64::saturating_add);
    let busy = sum(&[user, nice, system, irq, soft_irq]);
    Some(MachineTime {
        processors: lines.take_while(|line| line.starts_with("cpu")).count(),
        all: sum(&[busy, idle, wait, stolen]),
        busy,
        stolen,
    })
}

/// User and system time of all threads in `/proc/self/stat`, including ended ones.
fn own_time(text: &str) -> Option<u64> {
    // The second word is the program's name in brackets, with any characters.
    let (_, rest) = text.rsplit_once(')')?;
    // X-Val: proc(5): utime and stime are the fields 14 and 15, the state after the name is the
    // third.
    let mut times = rest.split_whitespace().skip(11).map(str::parse::<u64>);
    Some(times.next()?.ok()?.saturating_add(times.next()?.ok()?))
}

/// Context switches of all threads, including ended ones.
#[cfg(target_os = "linux")]
fn switches() -> Option<Switches> {
    use nix::sys::resource::{UsageWho, getrusage};
    let usage = getrusage(UsageWho::RUSAGE_SELF).ok()?;
    Some(Switches {
        voluntary: u64::try_from(usage.voluntary_context_switches()).ok()?,
        involuntary: u64::try_from(usage.involuntary_context_switches()).ok()?,
    })
}

#[cfg(not(target_os = "linux"))]
fn switches() -> Option<Switches> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(time: Option<MachineTime>, own: Option<u64>, switches: Option<Switches>) -> Host {
        Host {
            at: Instant::now(),
            processor: "abacus".to_string(),
            kernel: Some("6.1".to_string()),
            governor: Some("none".to_string()),
            load: Some([0.5, 0.25]),
            time,
            own,
            switches,
        }
    }

    #[test]
    fn shares_refer_to_the_elapsed_time() {
        let time = |all, busy, stolen| {
            Some(MachineTime {
                processors: 4,
                all,
                busy,
                stolen,
            })
        };
        let switches = |voluntary, involuntary| {
            Some(Switches {
                voluntary,
                involuntary,
            })
        };
        let then = of(time(1000, 500, 10), Some(100), switches(7, 5));
        let now = of(time(3000, 1500, 30), Some(700), switches(107, 5));
        let report = now.since(&then);
        // X-Val: by hand; of 2000 ticks 600 are ours, 1000 are busy, 20 stolen.
        assert_eq!(report.own, Some(0.3));
        assert_eq!(report.others, Some(0.2));
        assert_eq!(report.stolen, Some(0.01));
        assert_eq!(report.voluntary_switches, Some(100));
        assert_eq!(report.involuntary_switches, Some(0));
        let rows = report.rows();
        let row = |name: &str| &rows.iter().find(|row| row.0 == name).unwrap().1;
        assert_eq!(row("processor"), "abacus, 4 of them");
        assert_eq!(row("load 1 / 5 min"), "0.50 / 0.25");
        assert_eq!(row("context switches"), "100 voluntary, 0 involuntary");
        assert_eq!(
            row("processors used"),
            "30.0 % by this process, 20.0 % by others, 1.0 % stolen"
        );
        // Clocks that stop or go back, and a process with more time than the machine.
        assert_eq!(then.since(&then).others, None);
        let report = then.since(&now);
        assert_eq!((report.own, report.voluntary_switches), (None, Some(0)));
        let busier = of(time(3000, 1500, 30), Some(1300), None);
        assert_eq!(busier.since(&then).others, Some(0.0));
    }

    #[test]
    fn unreadable_values_are_unknown() {
        let mut blind = of(None, None, None);
        (blind.kernel, blind.governor, blind.load) = (None, None, None);
        let report = blind.since(&blind);
        assert_eq!(report.own, None);
        let rows = report.rows();
        assert!(rows.iter().all(|(_, value)| value.contains("unknown")));
        let json = serde_json::to_value(&report).unwrap();
        assert!(json["others"].is_null() && json["processor"] == "abacus");
    }

    #[test]
    fn the_machines_time_is_read() {
        let text = "cpu  100 20 30 400 50 6 7 8 90 10\ncpu0 1\ncpu1 1\nintr 5\ncpu9\n";
        // X-Val: by hand, guests (90 and 10) left out.
        let expected = MachineTime {
            processors: 2,
            all: 621,
            busy: 163,
            stolen: 8,
        };
        assert_eq!(machine_time(text), Some(expected));
        for damaged in [
            "",
            "cpu",
            "cpu 1 2 3",
            "cpu0 1 2 3 4 5 6 7 8",
            "cpu 1 2 x 4 5 6 7 8",
        ] {
            assert_eq!(machine_time(damaged), None, "{damaged}");
        }
    }

    #[test]
    fn own_time_is_read_for_any_program_name() {
        let rest = "S 1 2 3 4 5 6 7 8 9 10 300 40 50 60";
        for name in ["skyloop", "a b", "x) 1 2", "((("] {
            let text = format!("12 ({name}) {rest}");
            assert_eq!(own_time(&text), Some(340), "{name}");
        }
        for damaged in ["", "12 (x) S 1", "12 (x) S 1 2 3 4 5 6 7 8 9 10 a b"] {
            assert_eq!(own_time(damaged), None, "{damaged}");
        }
    }

    #[test]
    fn governors_are_counted_where_they_differ() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        assert_eq!(governor(root), None);
        assert_eq!(governor(&root.join("absent")), None);
        for name in ["cpu0", "cpu1", "cpufreq", "cpuidle", "power"] {
            std::fs::create_dir(root.join(name)).unwrap();
        }
        assert_eq!(governor(root).as_deref(), Some("none"));
        for cpu in ["cpu0", "cpu1"] {
            let frequency = root.join(cpu).join("cpufreq");
            std::fs::create_dir(&frequency).unwrap();
            std::fs::write(frequency.join("scaling_governor"), "performance\n").unwrap();
        }
        assert_eq!(governor(root).as_deref(), Some("performance"));
        let slow = root.join("cpu1/cpufreq/scaling_governor");
        std::fs::write(slow, "powersave\n").unwrap();
        let both = "performance (1), powersave (1)";
        assert_eq!(governor(root).as_deref(), Some(both));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_machine_is_read() {
        let then = Host::now();
        std::thread::spawn(|| std::thread::sleep(std::time::Duration::from_millis(30)))
            .join()
            .unwrap();
        let report = Host::now().since(&then);
        assert!(report.processors >= Some(1), "{report:?}");
        assert!(report.kernel.is_some() && report.load_5_min.is_some());
        // The thread that has ended slept once.
        assert!(report.voluntary_switches >= Some(1), "{report:?}");
        assert!(report.seconds >= 0.03);
    }
}
