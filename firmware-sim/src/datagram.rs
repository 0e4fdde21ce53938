//! Received datagrams, with the number that the system dropped before them for lack of buffer
//! space.
//!
//! Linux reports the drops with a datagram (`SO_RXQ_OVFL`, socket(7)). Elsewhere they show in the
//! sequence counts alone.

use std::io;
use std::net::{SocketAddr, UdpSocket};

/// Receiving side of a socket.
#[derive(Debug)]
pub struct Datagrams {
    socket: UdpSocket,
    /// Dropped datagrams at the last report, modulo 2^32.
    lost: u32,
}

/// Properties of a received datagram.
#[derive(Clone, Copy, Debug)]
pub struct Datagram {
    /// Bytes in the buffer.
    pub length: usize,
    /// Length of each joined datagram, bytes; the last one may be shorter.
    pub each: usize,
    /// Address of the sender.
    pub from: SocketAddr,
    /// Datagrams dropped since the previous one.
    pub lost: u32,
}

impl Datagrams {
    /// Counts the drops of a socket from now on.
    ///
    /// # Errors
    /// The system cannot copy the handle, or cannot count.
    pub fn of(socket: &UdpSocket) -> io::Result<Self> {
        let socket = socket.try_clone()?;
        system::count_losses(&socket)?;
        Ok(Self { socket, lost: 0 })
    }

    /// A second socket at the same address for the datagrams of `peer` alone, with its receiving
    /// side. The kernel sorts datagrams on arrival, so a flood from other addresses takes no buffer
    /// space from `peer`. The socket also reports a closed port at `peer`
    /// ([`io::ErrorKind::ConnectionRefused`]). Earlier datagrams of `peer` stay in the first
    /// socket.
    ///
    /// # Errors
    /// The system's error; [`io::ErrorKind::Unsupported`] except on Linux.
    pub fn split_off(&self, peer: SocketAddr) -> io::Result<(UdpSocket, Self)> {
        let socket = system::split_off(&self.socket, peer)?;
        let datagrams = Self::of(&socket)?;
        Ok((socket, datagrams))
    }

    /// Requests a receive buffer of this size. Returns the size granted, if the system reports it.
    pub(crate) fn request_buffer(&self, bytes: usize) -> Option<usize> {
        system::request_buffer(&self.socket, bytes)
    }

    /// Requests datagrams of one send call as one buffer, if the system can (`UDP_GRO`, udp(7)).
    /// Receiving them one by one takes longer than all other work on them. For dropped joined
    /// datagrams the system may count only one.
    pub(crate) fn join(&self) {
        system::join(&self.socket);
    }

    /// Receives the next datagram; blocks according to the socket's mode.
    pub fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Datagram> {
        let (length, from, lost, each) = system::receive(&self.socket, buffer)?;
        // The counter is absent until the first drop.
        let lost = lost.unwrap_or(self.lost);
        let since = lost.wrapping_sub(std::mem::replace(&mut self.lost, lost));
        Ok(Datagram {
            length,
            each: each.unwrap_or(length),
            from,
            lost: since,
        })
    }
}

#[cfg(target_os = "linux")]
mod system {
    use nix::sys::socket::{
        AddressFamily, ControlMessageOwned, MsgFlags, SockFlag, SockType, SockaddrStorage, bind,
        cmsg_space, getsockopt, recvmsg, setsockopt, sockopt,
    };
    use std::io::{self, IoSliceMut};
    use std::net::{SocketAddr, SocketAddrV4, SocketAddrV6, UdpSocket};
    use std::os::fd::AsRawFd;

    pub(super) fn count_losses(socket: &UdpSocket) -> io::Result<()> {
        Ok(setsockopt(socket, sockopt::RxqOvfl, &1)?)
    }

    pub(super) fn request_buffer(socket: &UdpSocket, bytes: usize) -> Option<usize> {
        // The system limits a larger value to its maximum.
        let _ = setsockopt(socket, sockopt::RcvBuf, &bytes);
        getsockopt(socket, sockopt::RcvBuf).ok()
    }

