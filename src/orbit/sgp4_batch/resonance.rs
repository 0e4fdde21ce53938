//! Resonance of deep-space orbits with the Earth's turning: integrated from the epoch in steps of 720 min (Vallado et al., AIAA
//! 2006-6753; Hujsak 1979).
//!
//! Where the integrator stands depends on the number of steps alone: it may go on from where it stood, and begins anew where the time asked lies
//! before that.

use super::Site;
use super::figures;
use super::lanes::{Lanes, Part, Row, Truth};
use super::secular::Secular;
use pulp::Simd;

/// Length of a step, min.
const STEP: f64 = 720.0;
/// The Earth's turning, rad/min.
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

/// Semi-major axis (Earth radii) and mean anomaly (rad) before Sun, Moon and drag; and where there are any.
pub struct Unperturbed<S: Simd> {
    pub a: Lanes<S>,
    pub mean_anomaly: Lanes<S>,
    pub well: Truth<S>,
}

/// How the mean anomaly runs on.
pub trait Resonance: Default + Send + Sync {
    const SITE: Site;

    fn set(&mut self, i: usize, mean_motion: f64, figures: &figures::Resonant);

    /// Stands near `t` min after the epoch from now on.
    fn advance<S: Simd>(&mut self, _: Part<S>, _: &Secular, _: Lanes<S>) {}

    /// `t` min after the epoch; the node p22 and the perigee p23 are those of that time.
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
pub struct Free {
    a0: Row,
}

impl Resonance for Free {
    const SITE: Site = Site::Deep;

    fn set(&mut self, i: usize, _: f64, figures: &figures::Resonant) {
        if let figures::Resonant::No { a0 } = figures {
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
            well: t.at_most(t),
        }
    }
}

/// The integrator of a block: where it began, and where it stands.
#[derive(Clone, Debug, Default)]
struct Integrator {
    mean_motion_0: Row,
    lambda_0: Row,
    lambda_dot: Row,
    sidereal_time: Row,
    a0: Row,
    t: Row,
    mean_motion: Row,
    lambda: Row,
}

/// Resonance with a whole day.
#[derive(Clone, Debug, Default)]
pub struct OneDay {
    integrator: Integrator,
    dr: [Row; 3],
}

/// Resonance with half a day.
#[derive(Clone, Debug, Default)]
pub struct HalfDay {
    integrator: Integrator,
    d: [Row; 10],
    /// k14: the perigee's rate by the Earth alone, rad/min.
    perigee_dot: Row,
}

/// Where an integrator stands: min after the epoch, rad/min, rad.
struct Standing<S: Simd> {
    at: Lanes<S>,
    n: Lanes<S>,
    lambda: Lanes<S>,
}

impl Integrator {
    /// Sets an object, and gives its resonance.
    fn set<'a>(
        &mut self,
        i: usize,
        mean_motion: f64,
        figures: &'a figures::Resonant,
    ) -> Option<&'a figures::Resonance> {
        let figures::Resonant::Yes {
            lambda,
            lambda_dot,
            sidereal_time,
            resonance,
        } = figures
        else {
            return None;
        };
        (self.mean_motion_0[i], self.mean_motion[i]) = (mean_motion, mean_motion);
        (self.lambda_0[i], self.lambda[i]) = (*lambda, *lambda);
        self.lambda_dot[i] = *lambda_dot;
        self.sidereal_time[i] = *sidereal_time;
        self.a0[i] = libm::cbrt(KE / mean_motion).powi(2);
        self.t[i] = 0.0;
        Some(resonance)
    }

    /// Where it stands.
    #[inline(always)]
    fn standing<S: Simd>(&self, part: Part<S>) -> Standing<S> {
        Standing {
            at: part.load(&self.t),
            n: part.load(&self.mean_motion),
            lambda: part.load(&self.lambda),
        }
    }

    /// Stands near `t` from now on.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, part: Part<S>, t: Lanes<S>, terms: impl Terms<S>) {
        let Standing { at, n, lambda } = self.near(part, t, &terms);
        part.store(&mut self.t, at);
        part.store(&mut self.mean_motion, n);
        part.store(&mut self.lambda, lambda);
    }

    /// Where it stands within a step before `t`.
    #[inline(always)]
    fn near<S: Simd>(&self, part: Part<S>, t: Lanes<S>, terms: &impl Terms<S>) -> Standing<S> {
        let zero = part.splat(0.0);
        let Standing {
            mut at,
            mut n,
            mut lambda,
        } = self.standing(part);
        // Anew, where t lies before, or on the other side of the epoch.
        let onward = zero.at_most(at * t).and(at.abs().at_most(t.abs()));
        at = onward.select(at, zero);
        n = onward.select(n, part.load(&self.mean_motion_0));
        lambda = onward.select(lambda, part.load(&self.lambda_0));

        let lambda_dot = part.load(&self.lambda_dot);
        let step = zero
            .less_than(t)
            .select(part.splat(STEP), part.splat(-STEP));
        let half = part.splat(STEP * STEP / 2.0);
        loop {
            let on = step.abs().at_most((t - at).abs());
            if !on.any() {
                return Standing { at, n, lambda };
            }
            // n += n' dt + n'' dt^2 / 2; lambda += lambda' dt + n' dt^2 / 2, rounded as in the scalar model: a century has 73,000
            // steps, whose rounding would outweigh all else.
            let rate = n + lambda_dot;
            let Pull { n_dot, slope } = terms.pull(lambda, at);
            let next = n + (n_dot * step + slope * rate * half);
            let further = lambda + (rate * step + n_dot * half);
            n = on.select(next, n);
            lambda = on.select(further, lambda);
            at = on.select(at + step, at);
        }
    }

    /// At `t`: a, and lambda as the mean anomaly.
    #[inline(always)]
    fn run<S: Simd>(&self, part: Part<S>, t: Lanes<S>, terms: impl Terms<S>) -> Unperturbed<S> {
        let Standing { at, n, lambda } = self.near(part, t, &terms);
        let rate = n + part.load(&self.lambda_dot);
        let Pull { n_dot, slope } = terms.pull(lambda, at);
        let left = t - at;
        let half = left * left * 0.5;
        // p28 = (ke / (n + n' dt + n'' dt^2 / 2))^(2/3); lambda + lambda' dt + n' dt^2 / 2
        let motion = (slope * rate).mul_add(half, n_dot.mul_add(left, n));
        Unperturbed {
            a: major_axis(motion, part.load(&self.a0)),
            mean_anomaly: lambda + rate * left + n_dot * half,
            well: part.splat(0.0).less_than(motion),
        }
    }

    /// The Earth's turning at `t`, rad, within a turn.
    #[inline(always)]
    fn sidereal_time_at<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Lanes<S> {
        let angle = t * SIDEREAL_SPEED + part.load(&self.sidereal_time);
        angle.within_a_turn()
    }
}

