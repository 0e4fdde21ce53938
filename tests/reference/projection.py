"""Lens distortion by OpenCV's camera models: writes projection.csv beside it. Needs opencv-python-headless 5.0.0.93, numpy 2.4.6."""

import pathlib

import cv2
import numpy as np

FOCAL, CENTRE = 2650.0, (511.5, 498.25)
CAMERA = np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1.0]])
CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
BROWN = [(-0.28, 0.09, -0.01, 3e-4, -2e-4), (0.12, 0.3, 0.0, -1e-3, 2e-3), (0.9, -0.4, 0.2, 0.0, 0.0), (0.0, 0.0, 0.0, 4e-3, -6e-3)]
FISHEYE = [(0.0, 0.0, 0.0, 0.0), (-0.02, 3e-3, -8e-4, 4e-5), (0.05, -0.01, 0.0, 0.0)]


def directions(most_deg):
    """Unit vectors out to an angle from the boresight."""
    for angle in np.radians(np.linspace(0.4, most_deg, 9)):
        for azimuth in np.radians([10, 77, 133, 200, 261, 344]):
            yield np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)])


def main():
    zero = np.zeros(3)
    with open(pathlib.Path(__file__).parent / "projection.csv", "w") as out:
        print(f"# Pixels of directions and back by OpenCV {cv2.__version__}, made by projection.py: projectPoints and undistortPoints", file=out)
        print(f"# (brown: k1, k2, k3, p1, p2), fisheye.projectPoints and fisheye.undistortPoints (fisheye: k1 to k4). Focal length {FOCAL} px,", file=out)
        print(f"# principal point {CENTRE[0]}, {CENTRE[1]}. ux, uy: X / Z, Y / Z of the direction of the pixel (x, y) rounded to 0.01 px.", file=out)
        print("model,c1,c2,c3,c4,c5,dx,dy,dz,x,y,rx,ry,ux,uy", file=out)
        for model, sets, most in (("brown", BROWN, 33.0), ("fisheye", FISHEYE, 80.0)):
            for c in sets:
                for d in directions(most):
                    point = (d / d[2]).reshape(1, 1, 3)
                    if model == "brown":
                        k = np.array([c[0], c[1], c[3], c[4], c[2]])
                        pixel = cv2.projectPoints(point, zero, zero, CAMERA, k)[0].ravel()
                        rounded = np.round(pixel, 2)
                        back = cv2.undistortPoints(rounded.reshape(1, 1, 2), CAMERA, k, criteria=CRITERIA).ravel()
                        c5 = c[4]
                    else:
                        k = np.array(c)
                        pixel = cv2.fisheye.projectPoints(point, zero, zero, CAMERA, k)[0].ravel()
                        rounded = np.round(pixel, 2)
                        back = cv2.fisheye.undistortPoints(rounded.reshape(1, 1, 2), CAMERA, k, criteria=CRITERIA).ravel()
                        c5 = 0.0
                    numbers = [*c[:4], c5, *d, *pixel, *rounded, *back]
                    print(model + "," + ",".join(repr(float(n)) for n in numbers), file=out)


main()
