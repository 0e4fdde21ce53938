"""Reads a recording with a library of others: read.py pcapng FILE REPLAYED, read.py can FILE, or read.py fits FOLDER."""
import binascii
import json
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


def read_fits(folder):
    import numpy
    from astropy.coordinates import angular_separation
    from astropy.io import fits
    from astropy.time import Time
    from astropy.wcs import WCS

    with open(f"{folder}/labels.jsonl") as text:
        label = json.loads(text.readline())
    with fits.open(f"{folder}/{label['files'][0]}") as file:
        file.verify("exception")
        header, shape = file[0].header, file[0].data.shape
    assert shape == (label["rows"], label["columns"])
    wcs = WCS(header)
    for part, epoch in [("OBS", "start"), ("BEG", "start"), ("AVG", "mid"), ("END", "end")]:
        ours = Time(label[f"epoch_{epoch}"].rstrip("Z"), scale="utc")
        date = Time(header[f"DATE-{part}"], scale=header["TIMESYS"].lower())
        days = Time(header[f"MJD-{part}"], format="mjd", scale="utc")
        assert abs((date - ours).sec) < 1e-9 and abs((days - ours).sec) < 2e-6, part
    assert wcs.wcs.dateobs == header["DATE-OBS"] and wcs.wcs.mjdobs == header["MJD-OBS"]
    assert (header["INSTRUME"], header["EXPTIME"]) == (label["camera"], label["exposure_s"])
    # The boresight is at the principal point; a pixel further up lies in the direction of the roll.
    for key, name in [("RA", "ra_deg"), ("DEC", "dec_deg"), ("PA_PNT", "roll_deg")]:
        assert abs(header[key] - label[name]) < 1e-10, key
    x, y = header["CRPIX1"] - 1, header["CRPIX2"] - 1
    [ra, up_ra], [dec, up_dec] = numpy.radians(wcs.all_pix2world([x, x], [y, y - 0.01], 0))
    here = numpy.radians([header["RA"], header["DEC"]])
    assert angular_separation(*here, ra, dec) < 1e-9
    roll = numpy.degrees(numpy.arctan2((up_ra - ra) * numpy.cos(dec), up_dec - dec)) % 360
    assert abs(roll - header["PA_PNT"]) < 0.01, roll
    print(f"astropy: {wcs.wcs.dateobs}, RA {header['RA']:.6f}, Dec {header['DEC']:.6f}, roll {header['PA_PNT']:.6f}")


{"pcapng": read_pcapng, "can": read_can, "fits": read_fits}[sys.argv[1]](*sys.argv[2:])
