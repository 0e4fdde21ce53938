//! Resonance of deep-space orbits with the Earth's rotation, integrated from the epoch in steps of
//! 720 min (Vallado et al., AIAA 2006-6753; Hujsak 1979).
//!
//! The integrator's state depends on the number of steps alone. It continues from its last state.
//! It restarts at the epoch where the requested time lies before that state.

use super::constants;
use super::lanes::{Lanes, Part, Row, Truth};
use super::orbit_kind::OrbitKind;
use super::secular::Secular;
use pulp::Simd;

/// Length of a step, min.
const STEP: f64 = 720.0;
/// Rotation of the Earth, rad/min.
const SIDEREAL_SPEED: f64 = 4.375_269_088_011_3e-3;
const KE: f64 = sgp4::WGS72.ke;

/// Phases of the resonance terms, rad.
const LAMBDA31: f64 = 0.131_309_08;
const LAMBDA22: f64 = 2.884_319_8;
const LAMBDA33: f64 = 0.374_480_87;
const G22: f64 = 5.768_639_6;
const G32: f64 = 0.952_408_98;
const G44: f64 = 1.801_499_8;
const G52: f64 = 1.050_833_0;
const G54: f64 = 4.410_889_8;

/// Mean elements before Sun, Moon and drag.
pub(crate) struct Unperturbed<S: Simd> {
    /// Semi-major axis, Earth radii.
    pub a: Lanes<S>,
    /// rad
    pub mean_anomaly: Lanes<S>,
    /// Where the mean motion is above 0.
    pub is_valid: Truth<S>,
}

/// Change of mean anomaly and semi-major axis with time.
pub(crate) trait Resonance: Default + Send + Sync {
    const KIND: OrbitKind;

    fn set(&mut self, i: usize, mean_motion: f64, constants: &constants::Resonant);

    /// Integrates to less than a step before `t` (min after the epoch), and stores the state.
    fn advance<S: Simd>(&mut self, _: Part<S>, _: &Secular, _: Lanes<S>) {}

    /// Mean elements `t` min after the epoch, with the node p22 and the perigee p23 at that time.
    fn unperturbed<S: Simd>(
        &self,
        part: Part<S>,
        secular: &Secular,
        t: Lanes<S>,
        p22_p23: [Lanes<S>; 2],
    ) -> Unperturbed<S>;
}

/// No resonance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Free {
    a0: Row,
}

impl Resonance for Free {
    const KIND: OrbitKind = OrbitKind::Deep;

    fn set(&mut self, i: usize, _: f64, constants: &constants::Resonant) {
        if let constants::Resonant::No { a0 } = constants {
            self.a0[i] = *a0;
        }
    }

    #[inline(always)]
    fn unperturbed<S: Simd>(
        &self,
        part: Part<S>,
        secular: &Secular,
        t: Lanes<S>,
        _: [Lanes<S>; 2],
    ) -> Unperturbed<S> {
        Unperturbed {
            a: part.load(&self.a0),
            mean_anomaly: secular.mean_anomaly_at(part, t),
            is_valid: t.at_most(t),
        }
    }
}

/// Resonance with one day.
pub(crate) type OneDay = Resonant<OneDayTerms>;
/// Resonance with half a day.
pub(crate) type HalfDay = Resonant<HalfDayTerms>;

/// The terms of a resonance.
pub(crate) trait Terms: Default + Send + Sync {
    const KIND: OrbitKind;

    fn set(&mut self, i: usize, constants: &constants::Resonance);

    /// n' and its derivative by lambda, at lambda (rad) and `at` min after the epoch.
    fn pull<S: Simd>(
        &self,
        part: Part<S>,
        secular: &Secular,
        lambda: Lanes<S>,
        at: Lanes<S>,
    ) -> Pull<S>;

    /// p29, the mean anomaly, from lambda, the node p22, the perigee p23 and sidereal time.
    fn mean_anomaly<S: Simd>(lambda: Lanes<S>, p22_p23: [Lanes<S>; 2], theta: Lanes<S>)
    -> Lanes<S>;
}

/// Resonant orbits: initial values of the integrator, and its state.
#[derive(Clone, Debug, Default)]
pub(crate) struct Resonant<T> {
    mean_motion_0: Row,
    lambda_0: Row,
    lambda_dot: Row,
    sidereal_time: Row,
    a0: Row,
    t: Row,
    mean_motion: Row,
    lambda: Row,
    terms: T,
}

/// State of an integrator: min after the epoch, rad/min, rad.
struct Integrated<S: Simd> {
    at: Lanes<S>,
    n: Lanes<S>,
    lambda: Lanes<S>,
}

