"""docs/skyloop.xtce.xml is XTCE 1.2 by the OMG's XML schema, and reads every golden packet: space_packet_parser decodes
it, every field is compared."""
import struct
import sys
import warnings
from pathlib import Path

import space_packet_parser
from space_packet_parser.xtce.definitions import XtcePacketDefinition
from space_packet_parser.xtce.validation import validate_xtce

from vectors import PROTOCOLS, golden

warnings.simplefilter("error")  # octets that no parameter has claimed
FILE = PROTOCOLS / "docs/skyloop.xtce.xml"
definition = XtcePacketDefinition.from_xtce(FILE)
HEADER = {"VERSION", "TYPE", "SEC_HDR_FLG", "PKT_APID", "SEQ_FLGS", "SRC_SEQ_CTR", "PKT_LEN", "TIME", "FORMAT_VERSION",
          "CRC"}
PARTS = {4: "xyzw", 3: "xyz"}


def raw(value):
    """What the octets say: the code of an enumeration, the count of a time."""
    return getattr(value, "raw_value", value)


def same(text, value):
    value = raw(value)
    if isinstance(value, float):
        return struct.pack(">d", float(text)) == struct.pack(">d", value)
    return int(text, 0) == value


def packed(pixels, packing):
    bits = "".join(f"{int(pixel):0{packing}b}" for pixel in pixels)
    bits += "0" * (-len(bits) % 8)
    return int("1" + bits, 2).to_bytes(len(bits) // 8 + 1, "big")[1:]


def data(entry):
    """The octets at the end of a packet, from what is listed."""
    if "places" in entry:
        size, packing = int(entry["size"]) ** 2, int(entry["packing"])
        pixels, places = entry["pixels"].split(), entry["places"].split()
        windows = range(int(entry["count"]))
        return b"".join(struct.pack(">2H", *map(int, places[2 * n:2 * n + 2]))
                        + packed(pixels[size * n:size * (n + 1)], packing) for n in windows)
    if "pixels" in entry and "packing" in entry:
        return packed(entry["pixels"].split(), int(entry["packing"]))
    return bytes.fromhex(entry.get("records") or entry["data"])


def check(entry):
    packet = definition.parse_bytes(entry["octets"])
    octets, message = entry["octets"], entry["message"]
    assert packet["SRC_SEQ_CTR"] == int(entry["sequence_count"])
    assert raw(packet["TIME"]) == int(entry["time"], 0)
    assert packet["PKT_LEN"] + 7 == len(octets)
    assert packet["CRC"] == int.from_bytes(octets[-2:], "big")
    prefix = message
    seen = set(HEADER)
    if "opcode" in entry:
        prefix = f"{message}_{entry['opcode']}"
        assert packet["Command_opcode"] == entry["opcode"]
        seen.add("Command_opcode")
    if message == "Attitude":
        assert packet["Attitude_flags"] == ("position_m" in entry)
        seen.add("Attitude_flags")
    for key, text in entry.items():
        if key in ("name", "message", "sequence_count", "time", "opcode", "hex", "octets", "records", "places", "data",
                   "pixel_bits") \
                or (key == "pixels" and f"{prefix}_data" in packet):
            continue
        name = f"{prefix}_{key.removeprefix('answers_')}"
        words = text.split()
        if key in ("text", "detail"):
            value = packet[name]
            assert (value if isinstance(value, str) else bytes(value).decode()) == text, name
        elif key == "at":
            assert bytes(packet[name]) == struct.pack(f">{len(words)}H", *map(int, words)), name
        elif len(words) > 1:
            for part, word in zip(PARTS[len(words)], words, strict=True):
                assert same(word, packet[f"{name}_{part}"]), f"{name}_{part}"
                seen.add(f"{name}_{part}")
            continue
        else:
            assert same(text, packet[name]), name
        seen.add(name)
    if f"{prefix}_data" in packet:
        assert bytes(packet[f"{prefix}_data"]) == data(entry)
        seen.add(f"{prefix}_data")
    assert seen == set(packet), f"nothing to compare with: {set(packet) - seen}"
    return len(seen)


# The package brings the OMG's schema along.
XSD = Path(space_packet_parser.__file__).parent / "xtce/schemas/SpaceSystem.xsd"
for level, schema in (("schema", XSD), ("structure", None)):
    verdict = validate_xtce(FILE, level=level, local_xsd=schema, raise_on_error=False, print_results=False)
    if not verdict.valid:
        sys.exit(f"xtce.py: {FILE.name}: not XTCE by its {level}: {verdict.errors[0]}")

fields = packets = 0
for vector in golden():
    if "message" in vector:
        try:
            fields += check(vector)
        except Exception as error:
            sys.exit(f"xtce.py: [{vector['name']}]: {type(error).__name__}: {error}")
        packets += 1
assert packets >= 30
print(f"skyloop.xtce.xml: valid XTCE; {packets} packets, {fields} fields as in golden.txt")
