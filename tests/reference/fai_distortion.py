"""What the paper's real FAI frames say of the lens: the figures quoted in configs/cameras/fai-nir.toml.

    python3 fai_distortion.py        # needs numpy and scipy (made with numpy 2.4.6, scipy 1.17.1)

Table A1 gives SBOIS pixels and their errors against the frames, so FAI = SBOIS - error. SBOIS is a pinhole of 13.8 mm with
26 um pixels. Fitted to the 35 FAI positions: a small rotation an epoch, and a distortion `1 + k1 r^2` (r in focal lengths,
OpenCV's Brown-Conrady) or a scale of the focal length; robustly (soft L1), since the table was measured by hand to whole pixels.
"""

import csv
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

TABLE = Path(__file__).parents[2] / "configs/scenes/rcm-2019-06-15/table_a1.csv"
FOCAL_PX, CENTRE = 13.8e-3 / 26e-6, 127.5

with open(TABLE) as file:
    rows = [row for row in csv.DictReader(line for line in file if not line.startswith("#")) if row["sx"]]
sbois = np.array([[float(row["sx"]), float(row["sy"])] for row in rows])
fai = sbois - np.array([[float(row["sex"]), float(row["sey"])] for row in rows])
# A misprint: 171.8 for 172.8 (the error beside it was taken with the wrong figure: its neighbours in time say so).
for i, row in enumerate(rows):
    if (row["epoch"], row["obj"]) == ("23:36:00", "HR6195") and row["sy"] == "171.8":
        sbois[i, 1] += 1.0
epochs = sorted({row["epoch"] for row in rows})
epoch = np.array([epochs.index(row["epoch"]) for row in rows])
star = np.array([row["obj"].startswith("HR") for row in rows])
lines = np.column_stack([(sbois - CENTRE) / FOCAL_PX, np.ones(len(rows))])


def positions(k1, scale, turns):
    turned = Rotation.from_rotvec(turns.reshape(-1, 3)[epoch]).apply(lines)
    xy = turned[:, :2] / turned[:, 2:]
    return CENTRE + FOCAL_PX * scale * xy * (1 + k1 * (xy**2).sum(1, keepdims=True))


def fit(name, unpack, start):
    turns = np.zeros(3 * len(epochs))
    residual = lambda p: (positions(*unpack(p[: len(start)]), p[len(start) :]) - fai).ravel()
    best = least_squares(residual, np.concatenate([start, turns]), loss="soft_l1")
    apart = np.hypot(*(residual(best.x).reshape(-1, 2).T))
    degrees = len(best.fun) - len(best.x)
    sigma = np.sqrt(np.diag(np.linalg.pinv(best.jac.T @ best.jac)) * 2 * best.cost / degrees)
    own = ", ".join(f"{v:.3f} +- {s:.3f}" for v, s in zip(best.x[: len(start)], sigma))
    print(f"{name:26s} stars {apart[star].mean():.2f} px, satellites {apart[~star].mean():.2f} px  {own}")


fit("attitudes alone", lambda p: (0.0, 1.0), [])
fit("and k1", lambda p: (p[0], 1.0), [0.0])
fit("and a focal length", lambda p: (0.0, p[0]), [1.0])
fit("and both", lambda p: (p[0], p[1]), [0.0, 1.0])
