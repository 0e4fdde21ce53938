"""docs/skyloop.dbc reads our CAN frames: cantools decodes them, the f64s are put together again, bit by bit."""
import struct

import cantools

from vectors import PROTOCOLS, golden

database = cantools.database.load_file(PROTOCOLS / "docs/skyloop.dbc", strict=True)
vectors = {entry["name"]: entry for entry in golden()}
NUMBERS = [("q_icrf_to_body", "q", "xyzw"), ("rates_rad_s", "rate", "xyz"), ("position_m", "position", "xyz"),
           ("velocity_m_s", "velocity", "xyz")]


def bits(number):
    return struct.unpack(">Q", struct.pack(">d", number))[0]


def joined(high, low):
    """The f64 whose upper part is an f32 and whose last 29 bits are given."""
    return bits(high) | low


def frames(entry):
    for frame in entry["frames"].split():
        identifier, _, octets = frame.partition("#")
        message = database.get_message_by_frame_id(int(identifier, 16))
        octets = bytes.fromhex(octets)
        signals = message.decode(octets)
        assert message.encode(signals) == octets, f"{entry['name']}: {frame} has bits that no signal has"
        yield message.name, signals


def check_attitude(entry, packet):
    found, names, counters = {}, [], set()
    for name, signals in frames(entry):
        names.append(name)
        counters.add(signals.pop("counter"))
        found.update(signals)
    assert names[0] == "AttitudeBegin" and names[-1] == "AttitudeEnd" and len(counters) == 1
    assert found["has_state"] == ("position_m" in packet)
    assert len(names) == (16 if found["has_state"] else 10)
    assert found["sequence"] == int(packet["sequence"])
    assert found["sequence_count"] == int(packet["sequence_count"])
    assert found["crc"] == int.from_bytes(packet["octets"][-2:], "big")
    time = found["time_seconds"] << 32 | found["time_fraction_high"] << 3 | found["time_fraction_low"]
    assert time == int(packet["time"], 0)
    compared = 0
    for field, signal, parts in NUMBERS:
        for part, text in zip(parts, packet.get(field, "").split()):
            number = found[f"{signal}_{part}"]
            assert joined(number, found[f"{signal}_{part}_low"]) == bits(float(text)), f"{field} {part}"
            # What a tool without the lower bits shows: cut, never more than 2^-23 of it off.
            assert abs(number - float(text)) <= abs(float(text)) * 2 ** -23
            compared += 1
    return compared


def check_short(entry, packet):
    (name, signals), = frames(entry)
    if name == "ShortAck":
        assert signals == {"apid": int(packet["answers_apid"]),
                           "answered_sequence_count": int(packet["answers_sequence_count"])}
    else:
        assert name == "ShortCommand" and str(signals["opcode"]) == packet["opcode"]
        assert signals["sequence_count"] == int(packet["sequence_count"])
        assert signals["argument"] == int(packet.get("packets", 0))
    assert int(packet["time"], 0) == 0


numbers = sets = 0
for entry in vectors.values():
    if "frames" in entry:
        packet = vectors[entry["of"]]
        if packet["message"] == "Attitude":
            numbers += check_attitude(entry, packet)
        else:
            check_short(entry, packet)
        sets += 1
assert sets >= 6 and numbers >= 30
print(f"skyloop.dbc: {len(database.messages)} messages; {sets} packets as frames, {numbers} f64s bit by bit")
