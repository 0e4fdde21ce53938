//! Sends consecutive datagrams to one address in one system call.
//!
//! Linux splits one buffer into datagrams of equal length (`UDP_SEGMENT`, udp(7)). Elsewhere, and
//! on paths without support, each datagram takes its own call. Receivers see no difference.

use std::io;
use std::net::{SocketAddr, UdpSocket};

/// Sender of datagrams; remembers whether the system splits buffers.
#[derive(Debug)]
pub struct Burst {
    splits_buffers: bool,
}

impl Default for Burst {
    fn default() -> Self {
        Self {
            splits_buffers: true,
        }
    }
}

/// Limits of one buffer: datagrams (udp(7)), and bytes (below the length of an IPv4 datagram).
const MAX: usize = 64;
const BYTES: usize = 65_000;

impl Burst {
    /// Sends the first datagrams of `packets`, as many as one call takes. Returns their number.
    ///
    /// # Errors
    /// The system's error for the first datagram; none was sent.
    pub fn send<P: AsRef<[u8]>>(
        &mut self,
        socket: &UdpSocket,
        packets: &[P],
        to: SocketAddr,
    ) -> io::Result<usize> {
        let count = if self.splits_buffers {
            batch_len(packets)
        } else {
            1
        };
        if count > 1 {
            let length = packets.first().map_or(0, |first| first.as_ref().len());
            match system::send_split(socket, packets.get(..count).unwrap_or_default(), length, to) {
                Ok(()) => return Ok(count),
                Err(error) if is_temporary(error.kind()) => return Err(error),
                // An old system, a device without support, or a path MTU below this length. Other
                // errors are temporary.
                Err(error) => self.splits_buffers = !system::never_splits(&error),
            }
        }
        let Some(first) = packets.first() else {
            return Ok(0);
        };
        socket.send_to(first.as_ref(), to).map(|_| 1)
    }
}

/// Whether the same call may succeed later. A refused connection belongs to an earlier datagram and
/// is reported once.
fn is_temporary(kind: io::ErrorKind) -> bool {
    matches!(
        kind,
        io::ErrorKind::WouldBlock | io::ErrorKind::ConnectionRefused
    )
}

/// Number of leading `packets` for one buffer: all have the first one's length; the last may be
/// shorter.
fn batch_len<P: AsRef<[u8]>>(packets: &[P]) -> usize {
    let length = packets.first().map_or(0, |first| first.as_ref().len());
    if length == 0 {
        return 1;
    }
    let max = MAX.min(BYTES / length);
    let lengths = packets.iter().take(max).map(|one| one.as_ref().len());
    let equal = lengths.clone().take_while(|one| *one == length).count();
    let shorter = lengths.skip(equal).take(1);
    equal + shorter.filter(|last| (1..length).contains(last)).count()
}

#[cfg(target_os = "linux")]
mod system {
    use nix::sys::socket::{ControlMessage, MsgFlags, SockaddrStorage, sendmsg};
    use std::io::{self, IoSlice};
    use std::net::{SocketAddr, UdpSocket};
    use std::os::fd::AsRawFd;

    pub(super) fn send_split<P: AsRef<[u8]>>(
        socket: &UdpSocket,
        packets: &[P],
        length: usize,
        to: SocketAddr,
    ) -> io::Result<()> {
        let length = u16::try_from(length).map_err(io::Error::other)?;
        let parts = packets.iter().map(|packet| IoSlice::new(packet.as_ref()));
        let parts: Vec<IoSlice<'_>> = parts.collect();
        let cut = [ControlMessage::UdpGsoSegments(&length)];
        let (fd, flags) = (socket.as_raw_fd(), MsgFlags::empty());
        sendmsg(fd, &parts, &cut, flags, Some(&SockaddrStorage::from(to)))?;
        Ok(())
    }

    pub(super) fn never_splits(error: &io::Error) -> bool {
        use nix::errno::Errno::{EINVAL, EIO, EMSGSIZE, ENOPROTOOPT, EOPNOTSUPP};
        let never = [EINVAL, EIO, EMSGSIZE, EOPNOTSUPP, ENOPROTOOPT];
        let errno = error.raw_os_error();
        errno.is_none_or(|errno| never.iter().any(|one| *one as i32 == errno))
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use std::io;

    pub(super) fn never_splits(_: &io::Error) -> bool {
        true
    }
    use std::net::{SocketAddr, UdpSocket};

    pub(super) fn send_split<P: AsRef<[u8]>>(
        _: &UdpSocket,
        _: &[P],
        _: usize,
        _: SocketAddr,
    ) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn equal_packets_and_a_shorter_last_one_share_a_call() {
        let of = |lengths: &[usize]| -> usize {
            let packets: Vec<Vec<u8>> = lengths.iter().map(|length| vec![0; *length]).collect();
            batch_len(&packets)
        };
        assert_eq!(of(&[100, 100, 100, 40, 100]), 4);
        assert_eq!(of(&[100, 100, 100, 140]), 3);
        assert_eq!(of(&[40, 100, 100]), 1);
        assert_eq!((of(&[]), of(&[0, 0]), of(&[100, 0])), (1, 1, 1));
        // X-Val: 65,000 / 1400 = 46.4.
        assert_eq!(of(&[1400; 100]), 46);
        assert_eq!(of(&[10; 100]), 64);
        assert_eq!(of(&[&[10; 64][..], &[5]].concat()), 64);
    }

    #[test]
    fn batched_datagrams_arrive_separately() {
        let receiver = UdpSocket::bind("127.0.0.1:0").unwrap();
        let timeout = Duration::from_secs(20);
        receiver.set_read_timeout(Some(timeout)).unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let to = receiver.local_addr().unwrap();
        let packets: Vec<Vec<u8>> = (0..20u8)
            .map(|n| vec![n; if n % 7 == 6 { 300 } else { 1400 }])
            .collect();
        for mut burst in [
            Burst::default(),
            Burst {
                splits_buffers: false,
            },
        ] {
            let mut sent = 0;
            while sent < packets.len() {
                sent += burst.send(&sender, &packets[sent..], to).unwrap();
            }
            for packet in &packets {
                let mut buffer = [0; 2000];
                let length = receiver.recv(&mut buffer).unwrap();
                assert_eq!(&buffer[..length], packet);
            }
        }
    }

    #[test]
    fn refused_datagrams_are_reported_and_lose_no_other() {
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let receiver = UdpSocket::bind("127.0.0.1:0").unwrap();
        let to = receiver.local_addr().unwrap();
        let mut burst = Burst::default();
        // Longer than any datagram.
        assert!(burst.send(&sender, &[vec![0; 70_000]], to).is_err());
        assert_eq!(burst.send(&sender, &[b"after"], to).unwrap(), 1);
        assert_eq!(burst.send(&sender, &[b""; 0], to).unwrap(), 0);
    }
}
