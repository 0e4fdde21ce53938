//! Shapes of objects in orbit: facets whose reflective areas sum, Eq. (6) of Clark et al. 2021.
//!
//! Plates, the sides of cylinders and cones, and spheres; boxes and closed bodies consist of them.
//! A facet that faces away from the Sun or from the sensor is dark. Parts neither shade nor hide
//! each other, and light is reflected once only: a panel behind a body is as bright as one next to
//! it. If self-shadowing matters, the shape must omit the hidden parts.

mod ring;
mod surface;

pub use surface::{Lobe, Surface};

use super::photometry::{Sphere, phase_angle};
use nalgebra::{Unit, Vector3};
use ring::Ring;
use std::f64::consts::PI;

/// The shape of an object; axes of its body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shape {
    facets: Vec<Facet>,
}

/// A part with one kind of surface.
#[derive(Debug, Clone, PartialEq)]
struct Facet {
    form: Form,
    surface: Surface,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Plate(Plate),
    Ring(Ring),
    /// Its diameter, m.
    Sphere(f64),
}

/// A flat piece of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plate {
    /// Area of one side, m^2.
    pub area_m2: f64,
    /// Normal of its front, unit vector.
    pub normal: Unit<Vector3<f64>>,
    /// Whether its back reflects too.
    pub two_sided: bool,
    /// The body axis about which it rotates toward the Sun.
    pub hinge: Option<Unit<Vector3<f64>>>,
}

/// Closed ends of a cylinder or a cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ends {
    /// At the start of the axis.
    pub base: bool,
    /// At the end of the axis.
    pub top: bool,
}

/// Rotation of a body over which diffuse light changes little, rad.
const DIFFUSE_DETAIL: f64 = 0.2;

impl Shape {
    /// Adds a plate.
    pub fn plate(&mut self, plate: Plate, surface: Surface) {
        let form = Form::Plate(plate);
        self.facets.push(Facet { form, surface });
    }

    /// Adds a box of edges `size_m` along the body's axes: six plates; those with an edge of 0 have
    /// no area.
    pub fn cuboid(&mut self, size_m: [f64; 3], surface: Surface) {
        let [x, y, z] = size_m;
        for (axis, area_m2) in [
            (Vector3::x_axis(), y * z),
            (Vector3::y_axis(), z * x),
            (Vector3::z_axis(), x * y),
        ] {
            for normal in [axis, -axis] {
                self.plate(Plate::new(area_m2, normal), surface);
            }
        }
    }

    /// Adds a truncated cone with the two diameters of its base and top: a cylinder if they are
    /// equal. Lengths in m.
    pub fn cone(
        &mut self,
        axis: Unit<Vector3<f64>>,
        [base_m, top_m]: [f64; 2],
        length_m: f64,
        ends: Ends,
        surface: Surface,
    ) {
        // The side's normals tilt towards the narrower end; its area is pi (r1 + r2) times its
        // slant height.
        let narrowing = (base_m - top_m) / 2.0;
        let slant_m = libm::hypot(length_m, narrowing);
        let area_m2 = PI * (base_m + top_m) / 2.0 * slant_m;
        let elevation = libm::atan2(narrowing, length_m);
        let form = Form::Ring(Ring::new(axis.into_inner(), elevation, area_m2));
        self.facets.push(Facet { form, surface });
        for (closed, diameter_m, normal) in [(ends.base, base_m, -axis), (ends.top, top_m, axis)] {
            if closed && diameter_m > 0.0 {
                let area_m2 = PI * diameter_m * diameter_m / 4.0;
                self.plate(Plate::new(area_m2, normal), surface);
            }
        }
    }

    /// Adds a sphere, Eqs. (7) and (8). Its lobe has no effect: a sphere reflects specular light
    /// equally in all directions.
    pub fn sphere(&mut self, diameter_m: f64, surface: Surface) {
        let form = Form::Sphere(diameter_m);
        self.facets.push(Facet { form, surface });
    }