impl<T: Terms> Resonant<T> {
    /// The integrator's state less than a step before `t`.
    #[inline(always)]
    fn near<S: Simd>(&self, part: Part<S>, secular: &Secular, t: Lanes<S>) -> Integrated<S> {
        let zero = part.splat(0.0);
        // Restart where t lies before the last state, or on the other side of the epoch.
        let at = part.load(&self.t);
        let onward = zero.at_most(at * t).and(at.abs().at_most(t.abs()));
        let mut at = onward.select(at, zero);
        let mut n = onward.select(part.load(&self.mean_motion), part.load(&self.mean_motion_0));
        let mut lambda = onward.select(part.load(&self.lambda), part.load(&self.lambda_0));

        let lambda_dot = part.load(&self.lambda_dot);
        let forward = zero.less_than(t);
        let step = forward.select(part.splat(STEP), part.splat(-STEP));
        let half = part.splat(STEP * STEP / 2.0);
        loop {
            let on = step.abs().at_most((t - at).abs());
            if !on.any() {
                return Integrated { at, n, lambda };
            }
            // n += n' dt + n'' dt^2 / 2; lambda += lambda' dt + n' dt^2 / 2, rounded as in the
            // scalar model: over the 73,000 steps of a century other rounding would dominate.
            let rate = n + lambda_dot;
            let Pull { n_dot, slope } = self.terms.pull(part, secular, lambda, at);
            let next = n + (n_dot * step + slope * rate * half);
            let further = lambda + (rate * step + n_dot * half);
            n = on.select(next, n);
            lambda = on.select(further, lambda);
            at = on.select(at + step, at);
        }
    }
}

impl<T: Terms> Resonance for Resonant<T> {
    const KIND: OrbitKind = T::KIND;

    fn set(&mut self, i: usize, mean_motion: f64, constants: &constants::Resonant) {
        let constants::Resonant::Yes {
            lambda,
            lambda_dot,
            sidereal_time,
            resonance,
        } = constants
        else {
            return;
        };
        (self.mean_motion_0[i], self.mean_motion[i]) = (mean_motion, mean_motion);
        (self.lambda_0[i], self.lambda[i]) = (*lambda, *lambda);
        self.lambda_dot[i] = *lambda_dot;
        self.sidereal_time[i] = *sidereal_time;
        self.a0[i] = libm::cbrt(KE / mean_motion).powi(2);
        self.t[i] = 0.0;
        self.terms.set(i, resonance);
    }

    #[inline(always)]
    fn advance<S: Simd>(&mut self, part: Part<S>, secular: &Secular, t: Lanes<S>) {
        let Integrated { at, n, lambda } = self.near(part, secular, t);
        part.store(&mut self.t, at);
        part.store(&mut self.mean_motion, n);
        part.store(&mut self.lambda, lambda);
    }

    #[inline(always)]
    fn unperturbed<S: Simd>(
        &self,
        part: Part<S>,
        secular: &Secular,
        t: Lanes<S>,
        p22_p23: [Lanes<S>; 2],
    ) -> Unperturbed<S> {
        let Integrated { at, n, lambda } = self.near(part, secular, t);
        let rate = n + part.load(&self.lambda_dot);
        let Pull { n_dot, slope } = self.terms.pull(part, secular, lambda, at);
        let left = t - at;
        let half = left * left * 0.5;
        // p28 = (ke / (n + n' dt + n'' dt^2 / 2))^(2/3); lambda + lambda' dt + n' dt^2 / 2
        let motion = (slope * rate).mul_add(half, n_dot.mul_add(left, n));
        let lambda = lambda + rate * left + n_dot * half;
        let theta = t * SIDEREAL_SPEED + part.load(&self.sidereal_time);
        Unperturbed {
            a: major_axis(motion, part.load(&self.a0)),
            mean_anomaly: T::mean_anomaly(lambda, p22_p23, theta.within_a_turn()),
            is_valid: part.splat(0.0).less_than(motion),
        }
    }
}

/// a = (ke / n)^(2/3), Earth radii, by Newton's method on a^3 n^2 = ke^2 from a guess; undefined
/// where n is not above 0.
#[inline(always)]
fn major_axis<S: Simd>(n: Lanes<S>, guess: Lanes<S>) -> Lanes<S> {
    const STEPS: usize = 60;
    const DIGITS: f64 = 4e-16;
    let mut a = guess;
    let ratio = n.splat(KE) / n;
    let square = ratio.squared();
    let mut moving = n.splat(0.0).less_than(n);
    for _ in 0..STEPS {
        if !moving.any() {
            break;
        }
        // a <- a - (a - (ke / n a)^2) / 3
        let change = (a - square / a.squared()) * (1.0 / 3.0);
        a = moving.select(a - change, a);
        moving = moving.and((a * DIGITS).less_than(change.abs()));
    }
    a
}

