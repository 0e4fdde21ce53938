//! The kernel's ISO-TP with ours: whole frames from the emulator, long commands to it.

use crate::support::client::{Client, counted};
use crate::support::line::Line;
use crate::tools::{Listening, hex, isotpsend};
use crate::{CLASSIC, FD, VCAN0, VCAN1, emulator};
use skyloop_protocols::{Ack, Command, MAX_PACKET, Reply, WireTime};
use socket2::{Domain, Protocol, SockAddr, Socket as RawSocket, Type};
use socketcan::{CanAddr, CanFdSocket, EmbeddedFrame, Socket, SocketOptions, StandardId};
use std::io::Read;
use std::os::fd::{AsRawFd, RawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Settings of the kernel's ISO-TP (`linux/can/isotp.h`).
#[derive(Clone, Copy)]
pub struct Settings {
    pub fd: bool,
    /// Frames that the emulator may send before the next flow control; 0: all.
    pub block_size: u8,
    /// Minimum interval of the emulator's frames: up to 0x7F ms, from 0xF1 in 100 us.
    pub st_min: u8,
    /// Pads frames with 0xCC, as ours are.
    pub padding: bool,
}

pub struct KernelLine {
    transport: Arc<Transport>,
    packets: Receiver<Vec<u8>>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// Interval between a thread's checks of its stop flag.
const TICK: Duration = Duration::from_millis(50);

struct Transport(RawSocket);

impl AsRawFd for Transport {
    fn as_raw_fd(&self) -> RawFd {
        self.0.as_raw_fd()
    }
}

impl SocketOptions for Transport {}

impl KernelLine {
    pub fn new(interface: &str, settings: Settings) -> KernelLine {
        // X-Val: AF_CAN = 29 (`linux/socket.h`), CAN_ISOTP = 6 (`linux/can.h`), SOL_CAN_ISOTP =
        // 106.
        const LEVEL: i32 = 106;
        let socket = RawSocket::new(Domain::from(29), Type::DGRAM, Some(Protocol::from(6)));
        let transport = Transport(socket.unwrap());
        // CAN_ISOTP_OPTS = 1: flags u32 (CAN_ISOTP_TX_PADDING = 4), frame_txtime u32, address,
        // padding out and in, address.
        let mut options = [0; 12];
        let flags: u32 = if settings.padding { 4 } else { 0 };
        options[..4].copy_from_slice(&flags.to_ne_bytes());
        (options[9], options[10]) = (0xCC, 0xCC);
        transport
            .set_socket_option_bytes(LEVEL, 1, &options)
            .unwrap();
        // CAN_ISOTP_RECV_FC = 2: block size, STmin, number of waits.
        let flow = [settings.block_size, settings.st_min, 0];
        transport.set_socket_option_bytes(LEVEL, 2, &flow).unwrap();
        if settings.fd {
            // CAN_ISOTP_LL_OPTS = 5: CANFD_MTU = 72, TX_DL 64, flags CANFD_BRS = 1.
            transport
                .set_socket_option_bytes(LEVEL, 5, &[72, 64, 1])
                .unwrap();
        }
        let ids = [0x220, 0x120].map(|id| StandardId::new(id).unwrap());
        let address = CanAddr::from_iface_isotp(interface, ids[0], ids[1]).unwrap();
        transport.0.bind(&SockAddr::from(address)).unwrap();
        transport.0.set_read_timeout(Some(TICK)).unwrap();
        let plain = CanFdSocket::open(interface).unwrap();
        plain.set_read_timeout(TICK).unwrap();

        let transport = Arc::new(transport);
        let stop = Arc::new(AtomicBool::new(false));
        let (to_test, packets) = channel();
        let (long, reading, stopped) = (to_test.clone(), transport.clone(), stop.clone());
        let kernels = std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while !stopped.load(Ordering::Relaxed) {
                let Ok(length) = (&reading.0).read(&mut buffer) else {
                    continue;
                };
                let packet = &buffer[..length];
                // An earlier Ack may still be in the other thread.
                if !Reply::decode(packet).is_ok_and(|(_, reply)| reply.takes_credit()) {
                    std::thread::sleep(TICK);
                }
                let _ = long.send(packet.to_vec());
            }
        });
        let stopped = stop.clone();
        let acks = std::thread::spawn(move || {
            let mut count = 0;
            while !stopped.load(Ordering::Relaxed) {
                let frame = plain.read_frame();
                if let Some(packet) = frame.ok().and_then(|f| ack(f.id(), f.data(), count)) {
                    count += 1;
                    let _ = to_test.send(packet);
                }
            }
        });
        KernelLine {
            transport,
            packets,
            stop,
            threads: vec![kernels, acks],
        }
    }
}