/// a = (ke / n)^(2/3), Earth radii, by Newton's method on a^3 n^2 = ke^2 from a guess; anything where n is not above 0.
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

impl OneDay {
    #[inline(always)]
    fn terms<S: Simd>(&self, part: Part<S>) -> OneDayTerms<S> {
        OneDayTerms {
            dr: part.load_three(&self.dr),
        }
    }
}

impl Resonance for OneDay {
    const SITE: Site = Site::OneDay;

    fn set(&mut self, i: usize, mean_motion: f64, figures: &figures::Resonant) {
        if let Some(figures::Resonance::OneDay(dr)) = self.integrator.set(i, mean_motion, figures) {
            for (row, dr) in self.dr.iter_mut().zip(dr) {
                row[i] = *dr;
            }
        }
    }

    #[inline(always)]
    fn advance<S: Simd>(&mut self, part: Part<S>, _: &Secular, t: Lanes<S>) {
        let terms = self.terms(part);
        self.integrator.advance(part, t, terms);
    }

    #[inline(always)]
    fn unperturbed<S: Simd>(
        &self,
        part: Part<S>,
        _: &Secular,
        t: Lanes<S>,
        [p22, p23]: [Lanes<S>; 2],
    ) -> Unperturbed<S> {
        let theta = self.integrator.sidereal_time_at(part, t);
        let mut there = self.integrator.run(part, t, self.terms(part));
        // p29 = lambda - p22 - p23 + theta
        there.mean_anomaly = there.mean_anomaly - p22 - p23 + theta;
        there
    }
}

