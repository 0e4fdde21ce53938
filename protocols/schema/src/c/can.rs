//! The CAN form in C: encoders and decoders of attitudes and short packets.

use super::{count_to, function, when};
use crate::model::{CanFrame, Schema, Signal};
use crate::text::{each, indent, join, upper};

pub(super) fn write(schema: &Schema) -> String {
    let frames = &schema.can.frames;
    let group = |names: [&'static str; 2]| {
        let frames = frames.iter();
        frames.filter(move |frame| names.contains(&frame.group.as_str()))
    };
    let identifiers = each(frames, |frame| {
        let (name, id, doc) = (upper(&frame.name), frame.id, &frame.doc);
        format!("#define SKYLOOP_CAN_{name} {id:#05x}U /* {doc} */\n")
    });
    let attitude: Vec<&CanFrame> = group(["attitude", "state"]).collect();
    let count = attitude.len();
    let (encode, decode) = (encode_attitude(&attitude), decode_attitude(&attitude));
    let short = each(group(["command", "ack"]), short);
    format!("\n{identifiers}#define SKYLOOP_CAN_ATTITUDE_FRAMES {count}U\n{encode}{decode}{short}")
}

/// `("high", "q_icrf_to_body", "0")` from `high q_icrf_to_body 0`.
fn number(of: &str) -> Option<(&str, &str, &str)> {
    let (half, rest) = of.split_once(' ')?;
    let (name, index) = rest.split_once(' ')?;
    Some((half, name, index))
}

/// Identifier, length and signals of `frame`.
fn fill(frame: &CanFrame, id: &str, value: impl Fn(&str) -> String) -> String {
    let puts = each(frame.placed(), |(at, Signal { bits, of, .. })| {
        let value = value(of);
        format!("skyloop_bits_put(frame->data, {at}U, {bits}U, {value});\n")
    });
    let bytes = frame.octets;
    format!(
        "frame->id = {id};\nframe->length = {bytes}U;\n(void)memset(frame->data, 0, sizeof frame->data);\n{puts}"
    )
}

/// The value of a signal of an attitude.
fn attitude_value(of: &str) -> String {
    match of {
        "has_state" => "in->has_state ? 1U : 0U".to_owned(),
        "sequence" => "in->sequence".to_owned(),
        "time.seconds" => "header->time >> 32".to_owned(),
        "time.fraction_high" => "header->time >> 3".to_owned(),
        "time.fraction_low" => "header->time".to_owned(),
        "header.sequence_count" => "header->sequence_count".to_owned(),
        of => number(of).map_or(of.to_owned(), |(half, name, index)| {
            format!("skyloop_can_{half}(in->{name}[{index}])")
        }),
    }
}

fn encode_attitude(frames: &[&CanFrame]) -> String {
    let mut arrays: Vec<(&str, usize, &str)> = Vec::new();
    for frame in frames {
        let condition = if frame.group == "state" {
            "(!in->has_state) || "
        } else {
            ""
        };
        for (_, signal) in frame.placed().filter(|(_, signal)| signal.is_float()) {
            let name = number(&signal.of).map_or("", |(_, name, _)| name);
            match arrays.iter_mut().find(|(known, ..)| *known == name) {
                Some((_, length, _)) => *length += 1,
                None => arrays.push((name, 1, condition)),
            }
        }
    }
    let carries = each(arrays, |(name, length, condition)| {
        let carries = format!("{condition}skyloop_can_carries(in->{name}[n])");
        count_to(length, &format!("carried = carried && ({carries});\n"))
    });
    let fills = each(frames, |frame| {
        let fill = fill(frame, &format!("{:#05x}U", frame.id), attitude_value);
        let text = format!("frame = &frames[used];\n{fill}used++;\n");
        match frame.group.as_str() {
            "state" => when("in->has_state", &text),
            _ => text,
        }
    });
    let body = "uint8_t packet[SKYLOOP_MAX_PACKET];\nsize_t length = 0U;\nbool carried = true;\n"
        .to_owned()
        + &carries
        + &when("!carried", "return SKYLOOP_NOT_REPRESENTABLE;\n")
        + "skyloop_uplink_t whole;\n(void)memset(&whole, 0, sizeof whole);\nwhole.header = *header;\n\
           whole.header.apid = SKYLOOP_APID_ATTITUDE;\nwhole.as.attitude = *in;\n\
           const skyloop_error_t error = skyloop_encode_uplink(&whole, packet, sizeof packet, &length);\n"
        + &when("error != SKYLOOP_OK", "return error;\n")
        + "const uint16_t crc = (uint16_t)(((uint32_t)packet[length - 2U] << 8) | packet[length - 1U]);\n\
           size_t used = 0U;\nskyloop_can_frame_t *frame;\n"
        + &fills
        + "*count = used;\nreturn SKYLOOP_OK;\n";
    let signature = "skyloop_error_t skyloop_can_encode_attitude(const skyloop_header_t *header, const skyloop_attitude_t *in,
                                                          uint8_t counter, skyloop_can_frame_t frames[SKYLOOP_CAN_ATTITUDE_FRAMES],
                                                          size_t *count)";
    format!(
        "\n/* An attitude as frames, in the order in which they are sent; `counter` is the attitude's number, modulo 8. */\n{}",
        function(signature, &body)
    )
}

