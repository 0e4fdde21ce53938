"""Writes what the tests of the batch propagator read, beside this file.

PyPI packages: sgp4 2.27, mpmath 1.4.1. Nothing is downloaded:

    python make_batch_references.py

synthetic_elements.txt  made-up element sets of every kind of orbit that SGP4 tells apart, with
                        the error codes that PyPI sgp4 gives them, up to a century away
angles.txt              sines and cosines of arguments that are hard to reduce, and angles of
                        vectors, worked out with 60 digits
"""

import math
import random
from datetime import datetime, timedelta
from pathlib import Path

from mpmath import mp, mpf
from sgp4.api import WGS72, Satrec

HERE = Path(__file__).parent
EARTH_RADIUS_KM = 6378.135
MU = 398600.8  # km^3/s^2, WGS72
DAYS = [-36525, -365, -30, -7, -1, 0, 1, 7, 30, 365, 36525]
PER_CLASS = 30


def of_perigee(altitude_km, eccentricity):
    """Revolutions a day of an orbit with that perigee."""
    a = (EARTH_RADIUS_KM + altitude_km) / (1.0 - eccentricity)
    return 86400.0 / (2.0 * math.pi * math.sqrt(a**3 / MU))


def classes(rng):
    """Name, then what draws inclination (deg), eccentricity, mean motion (rev/day) and B*."""
    u = rng.uniform

    def low(low_km, high_km, e_max, drag):
        def draw():
            e = u(0.0, e_max)
            return u(0.0, 180.0), e, of_perigee(u(low_km, high_km), e), u(*drag)
        return draw

    def core():
        e = u(0.9, 0.995)
        return u(0.0, 180.0), e, of_perigee(-EARTH_RADIUS_KM * (1.0 - u(0.005, 0.06)), e), u(-1e-3, 1e-3)

    def deep(inclination, eccentricity, motion, drag=(-1e-4, 3e-4)):
        return lambda: (u(*inclination), u(*eccentricity), u(*motion), u(*drag))

    yield "low orbits", low(300, 1500, 0.02, (0.0, 1e-3))
    yield "nearly circular", low(300, 1500, 1e-4, (0.0, 1e-3))
    yield "perigee near 220 km", low(215, 225, 0.05, (0.0, 1e-3))
    yield "perigee near 156 km", low(150, 160, 0.05, (-1e-3, 1e-3))
    yield "perigee near 98 km", low(90, 105, 0.3, (-1e-3, 1e-3))
    yield "perigee in the ground", low(-100, 90, 0.1, (0.0, 1e-2))
    yield "drag of either sign", low(150, 800, 0.1, (-0.1, 0.1))
    yield "near-Earth ellipses", low(200, 2000, 0.35, (-1e-3, 1e-3))
    yield "about 225 minutes", deep((0, 180), (0, 0.45), (6.39, 6.41))
    yield "half a day, round", deep((50, 70), (0, 0.02), (1.95, 2.05))
    yield "half a day, e below 0.5", deep((0, 180), (0.3, 0.4999), (1.95, 2.05))
    yield "half a day, e 0.5 to 0.65", deep((0, 180), (0.5, 0.65), (1.9, 2.1))
    yield "half a day, e 0.65 to 0.75", deep((62, 65), (0.65, 0.75), (1.9, 2.1))
    yield "transfer orbits", deep((0, 30), (0.70, 0.735), (2.2, 2.4), (0.0, 1e-2))
    yield "a day, level", deep((0, 0.3), (0, 1e-3), (0.999, 1.006))
    yield "a day, tilted", deep((0, 16), (0, 0.01), (0.99, 1.02))
    yield "a day, about Lyddane's 0.2 rad", deep((11.3, 11.6), (0, 0.3), (0.95, 1.05))
    yield "a day, any", deep((0, 180), (0, 0.6), (0.91, 1.19))
    yield "far and long", deep((0, 180), (0.3, 0.97), (0.05, 0.9))
    yield "perigee low, apogee far", deep((0, 180), (0.8, 0.9), (0.9, 2.0), (0.0, 0.1))
    # the reference's radius is negative in some: decayed
    yield "beside the Earth's centre", core


