//! A client's own socket: the system separates its datagrams from those of others.

use skyloop_firmware_sim::datagram::{Datagram, Datagrams};
use std::cell::RefCell;
use std::io;
use std::net::{SocketAddr, UdpSocket as SystemSocket};
use tokio::io::Interest;
use tokio::net::UdpSocket;

/// A socket for one client, at the same local address as the common socket.
pub(super) struct ClientSocket {
    pub peer: SocketAddr,
    pub socket: UdpSocket,
    /// The same socket, for calls that send several datagrams.
    pub sending: SystemSocket,
    datagrams: RefCell<Datagrams>,
}

impl ClientSocket {
    /// A socket for `peer`, split off the socket of `all`.
    pub fn of(all: &Datagrams, peer: SocketAddr) -> io::Result<ClientSocket> {
        let (socket, datagrams) = all.split_off(peer)?;
        Ok(ClientSocket {
            peer,
            sending: socket.try_clone()?,
            socket: UdpSocket::from_std(socket)?,
            datagrams: RefCell::new(datagrams),
        })
    }

    pub async fn receive(&self, buffer: &mut [u8]) -> io::Result<Datagram> {
        let receive = || self.datagrams.borrow_mut().receive(buffer);
        self.socket.async_io(Interest::READABLE, receive).await
    }

    /// Reads and counts the remaining datagrams.
    pub fn drain(&self) -> u32 {
        let (mut datagrams, mut buffer) = (self.datagrams.borrow_mut(), [0; 64]);
        let mut left = 0_u32;
        while let Ok(datagram) = datagrams.receive(&mut buffer) {
            left = left.saturating_add(1).saturating_add(datagram.lost);
        }
        left
    }
}
