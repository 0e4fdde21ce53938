"""Apparent directions of Hipparcos stars by astropy and by skyfield: python stars.py de440.bsp hip2.dat"""

import sys

import astropy.units as u
import numpy as np
from astropy.coordinates import GCRS, CartesianRepresentation, SkyCoord, solar_system_ephemeris
from astropy.time import Time
from astropy.utils import iers
from skyfield.api import Star

from common import AU_M, DAY_S, EPOCHS_TAI, Kepler, kepler_state, kernel, numbers, orbit, time_tai, write

iers.conf.auto_download = False
NAMED = {
    87937: "Barnard's star", 57939: "Groombridge 1830", 104214: "61 Cyg A", 104217: "61 Cyg B", 71683: "alpha Cen A",
    71681: "alpha Cen B", 70890: "Proxima Cen", 32349: "Sirius", 91262: "Vega", 11767: "Polaris", 104382: "sigma Oct",
    24186: "Kapteyn's star", 114046: "Lacaille 9352", 67155: "Wolf 489 field", 80351: "HR 6111 (touchstone field)",
    21421: "Aldebaran", 69673: "Arcturus", 37279: "Procyon",
}

ephemeris = kernel()
earth, sun = ephemeris["earth"], ephemeris["sun"]
solar_system_ephemeris.set(sys.argv[1])
rng = np.random.default_rng(20261121)

# HIP, RA, Dec (rad), parallax, pmRA cos(dec), pmDec (mas, mas/yr), Hp
table = {}
for line in open(sys.argv[2]):
    f = line.split()
    table[int(f[0])] = tuple(map(float, f[4:9])) + (float(f[19]),)

# Observers: the Earth's centre and one orbit at each epoch.
observers = []
for k, epoch in enumerate(EPOCHS_TAI):
    observers.append((f"geocentre-{epoch[:4]}", epoch, None))
    kind = ("leo", "leo", "geo", "heo")[k % 4]
    observers.append((f"{kind}-{epoch[:4]}", epoch, orbit(kind, rng)))

bright = [h for h, s in table.items() if s[5] < 9.0]
unit = {h: np.array([np.cos(s[1]) * np.cos(s[0]), np.cos(s[1]) * np.sin(s[0]), np.sin(s[1])]) for h, s in table.items() if s[5] < 9}
sample = [int(h) for h in rng.choice(sorted(set(bright) - set(NAMED)), 200, replace=False)]
poles = sorted(bright, key=lambda h: table[h][1])
poles = poles[:3] + poles[-3:]

cases = []  # (hip, observer index)
for hip in [h for h in NAMED if h in table] + poles:
    cases += [(hip, k) for k in range(len(observers))]
for hip in sample:
    cases += [(hip, int(k)) for k in rng.choice(len(observers), 3, replace=False)]
for k, (_, epoch, _) in enumerate(observers):
    s = earth.at(time_tai(epoch)).observe(sun).xyz.m
    s /= np.linalg.norm(s)
    elongation = {h: np.degrees(np.arccos(np.clip(v @ s, -1, 1))) for h, v in unit.items()}
    near = [h for h, e in elongation.items() if 1.0 <= e <= 5.0]
    cases += [(int(h), k) for h in sorted(near, key=elongation.get)[:2]]
    cases += [(int(h), k) for h in rng.choice(near, 2, replace=False)]
cases = sorted(set(cases), key=lambda c: (c[1], c[0]))

astro_epoch = Time(2448349.0625, format="jd", scale="tdb")
rows, observer_rows, worst = [], [], 0.0
for k, (name, epoch, elements) in enumerate(observers):
    t = time_tai(epoch)
    when = Time(epoch, scale="tai")
    r, v = (np.zeros(3), np.zeros(3)) if elements is None else kepler_state(elements, 0.0)
    observer_rows.append([name, epoch, *numbers(r, 3), *numbers(v, 6)])
    here = (earth if elements is None else earth + Kepler(elements, t, -900000)).at(t)
    frame = GCRS(obstime=when, obsgeoloc=CartesianRepresentation(r * u.m), obsgeovel=CartesianRepresentation(v * u.m / u.s))
    for hip in [h for h, o in cases if o == k]:
        ra, dec, parallax, pm_ra, pm_dec, _ = table[hip]
        # Not negative, and a distance that astropy takes.
        near = max(parallax, 1e-3)
        place = SkyCoord(ra * u.rad, dec * u.rad, distance=(1000.0 / near) * u.pc, pm_ra_cosdec=pm_ra * u.mas / u.yr,
                         pm_dec=pm_dec * u.mas / u.yr, radial_velocity=0 * u.km / u.s, obstime=astro_epoch, frame="icrs")
        a = place.apply_space_motion(new_obstime=when).transform_to(frame).cartesian.xyz.value
        a = np.asarray(a) / np.linalg.norm(a)
        star = Star(ra_hours=np.degrees(ra) / 15.0, dec_degrees=np.degrees(dec), ra_mas_per_year=pm_ra, dec_mas_per_year=pm_dec,
                    parallax_mas=max(parallax, 0.0), epoch=2448349.0625)
        seen = here.observe(star)
        b = seen.apparent(deflectors=(10,)).xyz.au
        b /= np.linalg.norm(b)
        c = seen.xyz.au / np.linalg.norm(seen.xyz.au)
        worst = max(worst, np.linalg.norm(a - b) * 206264.806)
        catalogue = [hip, repr(ra), repr(dec), parallax, pm_ra, pm_dec, name]
        rows.append([*catalogue, "astropy", *numbers(a, 11)])
        rows.append([*catalogue, "skyfield", *numbers(b, 11)])
        if hip in NAMED:
            rows.append([*catalogue, "astrometric", *numbers(c, 11)])

tools = "astropy 8.0.2 (pyerfa 2.0.1.5) and skyfield 1.55, both with JPL DE440"
write("observers.csv", ["Observers of stars.csv, made by stars.py: TAI epoch, geocentric GCRF position (m) and velocity (m/s)."],
      ["observer", "epoch_tai", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"], observer_rows)
write("stars.csv", [
    f"Directions of Hipparcos stars, made by stars.py with {tools}. Catalogue: Hipparcos-2 (ESA I/311), ICRS at J1991.25.",
    "Angles in rad, parallax mas, motions mas/yr; direction: unit vector, axes of the ICRF. No radial velocity (not in the catalogue).",
    "astropy: space motion, parallax, deflection by the Sun, aberration. skyfield: the same; in orbit also the Earth's deflection (0.6 mas).",
    "astrometric: skyfield before deflection and aberration. Stars 1 to 5 degrees from the Sun are among them at every epoch.",
    f"astropy and skyfield differ by at most {worst * 1000:.2f} mas.",
], ["hip", "ra_rad", "dec_rad", "parallax_mas", "pm_ra_cosdec_mas_yr", "pm_dec_mas_yr", "observer", "source", "x", "y", "z"], rows)