    /// Eq. (6): `rho A F` (m^2/sr), summed over the facets, for the unit vectors to the Sun and to
    /// the sensor in axes of the body, and the angular radius `sun_radius` (rad) of the Sun's disc.
    ///
    /// Plates and spheres are exact, sides of cylinders and cones within 1e-4. A facet with
    /// negative light or NaN counts as 0.
    pub fn reflective_area(
        &self,
        to_sun: &Vector3<f64>,
        to_sensor: &Vector3<f64>,
        sun_radius: f64,
    ) -> f64 {
        let facets = self.facets.iter();
        facets
            .map(|facet| facet.reflective_area(to_sun, to_sensor, sun_radius))
            .map(|area| area.max(0.0))
            .sum()
    }

    /// Number of facets, at least one.
    pub(crate) fn facets(&self) -> usize {
        self.facets.len().max(1)
    }

    /// Rotation of the body (rad) over which its light may change much: that which moves the
    /// narrowest lobe across a sensor. `sun_radius` is that of [`Shape::reflective_area`].
    pub fn detail(&self, sun_radius: f64) -> f64 {
        let details = self.facets.iter().map(|facet| match facet.form {
            Form::Plate(_) | Form::Ring(_) if facet.surface.specular > 0.0 => {
                facet.surface.lobe.cap(sun_radius).edge()
            }
            _ => DIFFUSE_DETAIL,
        });
        details.fold(DIFFUSE_DETAIL, f64::min)
    }
}

impl Facet {
    fn reflective_area(
        &self,
        to_sun: &Vector3<f64>,
        to_sensor: &Vector3<f64>,
        sun_radius: f64,
    ) -> f64 {
        let Surface {
            reflectance,
            diffuse,
            specular,
            ..
        } = self.surface;
        match &self.form {
            Form::Plate(plate) => {
                plate.reflective_area(&self.surface, to_sun, to_sensor, sun_radius)
            }
            Form::Ring(ring) => ring.reflective_area(&self.surface, to_sun, to_sensor, sun_radius),
            Form::Sphere(diameter_m) => Sphere {
                diameter_m: *diameter_m,
                reflectance,
                diffuse,
                specular,
            }
            .reflective_area(phase_angle(to_sun, to_sensor)),
        }
    }
}

impl Plate {
    /// One-sided and fixed.
    pub fn new(area_m2: f64, normal: Unit<Vector3<f64>>) -> Plate {
        Plate {
            area_m2,
            normal,
            two_sided: false,
            hinge: None,
        }
    }

    fn reflective_area(
        &self,
        surface: &Surface,
        to_sun: &Vector3<f64>,
        to_sensor: &Vector3<f64>,
        sun_radius: f64,
    ) -> f64 {
        let normal = self.turned(to_sun);
        let (mut sun, mut seen) = (normal.dot(to_sun), normal.dot(to_sensor));
        if self.two_sided && sun < 0.0 {
            (sun, seen) = (-sun, -seen);
        }
        if sun <= 0.0 || seen <= 0.0 {
            return 0.0;
        }
        let cap = surface.lobe.cap(sun_radius);
        self.area_m2 * surface.reflected(sun, seen, to_sun.dot(to_sensor), &cap)
    }

    /// Its normal after the rotation about its hinge that turns it nearest to the Sun. Unchanged if
    /// the Sun is on the hinge's axis.
    fn turned(&self, to_sun: &Vector3<f64>) -> Vector3<f64> {
        let normal = self.normal.into_inner();
        let Some(hinge) = self.hinge else {
            return normal;
        };
        let across = |v: &Vector3<f64>| v - hinge.into_inner() * hinge.dot(v);
        let (own, sunward) = (across(&normal), across(to_sun));
        match sunward.try_normalize(1e-9) {
            Some(sunward) => hinge.into_inner() * hinge.dot(&normal) + sunward * own.norm(),
            None => normal,
        }
    }
}
