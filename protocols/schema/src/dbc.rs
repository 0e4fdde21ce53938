//! The DBC file of the CAN form. Signals are big-endian; the upper halves of f64 are IEEE 754
//! singles.

use crate::NOTE;
use crate::model::{CanFrame, Receiver, Schema, Signal};
use crate::text::{each, join};

/// The whole file.
pub fn write(schema: &Schema) -> String {
    let version = schema.version;
    let frames = &schema.can.frames;
    let mut out = format!(
        "VERSION \"skyloop CAN form, format version {version}. {NOTE}\"\n\n\
         NS_ :\n\nBS_:\n\nBU_: Client Emulator\n"
    );
    out += &each(frames, declaration);
    out += &format!("\nCM_ \"{}\";\n", schema.can.doc);
    for frame in frames {
        let id = frame.id;
        out += &format!("CM_ BO_ {id} \"{}\";\n", frame.doc);
        out += &each(frame.placed(), |(_, Signal { name, doc, .. })| {
            format!("CM_ SG_ {id} {name} \"{doc}\";\n")
        });
    }
    let signals = || {
        let signals = frames
            .iter()
            .map(|frame| frame.placed().map(|(_, signal)| (frame.id, signal)));
        signals.flatten()
    };
    for (id, signal) in signals().filter(|(_, signal)| signal.of == "opcode") {
        let codes = schema
            .opcodes()
            .map(|code| format!("{} \"{}\"", code.code, code.name));
        out += &format!("VAL_ {id} {} {} ;\n", signal.name, join(codes, " "));
    }
    for (id, signal) in signals().filter(|(_, signal)| signal.is_float()) {
        out += &format!("SIG_VALTYPE_ {id} {} : 1;\n", signal.name);
    }
    out
}

/// A frame and its signals.
fn declaration(frame: &CanFrame) -> String {
    let CanFrame {
        id, name, octets, ..
    } = frame;
    let (from, to) = match frame.to {
        Receiver::Emulator => ("Client", "Emulator"),
        Receiver::Client => ("Emulator", "Client"),
    };
    let signals = each(frame.placed(), |(at, signal)| {
        let Signal {
            name, bits, unit, ..
        } = signal;
        let (sign, max) = if signal.is_float() {
            ('-', 0)
        } else {
            ('+', (1_u64 << bits) - 1)
        };
        // DBC counts from a byte's lowest bit; a big-endian signal starts at its highest bit.
        let start = at / 8 * 8 + (7 - at % 8);
        format!(" SG_ {name} : {start}|{bits}@0{sign} (1,0) [0|{max}] \"{unit}\" {to}\n")
    });
    format!("\nBO_ {id} {name}: {octets} {from}\n{signals}")
}
