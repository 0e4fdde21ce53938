//! Position and velocity from perturbed mean elements: long-period terms, Kepler's equation,
//! short-period terms (Vallado et al., AIAA 2006-6753).

use super::block::{BlockStates, DECAYED, TOO_FAR, UNKNOWN};
use super::lanes::{BLOCK, Lanes, Part, Row, Truth};
use crate::elements::MAX_ELAPSED_DAYS;
use pulp::Simd;

/// WGS72: radius of the Earth, km; root of its gravitational parameter, radii^1.5/min; J2, J3.
const EARTH_KM: f64 = sgp4::WGS72.ae;
const KE: f64 = sgp4::WGS72.ke;
const J2: f64 = sgp4::WGS72.j2;
const J3: f64 = sgp4::WGS72.j3;

/// Limits of Newton's method, as in the reference: number of steps, and size of a step, rad.
const STEPS: usize = 10;
const LONGEST_STEP: f64 = 0.95;
/// A step (rad) after which no other is needed: the error is e/(2(1 - e)) times its square, 5e-13
/// rad at e = 0.99.
const LAST_STEP: f64 = 1e-7;

/// Failure codes, or 0. The first failure counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Failed<S: Simd>(Lanes<S>);

impl<S: Simd> Failed<S> {
    /// Fails objects that are too far from their epochs, `t` in minutes.
    #[inline(always)]
    pub fn far(t: Lanes<S>) -> Self {
        let near = t.abs().at_most(t.splat(MAX_ELAPSED_DAYS * 1440.0));
        Self(near.select(t.splat(0.0), t.splat(f64::from(TOO_FAR))))
    }

    /// The time `t`; 0 for failed objects.
    #[inline(always)]
    pub fn where_valid(self, t: Lanes<S>) -> Lanes<S> {
        self.0.less_than(t.splat(0.5)).select(t, t.splat(0.0))
    }

    /// Sets the code where `holds` is false.
    #[inline(always)]
    pub fn unless(&mut self, holds: Truth<S>, code: u8) {
        let none = self.0.abs().less_than(self.0.splat(0.5));
        let new = none.select(self.0.splat(f64::from(code)), self.0);
        self.0 = holds.select(self.0, new);
    }

    /// Fails mean eccentricities outside -0.001 to 1: code 1.
    #[inline(always)]
    pub fn outside_of_ellipses(&mut self, e: Lanes<S>) {
        let holds = e.at_least(e.splat(-0.001)).and(e.less_than(e.splat(1.0)));
        self.unless(holds, 1);
    }
}

/// Mean elements at an instant, with all but the short-period perturbations; rad, Earth radii.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Perturbed<S: Simd> {
    pub failed: Failed<S>,
    pub a: Lanes<S>,
    pub eccentricity: Lanes<S>,
    pub perigee: Lanes<S>,
    pub node: Lanes<S>,
    pub mean_anomaly: Lanes<S>,
    pub sin_i: Lanes<S>,
    pub cos_i: Lanes<S>,
    /// J3/J2 sin I (3 + 5 cos I) / (1 + cos I) / -4.
    pub k5: Lanes<S>,
}

/// k5 of an inclination. Near 180 deg the divisor is limited to 1.5e-12.
#[inline(always)]
pub(crate) fn k5<S: Simd>(sin_i: Lanes<S>, cos_i: Lanes<S>) -> Lanes<S> {
    let (one, least) = (sin_i.splat(1.0), sin_i.splat(1.5e-12));
    let sum = one + cos_i;
    let divisor = least.less_than(sum.abs()).select(sum, least);
    sin_i * (-0.25 * J3 / J2) * cos_i.mul_add(sin_i.splat(5.0), sin_i.splat(3.0)) / divisor
}

/// Intermediate results of a block, from mean elements to states. Each step is done for many
/// blocks: in a single block every operation would wait for the one before.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct Intermediate {
    failed: Row,
    a: Row,
    node: Row,
    sin_i: Row,
    cos_i: Row,
    axn: Row,
    ayn: Row,
    /// p38; then sine and cosine of E + w.
    p38: Row,
    sin: Row,
    cos: Row,
}

