//! Real-time settings of the system: scheduling priority, locked memory, processor affinity.
//!
//! All are optional. A refusal does not fail a run; it is reported with reason and remedy. Threads
//! inherit scheduling and affinity from the thread that starts them; memory is locked for the
//! process. Threads of an existing pool apply the settings themselves ([`Requested::of_thread`]). A
//! thread that must not inherit them, such as that of the metrics, is started before.
//!
//! If real-time threads use all processors, the kernel reserves 5 % of the time for others
//! (`sched_rt_runtime_us`).

#[cfg(target_os = "linux")]
mod linux;

use serde::Serialize;
pub use skyloop_config::Requested;
use std::fmt;

/// One setting.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Help {
    /// The priority, 1 to 99.
    Priority(u8),
    /// Locked memory.
    Memory,
    /// Processors, in rising order.
    Cpus(Vec<usize>),
}

impl Help {
    /// Its key in the run file.
    fn key(&self) -> &'static str {
        match self {
            Help::Priority(_) => "run.priority",
            Help::Memory => "run.lock_memory",
            Help::Cpus(_) => "run.cpus",
        }
    }
}

/// The result of one setting.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Grant {
    /// The setting.
    pub help: Help,
    /// Why it was not granted, and the remedy; `None` if it was.
    pub refused: Option<String>,
}

impl fmt::Display for Grant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let granted = self.refused.is_none();
        match (&self.help, granted) {
            (Help::Priority(priority), true) => write!(f, "SCHED_FIFO {priority} granted"),
            (Help::Priority(priority), false) => write!(f, "SCHED_FIFO {priority} not granted"),
            (Help::Memory, true) => f.write_str("memory locked"),
            (Help::Memory, false) => f.write_str("memory not locked"),
            (Help::Cpus(cpus), true) => f.write_str(&named(cpus)),
            (Help::Cpus(cpus), false) => write!(f, "{} not granted", named(cpus)),
        }?;
        self.refused
            .as_ref()
            .map_or(Ok(()), |why| write!(f, " ({}: {why})", self.help.key()))
    }
}

/// The results of all settings; one short line as text.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Granted {
    /// In the order of [`Requested`]. Granted and absent processors are separate entries.
    pub grants: Vec<Grant>,
}

impl Granted {
    /// Adds the refusals of `others`, each reason once.
    pub fn add_refused(&mut self, others: impl IntoIterator<Item = Granted>) {
        for grant in others.into_iter().flat_map(|other| other.grants) {
            let is_listed = |other: &Grant| {
                other.help.key() == grant.help.key() && other.refused == grant.refused
            };
            if grant.refused.is_some() && !self.grants.iter().any(is_listed) {
                self.grants.push(grant);
            }
        }
    }

    /// Whether nothing was refused.
    #[must_use]
    pub fn is_all(&self) -> bool {
        self.grants.iter().all(|grant| grant.refused.is_none())
    }
}

impl fmt::Display for Granted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.grants.is_empty() {
            return f.write_str("none requested");
        }
        let grants: Vec<String> = self.grants.iter().map(Grant::to_string).collect();
        f.write_str(&grants.join("; "))
    }
}

/// Applies scheduling and affinity to the calling thread, and memory locking to the process.
///
/// Absent processors are reported, and the others used.
#[must_use]
pub fn ask(requested: &Requested) -> Granted {
    let mut grants = Vec::new();
    if let Some(priority) = requested.priority {
        let refused = match priority {
            1..=99 => system::schedule(priority).err(),
            _ => Some("not a priority: 1 to 99 are".to_string()),
        };
        let help = Help::Priority(priority);
        grants.push(Grant { help, refused });
    }
    if requested.lock_memory {
        let refused = system::lock_memory().err();
        let help = Help::Memory;
        grants.push(Grant { help, refused });
    }
    let mut cpus = requested.cpus.clone();
    cpus.sort_unstable();
    cpus.dedup();
    if !cpus.is_empty() {
        grants.extend(processors(cpus));
    }
    Granted { grants }
}

