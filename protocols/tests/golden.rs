//! `vectors/golden.txt` in both directions: decode(hex) is the fields, encode(fields) is the hex.

mod common;

use common::{Vector, golden, hex};
use skyloop_protocols::command::Opcode;
use skyloop_protocols::pixels::{pack, packed_length, unpack};
use skyloop_protocols::{
    Ack, Attitude, AttitudeSource, Challenge, Command, CompressedBlock, Counters, DecodeError,
    Direction, Fault, FaultKind, FrameEnd, FrameHeader, Header, LabelLevel, LabelPart, MAX_PACKET,
    Mode, Nack, ObjectPart, ObjectRecord, OrbitState, Output, Overrun, PERSONALITIES, Packing,
    PixelBlock, PixelLevel, Positions, Reason, Reply, Status, SyncState, Timing, WindowBlock,
    WireTime, Withheld, apid,
};
use std::collections::BTreeSet;

fn command(v: &Vector) -> Command {
    if v.text("message") == "Attitude" {
        return Command::Attitude(Attitude {
            sequence: v.integer("sequence"),
            q_icrf_to_body: v.floats("q_icrf_to_body"),
            rates_rad_s: v.floats("rates_rad_s"),
            state: v.has("position_m").then(|| OrbitState {
                position_m: v.floats("position_m"),
                velocity_m_s: v.floats("velocity_m_s"),
            }),
        });
    }
    let opcode = v.text("opcode");
    match Opcode::ALL
        .iter()
        .find(|known| known.name() == opcode)
        .expect(opcode)
    {
        Opcode::Exposure => Command::Exposure {
            seconds: v.float("seconds"),
        },
        Opcode::Gain => Command::Gain {
            e_per_dn: v.float("e_per_dn"),
        },
        Opcode::FrameRate => Command::FrameRate { hz: v.float("hz") },
        Opcode::SingleShot => Command::SingleShot,
        Opcode::Pause => Command::Pause,
        Opcode::Resume => Command::Resume,
        Opcode::Reset => Command::Reset,
        Opcode::Ping => Command::Ping,
        Opcode::Credit => Command::Credit {
            packets: v.integer("packets"),
        },
        Opcode::Output => Command::Output(output(v)),
        Opcode::Positions => {
            let numbers = v.integers("at");
            let centres: Vec<[u16; 2]> = numbers
                .chunks(2)
                .map(|c| [c[0] as u16, c[1] as u16])
                .collect();
            Command::Positions(Positions::new(&centres).expect("few"))
        }
        Opcode::Resend => Command::Resend {
            frame: v.integer("frame"),
            first: v.integer("first"),
            count: v.integer("count"),
        },
        Opcode::Fault => Command::Fault(Fault {
            kind: FaultKind::from_code(v.integer("kind")).expect("kind"),
            direction: Direction::from_code(v.integer("direction")).expect("direction"),
            value: v.float("value"),
            seconds: v.float("seconds"),
        }),
        Opcode::Trigger => Command::Trigger {
            number: v.integer("number"),
            start: WireTime(v.integer("start")),
        },
    }
}

fn output(v: &Vector) -> Output {
    Output {
        pixels: PixelLevel::from_code(v.integer("pixels")).expect("pixels"),
        labels: LabelLevel::from_code(v.integer("labels")).expect("labels"),
        window_size: v.integer("window_size"),
        windows: v.integer("windows"),
        objects: v.integer("objects"),
    }
}

fn packing(v: &Vector) -> Packing {
    Packing::from_code(v.integer("packing")).expect("packing")
}

fn pixels(v: &Vector) -> Vec<u16> {
    v.integers("pixels")
        .into_iter()
        .map(|pixel| u16::try_from(pixel).expect("pixel"))
        .collect()
}

/// The data of a packet, from what is listed.
fn block_data(v: &Vector) -> Vec<u8> {
    for key in ["records", "data"] {
        if v.has(key) {
            return hex(v.text(key));
        }
    }
    if !v.has("pixels") {
        return Vec::new();
    }
    let pixels = pixels(v);
    if v.has("places") {
        let places = v.integers("places");
        let area = v.integer::<usize>("size").pow(2);
        let mut data = Vec::new();
        for (place, pixels) in places.chunks(2).zip(pixels.chunks(area)) {
            for number in place {
                data.extend(u16::try_from(*number).expect("place").to_be_bytes());
            }
            let at = data.len();
            data.resize(at + packed_length(packing(v), area), 0);
            pack(packing(v), pixels, &mut data[at..]).expect("pixels pack");
        }
        return data;
    }
    let mut data = vec![0; packed_length(packing(v), pixels.len())];
    pack(packing(v), &pixels, &mut data).expect("pixels pack");
    data
}

