//! Further cameras of the same vehicle. Each has its own links, and gets copies of the packets
//! about the vehicle from the first camera's client.

use skyloop_link::{Inbound, Relay, Roles, Wire, relay};
use std::sync::{Arc, Mutex};

/// The role of the link that copies packets to a further camera.
const RELAYED: Roles = Roles {
    truth: true,
    pixels: false,
    labels: false,
};

/// What cameras of one vehicle share.
#[derive(Default)]
pub(super) struct Followers {
    /// Further cameras, if this is the first.
    relays: Vec<Relay>,
    /// Whether this is a further camera.
    pub is_follower: bool,
    /// Number of this camera; the first is 0.
    pub camera: u32,
    /// Cameras render one after another.
    pub render_turn: Arc<Mutex<()>>,
}

impl Followers {
    /// Adds a further camera: its state, and the link that copies packets to it.
    pub fn add(&mut self) -> (Followers, (Wire, Roles)) {
        let (relay, wire) = relay();
        self.relays.push(relay);
        let follower = Followers {
            relays: Vec::new(),
            is_follower: true,
            camera: self.relays.len() as u32,
            render_turn: self.render_turn.clone(),
        };
        (follower, (wire, RELAYED))
    }

    /// Copies a packet to the further cameras.
    pub fn relay(&self, inbound: &Inbound) {
        self.relays.iter().for_each(|relay| relay.copy(inbound));
    }
}
