//! A bus through the kernel's SocketCAN: `can0`, `vcan0`.

#[cfg(target_os = "linux")]
pub use linux::open;

/// Unsupported on this system.
///
/// # Errors
/// Always.
#[cfg(not(target_os = "linux"))]
pub fn open(_: &super::settings::Settings) -> Result<Box<dyn super::CanBus>, super::Refusal> {
    Err(super::Refusal {
        action: "open a CAN interface",
        source: std::io::ErrorKind::Unsupported.into(),
        remedy: "only Linux has SocketCAN: use an adapter on a serial port, slcan:///dev/NAME"
            .to_string(),
    })
}

/// Whether the system has an interface of any kind with this name.
#[cfg(target_os = "linux")]
fn exists(interface: &str) -> bool {
    std::path::Path::new("/sys/class/net")
        .join(interface)
        .exists()
}

/// Whether an interface carries FD frames: the kernel's FD frame has 72 bytes, a classic one 16.
/// True for unknown interfaces.
#[must_use]
pub fn carries_fd(interface: &str) -> bool {
    let mtu = std::fs::read_to_string(format!("/sys/class/net/{interface}/mtu"));
    mtu.map_or(true, |mtu| mtu.trim() != "16")
}

#[cfg(target_os = "linux")]
mod linux {
    use super::{carries_fd, exists};
    use crate::can::settings::Settings;
    use crate::can::{CanBus, Refusal, Sending};
    use nix::errno::Errno;
    use skyloop_protocols::can::CanFrame;
    use socketcan::id::FdFlags;
    use socketcan::{
        CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, CanId, CanRemoteFrame,
        EmbeddedFrame, Frame, ShouldRetry, Socket, SocketOptions,
    };
    use std::io::{self, ErrorKind};
    use std::sync::Arc;
    use std::time::Duration;

    /// Requested receive buffer, bytes: some 1,000 FD frames, as the kernel counts twice their
    /// size.
    const RECEIVE_BUFFER: usize = 1 << 20;

    struct SocketBus {
        socket: Arc<CanFdSocket>,
    }

    /// Opens the interface of `settings`.
    ///
    /// # Errors
    /// The kernel has no CAN, no such interface, or it is down or carries no FD frames.
    pub fn open(settings: &Settings) -> Result<Box<dyn CanBus>, Refusal> {
        let name = &settings.place;
        // Interface 0 means all interfaces: this only tests whether the kernel supports CAN.
        if let Err(error) = CanFdSocket::open_iface(0)
            && matches!(errno(&error), Errno::EAFNOSUPPORT | Errno::EPROTONOSUPPORT)
        {
            return Err(Refusal {
                action: "open a CAN socket",
                source: error,
                remedy: "this kernel has no CAN (modules can, can-raw): run `modprobe can-raw`, boot a kernel that has them, or use slcan, which needs none".to_string(),
            });
        }
        let refuse = |source: io::Error| {
            let remedy = match errno(&source) {
                Errno::ENODEV | Errno::ENXIO if exists(name) => {
                    format!("{name} is no CAN interface: `ip -br link` lists all")
                }
                Errno::ENODEV | Errno::ENXIO => format!(
                    "there is no CAN interface {name:?}: `ip -br link` lists them; `ip link add dev {name} type vcan && ip link set {name} up` makes a virtual one"
                ),
                Errno::ENETDOWN => format!("the interface is down: run `ip link set {name} up`"),
                _ if source.kind() == ErrorKind::PermissionDenied => {
                    "run it as a user that may open CAN sockets".to_string()
                }
                _ => format!(
                    "check that {name:?} is a CAN interface: `ip -details link show {name}`"
                ),
            };
            Refusal {
                action: "open the CAN interface",
                source,
                remedy,
            }
        };
        let socket = CanFdSocket::open(name).map_err(refuse)?;
        socket.set_error_filter_accept_all().map_err(refuse)?;
        socket.set_nonblocking(true).map_err(refuse)?;
        let raw = socket.as_raw_socket();
        // The system may grant less; that is no error.
        let _ = raw.set_recv_buffer_size(RECEIVE_BUFFER);
        // A down interface reports its state as the socket's pending error.
        if let Some(error) = raw.take_error().map_err(refuse)? {
            return Err(refuse(error));
        }
        if settings.fd && !carries_fd(name) {
            return Err(Refusal {
                action: "send CAN FD frames",
                source: ErrorKind::Unsupported.into(),
                remedy: format!(
                    "{name} is set up for classic frames: leave out fd=, or run `ip link set {name} mtu 72` (virtual), `ip link set {name} type can dbitrate RATE fd on` (real)"
                ),
            });
        }
        Ok(Box::new(SocketBus {
            socket: Arc::new(socket),
        }))
    }

