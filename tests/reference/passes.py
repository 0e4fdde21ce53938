"""Passes of made-up objects through a camera's field, by brute force: passes.tle and passes.csv.

Independent of skyloop: PyPI sgp4 (the reference implementation), TEME to GCRS by pyerfa (pnm06a, gst06a, gmst82), light
time and classical aberration, a pinhole, every object at every 20 ms, crossings bisected to 1 us.

    pip install sgp4==2.27 numpy==2.4.6 pyerfa==2.0.1.5
    python passes.py

Camera: fai-nir (530.769 px focal length, 256 x 256 px, centre 127.5). The observer is the first object of the file; the
attitude turns at constant rates from the beginning. passes.csv: catalogue number, entry and exit (s after the beginning),
place there (px), instant (s) and angle (deg) nearest to the boresight, least range (km), magnitude of a diffuse sphere (10 m,
reflectance 0.2) in full sunlight when nearest to the boresight.
"""

import math
from pathlib import Path

import erfa
import numpy as np
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_tle

HERE = Path(__file__).parent
# 2026-11-22T00:00:00 UTC, and how long, s
JD, LENGTH_S, STEP_S = 2461366.5, 900.0, 0.02
LEAP_S = 37.0 + 32.184
C_KM_S = 299792.458
AU_KM = 149597870.7
FOCAL_PX, CENTRE_PX, SIDE_PX = 13.8e-3 / 26e-6, 127.5, 256.0
# ICRF to body at the beginning, scalar last, and body rates, rad/s
Q = np.array([0.1, 0.6, -0.2, 0.76])
RATES = np.radians([0.02, -0.05, 0.03])
WANTED = 12


def satellite(number, a_km, e, inclination_deg, rng):
    """Elements of a random plane, as a TLE holds them."""
    motion = math.sqrt(398600.8 / a_km**3) * 60.0
    angles = rng.uniform(0.0, 2.0 * math.pi, 3)
    made = Satrec()
    made.sgp4init(WGS72, "i", number, JD - 2433281.5, 1e-4, 0.0, 0.0, e, angles[0],
                  math.radians(inclination_deg), angles[1], motion, angles[2])
    made.classification, made.intldesg, made.elnum, made.revnum = "U", "26001A", 1, 1
    lines = export_tle(made)
    return lines, Satrec.twoline2rv(*lines)


def rotation():
    """TEME to GCRS in the middle: it turns by 4e-9 rad within the time."""
    day = (LENGTH_S / 2.0) / 86400.0
    tt = day + LEAP_S / 86400.0
    npb = erfa.pnm06a(JD, tt)
    angle = erfa.gst06a(JD, day, JD, tt) - erfa.gmst82(JD, day)
    c, s = math.cos(angle), math.sin(angle)
    equinox = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return (equinox @ npb).T


TURN = rotation()


def states(sat, t):
    """GCRS position (km) and velocity (km/s) at times t (s), and whether each is known."""
    t = np.atleast_1d(np.asarray(t, dtype=float))
    code, r, v = sat.sgp4_array(np.full(len(t), JD), t / 86400.0)
    return r @ TURN.T, v @ TURN.T, code == 0


def attitude(t):
    """Matrices ICRF to body: exp(-[w x] t) R(q)."""
    x, y, z, w = Q / np.linalg.norm(Q)
    u = np.array([x, y, z])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    start = (w * w - u @ u) * np.eye(3) + 2.0 * np.outer(u, u) + 2.0 * w * cross
    rate = np.linalg.norm(RATES)
    n = RATES / rate
    k = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    angle = -rate * t[:, None, None]
    return (np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)) @ start


def seen(sat, observer, t):
    """Apparent directions in camera axes, geometric range (km), the place the light left (km)."""
    t = np.atleast_1d(np.asarray(t, dtype=float))
    ro, vo, _ = states(observer, t)
    r, _, known = states(sat, t)
    distance = np.linalg.norm(r - ro, axis=1)
    left = r
    for _ in range(3):
        left, _, _ = states(sat, t - np.linalg.norm(left - ro, axis=1) / C_KM_S)
    u = left - ro
    u /= np.linalg.norm(u, axis=1)[:, None]
    u = u + vo / C_KM_S
    u /= np.linalg.norm(u, axis=1)[:, None]
    return np.einsum("tij,tj->ti", attitude(t), u), distance, left, ro, known


