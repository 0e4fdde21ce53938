//! What a live run is given beside its links: a place for its figures, and help of the system.

use anyhow::Context;
use skyloop::config::{Config, Run};
use skyloop::link::{self, BusInstruments};
use skyloop::metrics::{self, Metrics};
use skyloop::orbit::path_text;
use skyloop::realtime::{self, Granted};
use skyloop::serve::Server;
use skyloop_protocols::personality::NATIVE;
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// What was granted, printed as lines of text; it lasts as long as this value.
pub struct Help {
    /// Where the figures of each camera are, and what serves them.
    metrics: Option<(Vec<Metrics>, metrics::Server)>,
    pub granted: Granted,
}

/// Serves the figures of all cameras at `address`, else where the run has them, and asks the system for what the run wants. Before links are opened: their threads have what
/// the one has that starts them.
pub fn help(config: &Config, address: Option<&str>) -> anyhow::Result<Help> {
    let run = &config.run;
    let from = if address.is_some() {
        "--metrics"
    } else {
        "run.metrics"
    };
    let address = address.or(run.metrics.as_deref());
    // Before the system is asked: the thread that serves figures is like any other program's.
    let metrics = match address {
        None => None,
        Some(address) => {
            let heads = config.heads.iter().map(|head| Metrics::of_head(&head.name));
            let places: Vec<_> = std::iter::once(Metrics::default()).chain(heads).collect();
            let serving = metrics::serve(address, places.clone()).context(from)?;
            Some((places, serving))
        }
    };
    let asked = &run.realtime;
    let mut rendering = Vec::new();
    if !asked.is_nothing() {
        // Each of those that render, which may be there already: files are read side by side.
        let thread = asked.of_thread();
        rendering = rayon::broadcast(|_| realtime::ask(&thread));
    }
    let mut granted = realtime::ask(asked);
    granted.add_refused(rendering);
    Ok(Help { metrics, granted })
}

/// The options of a run's links; `bus` stands between a CAN bus and its link.
pub fn link_options(run: &Run, bus: Option<BusInstruments>) -> link::Options {
    link::Options {
        idle: Duration::from_secs_f64(run.idle_s),
        personality: &NATIVE,
        bus,
    }
}

/// Errors: what opening a run's links would refuse without asking the system, with file and key.
pub fn check_links(config: &Config, file: &Path) -> anyhow::Result<()> {
    let file = path_text(file);
    link::check_all(&config.run.links).with_context(|| format!("{file}: run.link"))?;
    for head in &config.heads {
        let of_head = || format!("{file}: link of head {}", head.name);
        link::check_further(&head.links).with_context(of_head)?;
    }
    Ok(())
}

/// What the log says of a further camera says of which.
pub fn of_head(name: &str) -> tracing::Span {
    tracing::warn_span!("head", name)
}

impl Help {
    pub fn metrics_address(&self) -> Option<String> {
        let (_, metrics) = self.metrics.as_ref()?;
        Some(metrics.address().to_string())
    }

    /// Lets the `server` of a camera leave its figures there; 0 is the first.
    pub fn serve(&self, camera: usize, server: &mut Server) {
        let places = self.metrics.as_ref().map(|(places, _)| places);
        if let Some(place) = places.and_then(|places| places.get(camera)) {
            server.set_metrics(place.clone());
        }
    }
}

impl fmt::Display for Help {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((_, metrics)) = &self.metrics {
            writeln!(f, "figures at http://{}/metrics", metrics.address())?;
        }
        if !self.granted.grants.is_empty() {
            writeln!(f, "{}", self.granted)?;
        }
        Ok(())
    }
}
