"""Positions of the Earth and the Sun from JPL DE440 by skyfield: python bodies.py de440.bsp"""

import numpy as np

from common import kernel, numbers, time_tai, write

ephemeris = kernel()
earth, sun = ephemeris["earth"], ephemeris["sun"]
rng = np.random.default_rng(440)

rows = []
for year in range(1991, 2061):
    epoch = f"{year}-{rng.integers(1, 13):02d}-{rng.integers(1, 29):02d}T{rng.integers(0, 24):02d}:{rng.integers(0, 60):02d}:00"
    t = time_tai(epoch)
    e, s = earth.at(t), sun.at(t)
    rows.append([epoch, *numbers(e.xyz.km, 3), *numbers(e.velocity.km_per_s, 9), *numbers(s.xyz.km - e.xyz.km, 3),
                 *numbers(e.observe(sun).apparent(deflectors=()).xyz.km, 3)])

write("bodies.csv", [
    "Earth (barycentric, km and km/s), Sun (geocentric, km; geometric, then apparent: light time and aberration),",
    "axes of the ICRF, made by bodies.py with skyfield 1.55 and JPL DE440. Epochs TAI.",
], ["epoch_tai", "ex", "ey", "ez", "evx", "evy", "evz", "sx", "sy", "sz", "ax", "ay", "az"], rows)
