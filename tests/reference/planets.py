"""Apparent directions and V magnitudes of the planets from the Earth's centre, by skyfield: python planets.py de440.bsp"""

import numpy as np
from skyfield import magnitudelib
from skyfield.functions import angle_between

from common import kernel, numbers, time_tai, write

ephemeris = kernel()
earth, sun = ephemeris["earth"], ephemeris["sun"]
NAMES = ["Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune"]
rng = np.random.default_rng(8)


def latitude(pole, toward):
    """Latitude on a planet of the point below the direction, deg."""
    return 90.0 - np.degrees(angle_between(pole, toward))


rows = []
for year in range(1992, 2060, 2):
    epoch = f"{year}-{rng.integers(1, 13):02d}-{rng.integers(1, 29):02d}T{rng.integers(0, 24):02d}:00:00"
    t = time_tai(epoch)
    for number, name in zip((1, 2, 4, 5, 6, 7, 8), NAMES):
        astrometric = earth.at(t).observe(ephemeris[number])
        d = astrometric.apparent(deflectors=()).xyz.m
        # skyfield takes the barycentre for the Sun; this is the Sun when the light left.
        line = astrometric.xyz.au
        from_sun = line + earth.at(t).xyz.au - sun.at(t).xyz.au
        r, delta, phase = np.linalg.norm(from_sun), np.linalg.norm(line), np.degrees(angle_between(from_sun, line))
        extra = []
        if name in ("Saturn", "Uranus"):
            pole = getattr(magnitudelib, f"_{name.upper()}_POLE")
            extra = [latitude(pole, -from_sun), latitude(pole, -line)]
        if name == "Neptune":
            extra = [t.J]
        v = float(getattr(magnitudelib, f"_{name.lower()}_magnitude")(r, delta, phase, *extra))
        rows.append([name, epoch, *numbers(d / np.linalg.norm(d), 9), f"{delta:.7f}", f"{r:.7f}", f"{phase:.4f}", f"{v:.4f}"])

write("planets.csv", [
    "Planets from the Earth's centre, made by planets.py with skyfield 1.55 (magnitudelib: Mallama & Hilton 2018) and JPL DE440. Epochs TAI.",
    "Direction: unit vector, axes of the ICRF, light time and aberration; distances from the Earth and the Sun, au; phase angle, deg; V, mag.",
], ["name", "epoch_tai", "x", "y", "z", "distance_au", "sun_distance_au", "phase_deg", "v_mag"], rows)
