//! The CAN form in C: frames of an attitude and of short packets, both ways.

use crate::model::{CanFrame, Schema, Signal};

/// Signals of a frame with the place of their first bit.
fn signals(frame: &CanFrame) -> impl Iterator<Item = (usize, &Signal)> {
    crate::dbc::placed(frame)
}

/// Encoder and decoder.
pub(super) fn write(schema: &Schema) -> String {
    let group = |names: &[&str]| -> Vec<&CanFrame> {
        schema
            .can
            .frames
            .iter()
            .filter(|frame| names.contains(&frame.group.as_str()))
            .collect()
    };
    let attitude = group(&["attitude", "state"]);
    let mut out = String::from("\n");
    for frame in &schema.can.frames {
        out += &format!(
            "#define SKYLOOP_CAN_{} {:#05x}U /* {} */\n",
            super::upper(&frame.name),
            frame.id,
            frame.doc
        );
    }
    out += &format!("#define SKYLOOP_CAN_ATTITUDE_FRAMES {}U\n", attitude.len());
    out += &encode_attitude(&attitude);
    out += &decode_attitude(&attitude);
    for frame in group(&["command", "ack"]) {
        out += &short(frame);
    }
    out
}

/// `q_icrf_to_body[0]` from `high q_icrf_to_body 0`.
fn number(of: &str) -> Option<(&str, String)> {
    let mut words = of.split(' ');
    let (half, name, index) = (words.next()?, words.next()?, words.next()?);
    Some((half, format!("{name}[{index}]")))
}

fn put(frame: &CanFrame, value: impl Fn(&Signal) -> String, data: &str) -> String {
    let puts = signals(frame).map(|(at, signal)| {
        format!(
            "    skyloop_bits_put({data}, {at}U, {}U, {});\n",
            signal.bits,
            value(signal)
        )
    });
    puts.collect()
}

fn encode_attitude(frames: &[&CanFrame]) -> String {
    let mut arrays: Vec<(&str, usize, bool)> = Vec::new();
    for frame in frames {
        for (_, signal) in signals(frame).filter(|(_, signal)| signal.of.starts_with("high ")) {
            let name = signal.of.split(' ').nth(1).unwrap_or_default();
            match arrays.iter_mut().find(|(known, _, _)| *known == name) {
                Some((_, length, _)) => *length += 1,
                None => arrays.push((name, 1, frame.group == "state")),
            }
        }
    }
    let mut carries = String::new();
    for (name, length, in_state) in arrays {
        let condition = if in_state { "(!in->has_state) || " } else { "" };
        carries += &format!(
            "    for (size_t n = 0U; n < {length}U; n++) {{\n        carried = carried && ({condition}skyloop_can_carries(in->{name}[n]));\n    }}\n"
        );
    }
    let mut body = String::new();
    for frame in frames {
        let value = |signal: &Signal| match signal.of.as_str() {
            "counter" => "counter".to_owned(),
            "has_state" => "in->has_state ? 1U : 0U".to_owned(),
            "sequence" => "in->sequence".to_owned(),
            "time.seconds" => "header->time >> 32".to_owned(),
            "time.fraction_high" => "header->time >> 3".to_owned(),
            "time.fraction_low" => "header->time".to_owned(),
            "header.sequence_count" => "header->sequence_count".to_owned(),
            "crc" => "crc".to_owned(),
            of => number(of).map_or(String::new(), |(half, name)| {
                format!("skyloop_can_{half}(in->{name})")
            }),
        };
        let text = format!(
            "    frame = &frames[used];\n    frame->id = {:#05x}U;\n    frame->length = {}U;\n    (void)memset(frame->data, 0, sizeof frame->data);\n{}    used++;\n",
            frame.id,
            frame.octets,
            put(frame, value, "frame->data")
        );
        body += &match frame.group.as_str() {
            "state" => {
                let inside: String = text.lines().map(|line| format!("    {line}\n")).collect();
                format!("    if (in->has_state) {{\n{inside}    }}\n")
            }
            _ => text,
        };
    }
    format!(
        "\n/* An attitude as frames, in the order in which they are sent; `counter` is the attitude's number, modulo 8. */\nstatic inline skyloop_error_t skyloop_can_encode_attitude(const skyloop_header_t *header, const skyloop_attitude_t *in,\n                                                          uint8_t counter, skyloop_can_frame_t frames[SKYLOOP_CAN_ATTITUDE_FRAMES],\n                                                          size_t *count)\n{{\n    uint8_t packet[SKYLOOP_MAX_PACKET];\n    size_t length = 0U;\n    bool carried = true;\n{carries}    if (!carried) {{\n        return SKYLOOP_NOT_REPRESENTABLE;\n    }}\n    skyloop_uplink_t whole;\n    (void)memset(&whole, 0, sizeof whole);\n    whole.header = *header;\n    whole.header.apid = SKYLOOP_APID_ATTITUDE;\n    whole.as.attitude = *in;\n    const skyloop_error_t error = skyloop_encode_uplink(&whole, packet, sizeof packet, &length);\n    if (error != SKYLOOP_OK) {{\n        return error;\n    }}\n    const uint16_t crc = (uint16_t)(((uint32_t)packet[length - 2U] << 8) | packet[length - 1U]);\n    size_t used = 0U;\n    skyloop_can_frame_t *frame;\n{body}    *count = used;\n    return SKYLOOP_OK;\n}}\n"
    )
}

