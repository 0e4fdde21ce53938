//! Builds configuration, emulator, and cameras on their links for `run`, `loopback`, `soak` and
//! `replay`.

use super::budget::{Budget, FRAMES, states_along_axes};
use super::common::{Orbits, Records, scene, with_level};
use super::cost::spread;
use super::instruments;
use super::live::{LiveServices, of_head};
use anyhow::anyhow;
use skyloop::attitude::VehicleState;
use skyloop::config::{Clock, Config};
use skyloop::engine::Emulator;
use skyloop::link::{Roles, Wire};
use skyloop::serve::Server;
use skyloop_firmware_sim::mission::Mission;
use skyloop_protocols::personality::NATIVE;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The links of one camera.
pub type Links = Vec<(Wire, Roles)>;

/// The configuration of a file, or the built-in scene, with the options that commands share.
pub fn configure(
    file: Option<&Path>,
    records: &Records,
    orbits: &Orbits,
    output: Option<&str>,
) -> anyhow::Result<Config> {
    let mut config = scene(file)?;
    records.settle(&config)?;
    orbits.settle(&mut config);
    config.run.output = with_level(config.run.output, output);
    Ok(config)
}

/// An emulator and its configuration, before it is connected to links.
pub struct Session {
    pub config: Config,
    /// Number of configured objects, which were moved into the emulator.
    pub objects: usize,
    pub emulator: Emulator,
}

/// The cameras of a run: the first, and the further ones in the order of the run file.
pub struct Cameras {
    pub first: Server,
    pub further: Vec<Server>,
}

impl Session {
    pub fn new(mut config: Config) -> Session {
        let objects = config.objects.len();
        let emulator = Emulator::new(&mut config);
        Session {
            config,
            objects,
            emulator,
        }
    }

    /// Chooses tolerances by `--budget-ms`, for the frames of a mission; returns the choice as
    /// text.
    pub fn settle_budget(
        &mut self,
        budget: &Budget,
        mission: Option<&Mission>,
        stop: &AtomicBool,
    ) -> anyhow::Result<String> {
        budget.settle(&mut self.emulator, stop, || match mission {
            Some(mission) => spread(mission, FRAMES),
            None => states_along_axes(),
        })
    }

    /// The settings of the run that are not in its files, for recordings.
    pub fn settings(&self) -> Vec<(String, String)> {
        instruments::settings(self.config.run.output, &self.emulator)
    }

    /// Connects the emulator to its links, with the stepped clock.
    pub fn stepped(self, links: Links) -> (Config, Server) {
        let output = self.config.run.output;
        let server = Server::new(self.emulator, links, output, Clock::Stepped, &NATIVE);
        (self.config, server)
    }

    /// Connects each camera to its links, with the clock of the run file. If the vehicle's state is
    /// known at the start (`warm_up`), each camera first renders a frame of it.
    pub fn live(
        self,
        links: Vec<Links>,
        warm_up: Option<&VehicleState>,
        services: &LiveServices,
    ) -> anyhow::Result<(Config, Cameras)> {
        let Session {
            config,
            mut emulator,
            ..
        } = self;
        let warm_up = |emulator: &mut Emulator| {
            if let Some(vehicle) = warm_up {
                emulator.warm_up(vehicle);
            }
        };
        warm_up(&mut emulator);
        let cameras = (1..).zip(&config.cameras).map(|(number, head)| {
            let mut emulator = emulator.further_camera(&head.camera, number);
            warm_up(&mut emulator);
            emulator
        });
        let further: Vec<_> = cameras.collect();
        let mut links = links.into_iter();
        let (own, run) = (links.next().unwrap_or_default(), &config.run);
        let mut first = Server::new(emulator, own, run.output, run.clock, &NATIVE);
        first.set_run(run);
        services.serve(0, &mut first);
        first.fits().map_err(anyhow::Error::msg)?;
        let mut cameras = Cameras {
            first,
            further: Vec::new(),
        };
        for ((head, emulator), own) in config.cameras.iter().zip(further).zip(links) {
            let _of = of_head(&head.name).entered();
            let mut server = cameras.first.head(emulator, own, run);
            services.serve(cameras.further.len() + 1, &mut server);
            let unfit = |why| anyhow!("head {}: {why}", head.name);
            server.fits().map_err(unfit)?;
            cameras.further.push(server);
        }
        Ok((config, cameras))
    }
}
