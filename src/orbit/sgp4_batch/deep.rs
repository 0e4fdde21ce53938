//! Deep-space orbits (periods of 225 min and above): Sun and Moon, Lyddane's form near the equator,
//! resonance. Source: Vallado et al., AIAA 2006-6753; names are those of the `sgp4` crate.

use super::constants::{Method, ModelConstants, Perturber};
use super::lanes::{Lanes, Part, Row};
use super::model::Model;
use super::orbit_kind::OrbitKind;
use super::resonance::{Resonance, Unperturbed};
use super::secular::{Secular, When};
use super::short_period::{Failed, Perturbed, k5};
use crate::elements::Elements;
use pulp::Simd;

/// Eccentricity and mean motion (rad/min) of the apparent orbits of Sun and Moon.
const SUN: [f64; 2] = [0.01675, 1.194_59e-5];
const MOON: [f64; 2] = [0.054_90, 1.583_521_8e-4];
/// Below this inclination (rad) node and perigee are perturbed together (Lyddane 1963).
const LYDDANE: f64 = 0.2;

/// A block of deep-space orbits.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Deep<R> {
    secular: Secular,
    inclination: Row,
    inclination_dot: Row,
    eccentricity_dot: Row,
    sun: Pull,
    moon: Pull,
    resonance: R,
}

/// Amplitudes of a perturbing body, and its mean anomaly at the epoch.
#[derive(Clone, Debug, Default)]
struct Pull {
    k: [Row; 12],
    mean_anomaly: Row,
}

/// Perturbations by one body of e, I and M, and p4 and p5 for perigee and node.
struct Effects<S: Simd> {
    e: Lanes<S>,
    i: Lanes<S>,
    m: Lanes<S>,
    p4: Lanes<S>,
    p5: Lanes<S>,
}

impl Pull {
    fn set(&mut self, i: usize, constants: &Perturber) {
        for (row, k) in self.k.iter_mut().zip(constants.k) {
            row[i] = k;
        }
        self.mean_anomaly[i] = constants.mean_anomaly;
    }

    #[inline(always)]
    fn effects<S: Simd>(&self, part: Part<S>, [e, n]: [f64; 2], t: Lanes<S>) -> Effects<S> {
        // M = M0 + n t; f = M + 2 e sin M. M0 is up to 1e4 rad. It is rounded as in the scalar
        // model, since its last digits matter at low inclinations, where p5 / sin I is large.
        let m = part.load(&self.mean_anomaly) + t * n;
        let (sin_m, _) = m.sin_cos();
        let f = m + sin_m * (2.0 * e);
        let (sin, cos) = f.sin_cos();
        // F2 = sin^2 f / 2 - 1/4; F3 = -sin f cos f / 2
        let f2 = (sin * 0.5).mul_add(sin, part.splat(-0.25));
        let f3 = sin * cos * -0.5;
        Effects {
            e: self.two(part, 0, f2, f3),
            i: self.two(part, 2, f2, f3),
            m: part
                .load(&self.k[6])
                .mul_add(sin, self.two(part, 4, f2, f3)),
            p4: part
                .load(&self.k[9])
                .mul_add(sin, self.two(part, 7, f2, f3)),
            p5: self.two(part, 10, f2, f3),
        }
    }

    /// k_i F2 + k_(i+1) F3.
    #[inline(always)]
    fn two<S: Simd>(&self, part: Part<S>, i: usize, f2: Lanes<S>, f3: Lanes<S>) -> Lanes<S> {
        let second = part.load(&self.k[i + 1]) * f3;
        part.load(&self.k[i]).mul_add(f2, second)
    }
}

impl<R: Resonance> Model for Deep<R> {
    const KIND: OrbitKind = R::KIND;

