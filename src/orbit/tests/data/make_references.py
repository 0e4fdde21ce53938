"""Writes the reference numbers beside this file, which the orbit tests read.

PyPI packages: sgp4 2.27, skyfield 1.55, astropy 8.0.2 (with astropy-iers-data and
pyerfa). Nothing is downloaded:

    python make_references.py

sgp4_verification.txt   the verification cases of Vallado et al., AIAA 2006-6753, from the
                        files SGP4-VER.TLE and tcppver.out inside the package sgp4: all
                        vectors of every case, TEME, km and km/s, and that package's error
                        codes at the steps that SGP4-VER.TLE asks for
teme_to_gcrf.txt        TEME vectors turned to GCRF by skyfield (its own precession and
                        nutation, IAU 2006/2000A) and by astropy (through ITRS), m
elements_to_gcrf.txt    element sets of the same cases carried to GCRF by skyfield, m
"""

import math
import os
from itertools import groupby
from pathlib import Path

import numpy as np
import sgp4
from astropy import units as u
from astropy.coordinates import GCRS, TEME, CartesianRepresentation
from astropy.time import Time
from astropy.utils import iers
from sgp4.api import WGS72, Satrec
from skyfield.api import EarthSatellite, load
from skyfield.sgp4lib import TEME as SKYFIELD_TEME

HERE = Path(__file__).parent
PACKAGE = Path(os.path.dirname(sgp4.__file__))
AU_KM = 149597870.700

iers.conf.auto_download = False
timescale = load.timescale(builtin=True)


def element_sets():
    """Pairs of lines, in the order of the file."""
    lines = [
        line for line in (PACKAGE / "SGP4-VER.TLE").read_text().splitlines()
        if not line.startswith("#")
    ]
    return list(zip(lines[::2], lines[1::2]))


def codes(model, line2):
    """Minutes of the first step, minutes between steps, and runs of error codes, steps x code, for the span that
    columns 70 and on of a line 2 ask for."""
    start, stop, step = (float(word) for word in line2[69:].split())
    found = [model.sgp4_tsince(start + i * step)[0] for i in range(int((stop - start) / step + 1e-9) + 1)]
    runs = [f"{len(list(run))}x{code}" for code, run in groupby(found)]
    return f"{start!r} {step!r} {' '.join(runs)}"


def verification():
    cases = []
    for line in (PACKAGE / "tcppver.out").read_text().splitlines():
        if line.endswith("xx"):
            cases.append([])
        else:
            cases[-1].append(line.split()[:7])
    sets = element_sets()
    assert len(cases) == len(sets)
    with open(HERE / "sgp4_verification.txt", "w") as out:
        out.write("# AIAA 2006-6753 verification: two element lines, then rows of\n")
        out.write("# minutes x y z (km) vx vy vz (km/s), TEME, then, after a c, the error codes of PyPI sgp4:\n")
        out.write("# first step and distance of steps, minutes, and runs of steps x code. See make_references.py.\n")
        for (line1, line2), rows in zip(sets, cases):
            model = Satrec.twoline2rv(line1[:69], line2[:69], WGS72)
            out.write(f"{line1[:69].rstrip()}\n{line2[:69].rstrip()}\n")
            for row in rows:
                # the file repeats the vector of the case before where the model has none at the epoch
                if model.sgp4_tsince(float(row[0]))[0] == 0:
                    out.write("  " + " ".join(row) + "\n")
            out.write(f"  c {codes(model, line2)}\n")


def positions():
    """From low orbit to the geostationary belt, in every octant, m."""
    for radius, longitude, latitude in [
        (6.8e6, 20.0, 10.0), (7.2e6, 140.0, -65.0), (2.656e7, 250.0, 40.0), (4.2164e7, 310.0, -3.0),
    ]:
        lon, lat = math.radians(longitude), math.radians(latitude)
        yield radius * np.array(
            [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)]
        )


def frames():
    with open(HERE / "teme_to_gcrf.txt", "w") as out:
        out.write("# source, days of TT since 2000-01-01T12:00 TT, x y z TEME (m), x y z GCRF (m).\n")
        out.write("# See make_references.py.\n")

        def row(source, days, teme, gcrf):
            numbers = " ".join(f"{x:.4f}" for x in [*teme, *gcrf])
            out.write(f"{source} {days:.5f} {numbers}\n")

        # 1960 to 2060: uneven steps meet all phases of the nutation
        for days in np.round(np.linspace(-14609.5, 21914.3, 41), 5):
            rotation = SKYFIELD_TEME.rotation_at(timescale.tt_jd(2451545.0, days))
            for teme in positions():
                row("skyfield", days, teme, rotation.T @ teme)

        # within the measured Earth orientation that the package carries
        for days in np.round(np.linspace(-9000.3, 9600.7, 12), 5):
            time = Time(2451545.0, days, format="jd", scale="tt")
            for teme in positions():
                vector = TEME(CartesianRepresentation(teme * u.m), obstime=time)
                gcrs = vector.transform_to(GCRS(obstime=time)).cartesian.xyz.to_value(u.m)
                row("astropy", days, teme, gcrs)


def elements():
    # no leap second lies between the epochs of these sets and the days asked
    wanted = {"00005": 1.5, "06251": 1.0, "08195": 2.0, "14128": 1.0, "24208": 1.0, "28057": 2.0,
              "28129": 1.0, "88888": 0.5}
    with open(HERE / "elements_to_gcrf.txt", "w") as out:
        out.write("# two element lines, then: UTC, x y z (m), vx vy vz (m/s), GCRF, by skyfield.\n")
        out.write("# See make_references.py.\n")
        for line1, line2 in element_sets():
            offset = wanted.pop(line1[2:7], None)
            if offset is None:
                continue
            line1, line2 = line1[:69].rstrip(), line2[:69].rstrip()
            satellite = EarthSatellite(line1, line2, None, timescale)
            year, month, day, hour, minute, second = satellite.epoch.utc
            # a whole millisecond of UTC, so that the text is exact
            time = timescale.utc(year, month, day, hour, minute + offset * 1440, round(second, 3))
            text = time.utc_iso(places=3)
            time = timescale.utc(*[float(x) for x in text[:-1].replace("T", "-").replace(":", "-").split("-")])
            state = satellite.at(time)
            numbers = [f"{x * 1e3:.4f}" for x in state.position.km]
            numbers += [f"{x * 1e3:.7f}" for x in state.velocity.km_per_s]
            out.write(f"{line1}\n{line2}\n  {text} {' '.join(numbers)}\n")


verification()
frames()
elements()
