"""Apparent directions of the Sun, the Moon and the Earth seen by observers, by skyfield: python directions.py de440.bsp"""

import numpy as np

from common import Kepler, kepler_state, kernel, numbers, orbit, time_tai, write

ephemeris = kernel()
earth, sun, moon = (ephemeris[name] for name in ("earth", "sun", "moon"))
rng = np.random.default_rng(1969)

rows = []
for year in range(1991, 2061):
    for kind in ("centre", "leo", "geo"):
        epoch = f"{year}-{rng.integers(1, 13):02d}-{rng.integers(1, 29):02d}T{rng.integers(0, 24):02d}:{rng.integers(0, 60):02d}:00"
        t = time_tai(epoch)
        observer, r, v = earth, np.zeros(3), np.zeros(3)
        if kind != "centre":
            elements = orbit(kind, rng)
            observer, (r, v) = earth + Kepler(elements, t, -900001), kepler_state(elements, 0.0)
        row = [kind, epoch, *numbers(r, 3), *numbers(v, 6)]
        for body in (sun, moon, earth):
            seen = np.zeros(3)
            if (kind, body) != ("centre", earth):
                seen = observer.at(t).observe(body).apparent(deflectors=()).xyz.m
            row += numbers(seen / (np.linalg.norm(seen) or 1.0), 10) + [f"{np.linalg.norm(seen):.0f}"]
        rows.append(row)

write("directions.csv", [
    "The Sun, the Moon and the Earth as observers see them: light time and aberration by the barycentric velocity, without deflection;",
    "made by directions.py with skyfield 1.55 and JPL DE440. Epochs TAI. Observer: geocentric GCRF, m and m/s.",
    "Directions: unit vectors, axes of the ICRF (zero: none); distances when the light left, m.",
], ["observer", "epoch_tai", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "sx", "sy", "sz", "sun_m", "mx", "my", "mz", "moon_m",
    "ex", "ey", "ez", "earth_m"], rows)
