#!/usr/bin/env python3
"""Writes golden.txt: the wire formats once more, written down from docs/icd.md in another language.

Nothing here is shared with the Rust code. CRC-16/CCITT-FALSE is binascii.crc_hqx with preset 0xFFFF,
CRC-32 is binascii.crc32; both are checked against their published values first.
Run: python3 golden.py > golden.txt
"""
from binascii import crc32, crc_hqx
from datetime import datetime
from struct import pack

assert crc_hqx(b"123456789", 0xFFFF) == 0x29B1  # catalogue of parametrised CRC algorithms: check value
assert crc32(b"123456789") == 0xCBF43926  # the same

APID = {"Attitude": 0x101, "Command": 0x102, "FrameHeader": 0x201, "PixelBlock": 0x202,
        "Labels": 0x203, "Status": 0x204, "Ack": 0x205, "Nack": 0x206, "Windows": 0x207, "Objects": 0x208,
        "Compressed": 0x209}
# 2019-06-15T23:35:50 UTC is 37 s behind TAI.
SECONDS = int((datetime(2019, 6, 15, 23, 35, 50) - datetime(1958, 1, 1)).total_seconds()) + 37
TIME = SECONDS << 32
START, END = TIME - (1 << 32) // 20, TIME + (1 << 32) // 20  # 0.1 s of exposure


def seal(octets):
    return octets + pack(">H", crc_hqx(octets, 0xFFFF))


def packet(kind, count, payload, time=TIME, version=2, octet0=0, apid=None, flags=3, extra=0):
    apid = APID[kind] if apid is None else apid
    first = (0x1000 if kind in ("Attitude", "Command") else 0) | 0x0800 | apid
    body = pack(">QB", time, version) + payload
    head = pack(">HHH", first ^ octet0 << 8, flags << 14 | count, len(body) + 2 - 1 + extra)
    return seal(head + body)


def spaced(octets):
    """Primary header, time, version, payload, CRC; the payload in lines of 32 octets."""
    payload = octets[15:-2]
    lines = [payload[at:at + 32].hex(" ", -4) for at in range(0, len(payload), 32)]
    head = f"{octets[:6].hex(' ', -2)} | {octets[6:14].hex()} | {octets[14:15].hex()} |"
    return "\n      ".join([head, *lines, f"| {octets[-2:].hex()}"])


def show(name, octets, /, **fields):
    print(f"[{name}]")
    for key, value in fields.items():
        print(f"{key} = {value}".rstrip())
    print(f"hex = {spaced(octets) if len(octets) >= 17 else octets.hex()}".rstrip() + "\n")


def good(name, kind, sequence_count, payload, time=TIME, /, **fields):
    show(name, packet(kind, sequence_count, payload, time), message=kind, sequence_count=sequence_count,
         time=f"{time:#018x}", **fields)


def bad(name, end, error, octets):
    show(name, octets, receiver=end, error=error)


def words(numbers):
    return " ".join(map(repr, numbers))


print("""# Golden vectors: decode(hex) must give the fields, encode(fields) must give the hex.
# Written by golden.py, which shares nothing with the Rust code. Numbers with 0x are hexadecimal,
# time is in units of 2^-32 s since 1958-01-01 TAI, bars part primary header, time, version, payload and CRC.
""")

# ---- towards the emulator -------------------------------------------------------------------------------------------
Q = [-0.070834, -0.644137, 0.733522, -0.204975]
RATES = [0.001, -0.0005, 0.00025]
POSITION = [-4340768.444, 848975.278, -5362534.303]
VELOCITY = [5544.406469, -3022.740430, -4386.550226]
fixed = pack(">4d3d", *Q, *RATES)
attitude = pack(">IB", 7, 1) + fixed + pack(">6d", *POSITION, *VELOCITY)
good("attitude with state", "Attitude", 5, attitude, sequence=7, q_icrf_to_body=words(Q), rates_rad_s=words(RATES),
     position_m=words(POSITION), velocity_m_s=words(VELOCITY))
