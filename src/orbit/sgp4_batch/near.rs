//! Near-Earth orbits (periods below 225 min) with drag. Source: Vallado et al., AIAA 2006-6753;
//! names are those of the `sgp4` crate.
//!
//! Orbits with perigees below 220 km and near-circular orbits have fewer drag terms. The missing
//! terms get coefficients of 0, so that one formula serves all orbits.

use super::constants::{Elliptic, High, Method, ModelConstants};
use super::lanes::{Lanes, Part, Row};
use super::model::Model;
use super::orbit_kind::OrbitKind;
use super::secular::Secular;
use super::short_period::{Failed, Perturbed};
use crate::elements::Elements;
use pulp::Simd;

/// A block of near-Earth orbits.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Near {
    secular: Secular,
    sin_i: Row,
    cos_i: Row,
    a0: Row,
    k5: Row,
    c5: Row,
    /// D2, D3, D4.
    d: [Row; 3],
    eta: Row,
    k7: Row,
    /// n0" k8, n0" k9, n0" k10.
    mean_motion_k: [Row; 3],
    k11: Row,
    k12: Row,
    k13: Row,
}

impl Model for Near {
    const KIND: OrbitKind = OrbitKind::Near;

    fn set(&mut self, i: usize, elements: &Elements, constants: &ModelConstants) {
        self.secular.set(i, elements, constants);
        (self.sin_i[i], self.cos_i[i]) = libm::sincos(constants.orbit.inclination);
        let Method::NearEarth { a0, k5, high, .. } = &constants.method else {
            return;
        };
        (self.a0[i], self.k5[i]) = (*a0, *k5);
        let drag = [&mut self.c5, &mut self.eta, &mut self.k7];
        let circular = [&mut self.k11, &mut self.k12, &mut self.k13];
        let series = self.d.iter_mut().chain(&mut self.mean_motion_k);
        for row in drag.into_iter().chain(circular).chain(series) {
            row[i] = 0.0;
        }
        if let High::Yes {
            c5,
            d2,
            d3,
            d4,
            eta,
            k7,
            k8,
            k9,
            k10,
            elliptic,
        } = high
        {
            (self.c5[i], self.eta[i], self.k7[i]) = (*c5, *eta, *k7);
            for (row, d) in self.d.iter_mut().zip([d2, d3, d4]) {
                row[i] = *d;
            }
            for (row, k) in self.mean_motion_k.iter_mut().zip([k8, k9, k10]) {
                row[i] = constants.orbit.mean_motion * k;
            }
            if let Elliptic::Yes { k11, k12, k13 } = elliptic {
                (self.k11[i], self.k12[i], self.k13[i]) = (*k11, *k12, *k13);
            }
        }
    }

    #[inline(always)]
    fn secular(&self) -> &Secular {
        &self.secular
    }

    #[inline(always)]
    fn perturbed<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Perturbed<S> {
        let Secular { c1, c4, .. } = &self.secular;
        let t2 = t * t;
        let one = part.splat(1.0);
        let p23 = self.secular.perigee_at(part, t);
        let p24 = self.secular.mean_anomaly_at(part, t);

        // p25 = k13 ((1 + eta cos p24)^3 - k11) + k12 t
        let (_, cos_p24) = p24.sin_cos();
        let base = part.load(&self.eta).mul_add(cos_p24, one);
        let cube = base.squared().mul_add(base, -part.load(&self.k11));
        let p25 = part.load(&self.k13).mul_add(cube, part.load(&self.k12) * t);
        // w = p23 - p25, p26 = p24 + p25
        let (perigee, p26) = (p23 - p25, p24 + p25);
        // M = p26 + n0" (k1 t^2 + k8 t^3 + t^4 (k9 + t k10))
        let [k8, k9, k10] = part.load_three(&self.mean_motion_k);
        let k1 = part.load(&self.secular.mean_motion_k1);
        let series = t.mul_add(t.mul_add(t.mul_add(k10, k9), k8), k1);
        let mean_anomaly = t2.mul_add(series, p26);
        // a = a0" (1 - C1 t - D2 t^2 - D3 t^3 - D4 t^4)^2
        let [d2, d3, d4] = part.load_three(&self.d);
        let lost = t.mul_add(t.mul_add(t.mul_add(d4, d3), d2), part.load(c1));
        let a = part.load(&self.a0) * t.neg_mul_add(lost, one).squared();
        // p27 = e0 - (C4 t + C5 (sin p26 - k7))
        let (sin_p26, _) = p26.sin_cos();
        let periodic = part.load(&self.c5) * (sin_p26 - part.load(&self.k7));
        let p27 = part.load(&self.secular.eccentricity) - part.load(c4).mul_add(t, periodic);

        let mut failed = Failed::far(t);
        failed.outside_of_ellipses(p27);
        // e = max(p27, 1e-6)
        let least = part.splat(1e-6);
        Perturbed {
            failed,
            a,
            eccentricity: p27.less_than(least).select(least, p27),
            perigee,
            node: self.secular.node_at(part, t),
            mean_anomaly,
            sin_i: part.load(&self.sin_i),
            cos_i: part.load(&self.cos_i),
            k5: part.load(&self.k5),
        }
    }
}
