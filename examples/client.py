#!/usr/bin/env python3
"""A client of skyloop over UDP, with Python's standard library alone: sends attitudes, writes each frame as a PGM picture
and its label as JSON. Pixels of every camera, lost packets and a camera's full rate are taken care of.

    skyloop run --config configs/run.toml                  the emulator; in another terminal:
    python3 examples/client.py --frames 3                  a frame for each attitude, or, where the emulator's clock is "wall",
    python3 examples/client.py --frames 3 --wall 4         frames at the camera's rate, from 4 attitudes a second
"""
import argparse, binascii, json, socket, struct, time

ATTITUDE, COMMAND = 0x101, 0x102
HEADER, PIXELS, LABELS, STATUS, ACK, NACK, END, CHALLENGE = 0x201, 0x202, 0x203, 0x204, 0x205, 0x206, 0x20A, 0x20B
FRAME_PACKETS = HEADER, PIXELS, LABELS, 0x207, 0x208, 0x209, END
CREDIT, RESEND, PING, RESET, OUTPUT = 7, 10, 6, 5, 8
TRIES = 3  # of a frame whose pixels do not have their checksum
FRAME, TEXT = 2, 2  # levels of Output: all pixels, the whole label
VALUE_OUT_OF_RANGE, NOT_SUPPORTED = 8, 10  # reasons of a Nack
WITHHELD = ("none", "no credit", "link not read", "link too slow", "no proof of the address", "packets lost", "frame too long",
            "attitude or trigger refused", "no client", "no Trigger, and run.trigger is packet")
ROOM = 256  # frame packets that may be under way; many systems limit the receive buffer to about as many

options = argparse.ArgumentParser()
options.add_argument("--address", default="127.0.0.1:4810", metavar="HOST:PORT", help="of the emulator; default: %(default)s")
options.add_argument("--frames", type=int, default=1)
options.add_argument("--wall", type=float, metavar="HZ", help="attitudes a second; default: the next after each frame")
options.add_argument("--timeout", type=float, default=30, metavar="S", help="without a frame packet; default: %(default)s")
options.add_argument("--out", default="frame-", help="what the files' names begin with")
options = options.parse_args()
try:
    host, port = options.address.rsplit(":", 1)
    emulator = (socket.gethostbyname(host), int(port))
    if not 0 < emulator[1] < 65536:
        raise ValueError(f"port {port} is not 1 to 65535")
except (ValueError, OSError) as error:
    raise SystemExit(f"--address {options.address}: must be HOST:PORT, such as 127.0.0.1:4810 ({error})")
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # not connected: that would end at the emulator's end
link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
counts, buffer = {ATTITUDE: 0, COMMAND: 0}, bytearray(1400)
losses = {"late or lost": 0, "damaged": 0, "printed": (0, 0)}


def send(apid, payload, when=0):
    head = struct.pack(">HHHQB", 0x1800 | apid, 0xC000 | counts[apid], len(payload) + 10, when, 3)
    counts[apid] = (counts[apid] + 1) & 0x3FFF
    link.sendto(head + payload + struct.pack(">H", binascii.crc_hqx(head + payload, 0xFFFF)), emulator)


def send_attitude(number):
    s = number / (options.wall or 2)  # from 2019-06-15T23:35:50 UTC on: TAI seconds since 1958, and units of 2^-32 s
    send(ATTITUDE, struct.pack(">IB13d", number, 1, -0.070834, -0.644137, 0.733522, -0.204975, 0, 0, 0,
                               -4340768.444, 848975.278, -5362534.303, 5544.406469, -3022.740430, -4386.550226),
         (1939332987 << 32) + int(s * 2**32))


def ask_for_frames():
    """Whatever `skyloop run --output` says; the Status that answers Ping shows whether it has come."""
    send(COMMAND, struct.pack(">BBBBBH", OUTPUT, FRAME, TEXT, 1, 0, 0))
    send(COMMAND, struct.pack(">B", PING))


