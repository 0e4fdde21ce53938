"""Radiance of the sunlit limb and of the day side by an independent radiative transfer model, to limb.csv.

PyPI sasktran2 2026.10.1, pure Rayleigh scattering (Bates), US Standard Atmosphere 1976, a sphere with the Earth's equatorial radius, a
Lambert ground of albedo 0.3. Columns: wavelength (nm), direction of the Sun at the tangent point (up, along the line of sight, across),
tangent altitude (m), radiance over the Sun's irradiance (1/sr) with all orders of scattering, and with one order.
"""

import numpy as np
import sasktran2 as sk

RADIUS_M = 6378137.0
WAVELENGTHS_NM = np.array([450.0, 600.0, 750.0, 900.0])
TANGENTS_M = [10e3, 20e3, 30e3, 40e3, 50e3, 60e3, 70e3, 80e3]


def radiance(sun_deg, azimuth_deg, all_orders):
    config = sk.Config()
    config.num_streams = 16
    config.single_scatter_source = sk.SingleScatterSource.Exact
    if all_orders:
        config.multiple_scatter_source = sk.MultipleScatterSource.DiscreteOrdinates
        config.num_sza = 5
    grid = np.concatenate([np.arange(0, 60e3, 500.0), np.arange(60e3, 120001.0, 1000.0)])
    cos = np.cos(np.radians(sun_deg))
    geometry = sk.Geometry1D(cos, 0.0, RADIUS_M, grid, sk.InterpolationMethod.LinearInterpolation, sk.GeometryType.Spherical)
    viewing = sk.ViewingGeometry()
    for tangent in TANGENTS_M:
        viewing.add_ray(sk.TangentAltitudeSolar(tangent, np.radians(azimuth_deg), 600e3, cos))
    atmosphere = sk.Atmosphere(geometry, config, wavelengths_nm=WAVELENGTHS_NM, calculate_derivatives=False)
    sk.climatology.us76.add_us76_standard_atmosphere(atmosphere)
    atmosphere["rayleigh"] = sk.constituent.Rayleigh()
    atmosphere["ground"] = sk.constituent.LambertianSurface(0.3 if all_orders else 0.0)
    result = sk.Engine(config, geometry, viewing).calculate_radiance(atmosphere)
    return result["radiance"].values[:, :, 0]


def main():
    with open("limb.csv", "w") as out:
        out.write("# Made by limb.py: PyPI sasktran2 2026.10.1.\n")
        out.write("wavelength_nm,sun_up,sun_along,sun_across,tangent_m,radiance,single\n")
        for sun_deg in [20.0, 60.0, 80.0]:
            for azimuth_deg in [30.0, 90.0, 150.0]:
                whole = radiance(sun_deg, azimuth_deg, True)
                single = radiance(sun_deg, azimuth_deg, False)
                zenith, azimuth = np.radians([sun_deg, azimuth_deg])
                up, flat = np.cos(zenith), np.sin(zenith)
                sun = f"{up:.9f},{flat * np.cos(azimuth):.9f},{flat * np.sin(azimuth):.9f}"
                for w, nm in enumerate(WAVELENGTHS_NM):
                    for k, tangent in enumerate(TANGENTS_M):
                        out.write(f"{nm:.0f},{sun},{tangent:.0f},{whole[w, k]:.5e},{single[w, k]:.5e}\n")


if __name__ == "__main__":
    main()
