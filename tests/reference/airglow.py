"""Zenith brightness of hydroxyl's lines in steps of 10 nm, R: the table HYDROXYL_R of src/render/sky/atmosphere/airglow.rs.

From the spectrum of ESO's sky model (SkyCalc 1.4; Noll et al. 2012, A&A 543, A92) that PyPI moons1d 1.0.3 holds: lines above the continuum,
the lower quartile of 3 nm, over the transmission of the lower atmosphere where that is above 0.3. The lines that the table LINES of
the same file has (oxygen, hydrogen) are taken out of their steps by hand: 165 and 51 R at 630 and 636 nm, 5 R at 656 nm, 16 R at 777 nm, 7 R at
845 nm, 330 R at 864 nm. Run: airglow.py SkyTemplate_ESO_a1.0.fits
"""

import sys

import numpy as np
from astropy.io import fits
from scipy.ndimage import percentile_filter, uniform_filter1d

ARCSEC = np.pi / 648000.0
RAYLEIGH = 1e10 / (4.0 * np.pi) * ARCSEC**2 * 1e-4  # ph/s/cm^2/arcsec^2
FROM_NM, STEP_NM = 600.0, 0.01

sky, passed = (np.array(hdu.data, dtype=float) for hdu in fits.open(sys.argv[1])[:2])
continuum = uniform_filter1d(percentile_filter(sky, 25, size=301), 301)
lines = np.where(passed > 0.3, np.clip(sky - continuum, 0.0, None) / np.clip(passed, 0.3, None), 0.0)
rayleigh = lines * STEP_NM * 10.0 / RAYLEIGH
wavelengths = FROM_NM + STEP_NM * np.arange(sky.size)
for nm in range(600, 1120, 10):
    print(nm, round(rayleigh[(wavelengths >= nm) & (wavelengths < nm + 10)].sum()))
inside = (wavelengths >= 650.0) & (wavelengths < 1100.0)
print("650 to 1100 nm:", round(rayleigh[inside].sum()), "R")