    fn set(&mut self, i: usize, elements: &Elements, constants: &ModelConstants) {
        self.secular.set(i, elements, constants);
        self.inclination[i] = constants.orbit.inclination;
        if let Method::DeepSpace {
            eccentricity_dot,
            inclination_dot,
            sun,
            moon,
            resonant,
        } = &constants.method
        {
            self.inclination_dot[i] = *inclination_dot;
            self.eccentricity_dot[i] = *eccentricity_dot;
            self.sun.set(i, sun);
            self.moon.set(i, moon);
            self.resonance.set(i, constants.orbit.mean_motion, resonant);
        }
    }

    #[inline(always)]
    fn advance<S: Simd>(&mut self, part: Part<S>, when: When) {
        let t = self.secular.minutes(part, when);
        let t = Failed::far(t).where_valid(t);
        self.resonance.advance(part, &self.secular, t);
    }

    #[inline(always)]
    fn secular(&self) -> &Secular {
        &self.secular
    }

    #[inline(always)]
    fn perturbed<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Perturbed<S> {
        let Secular { c1, c4, .. } = &self.secular;
        let (zero, one) = (part.splat(0.0), part.splat(1.0));
        let p22 = self.secular.node_at(part, t);
        let p23 = self.secular.perigee_at(part, t);
        let mut failed = Failed::far(t);
        // Failed orbits are not integrated.
        let t = failed.where_valid(t);
        let Unperturbed {
            a: p28,
            mean_anomaly: p29,
            is_valid,
        } = self
            .resonance
            .unperturbed(part, &self.secular, t, [p22, p23]);
        failed.unless(is_valid, 2);

        let sun = self.sun.effects(part, SUN, t);
        let moon = self.moon.effects(part, MOON, t);
        let (di, p4, p5) = (sun.i + moon.i, sun.p4 + moon.p4, sun.p5 + moon.p5);
        // I = I0 + I' t + dI
        let secular = part.load(&self.inclination) + part.load(&self.inclination_dot) * t;
        let inclination = secular + di;
        let (sin_i, cos_i) = inclination.sin_cos();
        // I >= 0.2: node = p22 + p5 / sin I; w = p23 + p4 - cos I p5 / sin I
        let shift = p5 / sin_i;
        let mut node = p22 + shift;
        let mut perigee = cos_i.neg_mul_add(shift, p23 + p4);
        let flat = inclination.less_than(part.splat(LYDDANE));
        if flat.any() {
            // node = atan2(sin I sin p22 + p5 cos p22 + dI cos I sin p22,
            // sin I cos p22 - p5 sin p22 + dI cos I cos p22) = p22 + atan2(p5, sin I + dI cos I);
            // w = p23 + p4 + cos I (p22 - node) - dI p22 sin I
            let shift = p5.angle_above(di.mul_add(cos_i, sin_i));
            let slow = (di * sin_i).neg_mul_add(p22.remainder_of_turns(), p23 + p4);
            node = flat.select(p22 + shift, node);
            perigee = flat.select(cos_i.neg_mul_add(shift, slow), perigee);
        }

        // p31 = e0 + e' t - C4 t
        let rate = part.load(&self.eccentricity_dot) - part.load(c4);
        let p31 = rate.mul_add(t, part.load(&self.secular.eccentricity));
        failed.outside_of_ellipses(p31);
        // e = max(p31, 1e-6) + de
        let least = part.splat(1e-6);
        let eccentricity = p31.less_than(least).select(least, p31) + (sun.e + moon.e);
        failed.unless(zero.at_most(eccentricity).and(eccentricity.at_most(one)), 3);
        // a = p28 (1 - C1 t)^2; M = p29 + dM + n0" k1 t^2
        let a = p28 * part.load(c1).neg_mul_add(t, one).squared();
        let drag = part.load(&self.secular.mean_motion_k1);
        let mean_anomaly = drag.mul_add(t * t, p29 + (sun.m + moon.m));
        Perturbed {
            failed,
            a,
            eccentricity,
            perigee,
            node,
            mean_anomaly,
            sin_i,
            cos_i,
            k5: k5(sin_i, cos_i),
        }
    }
}
