//! The DBC file of the CAN form: signals are big-endian, the upper halves of the f64s are IEEE 754 singles.

use crate::NOTE;
use crate::model::{CanFrame, Receiver, Schema, Signal};

/// The whole file.
pub fn write(schema: &Schema) -> String {
    let mut out = format!(
        "VERSION \"skyloop CAN form, format version {}. {NOTE}\"\n\nNS_ :\n\nBS_:\n\nBU_: Client Emulator\n",
        schema.version
    );
    for frame in &schema.can.frames {
        let (from, to) = ends(frame);
        out += &format!(
            "\nBO_ {} {}: {} {from}\n",
            frame.id, frame.name, frame.octets
        );
        for (at, signal) in placed(frame) {
            let most = (1_u64 << signal.bits) - 1;
            let (sign, range) = if is_float(signal) {
                ('-', "0|0".to_owned())
            } else {
                ('+', format!("0|{most}"))
            };
            // Bits of an octet are numbered from its last; a big-endian signal is named by its first.
            let start = at / 8 * 8 + (7 - at % 8);
            out += &format!(
                " SG_ {} : {start}|{}@0{sign} (1,0) [{range}] \"{}\" {to}\n",
                signal.name, signal.bits, signal.unit
            );
        }
    }
    out += &format!("\nCM_ \"{}\";\n", schema.can.doc);
    for frame in &schema.can.frames {
        out += &format!("CM_ BO_ {} \"{}\";\n", frame.id, frame.doc);
        for (_, signal) in placed(frame) {
            out += &format!("CM_ SG_ {} {} \"{}\";\n", frame.id, signal.name, signal.doc);
        }
    }
    for frame in &schema.can.frames {
        for (_, signal) in placed(frame).filter(|(_, signal)| signal.of == "opcode") {
            let opcodes = schema.messages.iter().flat_map(|message| &message.opcodes);
            let codes: Vec<String> = opcodes
                .map(|code| format!("{} \"{}\"", code.code, code.name))
                .collect();
            out += &format!("VAL_ {} {} {} ;\n", frame.id, signal.name, codes.join(" "));
        }
    }
    for frame in &schema.can.frames {
        for (_, signal) in placed(frame).filter(|(_, signal)| is_float(signal)) {
            out += &format!("SIG_VALTYPE_ {} {} : 1;\n", frame.id, signal.name);
        }
    }
    out
}

/// Sender and receiver.
fn ends(frame: &CanFrame) -> (&'static str, &'static str) {
    match frame.to {
        Receiver::Emulator => ("Client", "Emulator"),
        Receiver::Client => ("Emulator", "Client"),
    }
}

/// Whether it is the upper half of an f64: an f32.
pub fn is_float(signal: &Signal) -> bool {
    signal.of.starts_with("high ")
}

/// The signals with the place of their first bit, without the spare bits.
pub fn placed(frame: &CanFrame) -> impl Iterator<Item = (usize, &Signal)> {
    let signals = frame.signals.iter().scan(0, |at, signal| {
        let place = *at;
        *at += signal.bits;
        Some((place, signal))
    });
    signals.filter(|(_, signal)| !signal.name.is_empty())
}
