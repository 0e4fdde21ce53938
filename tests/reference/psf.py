"""Point spread functions integrated over pixels by GalSim: writes psf.csv and psf_image.csv beside it.

Needs GalSim 2.8.5, numpy 2.4.6. Every pixel is GalSim's own integral in real space, to a relative error of 1e-7: no FFT,
whose folding would add what lies in the wings.
"""

import pathlib

import galsim
import numpy as np

HERE = pathlib.Path(__file__).parent
SIDE = 11
CELLS, OVERSAMPLING = 25, 4
OFFSETS = [(0.0, 0.0), (0.31, -0.17), (-0.5, 0.5), (0.07, 0.44)]
PARAMS = galsim.GSParams(realspace_relerr=1e-7, realspace_abserr=1e-10, integration_relerr=1e-8,
                         integration_abserr=1e-12, xvalue_accuracy=1e-9, kvalue_accuracy=1e-9, maximum_fft_size=16384)


def stamp(profile, x, y):
    """Shares of the light on SIDE x SIDE pixels, the source x, y px from the middle of the central one."""
    pixel = galsim.Pixel(1.0, gsparams=PARAMS)
    seen = galsim.Convolve([profile, pixel], real_space=True, gsparams=PARAMS)
    return seen.drawImage(nx=SIDE, ny=SIDE, scale=1.0, offset=(x, y), method="no_pixel", dtype=float).array


def image():
    """An asymmetric core with a tail, the light of CELLS x CELLS cells, OVERSAMPLING a pixel; sums to 1."""
    at = (np.arange(CELLS) - (CELLS - 1) / 2) / OVERSAMPLING
    x, y = np.meshgrid(at, at)
    light = np.exp(-0.5 * ((x / 0.6) ** 2 + (y / 0.8) ** 2)) * (1 + 0.6 * np.tanh(x + 0.5 * y)) + 0.02 / (1 + x**2 + y**2)
    return np.round(light / light.sum(), 9)


def main():
    profiles = []
    for sigma in (0.3, 0.75, 2.0):
        profiles.append(("gaussian", sigma, 0.0, galsim.Gaussian(sigma=sigma, gsparams=PARAMS)))
    for fwhm, beta in ((0.8, 2.5), (1.7, 4.765), (3.0, 1.8)):
        profiles.append(("moffat", fwhm, beta, galsim.Moffat(fwhm=fwhm, beta=beta, gsparams=PARAMS)))
    for width, obscuration in ((0.4, 0.0), (1.2, 0.0), (1.2, 0.33), (3.1, 0.5)):
        airy = galsim.Airy(lam_over_diam=width, obscuration=obscuration, gsparams=PARAMS)
        profiles.append(("airy", width, obscuration, airy))
    cells = image()
    with open(HERE / "psf_image.csv", "w") as out:
        print(f"# A point spread function made by psf.py: light in cells, {OVERSAMPLING} a pixel.", file=out)
        for row in cells:
            print(",".join(f"{value:.9f}" for value in row), file=out)
    drawn = galsim.InterpolatedImage(galsim.Image(cells / cells.sum(), scale=1 / OVERSAMPLING), x_interpolant="nearest",
                                     normalization="flux", gsparams=PARAMS)
    profiles.append(("image", float(OVERSAMPLING), 0.0, drawn))
    with open(HERE / "psf.csv", "w") as out:
        print(f"# Shares of a point's light on {SIDE} x {SIDE} pixels, row by row, made by psf.py with GalSim {galsim.__version__}.", file=out)
        print("# The source stands x, y px from the middle of the central pixel. a, b: sigma (px), -; full width at half maximum (px),", file=out)
        print("# beta; lambda N (px), obscuration; cells a pixel of psf_image.csv, -.", file=out)
        print("kind,a,b,x,y,shares", file=out)
        for kind, a, b, profile in profiles:
            for x, y in OFFSETS:
                shares = stamp(profile, x, y)
                print(f"{kind},{a},{b},{x},{y}," + ",".join(f"{value:.8e}" for value in shares.ravel()), file=out, flush=True)
                print(kind, a, b, x, y, shares.sum())


main()