impl HalfDay {
    #[inline(always)]
    fn terms<S: Simd>(&self, part: Part<S>, secular: &Secular) -> HalfDayTerms<S> {
        let mut d = [part.splat(0.0); 10];
        for (d, row) in d.iter_mut().zip(&self.d) {
            *d = part.load(row);
        }
        HalfDayTerms {
            d,
            perigee_0: part.load(&secular.perigee),
            perigee_dot: part.load(&self.perigee_dot),
        }
    }
}

impl Resonance for HalfDay {
    const SITE: Site = Site::HalfDay;

    fn set(&mut self, i: usize, mean_motion: f64, figures: &figures::Resonant) {
        if let Some(figures::Resonance::HalfDay(figures)) =
            self.integrator.set(i, mean_motion, figures)
        {
            let [d @ .., k14] = figures;
            for (row, d) in self.d.iter_mut().zip(d) {
                row[i] = *d;
            }
            self.perigee_dot[i] = *k14;
        }
    }

    #[inline(always)]
    fn advance<S: Simd>(&mut self, part: Part<S>, secular: &Secular, t: Lanes<S>) {
        let terms = self.terms(part, secular);
        self.integrator.advance(part, t, terms);
    }

    #[inline(always)]
    fn unperturbed<S: Simd>(
        &self,
        part: Part<S>,
        secular: &Secular,
        t: Lanes<S>,
        [p22, _]: [Lanes<S>; 2],
    ) -> Unperturbed<S> {
        let theta = self.integrator.sidereal_time_at(part, t);
        let mut there = self.integrator.run(part, t, self.terms(part, secular));
        // p29 = lambda - 2 p22 + 2 theta
        there.mean_anomaly = there.mean_anomaly - (p22 + p22) + (theta + theta);
        there
    }
}

/// n', and d n' / d lambda.
struct Pull<S: Simd> {
    n_dot: Lanes<S>,
    slope: Lanes<S>,
}

impl<S: Simd> Pull<S> {
    /// With a term more: d sin(angle), whose angle turns `m` times as fast as lambda.
    #[inline(always)]
    fn and(self, d: Lanes<S>, angle: Lanes<S>, m: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            n_dot: d.mul_add(sin, self.n_dot),
            slope: (d * m).mul_add(cos, self.slope),
        }
    }
}

/// What pulls at the mean motion.
trait Terms<S: Simd> {
    /// At lambda (rad), `at` min after the epoch.
    fn pull(&self, lambda: Lanes<S>, at: Lanes<S>) -> Pull<S>;
}

struct OneDayTerms<S: Simd> {
    dr: [Lanes<S>; 3],
}

impl<S: Simd> Terms<S> for OneDayTerms<S> {
    /// n' = dr1 sin(l - l31) + dr2 sin 2(l - l22) + dr3 sin 3(l - l33).
    #[inline(always)]
    fn pull(&self, lambda: Lanes<S>, _: Lanes<S>) -> Pull<S> {
        let [dr1, dr2, dr3] = self.dr;
        let zero = lambda.splat(0.0);
        let none = Pull {
            n_dot: zero,
            slope: zero,
        };
        none.and(dr1, lambda - lambda.splat(LAMBDA31), 1.0)
            .and(dr2, (lambda - lambda.splat(LAMBDA22)) * 2.0, 2.0)
            .and(dr3, (lambda - lambda.splat(LAMBDA33)) * 3.0, 3.0)
    }
}

struct HalfDayTerms<S: Simd> {
    d: [Lanes<S>; 10],
    perigee_0: Lanes<S>,
    perigee_dot: Lanes<S>,
}

impl<S: Simd> Terms<S> for HalfDayTerms<S> {
    /// n' = sum D sin((l - 2p) w + m/2 lambda - G).
    #[inline(always)]
    fn pull(&self, lambda: Lanes<S>, at: Lanes<S>) -> Pull<S> {
        let w = self.perigee_dot.mul_add(at, self.perigee_0);
        let zero = lambda.splat(0.0);
        let mut all = Pull {
            n_dot: zero,
            slope: zero,
        };
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
            let angle = w * of_w + lambda * of_lambda - lambda.splat(phase);
            all = all.and(*d, angle, of_lambda);
        }
        all
    }
}