fn frame_header(v: &Vector) -> FrameHeader {
    FrameHeader {
        frame: v.integer("frame"),
        attitude_sequence: v.integer("attitude_sequence"),
        width: v.integer("width"),
        height: v.integer("height"),
        bits: v.integer("bits"),
        packing: packing(v),
        pixel_level: PixelLevel::from_code(v.integer("pixel_level")).expect("pixels"),
        label_level: LabelLevel::from_code(v.integer("label_level")).expect("labels"),
        window_size: v.integer("window_size"),
        windows: v.integer("windows"),
        blocks: v.integer("blocks"),
        label_parts: v.integer("label_parts"),
        label_bytes: v.integer("label_bytes"),
        exposure_start: WireTime(v.integer("exposure_start")),
        exposure_end: WireTime(v.integer("exposure_end")),
        seed: v.integer("seed"),
        gain_e_per_dn: v.float("gain_e_per_dn"),
        offset_dn: v.float("offset_dn"),
    }
}

/// All of these are written so that an f32 holds them.
fn timing(v: &Vector) -> Timing {
    let seconds = |name| v.float(name) as f32;
    Timing {
        attitude_age_s: seconds("attitude_age_s"),
        first_pixel_s: seconds("first_pixel_s"),
        last_pixel_s: seconds("last_pixel_s"),
        first_octet_s: seconds("first_octet_s"),
        last_octet_s: seconds("last_octet_s"),
        spare_s: seconds("spare_s"),
    }
}

fn sync(v: &Vector) -> SyncState {
    SyncState::from_code(v.integer("sync")).expect("sync")
}

fn frame_end(v: &Vector) -> FrameEnd {
    FrameEnd {
        frame: v.integer("frame"),
        pixels_crc32: v.integer("pixels_crc32"),
        trigger: v.integer("trigger"),
        attitude_source: AttitudeSource::from_code(v.integer("attitude_source")).expect("source"),
        overrun: Overrun::from_code(v.integer("overrun")).expect("overrun"),
        sync: sync(v),
        in_time: v.integer::<u8>("flags") == 1,
        timing: timing(v),
        clock_offset_s: v.float("clock_offset_s"),
    }
}

fn counters(v: &Vector) -> Counters {
    let n = |name| v.integer(name);
    Counters {
        attitudes: n("attitudes"),
        commands: n("commands"),
        frames_rendered: n("frames_rendered"),
        frames_delivered: n("frames_delivered"),
        frames_abandoned: n("frames_abandoned"),
        bad_crc: n("bad_crc"),
        bad_version: n("bad_version"),
        bad_length: n("bad_length"),
        unknown_type: n("unknown_type"),
        bad_framing: n("bad_framing"),
        bad_attitude: n("bad_attitude"),
        time_backwards: n("time_backwards"),
        foreign_packets: n("foreign_packets"),
        overflows: n("overflows"),
        bad_value: n("bad_value"),
        refused: n("refused"),
        sequence_gaps: n("sequence_gaps"),
        rejected_records: n("rejected_records"),
        objects_without_state: n("objects_without_state"),
        lost_outbound: n("lost_outbound"),
        exposures_missed: n("exposures_missed"),
        runts: n("runts"),
        oversize: n("oversize"),
        resent_blocks: n("resent_blocks"),
        reconnects: n("reconnects"),
        incomplete: n("incomplete"),
        bus_errors: n("bus_errors"),
        bus_off: n("bus_off"),
        deadlines_missed: n("deadlines_missed"),
        frames_coarsened: n("frames_coarsened"),
        frames_dropped: n("frames_dropped"),
        attitudes_stale: n("attitudes_stale"),
        attitudes_future: n("attitudes_future"),
        triggers: n("triggers"),
        triggers_missed: n("triggers_missed"),
    }
}

