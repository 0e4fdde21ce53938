//! The atmosphere's light for one frame, as tables that a direction looks up.
//!
//! What depends on the line alone (how much air it meets, how much airglow) stands in tables of one
//! dimension, in logarithms; the Sun's part of it in rows against the Sun's height over the line's
//! place, for some lines only: it changes slowly from one to the next.

use super::air::{Density, TOP_M, phase_function};
use super::model::Atmosphere;
use super::sight::{Line, Sight, Step};
use super::tables::{Row, Table, between};
use crate::sky::bodies::{AU_M, SUN_RADIUS_M};
use crate::sky::earth_light::EARTH_ALBEDO;
use crate::sky::shadow::{EARTH_RADIUS_M, Earth};
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

/// Points along a line, and entries of the two tables: lines before the ground, past the Earth, and
/// upwards.
const POINTS: usize = 32;
const SCATTERED: [usize; 3] = [16, 72, 12];
const AIRGLOW: [usize; 3] = [24, 192, 16];
/// Lines of which there is a row: cosines at the ground, altitudes (m), cosines at the observer.
const GROUND_ROWS: [f64; 7] = [0.0, 0.06, 0.14, 0.25, 0.4, 0.65, 1.0];
const PAST_ROWS_M: [f64; 14] = [
    0.0, 4e3, 8e3, 13e3, 19e3, 26e3, 34e3, 44e3, 58e3, 80e3, 120e3, 200e3, 400e3, TOP_M,
];
const UP_ROWS: [f64; 4] = [0.0, 0.15, 0.4, 1.0];

/// The light of the atmosphere around the Earth, from one place at one time.
#[derive(Debug, Clone)]
pub struct Limb {
    atmosphere: Arc<Atmosphere>,
    earth: Earth,
    /// Unit vectors: to the Sun, in space; to the observer's zenith and to the Sun, in stretched
    /// space.
    to_sun: Vector3<f64>,
    zenith: Vector3<f64>,
    sun: Vector3<f64>,
    /// The cosine of the angle between these two.
    along: f64,
    /// The observer's distance from the centre of stretched space, m.
    radius: f64,
    /// The Sun's light over that at 1 au, of which a steradian takes its part (1/sr).
    nearness: f64,
    /// Of lines past the Earth: up to which part of the greatest altitude entries are nearly even,
    /// and the logarithm that the greatest has then.
    near: f64,
    far: f64,
    /// Of each kind of line what has been asked for.
    kinds: [OnceLock<Kind>; 3],
}

/// What lines of one kind meet.
#[derive(Debug, Clone)]
struct Kind {
    /// Scattered light where the Sun reaches every point undimmed, 4 pi L, at 1 au; airglow;
    /// ph/s/m^2/sr.
    scattered: Table,
    airglow: Table,
    /// Lines of which there is a row, and those rows that have been asked for.
    lines: Vec<f64>,
    rows: Vec<OnceLock<Lit>>,
}

/// A line of which there is a row.
#[derive(Debug, Clone)]
struct Lit {
    row: Row,
    line: Line,
    /// The air along it, from the observer on.
    parcels: Vec<Parcel>,
}

impl Limb {
    /// The light of `atmosphere` around the Earth from `observer_m`, lit from `sun_m`
    /// ([`Bodies::sun_apparent_m`](crate::sky::bodies::Bodies::sun_apparent_m)); both GCRF, m. None
    /// for an observer inside the Earth.
    ///
    /// Directions cost 0.1 us each, and the first of their kind and height some 10 us more, for
    /// tables: 2 ms for all. Make it once a frame.
    pub fn new(
        atmosphere: &Arc<Atmosphere>,
        observer_m: Vector3<f64>,
        sun_m: Vector3<f64>,
        earth: Earth,
    ) -> Option<Limb> {
        if earth.contains(observer_m) {
            return None;
        }
        let observer = earth.to_sphere(observer_m);
        let radius = observer.norm();
        let zenith = observer / radius;
        let sun = earth.to_sphere(sun_m).normalize();
        let mut limb = Limb {
            atmosphere: atmosphere.clone(),
            earth,
            to_sun: sun_m.normalize(),
            zenith,
            sun,
            along: zenith.dot(&sun),
            radius,
            nearness: AU_M * AU_M / sun_m.norm_squared() / (4.0 * PI),
            near: 0.0,
            far: 0.0,
            kinds: Default::default(),
        };
        let near_m = if limb.inside() { NEAR_M / 2.0 } else { NEAR_M };
        limb.near = near_m / limb.highest_m();
        limb.far = libm::log(1.0 + 1.0 / limb.near);
        Some(limb)
    }

