//! Further cameras of the same vehicle: each at links of its own, all with the attitudes, Triggers, pauses and Resets of the first one's client, as they came.

use super::Server;
use skyloop_config::Run;
use skyloop_link::{Roles, Wire, relay};
use skyloop_protocols::Command;
use skyloop_render::engine::Emulator;

/// What the link of the truth is for, where another brings it.
const TOLD: Roles = Roles {
    truth: true,
    pixels: false,
    labels: false,
};

impl Server {
    /// Puts `emulator`, that of a further camera, at links that bring its frames. It hears what this one's client says of the vehicle, at the same moments; their
    /// frames are made one after another, each by all threads. It is to run in a thread of its own, and ends when this one has gone.
    pub fn head(
        &mut self,
        emulator: Emulator,
        links: impl IntoIterator<Item = (Wire, Roles)>,
        run: &Run,
    ) -> Server {
        let (told, wire) = relay();
        let links = std::iter::once((wire, TOLD)).chain(links);
        let mut server = Server::new(emulator, links, self.output, self.kind, self.personality);
        server.is_led = true;
        server.set_run(run);
        server.camera = self.told.len() as u32 + 1;
        server.darkroom = self.darkroom.clone();
        self.told.push(told);
        server
    }

    /// Whether a command is for the link that brings the truth. A further camera's settings come over links of its own.
    pub(super) fn is_truth(&self, command: &Command) -> bool {
        match command {
            Command::Attitude(_) | Command::Trigger { .. } | Command::Pause | Command::Resume => {
                true
            }
            Command::Exposure { .. }
            | Command::Gain { .. }
            | Command::FrameRate { .. }
            | Command::SingleShot => !self.is_led,
            _ => false,
        }
    }

    /// What further cameras hear, too.
    pub(super) fn is_of_the_vehicle(command: &Command) -> bool {
        matches!(
            command,
            Command::Attitude(_)
                | Command::Trigger { .. }
                | Command::Pause
                | Command::Resume
                | Command::Reset
        )
    }
}