/// n', and d n' / d lambda.
pub(crate) struct Pull<S: Simd> {
    n_dot: Lanes<S>,
    slope: Lanes<S>,
}

impl<S: Simd> Pull<S> {
    #[inline(always)]
    fn none(part: Part<S>) -> Self {
        let (n_dot, slope) = (part.splat(0.0), part.splat(0.0));
        Pull { n_dot, slope }
    }

    /// Adds a term d sin(angle), whose angle changes `m` times as fast as lambda.
    #[inline(always)]
    fn and(self, d: Lanes<S>, angle: Lanes<S>, m: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            n_dot: d.mul_add(sin, self.n_dot),
            slope: (d * m).mul_add(cos, self.slope),
        }
    }
}

/// dr1, dr2, dr3.
#[derive(Clone, Debug, Default)]
pub(crate) struct OneDayTerms([Row; 3]);

impl Terms for OneDayTerms {
    const KIND: OrbitKind = OrbitKind::OneDay;

    fn set(&mut self, i: usize, constants: &constants::Resonance) {
        if let constants::Resonance::OneDay(dr) = constants {
            for (row, dr) in self.0.iter_mut().zip(dr) {
                row[i] = *dr;
            }
        }
    }

    /// n' = dr1 sin(l - l31) + dr2 sin 2(l - l22) + dr3 sin 3(l - l33).
    #[inline(always)]
    fn pull<S: Simd>(&self, part: Part<S>, _: &Secular, lambda: Lanes<S>, _: Lanes<S>) -> Pull<S> {
        let [dr1, dr2, dr3] = part.load_three(&self.0);
        Pull::none(part)
            .and(dr1, lambda - part.splat(LAMBDA31), 1.0)
            .and(dr2, (lambda - part.splat(LAMBDA22)) * 2.0, 2.0)
            .and(dr3, (lambda - part.splat(LAMBDA33)) * 3.0, 3.0)
    }

    /// p29 = lambda - p22 - p23 + theta.
    #[inline(always)]
    fn mean_anomaly<S: Simd>(
        lambda: Lanes<S>,
        [p22, p23]: [Lanes<S>; 2],
        theta: Lanes<S>,
    ) -> Lanes<S> {
        lambda - p22 - p23 + theta
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct HalfDayTerms {
    d: [Row; 10],
    /// k14: the perigee's rate by the Earth alone, rad/min.
    perigee_dot: Row,
}

impl Terms for HalfDayTerms {
    const KIND: OrbitKind = OrbitKind::HalfDay;

    fn set(&mut self, i: usize, constants: &constants::Resonance) {
        if let constants::Resonance::HalfDay([d @ .., k14]) = constants {
            for (row, d) in self.d.iter_mut().zip(d) {
                row[i] = *d;
            }
            self.perigee_dot[i] = *k14;
        }
    }

    /// n' = sum D sin((l - 2p) w + m/2 lambda - G).
    #[inline(always)]
    fn pull<S: Simd>(
        &self,
        part: Part<S>,
        secular: &Secular,
        lambda: Lanes<S>,
        at: Lanes<S>,
    ) -> Pull<S> {
        let perigee_dot = part.load(&self.perigee_dot);
        let w = perigee_dot.mul_add(at, part.load(&secular.perigee));
        let mut all = Pull::none(part);
        // factors of w and lambda, and phases
        const TERMS: [(f64, f64, f64); 10] = [
            (2.0, 1.0, G22),
            (0.0, 1.0, G22),
            (1.0, 1.0, G32),
            (-1.0, 1.0, G32),
            (2.0, 2.0, G44),
            (0.0, 2.0, G44),
            (1.0, 1.0, G52),
            (-1.0, 1.0, G52),
            (1.0, 2.0, G54),
            (-1.0, 2.0, G54),
        ];
        for (d, (of_w, of_lambda, phase)) in self.d.iter().zip(TERMS) {
            let angle = w * of_w + lambda * of_lambda - part.splat(phase);
            all = all.and(part.load(d), angle, of_lambda);
        }
        all
    }

    /// p29 = lambda - 2 p22 + 2 theta.
    #[inline(always)]
    fn mean_anomaly<S: Simd>(
        lambda: Lanes<S>,
        [p22, _]: [Lanes<S>; 2],
        theta: Lanes<S>,
    ) -> Lanes<S> {
        lambda - (p22 + p22) + (theta + theta)
    }
}