good("attitude without state", "Attitude", 16383, pack(">IB", 0xFFFFFFFF, 0) + fixed, TIME + 1, sequence=0xFFFFFFFF,
     q_icrf_to_body=words(Q), rates_rad_s=words(RATES))
good("exposure", "Command", 0, pack(">Bd", 1, 0.1), opcode="Exposure", value=0.1)
good("gain", "Command", 1, pack(">Bd", 2, 2.5), opcode="Gain", value=2.5)
good("frame rate", "Command", 2, pack(">Bd", 3, 2.0), opcode="FrameRate", value=2.0)
good("single shot", "Command", 3, pack(">B", 4), opcode="SingleShot")
good("reset", "Command", 4, pack(">B", 5), opcode="Reset")
good("ping", "Command", 5, pack(">B", 6), opcode="Ping")
good("credit", "Command", 6, pack(">BI", 7, 0x01020304), opcode="Credit", packets=0x01020304)
good("output", "Command", 7, pack(">BBBBBH", 8, 1, 1, 11, 20, 300), opcode="Output", pixels=1, labels=1, window_size=11,
     windows=20, objects=300)
good("positions", "Command", 8, pack(">BB4H", 9, 2, 10, 20, 300, 400), opcode="Positions", centres="10 20 300 400")
good("no positions", "Command", 9, pack(">BB", 9, 0), opcode="Positions", centres="")
good("resend", "Command", 10, pack(">BIII", 10, 3, 17, 2), opcode="Resend", frame=3, first=17, count=2)
good("fault", "Command", 11, pack(">BBBdd", 11, 2, 1, 0.05, 1.5), opcode="Fault", kind=2, direction=1, value=0.05,
     seconds=1.5)

# ---- from the emulator ----------------------------------------------------------------------------------------------
PIXELS = [0x000, 0x123, 0xABC, 0xFFF, 0x5A5]
pixel_crc = crc32(pack(">5H", *PIXELS))
good("frame header, one block", "FrameHeader", 0,
     pack(">IIHHBBBBBHIHIQQQddI", 3, 7, 5, 1, 12, 12, 2, 2, 0, 0, 1, 1, 13, START, END, 42, 2.5, 100.0, pixel_crc),
     frame=3, attitude_sequence=7, width=5, height=1, bits=12, packing=12, pixels_sent=2, labels_sent=2, window_size=0,
     windows=0, blocks=1, label_parts=1, label_bytes=13,
     exposure_start=f"{START:#x}", exposure_end=f"{END:#x}", seed=42, gain_e_per_dn=2.5, offset_dn=100.0,
     pixels_crc32=f"{pixel_crc:#010x}")
# 1280 x 1024 pixels of 16 bits in blocks of 684: 1917 blocks. 2 x 1375 + 1 octets of labels: 3 parts.
good("frame header, many blocks", "FrameHeader", 1,
     pack(">IIHHBBBBBHIHIQQQddI", 4, 8, 1280, 1024, 14, 16, 2, 2, 0, 0, 1917, 3, 2751, START, END, 2**64 - 1, 0.7, -1.5, 0xDEADBEEF),
     frame=4, attitude_sequence=8, width=1280, height=1024, bits=14, packing=16, pixels_sent=2,
     labels_sent=2, window_size=0, windows=0, blocks=1917, label_parts=3,
     label_bytes=2751, exposure_start=f"{START:#x}", exposure_end=f"{END:#x}", seed=2**64 - 1, gain_e_per_dn=0.7,
     offset_dn=-1.5, pixels_crc32="0xdeadbeef")