    pub(super) fn join(socket: &UdpSocket) {
        // Old systems do not join datagrams.
        let _ = setsockopt(socket, sockopt::UdpGroSegment, &true);
    }

    /// Two sockets share an address while both allow it (`SO_REUSEADDR`, socket(7)). Both allow it
    /// only during this call, so that no other program gets the address. The connected socket gets
    /// its peer's datagrams.
    pub(super) fn split_off(socket: &UdpSocket, peer: SocketAddr) -> io::Result<UdpSocket> {
        let local = socket.local_addr()?;
        let family = match local {
            SocketAddr::V4(_) => AddressFamily::Inet,
            SocketAddr::V6(_) => AddressFamily::Inet6,
        };
        let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
        let own = nix::sys::socket::socket(family, SockType::Datagram, flags, None)?;
        let own = UdpSocket::from(own);
        setsockopt(socket, sockopt::ReuseAddr, &true)?;
        let shared = setsockopt(&own, sockopt::ReuseAddr, &true)
            .and_then(|()| bind(own.as_raw_fd(), &SockaddrStorage::from(local)));
        setsockopt(socket, sockopt::ReuseAddr, &false)?;
        shared?;
        own.connect(peer)?;
        setsockopt(&own, sockopt::ReuseAddr, &false)?;
        Ok(own)
    }

    /// Bytes, sender, dropped datagrams so far, length of each joined datagram; the last two are
    /// optional.
    pub(super) fn receive(
        socket: &UdpSocket,
        buffer: &mut [u8],
    ) -> io::Result<(usize, SocketAddr, Option<u32>, Option<usize>)> {
        let mut room = [0; cmsg_space::<u32>() + cmsg_space::<i32>()];
        let mut parts = [IoSliceMut::new(buffer)];
        let flags = MsgFlags::empty();
        let fd = socket.as_raw_fd();
        let message = recvmsg::<SockaddrStorage>(fd, &mut parts, Some(&mut room), flags)?;
        let (mut lost, mut each) = (None, None);
        for part in message.cmsgs()? {
            match part {
                ControlMessageOwned::RxqOvfl(packets) => lost = Some(packets),
                ControlMessageOwned::UdpGroSegments(bytes) => each = usize::try_from(bytes).ok(),
                _ => {}
            }
        }
        let four = |from: &SockaddrStorage| from.as_sockaddr_in().map(|v4| SocketAddrV4::from(*v4));
        let six = |from: &SockaddrStorage| from.as_sockaddr_in6().map(|v6| SocketAddrV6::from(*v6));
        let from = message.address.as_ref().and_then(|from| {
            let four = four(from).map(SocketAddr::from);
            four.or_else(|| six(from).map(SocketAddr::from))
        });
        let from = from.ok_or_else(|| io::Error::other("a datagram from no address"))?;
        Ok((message.bytes, from, lost, each))
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use std::io;
    use std::net::{SocketAddr, UdpSocket};

    pub(super) fn count_losses(_: &UdpSocket) -> io::Result<()> {
        Ok(())
    }

    pub(super) fn request_buffer(_: &UdpSocket, _: usize) -> Option<usize> {
        None
    }

    pub(super) fn join(_: &UdpSocket) {}

    pub(super) fn split_off(_: &UdpSocket, _: SocketAddr) -> io::Result<UdpSocket> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub(super) fn receive(
        socket: &UdpSocket,
        buffer: &mut [u8],
    ) -> io::Result<(usize, SocketAddr, Option<u32>, Option<usize>)> {
        let (length, from) = socket.recv_from(buffer)?;
        Ok((length, from, None, None))
    }
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;

    #[test]
    fn dropped_datagrams_are_counted_once() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_nonblocking(true).unwrap();
        let mut datagrams = Datagrams::of(&socket).unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let to = socket.local_addr().unwrap();
        let mut buffer = [0; 2000];
        for round in 0..2 {
            // More than any default buffer: each datagram takes some 2 KiB.
            let sent = 20_000;
            for number in 0..sent {
                let packet = [number as u8; 1400];
                sender.send_to(&packet, to).unwrap();
            }
            let (mut taken, mut lost) = (0, 0);
            while let Ok(datagram) = datagrams.receive(&mut buffer) {
                assert_eq!(datagram.length, 1400);
                assert_eq!(datagram.from, sender.local_addr().unwrap());
                (taken, lost) = (taken + 1, lost + datagram.lost);
            }
            assert!(taken < sent, "{taken} of {sent} fitted");
            // The next datagram reports the drops after the last one received.
            sender.send_to(b"next", to).unwrap();
            let next = datagrams.receive(&mut buffer).unwrap();
            let report = (next.length, lost + next.lost);
            assert_eq!(report, (4, sent - taken), "{round}");
        }
    }