/// Sets the affinity; returns the granted processors and the absent ones.
fn processors(cpus: Vec<usize>) -> Vec<Grant> {
    let of = |cpus, refused| Grant {
        help: Help::Cpus(cpus),
        refused,
    };
    match system::run_on(&cpus) {
        Err(why) => vec![of(cpus, Some(why))],
        Ok(granted) => {
            let (present, missing): (Vec<_>, Vec<_>) =
                cpus.into_iter().partition(|cpu| granted.contains(cpu));
            let mut grants = vec![of(present, None)];
            if !missing.is_empty() {
                let why = "not there, or not for this process: see nproc and taskset -p";
                grants.push(of(missing, Some(why.to_string())));
            }
            grants
        }
    }
}

/// `CPU 0` or `CPUs 0, 1`.
fn named(cpus: &[usize]) -> String {
    let plural = if cpus.len() == 1 { "" } else { "s" };
    let numbers: Vec<String> = cpus.iter().map(usize::to_string).collect();
    format!("CPU{plural} {}", numbers.join(", "))
}

#[cfg(target_os = "linux")]
use linux as system;

/// Systems without these settings.
#[cfg(not(target_os = "linux"))]
mod system {
    const WHY: &str = "not supported on this system: run on Linux";

    pub(super) fn schedule(_priority: u8) -> Result<(), String> {
        Err(WHY.to_string())
    }

    pub(super) fn lock_memory() -> Result<(), String> {
        Err(WHY.to_string())
    }

    pub(super) fn run_on(_cpus: &[usize]) -> Result<Vec<usize>, String> {
        Err(WHY.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(help: Help, refused: Option<&str>) -> Grant {
        let refused = refused.map(str::to_string);
        Grant { help, refused }
    }

    #[test]
    fn granted_settings_are_one_line() {
        let all = Granted {
            grants: vec![
                of(Help::Priority(50), None),
                of(Help::Memory, None),
                of(Help::Cpus(vec![0, 1]), None),
            ],
        };
        assert!(all.is_all());
        assert_eq!(
            all.to_string(),
            "SCHED_FIFO 50 granted; memory locked; CPUs 0, 1"
        );
        let some = Granted {
            grants: vec![
                of(Help::Priority(99), Some("why")),
                of(Help::Memory, Some("limit")),
                of(Help::Cpus(vec![3]), None),
                of(Help::Cpus(vec![7]), Some("not there")),
            ],
        };
        assert!(!some.is_all());
        assert_eq!(
            some.to_string(),
            "SCHED_FIFO 99 not granted (run.priority: why); memory not locked (run.lock_memory: limit); CPU 3; CPU 7 not granted (run.cpus: not there)"
        );
        assert_eq!(
            serde_json::to_string(&some).unwrap(),
            r#"[{"help":{"priority":99},"refused":"why"},{"help":"memory","refused":"limit"},{"help":{"cpus":[3]},"refused":null},{"help":{"cpus":[7]},"refused":"not there"}]"#
        );
    }

    #[test]
    fn nothing_is_requested_by_default() {
        assert!(Requested::default().is_nothing());
        let none = ask(&Requested::default());
        assert!(none.grants.is_empty() && none.is_all());
        assert_eq!(none.to_string(), "none requested");
    }

    #[test]
    fn refusals_of_several_threads_are_listed_once() {
        let one = |help, why| Granted {
            grants: vec![of(help, why)],
        };
        let mut granted = one(Help::Priority(50), None);
        let pool = [None, Some("why"), Some("why")];
        granted.add_refused(pool.map(|why| one(Help::Priority(50), why)));
        assert_eq!(
            granted.to_string(),
            "SCHED_FIFO 50 granted; SCHED_FIFO 50 not granted (run.priority: why)"
        );
    }

    #[test]
    fn invalid_priority_is_refused() {
        for priority in [0, 100, 255] {
            let granted = ask(&Requested {
                priority: Some(priority),
                ..Requested::default()
            });
            let text = granted.to_string();
            assert!(!granted.is_all() && text.contains("1 to 99"), "{text}");
        }
    }

    #[test]
    fn thread_of_a_pool_requests_all_but_locked_memory() {
        let requested = Requested {
            priority: Some(10),
            lock_memory: true,
            cpus: vec![1],
        };
        let of_thread = requested.of_thread();
        assert!(!of_thread.lock_memory && !of_thread.is_nothing());
        assert_eq!(of_thread.priority, requested.priority);
        assert_eq!(of_thread.cpus, requested.cpus);
    }
}