# 20 windows of 11 x 11 pixels of 16 bits, 246 octets each, five a packet; 26 objects of 54 octets, 25 a packet.
good("frame header, windows and objects", "FrameHeader", 2,
     pack(">IIHHBBBBBHIHIQQQddI", 5, 9, 256, 256, 14, 16, 1, 1, 11, 20, 4, 2, 1404, START, END, 42, 2.5, 100.0, 1),
     frame=5, attitude_sequence=9, width=256, height=256, bits=14, packing=16, pixels_sent=1, labels_sent=1, window_size=11,
     windows=20, blocks=4, label_parts=2, label_bytes=1404, exposure_start=f"{START:#x}", exposure_end=f"{END:#x}",
     seed=42, gain_e_per_dn=2.5, offset_dn=100.0, pixels_crc32=1)
good("frame header, compressed, no labels", "FrameHeader", 3,
     pack(">IIHHBBBBBHIHIQQQddI", 6, 9, 256, 256, 14, 16, 3, 0, 0, 0, 31, 0, 0, START, END, 42, 2.5, 100.0, 2),
     frame=6, attitude_sequence=9, width=256, height=256, bits=14, packing=16, pixels_sent=3, labels_sent=0, window_size=0,
     windows=0, blocks=31, label_parts=0, label_bytes=0, exposure_start=f"{START:#x}", exposure_end=f"{END:#x}",
     seed=42, gain_e_per_dn=2.5, offset_dn=100.0, pixels_crc32=2)


def pack12(pixels):
    bits = "".join(f"{pixel:012b}" for pixel in pixels)
    bits += "0" * (-len(bits) % 8)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


good("pixel block, 12 bits, odd count", "PixelBlock", 0, pack(">IIIHB", 3, 0, 0, 5, 12) + pack12(PIXELS),
     frame=3, index=0, first_pixel=0, count=5, packing=12, pixels=" ".join(map(hex, PIXELS)))
good("pixel block, 12 bits, second block", "PixelBlock", 1, pack(">IIIHB", 3, 1, 912, 2, 12) + pack12(PIXELS[1:3]),
     frame=3, index=1, first_pixel=912, count=2, packing=12, pixels=" ".join(map(hex, PIXELS[1:3])))
good("pixel block, 16 bits", "PixelBlock", 2, pack(">IIIHB", 4, 2, 1368, 3, 16) + pack(">3H", 0, 0x1234, 0xFFFF),
     frame=4, index=2, first_pixel=1368, count=3, packing=16, pixels="0x0 0x1234 0xffff")
FULL = [7 * n % 4096 for n in range(912)]
good("pixel block, 12 bits, full", "PixelBlock", 3, pack(">IIIHB", 5, 0, 0, 912, 12) + pack12(FULL),
     frame=5, index=0, first_pixel=0, count=912, packing=12, pixels=" ".join(map(hex, FULL)))
good("windows, 16 bits", "Windows", 0, pack(">IIHBBB", 5, 0, 0, 2, 2, 16) + pack(">6H", 7, 8, 1, 2, 3, 4)
     + pack(">6H", 250, 251, 5, 6, 7, 0xFFFF), frame=5, index=0, first=0, count=2, size=2, packing=16,
     places="7 8 250 251", pixels="1 2 3 4 5 6 7 0xffff")
# A window of 3 x 3 pixels of 12 bits takes 4 + 14 octets: 76 a packet.
good("windows, 12 bits, second packet", "Windows", 1, pack(">IIHBBB", 5, 1, 76, 1, 3, 12) + pack(">HH", 0, 1)
     + pack12(range(9)), frame=5, index=1, first=76, count=1, size=3, packing=12, places="0 1",
     pixels=" ".join(map(str, range(9))))
STAR = pack(">BB16sddfffff", 0, 3, b"HIP 80351", 12.5, 250.25, 0.5, -0.25, 4.75, 31.5, 12000.0)
RSO = pack(">BB16sddfffff", 1, 1, b"NORAD 44322", 100.125, 0.5, 3.5, 0.0, float("nan"), 0.0, 0.0)
good("objects", "Objects", 0, pack(">IHH", 5, 0, 1) + STAR + RSO, frame=5, part=0, parts=1, records=(STAR + RSO).hex())
good("compressed", "Compressed", 0, pack(">IIIH", 6, 1, 700, 2) + b"\x12\x34", frame=6, index=1, first_pixel=700, count=2,
     data="1234")
