//! Real-time settings that a run file requests from the operating system.

/// The requested settings.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Requested {
    /// SCHED_FIFO with this priority (1 to 99).
    pub priority: Option<u8>,
    /// Whether touched memory is locked.
    pub lock_memory: bool,
    /// The processors to run on, numbered by the system from 0; empty for all.
    pub cpus: Vec<usize>,
}

impl Requested {
    /// Whether nothing is requested.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// The settings of each thread: all except memory. Threads that yield to each other need the
    /// same priority; one would wait for ever for a thread of lower priority.
    #[must_use]
    pub fn of_thread(&self) -> Self {
        Self {
            lock_memory: false,
            ..self.clone()
        }
    }
}
