//! Metrics and real-time settings of a live run.

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

/// Metrics server and granted real-time settings, until this value is dropped.
pub struct LiveServices {
    metrics: Option<(Vec<Metrics>, metrics::Server)>,
    pub granted: Granted,
}

/// Serves the metrics of all cameras, and applies the real-time settings. Call it before links are
/// opened, because their threads inherit the settings.
pub fn services(config: &Config, address: Option<&str>) -> anyhow::Result<LiveServices> {
    let run = &config.run;
    let from = if address.is_some() {
        "--metrics"
    } else {
        "run.metrics"
    };
    let address = address.or(run.metrics.as_deref());
    // Started first, so that the metrics thread does not inherit the real-time settings.
    let metrics = match address {
        None => None,
        Some(address) => {
            let cameras = config
                .cameras
                .iter()
                .map(|head| Metrics::of_head(&head.name));
            let places: Vec<_> = std::iter::once(Metrics::default()).chain(cameras).collect();
            let serving = metrics::serve(address, places.clone()).context(from)?;
            Some((places, serving))
        }
    };
    let requested = &run.realtime;
    let mut rendering = Vec::new();
    if !requested.is_nothing() {
        // Threads of the pool may exist already, since files are read in parallel.
        let thread = requested.of_thread();
        rendering = rayon::broadcast(|_| realtime::ask(&thread));
    }
    let mut granted = realtime::ask(requested);
    granted.add_refused(rendering);
    Ok(LiveServices { metrics, granted })
}

/// The options of a run's links, with the instruments of a CAN bus.
pub fn link_options(run: &Run, bus: Option<BusInstruments>) -> link::Options {
    link::Options {
        idle: Duration::from_secs_f64(run.idle_s),
        personality: &NATIVE,
        bus,
    }
}

/// Errors: a link of the run file cannot be opened on any system; the error names file and key.
pub fn check_links(config: &Config, file: &Path) -> anyhow::Result<()> {
    let file = path_text(file);
    link::check_all(&config.run.links).with_context(|| format!("{file}: run.link"))?;
    for head in &config.cameras {
        let of_head = || format!("{file}: link of head {}", head.name);
        link::check_further(&head.links).with_context(of_head)?;
    }
    Ok(())
}

/// Names a further camera in its log messages.
pub fn of_head(name: &str) -> tracing::Span {
    tracing::warn_span!("head", name)
}

impl LiveServices {
    pub fn metrics_address(&self) -> Option<String> {
        let (_, metrics) = self.metrics.as_ref()?;
        Some(metrics.address().to_string())
    }

    /// Publishes the metrics of a camera's `server`; 0 is the first.
    pub fn serve(&self, camera: usize, server: &mut Server) {
        let places = self.metrics.as_ref().map(|(places, _)| places);
        if let Some(place) = places.and_then(|places| places.get(camera)) {
            server.set_metrics(place.clone());
        }
    }
}

impl fmt::Display for LiveServices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((_, metrics)) = &self.metrics {
            writeln!(f, "metrics at http://{}/metrics", metrics.address())?;
        }
        if !self.granted.grants.is_empty() {
            writeln!(f, "{}", self.granted)?;
        }
        Ok(())
    }
}