    /// What lines of a kind meet.
    fn kind(&self, kind: usize) -> &Kind {
        self.kinds[kind].get_or_init(|| {
            let lines = self.lines(kind);
            Kind {
                scattered: Table::of(SCATTERED[kind]),
                airglow: Table::of(AIRGLOW[kind]),
                rows: lines.iter().map(|_| OnceLock::new()).collect(),
                lines,
            }
        })
    }

    /// Radiance along `direction` (GCRF axes, any length) in the band, ph/s/m^2/sr; where the line
    /// ends on the ground, what the air before it adds.
    pub fn radiance(&self, direction: &Vector3<f64>) -> f64 {
        let [scattered, airglow] = self.parts(direction);
        scattered + airglow
    }

    /// [`Limb::radiance`] by scattered sunlight, and by airglow.
    pub fn parts(&self, direction: &Vector3<f64>) -> [f64; 2] {
        let stretched = self.earth.to_sphere(*direction).normalize();
        let (cos, sin) = self.angles(&stretched);
        let Some((kind, at)) = self.coordinate(Sight::of(self.radius, cos, sin)) else {
            return [0.0, 0.0];
        };
        let entry = self.entry(kind, at);
        let along = self.along;
        let across = if sin > 0.0 {
            (stretched.dot(&self.sun) - cos * along) / sin
        } else {
            0.0
        };
        let Kind {
            scattered,
            airglow,
            lines,
            rows,
        } = self.kind(kind);
        let scattered = scattered.at(entry, move |entry| {
            self.undimmed(&self.line_at(kind, entry))
        });
        let airglow = airglow.at(entry, move |entry| self.airglow(&self.line_at(kind, entry)));
        let (first, part) = between(lines, at);
        let mut sides = [[0.0; 2]; 2];
        for (i, side) in (first..).zip(&mut sides) {
            let lit = rows[i].get_or_init(move || self.lit(kind, lines[i]));
            let parts = move |height| self.sun_along(lit, height);
            *side = lit.row.at([along, across], parts);
        }
        let [[direct, from_below], there] = sides;
        let direct = direct + (there[0] - direct) * part;
        let from_below = from_below + (there[1] - from_below) * part;
        let cos_scattering = direction.dot(&self.to_sun) / direction.norm();
        let sunlit = phase_function(cos_scattering) * direct + from_below;
        [scattered * self.nearness * sunlit, airglow]
    }

    /// The part (0..1) of the light of the Earth's disc in `direction` that remains behind and
    /// below the air.
    ///
    /// All of the optical depth toward the observer counts, for what air scatters into the line is
    /// in [`Limb::radiance`], but half of that toward the Sun: half of what air scatters there goes
    /// on to the ground (a symmetric phase function, two streams; Coakley & Chylek 1975, J. Atmos.
    /// Sci. 32, 409). Seen from straight above, the two together keep the albedo that the disc has
    /// with its air, within 5 % from 400 nm on while the Sun is more than 20 deg high; at a slant,
    /// the Sun low behind, air adds up to 18 %.
    pub fn ground_share(&self, direction: &Vector3<f64>) -> f64 {
        let stretched = self.earth.to_sphere(*direction).normalize();
        let (cos, sin) = self.angles(&stretched);
        let Sight::Ground(slant) = Sight::of(self.radius, cos, sin) else {
            return 1.0;
        };
        let line = Sight::Ground(slant).line(self.radius);
        let ground = (self.zenith * self.radius + stretched * (line.to - self.radius * cos))
            / EARTH_RADIUS_M;
        let air = &self.atmosphere.air;
        let to_sun = air.column(0.0, ground.dot(&self.sun).max(0.0));
        self.atmosphere
            .passed
            .at(air.column(0.0, slant) + 0.5 * to_sun)
    }

