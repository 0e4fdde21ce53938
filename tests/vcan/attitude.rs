//! An attitude sent frame by frame with `cansend`, and an incomplete set of frames.

use crate::support::client::Client;
use crate::support::{on_memory, scene};
use crate::tools::{Listening, canplayer, cansend};
use crate::transport::{KernelLine, Settings};
use crate::{FD, VCAN0, emulator};
use skyloop::config::Clock;
use skyloop_protocols::{Attitude, OrbitState, WireTime};

/// The golden vector "attitude with state" (protocols/vectors/golden.txt) as frames.
// X-Val: cantools 45.1 with protocols/docs/skyloop.dbc; each number's f64 split into its f32 and
// the bits below.
const FRAMES: [&str; 16] = [
    "100#B000000000070000",
    "101#7397DF7B00000005",
    "102#BD91116A8B8F14DD",
    "103#BF24E6299524BFD5",
    "104#3F3BC81908E581D5",
    "105#BE51E4F765FD8ADD",
    "106#3A83126E978D4FE5",
    "107#BA03126E978D4FE5",
    "108#3983126E978D4FE5",
    "109#CA847840E353F7D5",
    "10A#494F44F472B020CD",
    "10B#CAA3A6CC9B22D0ED",
    "10C#45AD434072D1AEB5",
    "10D#C53CEBD8CD20AFA5",
    "10E#C5891466DCE39B4D",
    "10F#A0000014DFD90000",
];
/// Credit of 1000 packets, command 6.
const CREDIT: &str = "110#070006000003E8";

fn golden() -> (Attitude, WireTime) {
    let attitude = Attitude {
        sequence: 7,
        q_icrf_to_body: [-0.070834, -0.644137, 0.733522, -0.204975],
        rates_rad_s: [0.001, -0.0005, 0.00025],
        state: Some(OrbitState {
            position_m: [-4340768.444, 848975.278, -5362534.303],
            velocity_m_s: [5544.406469, -3022.74043, -4386.550226],
        }),
    };
    (attitude, WireTime(0x7397_df7b_0000_0000))
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn cansend_sets_the_attitude_and_candump_shows_the_reply() {
    let emulator = emulator(VCAN0, FD);
    let settings = Settings {
        fd: true,
        block_size: 0,
        st_min: 0,
        padding: true,
    };
    let mut client = Client::new(KernelLine::new(VCAN0, settings));
    let dump = Listening::candump(VCAN0);

    // An incomplete set is dropped as a whole: counter 4.
    for frame in ["100#9000000000060000", "101#7397DF7B00000004"] {
        cansend(VCAN0, frame);
    }
    cansend(VCAN0, CREDIT);
    canplayer(VCAN0, &FRAMES);

    // The reply is the first segment of the frame header's packet. FD with bit rate switch: flags 5
    // (`linux/can.h`: CANFD_BRS 1, CANFD_FDF 4); type 1 and the length, 86 bytes.
    dump.line(|line| line.contains(" 220##510"));

    client.window = None;
    let over_can = client.frame();
    assert_eq!(over_can.header.attitude_sequence, 7);
    let exposed = emulator.exposed();
    assert!(over_can.pixels == exposed.frame.dn && over_can.labels == *exposed.json);
    let counters = emulator.end();
    assert_eq!((counters.attitudes, counters.incomplete), (1, 1));
    assert_eq!(counters.sequence_gaps, 0, "the counts are in the frames");

    let (_memory, line) = on_memory(scene(), Clock::Stepped);
    let mut other = Client::new(line);
    let (attitude, time) = golden();
    other.point(attitude, time);
    let by_memory = other.frame();
    assert!(by_memory.pixels == over_can.pixels && by_memory.labels == over_can.labels);
    assert_eq!(by_memory.header, over_can.header);
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn short_commands_have_short_replies() {
    let emulator = emulator(VCAN0, FD);
    let dump = Listening::candump(VCAN0);
    // X-Val: protocols/docs/skyloop.dbc, ShortCommand: opcode 5 (Reset), sequence count 9.
    cansend(VCAN0, "110#05000900000000");
    dump.line(|line| line.ends_with(" 210##501020009"));
    assert_eq!(emulator.end().commands, 1);
}