def place(u):
    return CENTRE_PX + FOCAL_PX * u[:, :2] / u[:, 2:]


def inside(sat, observer, t):
    u, _, _, _, known = seen(sat, observer, t)
    p = place(u)
    within = np.all((p >= -0.5) & (p <= SIDE_PX - 0.5), axis=1)
    return within & (u[:, 2] > 0.0) & known


def bisect(sat, observer, low, high):
    state = inside(sat, observer, low)[0]
    while high - low > 1e-6:
        mid = (low + high) / 2.0
        if inside(sat, observer, mid)[0] == state:
            low = mid
        else:
            high = mid
    return (low + high) / 2.0


def least(value, t):
    """The instant of the least value by ever finer grids around it."""
    low, high = t
    for _ in range(8):
        grid = np.linspace(low, high, 201)
        best = int(np.argmin(value(grid)))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, 200)]
    return (low + high) / 2.0


def magnitude(sat, observer, t):
    _, distance, left, ro, _ = seen(sat, observer, t)
    earth, _ = erfa.epv00(JD, (t + LEAP_S) / 86400.0)
    heliocentric = np.array(earth["p"].tolist()) * AU_KM
    velocity = np.array(erfa.epv00(JD, (t + LEAP_S) / 86400.0)[1]["v"].tolist()) * AU_KM / 86400.0
    sun = -heliocentric
    away = np.linalg.norm(sun)
    direction = sun / away + velocity / C_KM_S
    to_sun = direction / np.linalg.norm(direction) * away - left[0]
    to_observer = ro[0] - left[0]
    cos = to_sun @ to_observer / np.linalg.norm(to_sun) / np.linalg.norm(to_observer)
    phase = math.acos(cos)
    shape = 2.0 / (3.0 * math.pi**2) * ((math.pi - phase) * math.cos(phase) + math.sin(phase))
    area = 0.2 * math.pi * 25.0 * shape
    au = AU_KM * 1e3
    product = np.linalg.norm(to_sun) * 1e3 * distance[0] * 1e3
    return -26.73 - 2.5 * math.log10(area / au**2) + 5.0 * math.log10(product / au**2)


def main():
    rng = np.random.default_rng(6)
    lines, observer = satellite(70001, 6950.0, 1e-3, 97.6, rng)
    texts, rows = list(lines), []
    t = np.arange(0.0, LENGTH_S + STEP_S / 2.0, STEP_S)
    number = 70001
    while len(rows) < WANTED:
        number += 1
        a_km, e, i = [(7078.0, 2e-3, 98.0), (7478.0, 1e-2, 74.0), (42164.0, 1e-3, 8.0),
                      (24400.0, 0.72, 7.0), (26560.0, 0.7, 63.4)][number % 5]
        lines, sat = satellite(number, a_km, e, i, rng)
        within = inside(sat, observer, t)
        turns = np.flatnonzero(within[1:] != within[:-1])
        # whole passes only
        if len(turns) == 0 or within[0] or within[-1]:
            continue
        texts += lines
        for first, last in turns.reshape(-1, 2):
            enters = bisect(sat, observer, t[first], t[first + 1])
            leaves = bisect(sat, observer, t[last], t[last + 1])
            off = lambda x: -seen(sat, observer, x)[0][:, 2]
            nearest = least(off, (enters, leaves))
            u, _, _, _, _ = seen(sat, observer, nearest)
            closest = least(lambda x: seen(sat, observer, x)[1], (enters, leaves))
            _, km, _, _, _ = seen(sat, observer, closest)
            places = [place(seen(sat, observer, x)[0])[0] for x in (enters, leaves)]
            degrees = math.degrees(math.atan2(math.hypot(u[0, 0], u[0, 1]), u[0, 2]))
            mag = magnitude(sat, observer, nearest)
            rows.append(f"{number},{enters:.6f},{leaves:.6f},{places[0][0]:.4f},{places[0][1]:.4f},"
                        f"{places[1][0]:.4f},{places[1][1]:.4f},{nearest:.4f},{degrees:.6f},{km[0]:.6f},{mag:.5f}")
    (HERE / "passes.tle").write_text("\n".join(texts) + "\n")
    head = "number,enters_s,leaves_s,enters_x,enters_y,leaves_x,leaves_y,nearest_s,nearest_deg,least_km,mag"
    (HERE / "passes.csv").write_text("\n".join([head, *rows]) + "\n")


main()