class Frame:
    """Its packets are numbered: 0 is the FrameHeader, then those with pixels, those with labels, and the FrameEnd.

    `sent` is the last number that is known to have been sent: the emulator sends pixels while it renders the rest."""

    def __init__(self, body, is_late):
        (self.number, self.attitude, self.width, self.height, self.bits, self.packing, self.blocks, parts,
         length) = struct.unpack_from(">IIHHBB5xIHI", body)
        self.last = self.blocks + parts + 1
        self.missing, self.requested, self.is_written, self.tries = set(range(1, self.last + 1)), set(), False, 0
        self.sent = self.last if is_late else 0
        self.pixels = bytearray((self.width * self.height * self.packing + 7) // 8)
        self.label = bytearray(length)

    def take(self, apid, body):
        index = struct.unpack_from(">I" if apid == PIXELS else ">H", body, 4)[0]
        number = 1 + index if apid == PIXELS else 1 + self.blocks + index if apid == LABELS else self.last
        if number in self.requested and number not in self.missing:  # it has come twice: the first was not lost
            losses["late or lost"] -= 1
            self.requested.discard(number)
        self.missing.discard(number)
        self.sent = max(self.sent, number)
        if apid == PIXELS:  # a full block has 1368 bytes of pixels
            self.pixels[1368 * index:1368 * index + len(body) - 15] = body[15:]
        elif apid == LABELS:
            self.label[1375 * index:1375 * index + len(body) - 8] = body[8:]
        else:
            self.crc = struct.unpack_from(">I", body, 4)[0]

    def request_missing(self, unseen=0):
        """Requests the packets that were sent and have not come; `unseen` were sent after the last that came."""
        missing = {number for number in self.missing if number <= self.sent + unseen}
        losses["late or lost"] += len(missing - self.requested)
        self.requested |= missing
        first = last = None
        for number in sorted(missing) + [1 << 30]:
            if first is not None and number != last + 1:
                send(COMMAND, struct.pack(">BIII", RESEND, self.number, first, last - first + 1))
                first = None
            first, last = number if first is None else first, number

    def image(self):
        """The pixels as 16-bit numbers, the high byte first."""
        if self.packing == 16:
            return bytes(self.pixels)
        count = self.width * self.height
        digits, wide = self.pixels.hex().encode()[:3 * count], bytearray(b"0000") * count
        wide[1::4], wide[2::4], wide[3::4] = digits[0::3], digits[1::3], digits[2::3]  # 12 bits: three hexadecimal digits
        return bytes.fromhex(wide.decode())

    def write(self):
        """Writes the frame; False where its pixels do not have the checksum of its FrameEnd: all of it is requested again, twice."""
        image, name = self.image(), f"{options.out}{self.number:05}"
        if binascii.crc32(image) != self.crc:
            self.tries += 1
            if self.tries == TRIES:
                raise SystemExit(f"frame {self.number}: its pixels have the CRC-32 {binascii.crc32(image):08x}, and its FrameEnd gives "
                                 f"{self.crc:08x} (pixels_crc32), {TRIES} times: emulator and client differ in what they sum up")
            self.missing = set(range(1, self.last + 1))
            self.request_missing()
            return False
        with open(name + ".pgm", "wb") as file:
            file.write(b"P5 %d %d %d\n" % (self.width, self.height, max((1 << self.bits) - 1, 256)) + image)
        with open(name + ".json", "wb") as file:
            file.write(self.label)
        self.is_written, objects = True, len(json.loads(self.label)["objects"]) if self.label else 0
        print(f"{name}: {self.width} x {self.height} pixels of {self.bits} bits, {objects} objects", flush=True)
        return True


def receive(seconds):
    """APID, sequence count and contents of the next packet, 0 of a damaged one; None if none comes for so long."""
    try:
        link.settimeout(seconds)
        packet = memoryview(buffer)[:link.recv_into(buffer)]
    except socket.timeout:
        return None
    if len(packet) < 17 or binascii.crc_hqx(packet, 0xFFFF):  # the CRC of a packet with its own CRC-16 is 0
        losses["damaged"] += 1
        return 0, 0, b""
    apid, count = int.from_bytes(packet[:2], "big") & 0x7FF, int.from_bytes(packet[2:4], "big") & 0x3FFF
    if apid == CHALLENGE:  # proves this address: sent back as it came
        link.sendto(packet, emulator)
    return apid, count, packet[15:-2]


def print_losses():
    lost = (losses["late or lost"], losses["damaged"])
    if lost != losses["printed"]:
        print("%d packets came late or were lost on the way and were requested again, %d came damaged; the receive buffer has %d bytes "
              "(sysctl net.core.rmem_max)" % (*lost, link.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)), flush=True)
        losses["printed"] = lost