impl Drop for KernelLine {
    /// Closes the socket; an open one would answer the next test's messages.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads
            .drain(..)
            .for_each(|thread| thread.join().unwrap());
    }
}

fn ack(id: socketcan::Id, data: &[u8], count: u16) -> Option<Vec<u8>> {
    // X-Val: protocols/docs/skyloop.dbc, ShortAck: 0x210, APID and sequence count, 16 bits each.
    let &[a, b, c, d] = data else {
        return None;
    };
    if id != socketcan::Id::from(StandardId::new(0x210)?) {
        return None;
    }
    let reply = Reply::Ack(Ack {
        apid: u16::from_be_bytes([a, b]),
        sequence_count: u16::from_be_bytes([c, d]),
    });
    let mut buffer = [0; MAX_PACKET];
    let length = reply.encode(count, WireTime(0), &mut buffer).unwrap();
    Some(buffer[..length].to_vec())
}

impl Line for KernelLine {
    fn send(&mut self, packet: &[u8]) {
        assert_eq!(self.transport.0.send(packet).unwrap(), packet.len());
    }

    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        self.packets.recv_timeout(timeout).ok()
    }
}

const PLAIN: Settings = Settings {
    fd: false,
    block_size: 0,
    st_min: 0,
    padding: true,
};

/// Sends long commands; the replies are longer than a frame.
fn converse(client: &mut Client<KernelLine>) {
    let centres: Vec<[u16; 2]> = (0..64).map(|n| [n, 2 * n]).collect();
    let positions = skyloop_protocols::Positions::new(&centres).unwrap();
    for _ in 0..3 {
        client.done(Command::Positions(positions));
        client.has_counted(&[("incomplete", 0), ("sequence_gaps", 0)]);
    }
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn segmentation_agrees_with_the_kernel_at_all_settings() {
    let unpadded = Settings {
        padding: false,
        block_size: 4,
        ..PLAIN
    };
    let slow = Settings {
        block_size: 1,
        st_min: 2,
        ..PLAIN
    };
    let fd = Settings { fd: true, ..PLAIN };
    let fd_unpadded = Settings {
        padding: false,
        block_size: 2,
        st_min: 0xF5,
        ..fd
    };
    for (interface, rates, settings) in [
        (VCAN1, CLASSIC, PLAIN),
        (VCAN1, CLASSIC, unpadded),
        (VCAN1, CLASSIC, slow),
        (VCAN0, FD, fd),
        (VCAN0, FD, fd_unpadded),
        // A kernel socket has one format only: FD with classic frames is impossible.
    ] {
        let emulator = emulator(interface, rates);
        let mut client = Client::new(KernelLine::new(interface, settings));
        converse(&mut client);
        let counters = emulator.end();
        counted(
            &counters,
            &[("commands", 6), ("incomplete", 0), ("lost_outbound", 0)],
        );
    }
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn the_kernel_reassembles_whole_frames() {
    let emulator = emulator(VCAN0, FD);
    let mut client = Client::new(KernelLine::new(VCAN0, Settings { fd: true, ..PLAIN }));
    let frame = client.good_frame(7);
    let exposed = emulator.exposed();
    assert!(frame.pixels == exposed.frame.dn && frame.labels == *exposed.json);
    println!(
        "{} packets of a frame by the kernel's ISO-TP",
        frame.packets
    );
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn isotpsend_and_isotprecv_exchange_packets_with_the_emulator() {
    let emulator = emulator(VCAN1, CLASSIC);
    let dump = Listening::candump(VCAN1);
    let receiver = Listening::start("isotprecv -s 120 -d 220 vcan1");
    // X-Val: golden vector "ping at time 0", protocols/vectors/golden.txt.
    let ping = [
        0x19, 0x02, 0xC0, 0x05, 0, 0x0B, 0, 0, 0, 0, 0, 0, 0, 0, 3, 6, 0x6E, 0x96,
    ];
    isotpsend("-s 120 -d 220 vcan1", &ping);
    // The Ack of command 5 (APID 0x102), then the Status in several frames.
    dump.line(|line| line.ends_with(" 210#01020005"));
    let bytes = receiver.line(|_| true);
    let packet: Vec<u8> = bytes
        .split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect();
    assert_eq!(hex(&packet), bytes);
    let (_, reply) = Reply::decode(&packet).unwrap();
    assert!(matches!(reply, Reply::Status(status) if status.counters.commands == 1));
    assert_eq!(emulator.end().commands, 1);
}