TEXT = '{"objects":[]}'[:13]
good("labels", "Labels", 0, pack(">IHH", 3, 0, 1) + TEXT.encode(), frame=3, part=0, parts=1, text=TEXT)
NAMES = ["attitudes", "commands", "frames_rendered", "frames_delivered", "frames_abandoned", "bad_crc", "bad_version",
         "bad_length", "unknown_type", "bad_framing", "bad_attitude", "time_backwards", "foreign_packets",
         "overflows", "bad_value", "refused", "sequence_gaps", "rejected_records", "objects_without_state",
         "lost_outbound", "exposures_missed", "runts", "oversize", "resent_blocks", "reconnects", "incomplete",
         "bus_errors", "bus_off"]
COUNTS = [101 + n for n in range(len(NAMES))]
good("status", "Status", 9,
     pack(">BHHBBBBBBHdddII28I", 1, 256, 256, 14, 16, 1, 1, 11, 20, 12, 0.1, 2.5, 2.0, 51, 4949, *COUNTS),
     mode=1, width=256, height=256, bits=14, packing=16, pixels=1, labels=1, window_size=11, windows=20, objects=12,
     exposure_s=0.1, gain_e_per_dn=2.5, frame_rate_hz=2.0,
     next_frame=51, packets_sent=4949, **dict(zip(NAMES, COUNTS)))
good("ack", "Ack", 2, pack(">HH", 0x102, 5), answers_apid="0x102", answers_sequence_count=5)
DETAIL = "Attitude.q_icrf_to_body has the squared norm 4: µ"
good("nack", "Nack", 3, pack(">HHB", 0x101, 16383, 5) + DETAIL.encode(), answers_apid="0x101",
     answers_sequence_count=16383, reason=5, detail=DETAIL)
good("nack without detail", "Nack", 4, pack(">HHB", 0x101, 0, 7), answers_apid="0x101", answers_sequence_count=0,
     reason=7, detail="")

# ---- on a serial line: RFC 1055 SLIP around packet and CRC-32 -------------------------------------------------------
ping = packet("Command", 5, pack(">B", 6))
escaped = (ping + pack(">I", crc32(ping))).replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc")
print(f"[ping on a serial line]\npacket = {ping.hex()}\nhex = c0 | {escaped.hex()} | c0\n")

# ---- refused --------------------------------------------------------------------------------------------------------
ping, ack = pack(">B", 6), pack(">HH", 0x102, 5)
whole = packet("Command", 0, ping)
bad("bad crc", "emulator", "BadCrc", whole[:-1] + bytes([whole[-1] ^ 1]))
bad("bad format version", "emulator", "BadVersion", packet("Command", 0, ping, version=1))
bad("bad packet version number", "emulator", "BadVersion", packet("Command", 0, ping, octet0=0x20))
bad("length field too large", "emulator", "BadLength", packet("Command", 0, ping, extra=1))
bad("length field too small", "emulator", "BadLength", packet("Command", 0, ping, extra=-1))
bad("cut short", "emulator", "BadLength", whole[:16])
bad("empty", "emulator", "BadLength", b"")
bad("trailing octet in the payload", "emulator", "BadLength", packet("Command", 0, ping + b"\0"))
bad("missing payload", "emulator", "BadLength", packet("Command", 0, b""))
bad("state announced but missing", "emulator", "BadLength", packet("Attitude", 0, pack(">IB", 7, 1) + fixed))
bad("state present but not announced", "emulator", "BadLength",
    packet("Attitude", 0, pack(">IB", 7, 0) + fixed + pack(">6d", *POSITION, *VELOCITY)))