fn status(v: &Vector) -> Status {
    Status {
        mode: Mode::from_code(v.integer("mode")).expect("mode"),
        width: v.integer("width"),
        height: v.integer("height"),
        bits: v.integer("bits"),
        packing: packing(v),
        output: output(v),
        exposure_s: v.float("exposure_s"),
        gain_e_per_dn: v.float("gain_e_per_dn"),
        frame_rate_hz: v.float("frame_rate_hz"),
        next_frame: v.integer("next_frame"),
        packets_sent: v.integer("packets_sent"),
        sync: sync(v),
        clock_offset_s: v.float("clock_offset_s"),
        exposure_start: WireTime(v.integer("exposure_start")),
        exposure_end: WireTime(v.integer("exposure_end")),
        timing: timing(v),
        latency_p50_s: v.float("latency_p50_s") as f32,
        latency_p99_s: v.float("latency_p99_s") as f32,
        latency_max_s: v.float("latency_max_s") as f32,
        withheld: Withheld::from_code(v.integer("withheld")).expect("withheld"),
        counters: counters(v),
    }
}

fn reply<'a>(v: &'a Vector, data: &'a [u8]) -> Reply<'a> {
    match v.text("message") {
        "FrameHeader" => Reply::FrameHeader(frame_header(v)),
        "FrameEnd" => Reply::FrameEnd(frame_end(v)),
        "PixelBlock" => Reply::PixelBlock(PixelBlock {
            frame: v.integer("frame"),
            index: v.integer("index"),
            first_pixel: v.integer("first_pixel"),
            count: v.integer("count"),
            packing: packing(v),
            data,
        }),
        "Labels" => Reply::Labels(LabelPart {
            frame: v.integer("frame"),
            part: v.integer("part"),
            parts: v.integer("parts"),
            text: v.text("text").as_bytes(),
        }),
        "Status" => Reply::Status(status(v)),
        "Challenge" => Reply::Challenge(Challenge {
            token: v.integer("token"),
        }),
        "Ack" => Reply::Ack(Ack {
            apid: v.integer("answers_apid"),
            sequence_count: v.integer("answers_sequence_count"),
        }),
        "Nack" => Reply::Nack(Nack {
            apid: v.integer("answers_apid"),
            sequence_count: v.integer("answers_sequence_count"),
            reason: Reason::from_code(v.integer("reason")).expect("reason"),
            detail: v.text("detail"),
        }),
        "Windows" => Reply::Windows(WindowBlock {
            frame: v.integer("frame"),
            index: v.integer("index"),
            first: v.integer("first"),
            count: v.integer("count"),
            size: v.integer("size"),
            packing: packing(v),
            data,
        }),
        "Objects" => Reply::Objects(ObjectPart {
            frame: v.integer("frame"),
            part: v.integer("part"),
            parts: v.integer("parts"),
            data,
        }),
        "Compressed" => Reply::Compressed(CompressedBlock {
            frame: v.integer("frame"),
            index: v.integer("index"),
            first_pixel: v.integer("first_pixel"),
            count: v.integer("count"),
            data,
        }),
        other => panic!("golden.txt [{}]: message {other}", v.name),
    }
}

#[test]
fn good_vectors_in_both_directions() {
    let vectors = golden();
    for v in vectors.iter().filter(|v| v.has("message")) {
        let (count, time) = (v.integer("sequence_count"), WireTime(v.integer("time")));
        let mut buffer = [0xAA; MAX_PACKET];
        let kind = apid::ALL
            .iter()
            .find(|(_, name)| *name == v.text("message"))
            .expect("kind");
        let header = Header {
            apid: kind.0,
            sequence_count: count,
            time,
        };
        let length = if apid::is_telecommand(kind.0) {
            let command = command(v);
            assert_eq!(
                Command::decode(&v.bytes),
                Ok((header, command)),
                "{}",
                v.name
            );
            command.encode(count, time, &mut buffer)
        } else {
            let data = block_data(v);
            let reply = reply(v, &data);
            assert_eq!(Reply::decode(&v.bytes), Ok((header, reply)), "{}", v.name);
            reply.encode(count, time, &mut buffer)
        };
        assert_eq!(&buffer[..length.expect(&v.name)], v.bytes, "{}", v.name);
    }
}

#[test]
fn pixel_blocks_give_their_pixels() {
    for v in golden()
        .iter()
        .filter(|v| v.name.starts_with("pixel block") && v.has("pixels"))
    {
        let pixels = pixels(v);
        let Ok((_, Reply::PixelBlock(block))) = Reply::decode(&v.bytes) else {
            panic!("{}", v.name)
        };
        let first = block.first_pixel as usize;
        let mut frame = vec![0; first + pixels.len()];
        assert!(block.place(&mut frame), "{}", v.name);
        assert_eq!(frame[first..], pixels, "{}", v.name);
    }
}

