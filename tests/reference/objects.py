"""Apparent directions of satellites seen from satellites, by skyfield: python objects.py de440.bsp"""

import numpy as np

from common import EPOCHS_TAI, Kepler, kepler_state, kernel, numbers, orbit, time_tai, write

earth = kernel()["earth"]
rng = np.random.default_rng(20190615)
PAIRS = [("leo", "leo"), ("leo", "geo"), ("geo", "leo"), ("geo", "geo"), ("heo", "leo"), ("leo", "heo"), ("heo", "geo")]

rows = []
for k in range(140):
    watcher, seen = PAIRS[k % len(PAIRS)]
    epoch = EPOCHS_TAI[k % len(EPOCHS_TAI)]
    t = time_tai(epoch)
    mine, theirs = orbit(watcher, rng), orbit(seen, rng)
    if k % 10 == 0:  # neighbours a few km to some tens of km away in the same orbit
        theirs = (*mine[:5], mine[5] + rng.uniform(1e-3, 1e-2))
    observer, target = Kepler(mine, t, -900001), Kepler(theirs, t, -900002)
    sight = (earth + observer).at(t).observe(earth + target)
    d = sight.apparent(deflectors=()).xyz.m
    d /= np.linalg.norm(d)
    r, v = kepler_state(mine, 0.0)
    line = kepler_state(theirs, 0.0)[0] - r
    rows.append([f"{watcher}-{seen}", epoch, *numbers(r, 4), *numbers(v, 7), *map(repr, map(float, theirs)),
                 *numbers(d, 11), f"{np.linalg.norm(line):.4f}", f"{sight.light_time * 86400:.10f}"])

write("objects.csv", [
    "Directions of satellites seen from satellites, made by objects.py with skyfield 1.55 and JPL DE440: all barycentric,",
    "light time and aberration by the observer's barycentric velocity; without deflection but by the Earth (at most 1 mas).",
    "Observer: geocentric GCRF, m and m/s. Target: two-body elements at the epoch (a m, e, i, node, perigee, mean anomaly rad), GM 3.986004418e14.",
    "Direction: unit vector, axes of the ICRF. Range: geometric, m. Light time: s.",
], ["case", "epoch_tai", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "a_m", "e", "i", "node", "perigee", "mean",
    "dx", "dy", "dz", "range_m", "light_time_s"], rows)