    /// The least and the greatest angle (rad) from the direction of the Earth's centre at which the
    /// atmosphere ends; pi for an observer inside it.
    pub fn edge(&self) -> [f64; 2] {
        self.earth
            .outline(self.earth.unstretched(self.zenith * self.radius), TOP_M)
    }

    /// Cosine and sine of the angle between a direction and the zenith, stretched space.
    fn angles(&self, stretched: &Vector3<f64>) -> (f64, f64) {
        let cos = self.zenith.dot(stretched);
        (cos, self.zenith.cross(stretched).norm())
    }

    fn inside(&self) -> bool {
        self.radius < EARTH_RADIUS_M + TOP_M
    }

    /// The kind of a line and its coordinate among its kind.
    fn coordinate(&self, sight: Sight) -> Option<(usize, f64)> {
        match sight {
            Sight::Ground(cos) => Some((0, cos)),
            Sight::Past(altitude_m) => Some((1, altitude_m)),
            Sight::Up(cos) => Some((2, cos)),
            Sight::Away => None,
        }
    }

    fn sight(kind: usize, at: f64) -> Sight {
        match kind {
            0 => Sight::Ground(at),
            1 => Sight::Past(at),
            _ => Sight::Up(at),
        }
    }

    /// Altitudes of lines past the Earth: at most the observer's own.
    fn highest_m(&self) -> f64 {
        (self.radius - EARTH_RADIUS_M).clamp(1.0, TOP_M)
    }

    /// Where a coordinate stands in its table, 0..1: altitudes evenly in their logarithm; from
    /// inside also evenly in the dip, near the observer's own.
    fn entry(&self, kind: usize, at: f64) -> f64 {
        if kind != 1 {
            return at;
        }
        let highest = self.highest_m();
        let part = if self.inside() {
            1.0 - (1.0 - at / highest).max(0.0).sqrt()
        } else {
            at / highest
        };
        libm::log(1.0 + part / self.near) / self.far
    }

    /// The inverse of [`Limb::entry`].
    fn coordinate_of(&self, kind: usize, entry: f64) -> f64 {
        if kind != 1 {
            return entry;
        }
        let highest = self.highest_m();
        let part = self.near * libm::expm1(entry * self.far);
        if self.inside() {
            highest * part * (2.0 - part)
        } else {
            highest * part
        }
    }

    /// The line at 0..1 of a kind's table.
    fn line_at(&self, kind: usize, entry: f64) -> Line {
        Limb::sight(kind, self.coordinate_of(kind, entry)).line(self.radius)
    }

    /// Airglow along a line, ph/s/m^2/sr.
    fn airglow(&self, line: &Line) -> f64 {
        let atmosphere = &*self.atmosphere;
        (atmosphere.shells).along(line, self.radius, &atmosphere.air, &atmosphere.passed)
    }

    /// `integral n sum E s exp(-s N_v) dl` along a line, ph/s/m^2: scattered light if the Sun
    /// reached it all, times 4 pi.
    fn undimmed(&self, line: &Line) -> f64 {
        self.parcels(line)
            .iter()
            .map(|parcel| parcel.undimmed)
            .sum()
    }

    /// The air along a line, from the observer on.
    fn parcels(&self, line: &Line) -> Vec<Parcel> {
        let Atmosphere { air, scattered, .. } = &*self.atmosphere;
        let mut behind = 0.0;
        let parcel = |step: Step| {
            let air = air.at(step.altitude);
            let molecules = air.molecules_m3 * step.length;
            let column = behind + molecules / 2.0;
            behind += molecules;
            Parcel {
                step,
                air,
                molecules,
                column,
                undimmed: molecules * scattered.at(column),
            }
        };
        line.steps(POINTS).map(parcel).collect()
    }