bad("unknown apid", "emulator", "UnknownApid", packet("Command", 0, ping, apid=0x103))
bad("idle apid", "client", "UnknownApid", packet("Ack", 0, ack, apid=0x7FF))
bad("reply sent to the emulator", "emulator", "UnknownApid", packet("Ack", 0, ack))
bad("command sent to the client", "client", "UnknownApid", whole)
bad("wrong type bit", "emulator", "WrongType", packet("Command", 0, ping, octet0=0x10))
bad("no secondary header", "emulator", "BadHeader", packet("Command", 0, ping, octet0=0x08))
bad("segmented", "emulator", "BadHeader", packet("Command", 0, ping, flags=1))
bad("unknown opcode", "emulator", "UnknownOpcode", packet("Command", 0, pack(">B", 99)))
bad("attitude flags", "emulator", "BadValue", packet("Attitude", 0, pack(">IB", 7, 2) + fixed))
bad("quaternion of norm 2", "emulator", "QuaternionNotUnit", packet("Attitude", 0, pack(">IB7d", 7, 0, 0, 0, 0, 2, 0, 0, 0)))
bad("quaternion NaN", "emulator", "NotFinite", packet("Attitude", 0, pack(">IB7d", 7, 0, float("nan"), 0, 0, 1, 0, 0, 0)))
bad("infinite rate", "emulator", "NotFinite", packet("Attitude", 0, pack(">IB7d", 7, 0, 0, 0, 0, 1, 0, float("inf"), 0)))
bad("exposure of 0", "emulator", "BadValue", packet("Command", 0, pack(">Bd", 1, 0.0)))
bad("gain NaN", "emulator", "BadValue", packet("Command", 0, pack(">Bd", 2, float("nan"))))
bad("frame header, too few blocks", "client", "BadValue", packet(
    "FrameHeader", 1, pack(">IIHHBBBBBHIHIQQQddI", 4, 8, 1280, 1024, 14, 16, 2, 2, 0, 0, 1916, 3, 2751, START, END, 0, 0.7, 0, 0)))
bad("frame header, 14 bits packed to 12", "client", "BadValue", packet(
    "FrameHeader", 1, pack(">IIHHBBBBBHIHIQQQddI", 4, 8, 5, 1, 14, 12, 2, 0, 0, 0, 1, 0, 0, START, END, 0, 0.7, 0, 0)))
bad("frame header, ends before it starts", "client", "BadValue", packet(
    "FrameHeader", 1, pack(">IIHHBBBBBHIHIQQQddI", 4, 8, 5, 1, 12, 12, 2, 0, 0, 0, 1, 0, 0, END, START, 0, 0.7, 0, 0)))
for what, fields in [("window larger than the frame", (5, 1, 12, 12, 1, 0, 2, 1, 1, 0, 0)),
                     ("windows without their level", (5, 1, 12, 12, 2, 0, 1, 1, 1, 0, 0)),
                     ("level 4", (5, 1, 12, 12, 4, 0, 0, 0, 1, 0, 0)),
                     ("label level 3", (5, 1, 12, 12, 0, 3, 0, 0, 0, 0, 0)),
                     ("half a record", (5, 1, 12, 12, 0, 1, 0, 0, 0, 1, 27)),
                     ("compressed into nothing", (5, 1, 12, 12, 3, 0, 0, 0, 0, 0, 0))]:
    bad(f"frame header, {what}", "client", "BadValue",
        packet("FrameHeader", 1, pack(">IIHHBBBBBHIHIQQQddI", 4, 8, *fields, START, END, 0, 0.7, 0, 0)))