    impl CanBus for SocketBus {
        fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
            let Some(frame) = to_kernel(frame) else {
                return Err(ErrorKind::InvalidInput.into());
            };
            match self.socket.write_frame(&frame) {
                Ok(()) => Ok(Sending::Sent),
                Err(error) if error.should_retry() => Ok(Sending::Full),
                // The interface's queue is full.
                Err(error) if errno(&error) == Errno::ENOBUFS => Ok(Sending::Full),
                Err(error) => Err(error),
            }
        }

        fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
            match self.socket.read_frame_timeout(timeout) {
                Ok(frame) => Ok(Some(from_kernel(&frame))),
                Err(error)
                    if error.should_retry()
                        || matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) =>
                {
                    Ok(None)
                }
                Err(error) => Err(error),
            }
        }

        fn share(&self) -> io::Result<Box<dyn CanBus>> {
            Ok(Box::new(SocketBus {
                socket: Arc::clone(&self.socket),
            }))
        }
    }

    fn errno(error: &io::Error) -> Errno {
        Errno::from_raw(error.raw_os_error().unwrap_or_default())
    }

    /// Converts to the kernel's type; none for frames that no bus carries.
    fn to_kernel(frame: &CanFrame) -> Option<CanAnyFrame> {
        let payload = frame.data.get(..frame.len.into())?;
        if frame.error {
            return Some(CanErrorFrame::new_error(frame.id, payload).ok()?.into());
        }
        let id = if frame.extended {
            CanId::extended(frame.id)
        } else {
            CanId::standard(u16::try_from(frame.id).ok()?)
        }?;
        Some(match (frame.fd, frame.remote) {
            (true, _) => {
                let mut flags = FdFlags::empty();
                flags.set(FdFlags::BRS, frame.brs);
                CanFdFrame::with_flags(id, payload, flags)?.into()
            }
            (false, true) => CanRemoteFrame::new_remote(id, frame.len.into())?.into(),
            (false, false) => CanDataFrame::new(id, payload)?.into(),
        })
    }

    fn from_kernel(frame: &CanAnyFrame) -> CanFrame {
        let (fd, brs) = match frame {
            CanAnyFrame::Fd(frame) => (true, frame.is_brs()),
            _ => (false, false),
        };
        let (error, remote) = (frame.is_error_frame(), frame.is_remote_frame());
        let mut ours = CanFrame {
            id: if error {
                frame.id_word() & 0x1FFF_FFFF
            } else {
                frame.raw_id()
            },
            extended: !error && frame.is_extended(),
            fd,
            brs,
            remote,
            error,
            len: 0,
            data: [0; 64],
        };
        let payload = frame.data();
        if let Some(data) = ours.data.get_mut(..payload.len()) {
            data.copy_from_slice(payload);
        }
        ours.len = if remote { frame.dlc() } else { payload.len() } as u8;
        ours
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn frames_convert_to_kernel_types_and_back() {
            let plain = CanFrame::new(0x123, false, &[1, 2, 3]).unwrap();
            let extended = CanFrame {
                id: 0x12345,
                extended: true,
                ..plain
            };
            let remote = CanFrame {
                remote: true,
                data: [0; 64],
                ..plain
            };
            let bytes: [u8; 64] = std::array::from_fn(|n| n as u8);
            let fd = CanFrame::new(0x7FF, true, &bytes).unwrap();
            let slow = CanFrame { brs: false, ..fd };
            // X-Val: linux/can/error.h, CAN_ERR_BUSOFF; an error frame always has 8 bytes.
            let bus_off = CanFrame {
                id: 0x40,
                error: true,
                len: 8,
                ..plain
            };
            for frame in [plain, extended, remote, fd, slow, bus_off] {
                assert_eq!(from_kernel(&to_kernel(&frame).unwrap()), frame);
            }
        }

        #[test]
        fn open_errors_name_the_interface_and_a_remedy() {
            let error = open(&Settings::new("nosuchcan0"))
                .err()
                .unwrap()
                .to_string();
            // Without CAN in the kernel the remedy is another one.
            let remedies = ["ip link add dev nosuchcan0 type vcan", "use slcan"];
            assert!(
                remedies.iter().any(|remedy| error.contains(remedy)),
                "{error}"
            );
        }
    }
}