#[test]
fn windows_give_their_places_and_pixels() {
    for v in golden().iter().filter(|v| v.has("places")) {
        let Ok((_, Reply::Windows(block))) = Reply::decode(&v.bytes) else {
            panic!("{}", v.name)
        };
        let (mut places, mut all) = (Vec::new(), Vec::new());
        for window in block.windows() {
            places.extend([u64::from(window.column), u64::from(window.row)]);
            let mut pixels = vec![0; usize::from(block.size).pow(2)];
            assert_eq!(
                unpack(block.packing, window.data, &mut pixels),
                pixels.len()
            );
            all.extend(pixels);
        }
        assert_eq!(
            (places, all),
            (v.integers("places"), pixels(v)),
            "{}",
            v.name
        );
    }
}

#[test]
fn objects_give_their_numbers() {
    let vectors = golden();
    let v = vectors
        .iter()
        .find(|v| v.name == "objects")
        .expect("objects");
    let Ok((_, Reply::Objects(part))) = Reply::decode(&v.bytes) else {
        panic!("{}", v.name)
    };
    let objects: Vec<ObjectRecord> = part.objects().collect();
    let [star, rso] = objects[..] else {
        panic!("two objects, not {objects:?}")
    };
    // X-Val: STAR and RSO in vectors.toml.
    assert_eq!(
        (star.is_rso, star.in_frame, star.visible),
        (false, true, true)
    );
    assert!(star.id.starts_with(b"HIP 80351\0"));
    assert_eq!(
        (star.x_px, star.y_px, star.dx_px, star.dy_px),
        (12.5, 250.25, 0.5, -0.25)
    );
    assert_eq!((star.mag, star.snr, star.electrons), (4.75, 31.5, 12000.0));
    assert_eq!((rso.is_rso, rso.in_frame, rso.visible), (true, true, false));
    assert!(rso.mag.is_nan());
    let octets: Vec<u8> = objects.iter().flat_map(ObjectRecord::to_octets).collect();
    assert_eq!(octets, part.data);
}

#[test]
fn bad_vectors_are_refused_for_their_reason() {
    let mut seen = BTreeSet::new();
    for v in golden().iter().filter(|v| v.has("error")) {
        let error = match v.text("receiver") {
            "emulator" => Command::decode(&v.bytes).err(),
            "client" => Reply::decode(&v.bytes).err(),
            other => panic!("golden.txt [{}]: receiver {other}", v.name),
        };
        let error = error.unwrap_or_else(|| panic!("{} was accepted", v.name));
        assert_eq!(variant(&error), v.text("error"), "{}: {error}", v.name);
        assert!(error.to_string().len() <= 200, "{}: {error}", v.name);
        seen.insert(v.text("error").to_owned());
    }
    assert_eq!(seen.len(), 10, "every DecodeError: {seen:?}");
}

fn variant(error: &DecodeError) -> String {
    format!("{error:?}")
        .split([' ', '{'])
        .next()
        .unwrap_or_default()
        .to_owned()
}

#[test]
fn every_kind_and_every_opcode_has_a_vector() {
    let vectors = golden();
    let named = |key: &str, name: &str| vectors.iter().any(|v| v.has(key) && v.text(key) == name);
    for (_, name) in apid::ALL {
        assert!(named("message", name), "{name}");
    }
    for opcode in Opcode::ALL {
        assert!(named("opcode", opcode.name()), "{opcode:?}");
    }
}

#[test]
fn the_native_personality_speaks_the_same_bytes() {
    let native = PERSONALITIES
        .iter()
        .find(|personality| personality.name == "native")
        .expect("native");
    for v in golden().iter().filter(|v| v.has("message")) {
        let mut buffer = [0; MAX_PACKET];
        let length = match (native.decode_command)(&v.bytes) {
            Ok((h, command)) => {
                (native.encode_command)(&command, h.sequence_count, h.time, &mut buffer)
            }
            Err(_) => {
                let (h, reply) = (native.decode_reply)(&v.bytes).expect(&v.name);
                (native.encode_reply)(&reply, h.sequence_count, h.time, &mut buffer)
            }
        };
        assert_eq!(&buffer[..length.expect(&v.name)], v.bytes, "{}", v.name);
    }
}
