"""Sunlight and occultation near the Earth: python shadow.py de440.bsp

sunlit.csv and behind.csv ask skyfield (a point Sun and a spherical Earth of 6378.1366 km), only where the Sun's size and the
Earth's flattening cannot change the answer. illumination.csv integrates the Sun's disc, ray by ray, against the WGS84 ellipsoid.
"""

import math

import erfa
import numpy as np
from skyfield.positionlib import Geocentric

from common import AU_M, EPOCHS_TAI, Kepler, kepler_state, kernel, numbers, orbit, time_tai, write

ephemeris = kernel()
earth, sun = ephemeris["earth"], ephemeris["sun"]
rng = np.random.default_rng(84)
A, B = 6378137.0, 6378137.0 * (1 - 1 / 298.257223563)
FIGURE = 25e3  # the sphere stands out by at most 21.4 km


def miss(start, direction):
    """How far a half line's nearest point is from the origin, and where along it."""
    direction = direction / np.linalg.norm(direction)
    along = -start @ direction
    return np.linalg.norm(start + direction * max(along, 0.0)), along


def visible_part(position, sun_position, pole, n=1500):
    """The part of the Sun's disc (uniform, a sphere of 695700 km) seen past the ellipsoid about `pole`, by n x n rays."""
    toward = sun_position - position
    distance = np.linalg.norm(toward)
    toward /= distance
    radius = math.asin(6.957e8 / distance)
    up = np.cross(toward, [0.3, 0.5, 0.8])
    up /= np.linalg.norm(up)
    side = np.cross(toward, up)
    # Rings of the same solid angle, points of the same azimuth.
    cosine = 1.0 - (1.0 - math.cos(radius)) * (np.arange(n) + 0.5) / n
    sine = np.sqrt(1.0 - cosine**2)
    azimuth = 2.0 * math.pi * (np.arange(n) + 0.5) / n
    lit = 0
    ez = np.asarray(pole)
    ex = np.cross(ez, [0.0, 1.0, 0.0])
    ex /= np.linalg.norm(ex)
    axes = np.array([ex, np.cross(ez, ex), ez])
    p = axes @ position / [A, A, B]
    for phi in azimuth:
        rays = toward[:, None] * cosine + (up * math.cos(phi) + side * math.sin(phi))[:, None] * sine
        d = (axes @ rays) / np.array([A, A, B])[:, None]
        # |p + t d|^2 = 1 has a positive root: the ray meets the ellipsoid.
        half_b, a, c = p @ d, (d * d).sum(axis=0), p @ p - 1.0
        hit = (half_b < 0.0) & (half_b * half_b > a * c)
        lit += n - hit.sum()
    return lit / (n * n)


def sun_at(t):
    """The apparent geocentric Sun, m."""
    return earth.at(t).observe(sun).apparent(deflectors=()).xyz.m


def pole_at(t):
    """The true pole of date in the GCRS (IAU 2006/2000A)."""
    return erfa.pnm06a(2451545.0, t.tt - 2451545.0)[2]


sunlit, behind = [], []
while len(sunlit) < 400:
    epoch = EPOCHS_TAI[int(rng.integers(len(EPOCHS_TAI)))]
    t = time_tai(epoch)
    where = orbit(["leo", "geo", "heo"][len(sunlit) % 3], rng)
    r, _ = kepler_state(where, 0.0)
    s = sun_at(t)
    if len(sunlit) % 2:  # half of them behind the Earth, near the limb
        side = np.cross(s, rng.normal(size=3))
        side /= np.linalg.norm(side)
        off = 6378e3 * rng.uniform(0.0, 1.1)
        r = side * off - s / np.linalg.norm(s) * math.sqrt(max(np.linalg.norm(r) ** 2 - off**2, 0.0))
    height, along = miss(r, s - r)
    # The Sun's disc reaches 0.0047 rad about its centre, and it is seen 20.5 arcsec from where skyfield puts it.
    if along > 0 and abs(height - A) < FIGURE + 0.005 * along:
        continue
    if np.linalg.norm(r) < A + 100e3:
        continue
    answer = bool(Geocentric(r / AU_M, np.zeros(3), t, center=399, target=-1).is_sunlit(ephemeris))
    sunlit.append([epoch, *numbers(r, 1), *numbers(s, 0), int(answer)])

while len(behind) < 400:
    epoch = EPOCHS_TAI[len(behind) % len(EPOCHS_TAI)]
    t = time_tai(epoch)
    kinds = ["leo", "geo", "heo"]
    mine, theirs = orbit(kinds[int(rng.integers(3))], rng), orbit(kinds[int(rng.integers(3))], rng)
    r, q = kepler_state(mine, 0.0)[0], kepler_state(theirs, 0.0)[0]
    height, along = miss(r, q - r)
    if along > 0 and abs(height - A) < FIGURE:
        continue
    if min(np.linalg.norm(r), np.linalg.norm(q)) < A + 100e3:
        continue
    watcher, target = Kepler(mine, t, -1), Kepler(theirs, t, -2)
    answer = bool((target - watcher).at(t).is_behind_earth())
    behind.append([epoch, *numbers(r, 1), *numbers(q, 1), int(answer)])

partial = []
for k in range(72):
    epoch = EPOCHS_TAI[k % len(EPOCHS_TAI)]
    t = time_tai(epoch)
    s, pole = sun_at(t), pole_at(t)
    axis = s / np.linalg.norm(s)
    distance = [6.78e6, 7.2e6, 8.5e6, 4.2164e7, 3.8e8, 1.2e9, 1.6e9, 3.0e9][k % 8]
    for _ in range(1000):
        side = np.cross(axis, rng.normal(size=3))
        side /= np.linalg.norm(side)
        behind_by = math.sqrt(max(distance**2 - A**2, 0.0))
        off = A - rng.uniform(0, 22e3) + rng.uniform(-1.0, 1.0) * 0.0047 * behind_by
        if distance > 1e9:
            off = rng.uniform(0.0, 1.0) * (A + 0.0047 * distance)
        r = side * off - axis * math.sqrt(distance**2 - off**2)
        if 0.002 < visible_part(r, s, pole, 60) < 0.998:
            break
    f = visible_part(r, s, pole)
    partial.append([epoch, *numbers(r, 3), *numbers(s, 0), f"{f:.6f}"])

note = "the Sun: apparent (light time, aberration), geocentric, from JPL DE440 by skyfield 1.55. Metres, axes of the ICRF; epochs TAI."
write("sunlit.csv", ["Is a satellite lit? By skyfield 1.55 (is_sunlit), made by shadow.py, away from the penumbra by the Earth's flattening; " + note],
      ["epoch_tai", "x", "y", "z", "sun_x", "sun_y", "sun_z", "lit"], sunlit)
write("behind.csv", ["Is a satellite behind the Earth? By skyfield 1.55 (is_behind_earth), made by shadow.py, away from the limb by 25 km. Metres, GCRF."],
      ["epoch_tai", "x", "y", "z", "target_x", "target_y", "target_z", "behind"], behind)
write("illumination.csv", ["Part of the Sun's disc seen past the WGS84 ellipsoid about the true pole of date (pyerfa 2.0.1.5): 1500 x 1500 rays, by shadow.py;", note],
      ["epoch_tai", "x", "y", "z", "sun_x", "sun_y", "sun_z", "part"], partial)