def run():
    frames, expected, pause = {}, {}, 0.05
    whole = attitudes = newest = granted = 0
    counted = reported = 0  # frame packets that have left the emulator, by their sequence counts, and as the last Status has it
    accepted = None  # attitudes that it had accepted before
    headless = None  # number of a frame whose FrameHeader is missing
    heard = asked = begin = said = time.monotonic()
    patience, reason = options.timeout, "no Status either: is `skyloop run` listening there?"
    ask_for_frames()
    while whole < options.frames:
        now = time.monotonic()
        if now - said > 1:
            print_losses()
            said = now
        sent = max(counted, reported)
        if accepted is not None and sent + ROOM > granted + ROOM // 4:
            granted = sent + ROOM
            send(COMMAND, struct.pack(">BI", CREDIT, granted & 0xFFFFFFFF))
        if accepted is not None and (now - begin >= attitudes / options.wall if options.wall else attitudes == whole):
            send_attitude(attitudes)
            attitudes += 1
        if now - heard > patience:
            raise SystemExit(f"{whole} of {options.frames} frames; no packet of a frame has come from {options.address} "
                             f"for {patience:.0f} s; {reason}")
        received = receive(pause)
        if received is None:
            if accepted is None:
                ask_for_frames()
            else:
                send(COMMAND, struct.pack(">B", PING))  # the Status that answers tells what has been sent
            pause = min(2 * pause, 1)
            continue
        apid, count, body = received
        number = int.from_bytes(body[:4], "big")
        if apid == NACK:
            print("refused:", bytes(body[5:]).decode(), flush=True)
            if accepted is None and body[4] in (VALUE_OUT_OF_RANGE, NOT_SUPPORTED):
                raise SystemExit("whole frames with label text (Output) are refused: this client takes nothing else")
        elif apid == STATUS:
            patience = options.timeout + 2 / struct.unpack_from(">d", body, 29)[0]  # and two periods of the frame rate
            reason = f"Status gives as the reason (withheld): {dict(enumerate(WITHHELD)).get(body[106], body[106])}"
            if accepted is None and tuple(body[7:9]) != (FRAME, TEXT):
                continue  # Output has not come: it is sent again
            total = struct.unpack_from(">I", body, 107)[0]
            ahead = (struct.unpack_from(">I", body, 41)[0] - reported + (1 << 31)) % (1 << 32) - (1 << 31)
            reported += max(ahead, 0)  # an older Status may come late
            accepted = total if accepted is None else accepted
            for frame in frames.values():
                frame.request_missing(max(reported - counted, 0))
            if not options.wall and total - accepted < attitudes:
                send_attitude(attitudes - 1)
        if apid not in FRAME_PACKETS:
            continue
        pause, heard = 0.05, now
        ahead = (count - expected.get(apid, count)) & 0x3FFF
        if ahead < 8192:  # else it is an earlier packet, late or sent again
            counted, expected[apid] = counted + ahead + 1, count + 1
        if apid == HEADER and number >= newest:
            frames[number], newest = Frame(body, number == headless), number + 1
            for old in [old for old in frames if old < number - 1]:  # the emulator keeps the last two frames
                missing = len(frames.pop(old).missing)
                if missing:
                    print(f"frame {old} is lost: {missing} packets are missing", flush=True)
            if number - 1 in frames:
                frames[number - 1].sent = frames[number - 1].last
                frames[number - 1].request_missing()
        elif apid in (PIXELS, LABELS, END) and number in frames:
            frames[number].take(apid, body)
        elif number >= newest:
            headless = number
            if now - asked > 0.05:
                send(COMMAND, struct.pack(">BIII", RESEND, number, 0, 1))
                asked = now
        frame = frames.get(number)
        if frame and not frame.missing and not frame.is_written and frame.write():
            whole += 1


def leave():
    """The next client need not wait. What has been sent to this one is taken up to the answer, for 1 s at most."""
    answer = struct.pack(">HH", COMMAND, counts[COMMAND])
    send(COMMAND, struct.pack(">B", RESET))
    until = time.monotonic() + 1
    while time.monotonic() < until and (receive(0.1) or (0, 0, b""))[::2] != (ACK, answer):
        pass


try:
    run()
finally:
    leave()
    print_losses()
