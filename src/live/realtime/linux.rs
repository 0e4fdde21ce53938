//! Linux: the calls to the kernel, and the meaning of its refusals.

use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_getaffinity, sched_setaffinity};
use std::io;
use thread_priority::{
    Error, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Sets SCHED_FIFO for the calling thread.
pub(super) fn schedule(priority: u8) -> Result<(), String> {
    // With a real-time policy the crate does not change the value.
    let value = ThreadPriorityValue::try_from(priority)
        .map_err(|why| format!("{why}: priorities are 1 to 99"))?;
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(
        thread_native_id(),
        ThreadPriority::Crossplatform(value),
        fifo,
    )
    .map_err(|error| match error {
        Error::OS(code) if code == Errno::PERM.raw_os_error() => format!(
            "operation not permitted: run as root, with CAP_SYS_NICE, or with ulimit -r {priority}"
        ),
        Error::OS(code) => format!(
            "{}: run without a priority",
            io::Error::from_raw_os_error(code)
        ),
        other => format!("{other:?}: run without a priority"),
    })
}

/// Locks present and future memory of the process, each page when it is first touched: stacks and
/// arenas reserve more addresses than they use.
pub(super) fn lock_memory() -> Result<(), String> {
    let limit = getrlimit(Resource::Memlock).current;
    let without_limit =
        capabilities(None).is_ok_and(|held| held.effective.contains(CapabilitySet::IPC_LOCK));
    if let Some(bytes) = limit.filter(|_| !without_limit) {
        // Beyond the limit a process with locked memory could not allocate, and would abort.
        return Err(format!(
            "limit of {} KiB: run as root, with CAP_IPC_LOCK, or with ulimit -l unlimited",
            bytes / 1024
        ));
    }
    let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
    mlockall(flags).map_err(|why| match why {
        Errno::PERM => {
            "operation not permitted: run as root, with CAP_IPC_LOCK, or with ulimit -l unlimited"
                .to_string()
        }
        Errno::NOMEM | Errno::AGAIN => format!("{why}: free some memory, or run without"),
        _ => format!("{why}: run without"),
    })
}

/// Restricts the calling thread to the processors that exist; returns them.
pub(super) fn run_on(cpus: &[usize]) -> Result<Vec<usize>, String> {
    let mut set = CpuSet::new();
    let valid = cpus.iter().filter(|cpu| **cpu < CpuSet::MAX_CPU);
    valid.for_each(|cpu| set.set(*cpu));
    let granted = sched_setaffinity(None, &set).and_then(|()| sched_getaffinity(None));
    let granted = granted.map_err(|why| match why {
        Errno::INVAL => "none is there, or for this process: see nproc and taskset -p".to_string(),
        _ => format!("{why}: run without"),
    })?;
    let is_granted = |cpu: &usize| *cpu < CpuSet::MAX_CPU && granted.is_set(*cpu);
    Ok(cpus.iter().copied().filter(is_granted).collect())
}

#[cfg(test)]
mod tests {
    use crate::realtime::{Granted, Help, Requested, ask};
    use rustix::process::{Resource, getrlimit};
    use rustix::thread::{CapabilitySet, capabilities, sched_getaffinity, set_capabilities};
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, thread_native_id,
        thread_schedule_policy_param,
    };

    /// Runs `work` on a separate thread, so that its settings end with it.
    fn alone<T: Send>(work: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| scope.spawn(work).join().unwrap())
    }

    /// Without capabilities, even if root runs the tests.
    fn without_capabilities(requested: &Requested) -> Granted {
        alone(|| {
            let mut held = capabilities(None).unwrap();
            held.effective = CapabilitySet::empty();
            set_capabilities(None, held).unwrap();
            ask(requested)
        })
    }

    fn priority(priority: u8) -> Requested {
        Requested {
            priority: Some(priority),
            ..Requested::default()
        }
    }

    fn on(cpus: &[usize]) -> Requested {
        Requested {
            cpus: cpus.to_vec(),
            ..Requested::default()
        }
    }

    /// The processors that this thread may use.
    fn usable() -> Vec<usize> {
        let set = sched_getaffinity(None).unwrap();
        (0..1024).filter(|cpu| set.is_set(*cpu)).collect()
    }

    fn fifo() -> Option<i32> {
        let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        let (policy, params) = thread_schedule_policy_param(thread_native_id()).unwrap();
        (policy == fifo).then_some(params.sched_priority)
    }

    #[test]
    fn granted_priority_is_inherited_by_started_threads() {
        alone(|| {
            let granted = ask(&priority(7));
            let expected = granted.is_all().then_some(7);
            assert_eq!(fifo(), expected, "{granted}");
            assert_eq!(std::thread::spawn(fifo).join().unwrap(), expected);
        });
        // The thread of the test is unchanged.
        assert_eq!(fifo(), None);
    }

    /// Without capabilities a setting is granted if a limit allows it, else refused with the
    /// remedy.
    #[track_caller]
    fn check_up_to_a_limit(
        requested: &Requested,
        allowed: bool,
        granted: &[&str],
        refused: &[&str],
    ) {
        let outcome = without_capabilities(requested);
        assert_eq!(outcome.is_all(), allowed, "{outcome}");
        let text = outcome.to_string();
        for word in if allowed { granted } else { refused } {
            assert!(text.contains(word), "no {word:?} in {text}");
        }
    }

    #[test]
    fn refused_priority_names_the_capability_and_the_limit() {
        // A sufficient limit (ulimit -r 99) needs no capability.
        let max = getrlimit(Resource::Rtprio).current;
        check_up_to_a_limit(
            &priority(99),
            max.is_none_or(|max| max >= 99),
            &["SCHED_FIFO 99"],
            &["SCHED_FIFO 99 not granted", "CAP_SYS_NICE", "ulimit -r 99"],
        );
    }

    #[test]
    fn memory_is_not_locked_under_a_limit() {
        let requested = Requested {
            lock_memory: true,
            ..Requested::default()
        };
        check_up_to_a_limit(
            &requested,
            getrlimit(Resource::Memlock).current.is_none(),
            &["memory locked"],
            &["memory not locked", "CAP_IPC_LOCK", "ulimit -l unlimited"],
        );
    }

    #[test]
    fn affinity_is_inherited_by_started_threads() {
        let all = usable();
        let last = *all.last().unwrap();
        alone(|| {
            let granted = ask(&on(&[last, last]));
            assert_eq!(granted.to_string(), format!("CPU {last}"));
            assert_eq!(usable(), [last]);
            assert_eq!(std::thread::spawn(usable).join().unwrap(), [last]);
            // Another request may extend it.
            assert!(ask(&on(&all)).is_all());
            assert_eq!(usable(), all);
        });
        assert_eq!(usable(), all);
    }

    #[test]
    fn absent_processors_are_reported_and_the_others_granted() {
        let all = usable();
        // Beyond existing machines, beyond the kernel's sets, beyond all numbers.
        for missing in [1023, 1024, usize::MAX] {
            alone(|| {
                let granted = ask(&on(&[missing, all[0]]));
                let help: Vec<Help> = granted.grants.iter().map(|g| g.help.clone()).collect();
                assert_eq!(help, [Help::Cpus(vec![all[0]]), Help::Cpus(vec![missing])]);
                assert!(granted.grants[0].refused.is_none());
                let text = granted.to_string();
                assert!(text.contains("not there"), "{text}");
                assert_eq!(usable(), [all[0]]);
            });
            alone(|| {
                let granted = ask(&on(&[missing]));
                assert!(granted.to_string().contains("none is there"), "{granted}");
                assert_eq!(usable(), all);
            });
        }
    }
}
