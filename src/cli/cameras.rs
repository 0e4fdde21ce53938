//! The cameras of a live run: an emulator and a server each, with one clock and one sky.

use super::live::{Help, of_head};
use anyhow::anyhow;
use skyloop::attitude::VehicleState;
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::link::{Roles, Wire};
use skyloop::serve::Server;
use skyloop_protocols::Output;
use skyloop_protocols::personality::NATIVE;

/// The links of one camera.
pub type Links = Vec<(Wire, Roles)>;

/// Serves the first camera, of `emulator`, over the first of `links`, and each further one of the run file over its own. Where the vehicle is known at the start, a frame of it
/// is made by each beforehand.
pub fn serve(
    config: &Config,
    mut emulator: Emulator,
    links: Vec<Links>,
    first: Option<&VehicleState>,
    output: Output,
    help: &Help,
) -> anyhow::Result<(Server, Vec<Server>)> {
    let warm_up = |emulator: &mut Emulator| {
        if let Some(first) = first {
            emulator.warm_up(first);
        }
    };
    warm_up(&mut emulator);
    let heads = config.heads.iter().zip(1..).map(|(head, number)| {
        let mut emulator = emulator.beside(&head.camera, number);
        warm_up(&mut emulator);
        (head, emulator)
    });
    let heads: Vec<_> = heads.collect();
    let mut links = links.into_iter();
    let own = links.next().unwrap_or_default();
    let mut server = Server::new(emulator, own, output, config.run.clock, &NATIVE);
    server.set_run(&config.run);
    help.serve(0, &mut server);
    server.fits().map_err(anyhow::Error::msg)?;
    let mut further = Vec::new();
    for (number, ((head, emulator), own)) in (1..).zip(heads.into_iter().zip(links)) {
        let _of = of_head(&head.name).entered();
        let mut beside = server.head(emulator, own, &config.run);
        help.serve(number, &mut beside);
        let unfit = |why| anyhow!("head {}: {why}", head.name);
        beside.fits().map_err(unfit)?;
        further.push(beside);
    }
    Ok((server, further))
}
