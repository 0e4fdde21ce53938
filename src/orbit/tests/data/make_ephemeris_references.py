"""Writes the reference numbers of ephemeris messages beside this file, which the orbit tests read.

PyPI packages: scipy 1.17.1, astropy 8.0.2 (with astropy-iers-data), pyerfa 2.0.1.5. Nothing is downloaded:

    python make_ephemeris_references.py

oem_interpolated.txt   "state STEP t x y z vx vy vz": a Kepler orbit every 60 s and every 240 s, written to 1 um and 1 nm/s, km, km/s;
                       "METHOD DEGREE STEP t x y z vx vy vz": what scipy's KroghInterpolator (HERMITE: positions and velocities),
                       BarycentricInterpolator (LAGRANGE: each by itself) and numpy.interp (LINEAR) find between these states;
                       "true 0 STEP t ...": the Kepler orbit itself
frames_to_gcrf.txt     "SOURCE FRAME UT1-UTC utc x y z vx vy vz x y z vx vy vz": states in a frame and in GCRF, m and m/s. By erfa: TOD and
                       MOD of IAU 2006/2000A; ITRF by the celestial intermediate origin and the Earth rotation angle without the
                       pole's motion. By astropy: ITRS to GCRS with UT1 - UTC and the pole's motion of IERS Bulletin B
"""

from pathlib import Path

import erfa
import numpy as np
from astropy import units as u
from astropy.coordinates import GCRS, ITRS, CartesianRepresentation
from astropy.time import Time
from astropy.utils import iers
from scipy.interpolate import BarycentricInterpolator, KroghInterpolator

HERE = Path(__file__).parent
iers.conf.auto_download = False
MU = 398600.4418  # km^3/s^2


def kepler(t):
    """Position and velocity, km and km/s, on an ellipse of 6,790 km and eccentricity 0.002, inclined by 51.6 degrees."""
    a, e, incl, node, peri = 6790.0, 0.002, np.radians(51.6), 1.1, 0.4
    n = np.sqrt(MU / a**3)
    anomaly = n * t
    ecc = anomaly
    for _ in range(30):
        ecc = ecc - (ecc - e * np.sin(ecc) - anomaly) / (1 - e * np.cos(ecc))
    root = np.sqrt(1 - e * e)
    rate = n / (1 - e * np.cos(ecc))
    plane = np.array([a * (np.cos(ecc) - e), a * root * np.sin(ecc), 0.0])
    speed = np.array([-a * np.sin(ecc), a * root * np.cos(ecc), 0.0]) * rate

    def z(angle):
        return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])

    tilt = np.array([[1, 0, 0], [0, np.cos(incl), -np.sin(incl)], [0, np.sin(incl), np.cos(incl)]])
    turn = z(node) @ tilt @ z(peri)
    return np.concatenate([turn @ plane, turn @ speed])


def window(times, t, count):
    """The `count` neighbouring nodes whose middle is nearest to t."""
    firsts = range(len(times) - count + 1)
    first = min(firsts, key=lambda first: abs(times[first:first + count].mean() - t))
    return slice(first, first + count)


def interpolated(method, degree, times, states, t):
    if method == "LINEAR":
        return np.array([np.interp(t, times, column) for column in states.T])
    count = (degree + 1) // 2 if method == "HERMITE" else degree + 1
    near = window(times, t, count)
    # About t: the polynomials of scipy are of the distance from 0.
    x, states = times[near] - t, states[near]
    if method == "LAGRANGE":
        return np.array([BarycentricInterpolator(x, column)(0.0) for column in states.T])
    twice = np.repeat(x, 2)
    axes = [KroghInterpolator(twice, np.column_stack([states[:, i], states[:, i + 3]]).ravel()) for i in range(3)]
    return np.array([axis(0.0) for axis in axes] + [axis.derivative(0.0) for axis in axes])


def row(words, numbers):
    return " ".join([*words, *(repr(float(number)) for number in numbers)])


def ephemerides():
    rows = []
    for step in (60, 240):
        times = np.arange(12) * float(step)
        states = np.array([kepler(t) for t in times])
        states = np.column_stack([states[:, :3].round(9), states[:, 3:].round(12)])
        rows += [row(["state", str(step), repr(float(t))], state) for t, state in zip(times, states)]
        for share in (0.25, 0.4, 1.3, 3.7, 5.45, 7.0, 8.6, 10.55, 10.9):
            t = share * step
            at = [str(step), repr(t)]
            rows.append(row(["true", "0", *at], kepler(t)))
            for method, degree in (("HERMITE", 3), ("HERMITE", 7), ("HERMITE", 9), ("LAGRANGE", 5), ("LAGRANGE", 7), ("LINEAR", 1)):
                rows.append(row([method, str(degree), *at], interpolated(method, degree, times, states, t)))
    return rows


def matrices(time, ut1_utc):
    """GCRF to TOD, MOD and ITRF without the pole's motion, by erfa."""
    tt, ut1 = (time.tt.jd1, time.tt.jd2), erfa.utcut1(time.utc.jd1, time.utc.jd2, ut1_utc)
    x, y, s = erfa.xys06a(*tt)
    cio = erfa.c2ixys(x, y, s)
    fixed = erfa.rz(erfa.era00(*ut1), cio)
    return {"TOD": erfa.pnm06a(*tt), "MOD": erfa.pmat06(*tt), "ITRF": fixed}


def frames():
    rows = []
    places = [(6900e3, -1200e3, 800e3, 1100.0, 5200.0, 5300.0), (-20000e3, 35000e3, 9000e3, -2600.0, -1400.0, 300.0)]
    table = iers.IERS_B.open()
    for utc, ut1_utc in (("1995-03-11T04:05:06.5", 0.0), ("2019-06-15T23:35:50", -0.1634), ("2026-11-27T06:00:00", 0.7)):
        time = Time(utc, scale="utc")
        for place in places:
            r, v = np.array(place[:3]), np.array(place[3:])
            for frame in ("TOD", "MOD", "ITRF"):
                # The velocity by a central difference over 2 s of the turned straight line; of TOD and MOD, which turn by
                # 1e-11 rad/s, without their turning.
                at = {dt: matrices(time + dt * u.s, ut1_utc)[frame].T for dt in (-1, 0, 1)}
                speed = at[0] @ v
                if frame == "ITRF":
                    speed = (at[1] @ (r + v) - at[-1] @ (r - v)) / 2
                rows.append(row(["erfa", frame, repr(ut1_utc), utc], [*place, *(at[0] @ r), *speed]))
    for utc in ("1995-03-11T04:05:06.5", "2006-01-01T00:00:00", "2019-06-15T23:35:50"):
        time = Time(utc, scale="utc")
        with iers.earth_orientation_table.set(table):
            ut1_utc = float(table.ut1_utc(time).to_value("s"))
            for place in places:
                # Nothing about velocities: the test of the others holds.
                itrs = ITRS(CartesianRepresentation(np.array(place[:3]) * u.m), obstime=time)
                r = itrs.transform_to(GCRS(obstime=time)).cartesian.xyz.to_value("m")
                rows.append(row(["astropy", "ITRF", repr(ut1_utc), utc], [*place, *r, *np.zeros(3)]))
    return rows


def write(name, rows):
    (HERE / name).write_text("# Written by make_ephemeris_references.py\n" + "\n".join(rows) + "\n")


write("oem_interpolated.txt", ephemerides())
write("frames_to_gcrf.txt", frames())