    /// The lines of a kind of which there are rows.
    fn lines(&self, kind: usize) -> Vec<f64> {
        match kind {
            0 => GROUND_ROWS.to_vec(),
            1 => {
                let below = PAST_ROWS_M.iter().filter(|m| **m < self.highest_m());
                below.copied().chain([self.highest_m()]).collect()
            }
            _ => UP_ROWS.to_vec(),
        }
    }

    /// A line, and the row for all heights that the Sun can have over it.
    fn lit(&self, kind: usize, at: f64) -> Lit {
        let line = Limb::sight(kind, at).line(self.radius);
        // The place lies at p toward the lowest point's zenith and at s along the line; that zenith
        // is sin(zenith) - cos(horizontal).
        let position = line.position();
        let far = (line.p * line.p + position * position).sqrt();
        let weights = [
            (line.p * line.sin + position * line.cos) / far,
            (position * line.sin - line.p * line.cos) / far,
        ];
        let [along, most] = self.sun_above();
        let height = |across| weights[0] * along + weights[1] * across;
        Lit {
            row: Row::of(weights, [height(-most), height(most)]),
            parcels: self.parcels(&line),
            line,
        }
    }

    /// Cosine and sine of the angle between the Sun and the observer's zenith.
    fn sun_above(&self) -> [f64; 2] {
        let cos = self.along;
        [cos, ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt()]
    }

    /// The parts of the undimmed light that the Sun's direct light and the day side's give, the
    /// sine of the Sun's height over the line's place given.
    fn sun_along(&self, lit: &Lit, height: f64) -> [f64; 2] {
        let Lit { row, line, parcels } = lit;
        let [along, most] = self.sun_above();
        let across = row.across(height, along).clamp(-most, most);
        let Atmosphere { air, scattered, .. } = &*self.atmosphere;
        let lowest = line.sin * along - line.cos * across;
        let ahead = line.cos * along + line.sin * across;
        let [mut all, mut direct, mut from_below] = [0.0; 3];
        for parcel in parcels {
            all += parcel.undimmed;
            let radius = EARTH_RADIUS_M + parcel.step.altitude;
            let height = (line.p * lowest + parcel.step.s * ahead) / radius;
            let visible = visible_sun(radius, height);
            if visible <= 0.0 {
                continue;
            }
            let to_sun = air.column_from(radius, parcel.air, height);
            direct += parcel.molecules * visible * scattered.at(parcel.column + to_sun);
            if height > 0.0 {
                let part = (EARTH_RADIUS_M / radius).min(1.0);
                let sky = ((1.0 - part) * (1.0 + part)).sqrt();
                from_below += parcel.undimmed * 2.0 * EARTH_ALBEDO * height * (1.0 - sky);
            }
        }
        if all > 0.0 {
            [direct / all, from_below / all]
        } else {
            [0.0; 2]
        }
    }
}

/// The air of a part of a line.
#[derive(Debug, Clone, Copy)]
struct Parcel {
    step: Step,
    air: Density,
    /// Molecules a square metre across the line: its own, and from the observer to its middle.
    molecules: f64,
    column: f64,
    /// What it scatters if the Sun reaches it undimmed, 4 pi L, ph/s/m^2.
    undimmed: f64,
}

/// Altitude (m) up to which entries of the table of lines past the Earth are nearly even.
const NEAR_M: f64 = 60e3;

/// The part of the Sun's disc that is seen past the Earth from a point at `radius` (m), where the
/// sine of the Sun's height is `height`: from 0 to 1 while the Sun's disc, SUN_RADIUS_M / AU_M wide
/// to each side, clears the horizon.
fn visible_sun(radius: f64, height: f64) -> f64 {
    if height >= 0.0 {
        return 1.0;
    }
    let lowest = radius * ((1.0 - height) * (1.0 + height)).sqrt() - EARTH_RADIUS_M;
    let disc = -height * radius * (SUN_RADIUS_M / AU_M);
    let part = ((lowest / disc.max(1.0) + 1.0) / 2.0).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}
