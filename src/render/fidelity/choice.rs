//! Restrictions of a run on its effects.

/// The restrictions of a run on its effects, independent of its scenes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// Whether effects that draw random numbers run.
    pub noise: bool,
    /// Names of the effects that are switched off.
    pub off: Vec<&'static str>,
    /// Whether effects that the scene does not need run too.
    pub all: bool,
}

impl Default for Choice {
    fn default() -> Self {
        Choice {
            noise: true,
            off: Vec::new(),
            all: false,
        }
    }
}