def synthetic():
    rng = random.Random(20260711)
    with open(HERE / "synthetic_elements.txt", "w") as out:
        out.write("# UTC, inclination, node (deg), eccentricity, perigee, mean anomaly (deg), mean motion\n")
        out.write("# (rev/day), B*, then PyPI sgp4's error codes at these days from the epoch:\n")
        out.write(f"# {' '.join(str(day) for day in DAYS)}. See make_batch_references.py.\n")
        for name, draw in classes(rng):
            out.write(f"# {name}\n")
            for _ in range(PER_CLASS):
                inclination, e, motion, drag = draw()
                node, perigee, anomaly = (round(rng.uniform(0.0, 360.0), 4) for _ in range(3))
                inclination, e, motion = round(inclination, 4), round(e, 7), round(motion, 8)
                drag = float(f"{drag:.5g}")
                epoch = datetime(1980, 1, 1) + timedelta(minutes=rng.randrange(50 * 525600))
                since_1950 = epoch - datetime(1949, 12, 31)
                model = Satrec()
                model.sgp4init(
                    WGS72, "i", 0, since_1950.days + since_1950.seconds / 86400.0, drag, 0.0, 0.0, e,
                    *(math.radians(x) for x in (perigee, inclination, anomaly)),
                    motion * (math.pi / 720.0), math.radians(node),
                )
                states = [model.sgp4_tsince(1440.0 * day) for day in DAYS]
                assert all(code or all(map(math.isfinite, r + v)) for code, r, v in states)
                codes = "".join(str(code) for code, _, _ in states)
                numbers = f"{inclination} {node} {e} {perigee} {anomaly} {motion} {drag}"
                out.write(f"{epoch.isoformat()}Z {numbers} {codes}\n")


def nearest(x):
    """The nearest double, and what is left of it."""
    first = float(x)
    return f"{first!r} {float(x - mpf(first)):.3e}"


def angles():
    mp.dps = 60
    rng = random.Random(1896)
    arguments = [0.0, 1e-300, 5e-324, 1e-20, 1e-8, 0.5, 1.0, math.pi / 4, 1e7, 9999999.0, 5.5e6]
    # beside multiples of pi/4: the nearest double and its neighbours
    multiples = list(range(1, 65)) + [rng.randrange(65, 12_732_395) for _ in range(150)]
    for k in multiples:
        x = float(k * mp.pi / 4)
        arguments += [math.nextafter(x, 0.0), x, math.nextafter(x, math.inf)]
    # the doubles of up to 1e7 that are nearest to multiples of pi/2, from continued fractions
    arguments += hardest(60)
    arguments += [rng.uniform(0.0, 1.0) * 10.0 ** rng.uniform(-8, 7) for _ in range(300)]
    with open(HERE / "angles.txt", "w") as out:
        out.write("# sin: argument, rad, then sine and cosine, each as two doubles that add up. angle: y, x, and\n")
        out.write("# the angle of (x, y) from the x axis, rad, as two doubles. See make_batch_references.py.\n")
        for x in arguments:
            out.write(f"sin {x!r} {nearest(mp.sin(mpf(x)))} {nearest(mp.cos(mpf(x)))}\n")
        for y, x in vectors(rng):
            out.write(f"angle {y!r} {x!r} {nearest(mp.atan2(mpf(y), mpf(x)))}\n")


def hardest(count):
    """Doubles of 1 to 1e7 that lie nearest to multiples of pi/2: for each exponent, convergents p/q of 2^s / (pi/2)."""
    found = []
    for exponent in range(0, 24):
        unit = mpf(2) ** (exponent - 52)
        # m unit is near k pi/2: m/k is near (pi/2)/unit
        ratio, (m0, m1), (k0, k1) = mp.pi / 2 / unit, (0, 1), (1, 0)
        for _ in range(40):
            whole = int(mp.floor(ratio))
            m0, m1, k0, k1 = m1, whole * m1 + m0, k1, whole * k1 + k0
            if m1 >= 2**53:
                break
            if m1 >= 2**52 and float(m1 * unit) <= 1e7:
                found.append((abs(m1 * unit - k1 * mp.pi / 2), float(m1 * unit)))
            if ratio == whole:
                break
            ratio = 1 / (ratio - whole)
    return [x for _, x in sorted(found)[:count]]


def vectors(rng):
    ends = [0.0, -0.0, 1.0, -1.0]
    yield from ((y, x) for y in ends for x in ends if y != 0.0 or x != 0.0)
    for _ in range(300):
        length, angle = 10.0 ** rng.uniform(-3, 1), rng.uniform(-math.pi, math.pi)
        yield length * math.sin(angle), length * math.cos(angle)
    # close to the axes and the diagonals
    for quarter in range(8):
        for _ in range(20):
            angle = quarter * math.pi / 4 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-17, -2)
            yield math.sin(angle), math.cos(angle)


synthetic()
angles()
