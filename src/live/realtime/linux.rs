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
    // For a real-time policy the crate passes the value on unchanged.
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
        // Beyond the limit a locked process would get no more memory, and end.
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
    let told = cpus.iter().filter(|cpu| **cpu < CpuSet::MAX_CPU);
    told.for_each(|cpu| set.set(*cpu));
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

    /// On a thread of its own, which takes with it what it was granted.
    fn alone<T: Send>(work: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| scope.spawn(work).join().unwrap())
    }

    /// Without capabilities, whoever runs the tests.
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
    fn a_priority_that_is_granted_is_the_threads_and_of_those_that_it_starts() {
        alone(|| {
            let granted = ask(&priority(7));
            let expected = granted.is_all().then_some(7);
            assert_eq!(fifo(), expected, "{granted}");
            assert_eq!(std::thread::spawn(fifo).join().unwrap(), expected);
        });
        // The thread that runs the test is as it was.
        assert_eq!(fifo(), None);
    }

    /// Without capabilities it is granted where a limit allows it, and else told as refused, with
    /// the remedy.
    #[track_caller]
    fn is_up_to_a_limit(requested: &Requested, allowed: bool, granted: &[&str], refused: &[&str]) {
        let told = without_capabilities(requested);
        assert_eq!(told.is_all(), allowed, "{told}");
        let text = told.to_string();
        for word in if allowed { granted } else { refused } {
            assert!(text.contains(word), "no {word:?} in {text}");
        }
    }

    #[test]
    fn a_priority_that_is_not_granted_names_the_capability_and_the_limit() {
        // A limit that allows it (ulimit -r 99) does without.
        let most = getrlimit(Resource::Rtprio).current;
        is_up_to_a_limit(
            &priority(99),
            most.is_none_or(|most| most >= 99),
            &["SCHED_FIFO 99"],
            &["SCHED_FIFO 99 not granted", "CAP_SYS_NICE", "ulimit -r 99"],
        );
    }

    #[test]
    fn memory_is_not_locked_up_to_a_limit() {
        let requested = Requested {
            lock_memory: true,
            ..Requested::default()
        };
        is_up_to_a_limit(
            &requested,
            getrlimit(Resource::Memlock).current.is_none(),
            &["memory locked"],
            &["memory not locked", "CAP_IPC_LOCK", "ulimit -l unlimited"],
        );
    }

    #[test]
    fn a_thread_stays_on_its_processors_and_hands_them_on() {
        let all = usable();
        let last = *all.last().unwrap();
        alone(|| {
            let granted = ask(&on(&[last, last]));
            assert_eq!(granted.to_string(), format!("CPU {last}"));
            assert_eq!(usable(), [last]);
            assert_eq!(std::thread::spawn(usable).join().unwrap(), [last]);
            // Others may be asked for later.
            assert!(ask(&on(&all)).is_all());
            assert_eq!(usable(), all);
        });
        assert_eq!(usable(), all);
    }

    #[test]
    fn processors_that_are_not_there_are_told_and_the_others_granted() {
        let all = usable();
        // Beyond all machines of today, beyond the kernel's sets, beyond all numbers.
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
