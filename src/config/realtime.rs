//! The help that a run file asks of the operating system.

/// What is asked for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Asked {
    /// Scheduling first in, first out with this priority (1 to 99; more goes first) instead of a share of the time.
    pub priority: Option<u8>,
    /// Memory that stays where it is once it has been touched.
    pub lock_memory: bool,
    /// The processors to run on, numbered as the system does from 0; empty: all.
    pub cpus: Vec<usize>,
}

impl Asked {
    /// Whether nothing is.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// What each thread asks for itself: all but the memory, which is that of the process. Of one priority, all of them: where threads hand things on to each other, one
    /// waits for a moment by giving way to its equals, for ever if what it waits for is of less.
    #[must_use]
    pub fn of_thread(&self) -> Self {
        Self {
            lock_memory: false,
            ..self.clone()
        }
    }
}