bad("output, unknown level", "emulator", "BadValue", packet("Command", 0, pack(">BBBBBH", 8, 4, 1, 11, 20, 12)))
bad("output, window of 26", "emulator", "BadValue", packet("Command", 0, pack(">BBBBBH", 8, 1, 1, 26, 20, 12)))
bad("positions, too many", "emulator", "BadValue", packet("Command", 0, pack(">BB130H", 9, 65, *range(130))))
bad("positions, one missing", "emulator", "BadLength", packet("Command", 0, pack(">BBHH", 9, 2, 1, 1)))
bad("fault, unknown kind", "emulator", "BadValue", packet("Command", 0, pack(">BBBdd", 11, 12, 1, 0.05, 1.5)))
bad("fault, no direction", "emulator", "BadValue", packet("Command", 0, pack(">BBBdd", 11, 2, 2, 0.05, 1.5)))
bad("fault, probability of 2", "emulator", "BadValue", packet("Command", 0, pack(">BBBdd", 11, 2, 1, 2.0, 1.5)))
bad("fault, NaN", "emulator", "BadValue", packet("Command", 0, pack(">BBBdd", 11, 2, 1, float("nan"), 1.5)))
bad("windows, first out of step", "client", "BadValue",
    packet("Windows", 0, pack(">IIHBBB", 5, 1, 0, 1, 2, 16) + pack(">6H", 7, 8, 1, 2, 3, 4)))
bad("windows, none", "client", "BadValue", packet("Windows", 0, pack(">IIHBBB", 5, 0, 0, 0, 2, 16)))
bad("windows, size 0", "client", "BadValue", packet("Windows", 0, pack(">IIHBBB", 5, 0, 0, 1, 0, 16) + pack(">2H", 0, 0)))
bad("windows, padding not zero", "client", "BadValue",
    packet("Windows", 0, pack(">IIHBBB", 5, 0, 0, 1, 1, 12) + pack(">HHH", 0, 0, 1)))
bad("objects, half a record", "client", "BadValue", packet("Objects", 0, pack(">IHH", 5, 0, 1) + STAR[:27]))
bad("objects, unknown kind", "client", "BadValue", packet("Objects", 0, pack(">IHH", 5, 0, 1) + b"\2" + STAR[1:]))
bad("compressed, empty", "client", "BadValue", packet("Compressed", 0, pack(">IIIH", 6, 1, 700, 2)))
bad("pixel block, count above its data", "client", "BadLength",
    packet("PixelBlock", 0, pack(">IIIHB", 3, 0, 0, 6, 12) + pack12(PIXELS)))
bad("pixel block, count below its data", "client", "BadLength",
    packet("PixelBlock", 0, pack(">IIIHB", 3, 0, 0, 4, 12) + pack12(PIXELS)))
bad("pixel block, empty", "client", "BadValue", packet("PixelBlock", 0, pack(">IIIHB", 3, 0, 0, 0, 12)))
bad("pixel block, wrong place", "client", "BadValue",
    packet("PixelBlock", 0, pack(">IIIHB", 3, 1, 911, 2, 12) + pack12(PIXELS[:2])))
bad("pixel block, padding not zero", "client", "BadValue",
    packet("PixelBlock", 0, pack(">IIIHB", 3, 0, 0, 1, 12) + b"\x00\x01"))
bad("pixel block, unknown packing", "client", "BadValue", packet("PixelBlock", 0, pack(">IIIHB", 3, 0, 0, 1, 14) + b"\0\0"))
bad("labels, part beyond parts", "client", "BadValue", packet("Labels", 0, pack(">IHH", 3, 1, 1) + b"{}"))
bad("labels, short part before the last", "client", "BadValue", packet("Labels", 0, pack(">IHH", 3, 0, 2) + b"{}"))
bad("status, unknown mode", "client", "BadValue",
    packet("Status", 9, pack(">BHHBBBBBBHdddII28I", 2, 256, 256, 14, 16, 2, 2, 11, 20, 12, 0.1, 2.5, 2.0, 51, 4949, *COUNTS)))
bad("nack, unknown reason", "client", "BadValue", packet("Nack", 0, pack(">HHB", 0x101, 0, 200)))
bad("nack, detail not UTF-8", "client", "BadValue", packet("Nack", 0, pack(">HHB", 0x101, 0, 1) + b"\xff"))
bad("nack, detail too long", "client", "BadValue", packet("Nack", 0, pack(">HHB", 0x101, 0, 1) + b"x" * 201))
bad("ack, sequence count of 15 bits", "client", "BadValue", packet("Ack", 0, pack(">HH", 0x102, 16384)))
