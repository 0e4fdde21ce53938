"""Reads a recording with a library of others: read.py pcapng FILE REPLAYED, or read.py can FILE."""
import binascii
import re
import sys
import time

UPPER_PDU = 252
TAGS = b"\0\x0c\0\x08ccsds\0\0\0\0\0\0\0"


def read_pcapng(file, replayed):
    from pcapng import FileScanner
    from pcapng.blocks import EnhancedPacket, InterfaceDescription

    directions, times = [], []
    with open(file, "rb") as octets:
        for block in FileScanner(octets):
            if isinstance(block, InterfaceDescription):
                assert block.link_type == UPPER_PDU and block.timestamp_resolution == 1e-9, block
            if isinstance(block, EnhancedPacket):
                assert block.packet_data.startswith(TAGS)
                packet = block.packet_data[len(TAGS):]
                assert binascii.crc_hqx(packet[:-2], 0xFFFF) == int.from_bytes(packet[-2:], "big")
                directions.append(block.options["epb_flags"].inout)
                # Bit 12 of a space packet: towards the emulator.
                assert (directions[-1] == 1 or directions[-1] == "inbound") == bool(packet[0] & 0x10), directions[-1]
                times.append(block.timestamp)
    with open(replayed) as text:
        received, sent = re.search(r"(\d+) packets received, (\d+) sent", text.read()).groups()
    counted = [sum(d in kind for d in directions) for kind in ((1, "inbound"), (2, "outbound"))]
    assert counted == [int(received), int(sent)], (counted, received, sent)
    assert time.time() - 3600 < min(times) <= max(times) < time.time() + 1
    print(f"python-pcapng: {counted[0]} packets received and {counted[1]} sent, as skyloop reads them")


def read_can(file):
    import can

    with open(file) as text:
        lines = sum(1 for _ in text)
    with can.CanutilsLogReader(file) as reader:
        frames = list(reader)
    assert len(frames) == lines > 100
    assert all(frame.is_fd and frame.bitrate_switch and not frame.is_extended_id for frame in frames)
    # An attitude and its parts, short commands, ISO-TP both ways, short Acks.
    identifiers = {frame.arbitration_id for frame in frames}
    assert identifiers >= {0x100, 0x10F, 0x110, 0x210, 0x220}, identifiers
    print(f"python-can: {lines} frames")


if sys.argv[1] == "pcapng":
    read_pcapng(*sys.argv[2:])
else:
    read_can(*sys.argv[2:])