    #[test]
    fn split_sockets_receive_only_their_peer() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_nonblocking(true).unwrap();
        let mut all = Datagrams::of(&socket).unwrap();
        let to = socket.local_addr().unwrap();
        let [peer, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        peer.send_to(b"before", to).unwrap();
        let (own_socket, mut own) = all.split_off(peer.local_addr().unwrap()).unwrap();
        for n in 0..3000 {
            other.send_to(&[1; 1400], to).unwrap();
            if n % 100 == 0 {
                peer.send_to(b"peer", to).unwrap();
            }
        }
        let mut buffer = [0; 2000];
        // Earlier datagrams stay in the first socket; most of the flood after them was dropped.
        let first = all.receive(&mut buffer).unwrap();
        assert_eq!((first.from, first.length), (peer.local_addr().unwrap(), 6));
        let mut came = 0;
        while let Ok(datagram) = own.receive(&mut buffer) {
            assert_eq!(datagram.from, peer.local_addr().unwrap());
            assert_eq!(datagram.lost, 0);
            came += 1;
        }
        assert_eq!(came, 30);
        // No other socket gets the address.
        assert!(UdpSocket::bind(to).is_err());
        // Replies come from the address that the peer sent to; a closed peer is reported.
        own_socket.send(b"answer").unwrap();
        assert_eq!(peer.recv_from(&mut buffer).unwrap().1, to);
        drop(peer);
        own_socket.send(b"answer").unwrap();
        let refused = own.receive(&mut buffer).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::ConnectionRefused);
    }

    #[test]
    fn batched_datagrams_arrive_joined_or_separately() {
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let packet = |n| vec![n; if n == 29 { 300 } else { 1400 }];
        let packets: Vec<Vec<u8>> = (0..30).map(packet).collect();
        let mut buffer = vec![0; 1 << 16];
        for joined in [true, false] {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            let timeout = std::time::Duration::from_secs(20);
            socket.set_read_timeout(Some(timeout)).unwrap();
            let mut datagrams = Datagrams::of(&socket).unwrap();
            if joined {
                datagrams.join();
            }
            let to = socket.local_addr().unwrap();
            let (mut burst, mut sent) = (crate::burst::Burst::default(), 0);
            while sent < packets.len() {
                sent += burst.send(&sender, &packets[sent..], to).unwrap();
            }
            sender.send_to(b"", to).unwrap();
            let (mut taken, mut calls) = (Vec::new(), 0);
            while taken.len() < packets.len() {
                let datagram = datagrams.receive(&mut buffer).unwrap();
                let bytes = &buffer[..datagram.length];
                taken.extend(bytes.chunks(datagram.each).map(<[u8]>::to_vec));
                calls += 1;
            }
            assert_eq!(taken, packets);
            let alone = datagrams.receive(&mut buffer).unwrap();
            assert_eq!((alone.length, alone.each), (0, 0));
            assert!(calls < packets.len() || !joined);
        }
    }
}
