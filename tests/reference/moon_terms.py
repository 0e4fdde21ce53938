"""The terms of src/render/sky/moon/series.rs: python moon_terms.py de440.bsp elpMppDeFull.js

The second file is the series ELP/MPP02 in npm astronomia 4.2.0 (package/data). Terms of at least 0.25 arcsec are chosen that stand
whole in the difference between SOFA's moon98 (pyerfa) and DE440; printed with what they leave of it over 1991 to 2060.
"""

import json
import re
import sys

import erfa
import numpy as np

from common import kernel, timescale

ARCSEC = np.pi / 648000

text = open(sys.argv[2]).read()
text = re.sub(r"([{,]\s*)([A-Za-z]\w*):", r'\1"\2":', text[text.index("{"):text.rindex("}") + 1])
series = json.loads(re.sub(r",(\s*[}\]])", r"\1", text))

jd = np.arange(2448257.5, 2473825.5, 2.37)
centuries = (jd - 2451545.0) / 36525
ephemeris = kernel()
true = (ephemeris["moon"] - ephemeris["earth"]).at(timescale.tdb_jd(jd)).xyz.au
moon98 = erfa.moon98(jd, 0.0)["p"].T
distance_km = np.abs(np.linalg.norm(true, axis=0) - np.linalg.norm(moon98, axis=0)).max() * 149597870.7


def ecliptic(v):
    """Longitude and latitude, mean ecliptic of J2000.0, rad."""
    c, s = np.cos(84381.406 * ARCSEC), np.sin(84381.406 * ARCSEC)
    y, z = c * v[1] + s * v[2], c * v[2] - s * v[1]
    return np.arctan2(y, v[0]), np.arctan2(z, np.hypot(v[0], y))


(l, b), (l98, b98) = ecliptic(true), ecliptic(moon98)
left = []
for name, rest, terms in (("LONGITUDE", (l - l98 + np.pi) % (2 * np.pi) - np.pi, series["L"]["0"]), ("LATITUDE", b - b98, series["B"]["0"])):
    rest, wanted, chosen = rest / ARCSEC, rest / ARCSEC, []
    for amplitude, phase, rate, *higher in terms:
        if 0.25 <= abs(amplitude) <= 3.0:
            argument = phase + rate * centuries + sum(c * centuries ** (k + 2) for k, c in enumerate(higher))
            found = 2 * (np.sin(argument) @ wanted) / len(jd), 2 * (np.cos(argument) @ wanted) / len(jd)
            if max(abs(found[0] - amplitude), abs(found[1])) < 0.35 * abs(amplitude):
                chosen.append((amplitude, phase % (2 * np.pi), rate))
                rest = rest - amplitude * np.sin(phase + rate * centuries)
    left.append(rest)
    print(name, len(chosen), *(f"[{a:.3f}, {p:.4f}, {r:.4f}]," for a, p, r in chosen), sep="\n")
error = np.hypot(left[0] * np.cos(b), left[1])
print(f"{len(jd)} epochs: {error.max():.2f} arcsec at most, rms {np.sqrt((error**2).mean()):.2f}; distance {distance_km:.1f} km")
