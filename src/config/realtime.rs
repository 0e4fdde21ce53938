//! The help that a run file requests of the operating system.

/// The requested settings.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Requested {
    /// SCHED_FIFO with this priority (1 to 99).
    pub priority: Option<u8>,
    /// Whether touched memory is locked.
    pub lock_memory: bool,
    /// The processors to run on, numbered as the system does from 0; empty: all.
    pub cpus: Vec<usize>,
}

impl Requested {
    /// Whether nothing is requested.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// The settings of each thread: all but memory. Threads that wait for each other by yielding
    /// need the same priority: one would wait for ever for a thread of lower priority.
    #[must_use]
    pub fn of_thread(&self) -> Self {
        Self {
            lock_memory: false,
            ..self.clone()
        }
    }
}