fn decode_attitude(frames: &[&CanFrame]) -> String {
    let first = frames.first().map_or(0, |frame| frame.id);
    let (mut whole, mut state) = (0_u32, 0_u32);
    let (mut counters, mut body) = (Vec::new(), String::new());
    for (at, frame) in frames.iter().enumerate() {
        whole |= 1 << at;
        let in_state = frame.group == "state";
        if in_state {
            state |= 1 << at;
        }
        let mut text = String::new();
        let mut high = None;
        for (place, signal) in signals(frame) {
            let get = format!(
                "skyloop_bits_get(in->data[{at}], {place}U, {}U)",
                signal.bits
            );
            text += &match signal.of.as_str() {
                "counter" => {
                    counters.push(format!("{place}U"));
                    String::new()
                }
                "sequence" => format!("    attitude->sequence = (uint32_t){get};\n"),
                "time.seconds" => format!("    header->time |= {get} << 32;\n"),
                "time.fraction_high" => format!("    header->time |= {get} << 3;\n"),
                "time.fraction_low" => format!("    header->time |= {get};\n"),
                "header.sequence_count" => {
                    format!("    header->sequence_count = (uint16_t){get};\n")
                }
                "has_state" => format!("    attitude->has_state = {get} != 0U;\n"),
                "crc" => format!("    const uint16_t crc = (uint16_t){get};\n"),
                of => match (number(of), high.take()) {
                    (Some(("high", _)), _) => {
                        high = Some(get);
                        String::new()
                    }
                    (Some((_, name)), Some(high)) => {
                        format!(
                            "    attitude->{name} =\n        skyloop_can_join({high}, {get});\n"
                        )
                    }
                    _ => String::new(),
                },
            };
        }
        body += &match in_state {
            true => {
                let inside: String = text.lines().map(|line| format!("    {line}\n")).collect();
                format!("    if (attitude->has_state) {{\n{inside}    }}\n")
            }
            false => text,
        };
    }
    let last = frames.len().saturating_sub(1);
    format!(
        r"
/* An attitude under way. Begin with all zeros. */
typedef struct {{
    uint8_t data[SKYLOOP_CAN_ATTITUDE_FRAMES][8];
    uint32_t seen; /* bit n: frame n has come */
    uint8_t counter;
}} skyloop_can_attitude_t;

/* All frames are there: the attitude, if it is the one whose CRC came with it. */
static inline skyloop_error_t skyloop_can_finish(const skyloop_can_attitude_t *in, skyloop_uplink_t *out)
{{
    uint8_t packet[SKYLOOP_MAX_PACKET];
    size_t length = 0U;
    (void)memset(out, 0, sizeof *out);
    skyloop_header_t *const header = &out->header;
    skyloop_attitude_t *const attitude = &out->as.attitude;
    header->apid = SKYLOOP_APID_ATTITUDE;
{body}    const skyloop_error_t error = skyloop_encode_uplink(out, packet, sizeof packet, &length);
    if ((error != SKYLOOP_OK) || (crc != skyloop_crc16(packet, length - 2U))) {{
        return SKYLOOP_INCOMPLETE;
    }}
    return skyloop_valid_attitude(attitude);
}}

/* Takes any frame. `*complete`: with this one an attitude ended, which is in `*out` if there is no error. */
static inline skyloop_error_t skyloop_can_decode_attitude(skyloop_can_attitude_t *in, const skyloop_can_frame_t *frame,
                                                          skyloop_uplink_t *out, bool *complete)
{{
    static const uint8_t counters[SKYLOOP_CAN_ATTITUDE_FRAMES] = {{{counters}}}; /* first bit of the counter */
    *complete = false;
    if ((frame->id < {first:#05x}U) || (frame->id >= {first:#05x}U + SKYLOOP_CAN_ATTITUDE_FRAMES) || (frame->length != 8U)) {{
        return SKYLOOP_OK;
    }}
    const size_t at = (size_t)frame->id - {first:#05x}U;
    const uint8_t counter = (uint8_t)skyloop_bits_get(frame->data, counters[at], 3U);
    const bool broken = (at == 0U) && (in->seen != 0U);
    if (at == 0U) {{
        in->seen = 0U;
        in->counter = counter;
    }}
    if (((in->seen == 0U) && (at != 0U)) || (counter != in->counter)) {{
        const bool lost = (at == {last}U) || (in->seen != 0U);
        in->seen = 0U;
        return lost ? SKYLOOP_INCOMPLETE : SKYLOOP_OK;
    }}
    in->seen |= (uint32_t)1U << at;
    (void)memcpy(in->data[at], frame->data, sizeof frame->data);
    if (at != {last}U) {{
        return broken ? SKYLOOP_INCOMPLETE : SKYLOOP_OK;
    }}
    const bool has_state = skyloop_bits_get(in->data[0], 3U, 1U) != 0U;
    const uint32_t wanted = has_state ? {whole:#x}U : {without:#x}U;
    const bool is_whole = (in->seen & wanted) == wanted;
    in->seen = 0U;
    *complete = is_whole;
    return is_whole ? skyloop_can_finish(in, out) : SKYLOOP_INCOMPLETE;
}}
",
        counters = counters.join(", "),
        without = whole & !state,
    )
}

/// A packet that is one frame.
fn short(frame: &CanFrame) -> String {
    let id = super::upper(&frame.name);
    let (name, link, take, member) = match frame.group.as_str() {
        "command" => ("command", "uplink", "COMMAND", "command"),
        _ => ("ack", "downlink", "ACK", "ack"),
    };
    let value = |signal: &Signal| match signal.of.as_str() {
        "opcode" => format!("in->as.{member}.opcode"),
        "header.sequence_count" => "in->header.sequence_count".to_owned(),
        "argument" => format!(
            "(in->as.{member}.opcode == SKYLOOP_OPCODE_CREDIT) ? in->as.{member}.as.credit.packets : 0U"
        ),
        of => format!("in->as.{member}.{of}"),
    };
    let gets: String = signals(frame)
        .map(|(at, signal)| {
            let get = format!("skyloop_bits_get(frame->data, {at}U, {}U)", signal.bits);
            match signal.of.as_str() {
                "opcode" => format!("    out->as.{member}.opcode = (uint8_t){get};\n"),
                "header.sequence_count" => format!("    out->header.sequence_count = (uint16_t)({get} & 0x3FFFU);\n"),
                "argument" => format!("    if (out->as.{member}.opcode == SKYLOOP_OPCODE_CREDIT) {{\n        out->as.{member}.as.credit.packets = (uint32_t){get};\n    }}\n"),
                of => format!("    out->as.{member}.{of} = (uint16_t){get};\n"),
            }
        })
        .collect();
    let (accepts, known) = match name {
        "command" => (
            "    const uint8_t opcode = in->as.command.opcode;\n    const bool is_short = skyloop_can_is_short(opcode);\n".to_owned(),
            format!("    if (!skyloop_can_is_short(out->as.{member}.opcode)) {{\n        return SKYLOOP_UNKNOWN_OPCODE;\n    }}\n"),
        ),
        _ => ("    const bool is_short = true;\n".to_owned(), String::new()),
    };
    let helper = match name {
        "command" => {
            "\nstatic inline bool skyloop_can_is_short(uint8_t opcode)\n{\n    return (opcode >= SKYLOOP_OPCODE_SINGLE_SHOT) && (opcode <= SKYLOOP_OPCODE_CREDIT);\n}\n"
        }
        _ => "",
    };
    format!(
        "{helper}\n/* {} */\nstatic inline skyloop_error_t skyloop_can_encode_{name}(const skyloop_{link}_t *in, skyloop_can_frame_t *frame)\n{{\n{accepts}    if ((in->header.apid != SKYLOOP_APID_{take}) || !is_short) {{\n        return SKYLOOP_NOT_REPRESENTABLE;\n    }}\n    frame->id = SKYLOOP_CAN_{id};\n    frame->length = {}U;\n    (void)memset(frame->data, 0, sizeof frame->data);\n{}    return SKYLOOP_OK;\n}}\n\n\
         static inline skyloop_error_t skyloop_can_decode_{name}(const skyloop_can_frame_t *frame, skyloop_{link}_t *out)\n{{\n    if ((frame->id != SKYLOOP_CAN_{id}) || (frame->length != {}U)) {{\n        return SKYLOOP_BAD_LENGTH;\n    }}\n    (void)memset(out, 0, sizeof *out);\n    out->header.apid = SKYLOOP_APID_{take};\n{gets}{known}    return SKYLOOP_OK;\n}}\n",
        frame.doc,
        frame.octets,
        put(frame, value, "frame->data"),
        frame.octets,
    )
}