/// The statements that decode frame `at` of an attitude.
fn decode_frame((at, frame): (usize, &&CanFrame)) -> String {
    let mut high = None;
    let text = each(frame.placed(), |(first, Signal { bits, of, .. })| {
        let get = format!("skyloop_bits_get(in->data[{at}], {first}U, {bits}U)");
        match of.as_str() {
            "sequence" => format!("attitude->sequence = (uint32_t){get};\n"),
            "time.seconds" => format!("header->time |= {get} << 32;\n"),
            "time.fraction_high" => format!("header->time |= {get} << 3;\n"),
            "time.fraction_low" => format!("header->time |= {get};\n"),
            "header.sequence_count" => format!("header->sequence_count = (uint16_t){get};\n"),
            "has_state" => format!("attitude->has_state = {get} != 0U;\n"),
            "crc" => format!("const uint16_t crc = (uint16_t){get};\n"),
            of => match (number(of), high.take()) {
                (Some(("high", ..)), _) => {
                    high = Some(get);
                    String::new()
                }
                (Some((_, name, index)), Some(high)) => {
                    format!("attitude->{name}[{index}] =\n    skyloop_can_join({high}, {get});\n")
                }
                _ => String::new(),
            },
        }
    });
    match frame.group.as_str() {
        "state" => when("attitude->has_state", &text),
        _ => text,
    }
}

fn decode_attitude(frames: &[&CanFrame]) -> String {
    let body = indent(&each(frames.iter().enumerate(), decode_frame), 4);
    let first = frames.first().map_or(0, |frame| frame.id);
    let last = frames.len().saturating_sub(1);
    let bits = |group: &str| {
        let frames = frames.iter().enumerate();
        let of_group = frames.filter(|(_, frame)| frame.group == group);
        of_group.map(|(at, _)| 1_u32 << at).sum::<u32>()
    };
    let (without, whole) = (bits("attitude"), bits("attitude") | bits("state"));
    let signals = frames.iter().flat_map(|frame| frame.placed());
    let counters = signals.filter(|(_, signal)| signal.of == "counter");
    let counters = join(counters.map(|(first, _)| format!("{first}U")), ", ");
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
"
    )
}

/// Both functions of a packet that is one frame: a short command or an Ack.
fn short(frame: &CanFrame) -> String {
    let is_command = frame.group == "command";
    let (packet, link, is_short) = if is_command {
        (
            "command",
            "uplink",
            "const uint8_t opcode = in->as.command.opcode;\n\
             const bool is_short = skyloop_can_is_short(opcode);\n",
        )
    } else {
        ("ack", "downlink", "const bool is_short = true;\n")
    };
    let (id, apid) = (upper(&frame.name), upper(packet));
    let fill = fill(frame, &format!("SKYLOOP_CAN_{id}"), |of| match of {
        "header.sequence_count" => "in->header.sequence_count".to_owned(),
        "argument" => {
            let is_credit = "(in->as.command.opcode == SKYLOOP_OPCODE_CREDIT)";
            format!("{is_credit} ? in->as.command.as.credit.packets : 0U")
        }
        of => format!("in->as.{packet}.{of}"),
    });
    let take = each(frame.placed(), |(at, Signal { bits, of, .. })| {
        let get = format!("skyloop_bits_get(frame->data, {at}U, {bits}U)");
        match of.as_str() {
            "opcode" => format!("out->as.command.opcode = (uint8_t){get};\n"),
            "header.sequence_count" => {
                format!("out->header.sequence_count = (uint16_t)({get} & 0x3FFFU);\n")
            }
            "argument" => when(
                "out->as.command.opcode == SKYLOOP_OPCODE_CREDIT",
                &format!("out->as.command.as.credit.packets = (uint32_t){get};\n"),
            ),
            of => format!("out->as.{packet}.{of} = (uint16_t){get};\n"),
        }
    });
    let is_other = format!("(in->header.apid != SKYLOOP_APID_{apid}) || !is_short");
    let refuse = when(&is_other, "return SKYLOOP_NOT_REPRESENTABLE;\n");
    let encode = format!("{is_short}{refuse}{fill}return SKYLOOP_OK;\n");
    let bytes = frame.octets;
    let is_other = format!("(frame->id != SKYLOOP_CAN_{id}) || (frame->length != {bytes}U)");
    let mut decode = when(&is_other, "return SKYLOOP_BAD_LENGTH;\n");
    decode += "(void)memset(out, 0, sizeof *out);\n";
    decode += &format!("out->header.apid = SKYLOOP_APID_{apid};\n{take}");
    let mut helper = String::new();
    if is_command {
        let is_long = "!skyloop_can_is_short(out->as.command.opcode)";
        decode += &when(is_long, "return SKYLOOP_UNKNOWN_OPCODE;\n");
        let is_short =
            "return (opcode >= SKYLOOP_OPCODE_SINGLE_SHOT) && (opcode <= SKYLOOP_OPCODE_CREDIT);\n";
        helper = "\n".to_owned() + &function("bool skyloop_can_is_short(uint8_t opcode)", is_short);
    }
    decode += "return SKYLOOP_OK;\n";
    let to_frame = format!(
        "skyloop_error_t skyloop_can_encode_{packet}(const skyloop_{link}_t *in, skyloop_can_frame_t *frame)"
    );
    let from_frame = format!(
        "skyloop_error_t skyloop_can_decode_{packet}(const skyloop_can_frame_t *frame, skyloop_{link}_t *out)"
    );
    let (encode, decode) = (function(&to_frame, &encode), function(&from_frame, &decode));
    format!("{helper}\n/* {} */\n{encode}\n{decode}", frame.doc)
}