impl<S: Simd> Perturbed<S> {
    /// Long-period terms.
    #[inline(always)]
    pub fn long_period(self, part: Part<S>, work: &mut Intermediate) {
        let Self {
            failed,
            a,
            eccentricity: e,
            sin_i,
            cos_i,
            ..
        } = self;
        let one = part.splat(1.0);

        // p37 = 1 / (a (1 - e^2)); axn = e cos w; ayn = e sin w + p37 p32, p32 = -J3/J2 sin I / 2
        let p37 = one / (a * e.neg_mul_add(e, one));
        let (sin_w, cos_w) = self.perigee.sin_cos();
        let axn = e * cos_w;
        let ayn = e.mul_add(sin_w, p37 * (sin_i * (-0.5 * J3 / J2)));
        // p38 = M + w + p37 p35 axn
        let p38 = (p37 * self.k5).mul_add(axn, self.mean_anomaly + self.perigee);
        part.store(&mut work.p38, p38.within_a_turn());
        part.store(&mut work.axn, axn);
        part.store(&mut work.ayn, ayn);
        part.store(&mut work.failed, failed.0);
        part.store(&mut work.a, a);
        part.store(&mut work.node, self.node);
        part.store(&mut work.sin_i, sin_i);
        part.store(&mut work.cos_i, cos_i);
    }
}

impl Intermediate {
    /// Before the first step.
    pub const EMPTY: Intermediate = Intermediate {
        failed: [0.0; BLOCK],
        a: [0.0; BLOCK],
        node: [0.0; BLOCK],
        sin_i: [0.0; BLOCK],
        cos_i: [0.0; BLOCK],
        axn: [0.0; BLOCK],
        ayn: [0.0; BLOCK],
        p38: [0.0; BLOCK],
        sin: [0.0; BLOCK],
        cos: [0.0; BLOCK],
    };

    /// Kepler's equation.
    #[inline(always)]
    pub fn solve<S: Simd>(&mut self, part: Part<S>) {
        let (axn, ayn) = (part.load(&self.axn), part.load(&self.ayn));
        let (sin, cos) = kepler(part.load(&self.p38), axn, ayn);
        part.store(&mut self.sin, sin);
        part.store(&mut self.cos, cos);
    }

    /// Short-period terms: positions (km) and velocities (km/s), TEME, and the codes of failures.
    #[inline(always)]
    pub fn state<S: Simd>(&self, part: Part<S>, to: &mut BlockStates) {
        let (zero, one) = (part.splat(0.0), part.splat(1.0));
        let mut failed = Failed(part.load(&self.failed));
        let (a, node) = (part.load(&self.a), part.load(&self.node));
        let (sin_i, cos_i) = (part.load(&self.sin_i), part.load(&self.cos_i));
        let (axn, ayn) = (part.load(&self.axn), part.load(&self.ayn));
        let (sin, cos) = (part.load(&self.sin), part.load(&self.cos));
        // p39 = axn^2 + ayn^2; pl = a (1 - p39)
        let p39 = axn.mul_add(axn, ayn.squared());
        let rest = one - p39;
        let pl = a * rest;
        failed.unless(zero.at_most(pl), 4);
        // p40 = axn sin E - ayn cos E; r = a (1 - axn cos E - ayn sin E)
        let p40 = axn.mul_add(sin, -(ayn * cos));
        let near = ayn.neg_mul_add(sin, axn.neg_mul_add(cos, one));
        let r = a * near;
        // b = (1 - p39)^(1/2); p41 = p40 / (1 + b)
        let b = rest.sqrt();
        let p41 = p40 / (one + b);
        // sin u = (sin E - ayn - axn p41) a / r; cos u = (cos E - axn + ayn p41) a / r
        let a_over_r = one / near;
        let sin_u = axn.neg_mul_add(p41, sin - ayn) * a_over_r;
        let cos_u = ayn.mul_add(p41, cos - axn) * a_over_r;
        // p44 = sin 2u; p45 = cos 2u
        let sin_2u = (cos_u + cos_u) * sin_u;
        let cos_2u = (sin_u + sin_u).neg_mul_add(sin_u, one);

        // p47 = J2 / (2 pl); p46 = p47 / pl
        let inverse = one / pl;
        let p47 = inverse * (0.5 * J2);
        let p46 = p47 * inverse;
        // p33 = 1 - cos^2 I; p34 = 7 cos^2 I - 1; p36 = 3 cos^2 I - 1
        let cos2_i = cos_i.squared();
        let p33 = one - cos2_i;
        let p34 = cos2_i.mul_add(part.splat(7.0), -one);
        let p36 = cos2_i.mul_add(part.splat(3.0), -one);

        // r_k = r (1 - 3/2 p46 b p36) + p47 p33 cos 2u / 2
        let flat = (p46 * b * 1.5).neg_mul_add(p36, one);
        let r_k = r.mul_add(flat, p47 * p33 * cos_2u * 0.5);
        // u_k = u - p46 p34 sin 2u / 4; I_k = I + 3/2 p46 cos I sin I cos 2u;
        // node_k = node + 3/2 p46 cos I sin 2u
        let wave = p46 * cos_i * 1.5;
        let (sin_u, cos_u) = turned(sin_u, cos_u, p46 * p34 * sin_2u * -0.25);
        let (sin_ik, cos_ik) = turned(sin_i, cos_i, wave * sin_i * cos_2u);
        let (sin_node, cos_node) = wave.mul_add(sin_2u, node).sin_cos();

        // u = (cos node cos u - sin node cos I sin u, sin node cos u + cos node cos I sin u,
        // sin I sin u)
        let (across, along) = (cos_ik * sin_u, cos_ik * cos_u);
        let ux = cos_node.mul_add(cos_u, -(sin_node * across));
        let uy = sin_node.mul_add(cos_u, cos_node * across);
        let uz = sin_ik * sin_u;
        let length = r_k * EARTH_KM;
        failed.unless(r_k.at_least(one), DECAYED);

        // n / ke = a^(-3/2); r' = a^(1/2) p40 / r; r f' = pl^(1/2) / r
        let root_a = a.sqrt();
        let inverse_root = one / root_a;
        let n = inverse_root.squared() * inverse_root;
        // r_k' = r' - n p47 p33 sin 2u / ke; r_k f' = r f' + n p47 (p33 cos 2u + 3/2 p36) / ke
        let pull = n * p47;
        let speed = inverse_root * a_over_r;
        let rate = (pull * p33).neg_mul_add(sin_2u, speed * p40);
        let turn = pull.mul_add(p33.mul_add(cos_2u, p36 * 1.5), speed * b);
        // v = r_k' u + r_k f' (-cos node sin u - sin node cos I cos u,
        // cos node cos I cos u - sin node sin u, sin I cos u)
        let wx = -sin_node.mul_add(along, cos_node * sin_u);
        let wy = cos_node.mul_add(along, -(sin_node * sin_u));
        let wz = sin_ik * cos_u;
        let (rate, turn) = (rate * (EARTH_KM * KE / 60.0), turn * (EARTH_KM * KE / 60.0));
        let velocity = [
            rate.mul_add(ux, turn * wx),
            rate.mul_add(uy, turn * wy),
            rate.mul_add(uz, turn * wz),
        ];
        let position = [length * ux, length * uy, length * uz];

        let finite = part.splat(f64::MAX);
        for number in position.into_iter().chain(velocity) {
            failed.unless(number.abs().at_most(finite), UNKNOWN);
        }
        let valid = failed.0.less_than(part.splat(0.5));
        for (row, number) in to.position_km.iter_mut().zip(position) {
            part.store(row, valid.select(number, zero));
        }
        for (row, number) in to.velocity_km_s.iter_mut().zip(velocity) {
            part.store(row, valid.select(number, zero));
        }
        part.store(&mut to.code, failed.0);
    }
}

/// Sine and cosine of an angle plus `by` (rad).
#[inline(always)]
fn turned<S: Simd>(sin: Lanes<S>, cos: Lanes<S>, by: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let (s, c) = by.sin_cos_often_small();
    (sin.mul_add(c, cos * s), cos.mul_add(c, -(sin * s)))
}

/// Sine and cosine of E + w from Kepler's equation p38 = (E + w) + ayn cos(E + w) - axn sin(E + w),
/// by Newton's method. Converged lanes stay fixed, so results do not depend on other objects.
#[inline(always)]
fn kepler<S: Simd>(p38: Lanes<S>, axn: Lanes<S>, ayn: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let one = p38.splat(1.0);
    let (last, longest) = (p38.splat(LAST_STEP), p38.splat(LONGEST_STEP));
    let mut angle = p38;
    let (mut sin, mut cos) = angle.sin_cos();
    let mut moving = p38.splat(0.0).less_than(one);
    for _ in 0..STEPS {
        // (p38 - ayn cos + axn sin - angle) / (1 - axn cos - ayn sin)
        let miss = axn.mul_add(sin, ayn.neg_mul_add(cos, p38 - angle));
        let slope = ayn.neg_mul_add(sin, axn.neg_mul_add(cos, one));
        let step = miss / slope;
        let size = step.abs();
        let bounded = longest
            .less_than(size)
            .select(longest.with_sign_of(step), step);
        let step = moving.select(bounded, p38.splat(0.0));
        angle = angle + step;
        let (s, c) = turned(sin, cos, step);
        (sin, cos) = (moving.select(s, sin), moving.select(c, cos));
        moving = moving.and(last.less_than(size));
        if !moving.any() {
            break;
        }
    }
    (sin, cos)
}
