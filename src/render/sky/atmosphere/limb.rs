//! The atmosphere's light for one frame, in tables by direction.
//!
//! Terms that depend on the line alone (its air, its airglow) are in one-dimensional tables of
//! logarithms. The factors of sunlight are in rows by the Sun's elevation at the line's reference
//! point, for a few lines only, since they change slowly from line to line.

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

/// Points along a line, and entries of the two tables for the three kinds of lines: to the ground,
/// past the Earth, and upwards.
const POINTS: usize = 32;
const SCATTERED: [usize; 3] = [16, 72, 12];
const AIRGLOW: [usize; 3] = [24, 192, 16];
/// Lines with a row: cosines at the ground, altitudes (m), cosines at the observer.
const GROUND_ROWS: [f64; 7] = [0.0, 0.06, 0.14, 0.25, 0.4, 0.65, 1.0];
const PAST_ROWS_M: [f64; 14] = [
    0.0, 4e3, 8e3, 13e3, 19e3, 26e3, 34e3, 44e3, 58e3, 80e3, 120e3, 200e3, 400e3, TOP_M,
];
const UP_ROWS: [f64; 4] = [0.0, 0.15, 0.4, 1.0];

/// The light of the atmosphere around the Earth, for one observer at one time.
#[derive(Debug, Clone)]
pub struct Limb {
    atmosphere: Arc<Atmosphere>,
    earth: Earth,
    /// Unit vectors: to the Sun, in space; to the observer's zenith and to the Sun, in stretched
    /// space.
    to_sun: Vector3<f64>,
    zenith: Vector3<f64>,
    sun: Vector3<f64>,
    /// The cosine of the angle between `zenith` and `sun`.
    along: f64,
    /// The observer's distance from the centre of stretched space, m.
    radius: f64,
    /// The Sun's irradiance relative to that at 1 au, over 4 pi (1/sr).
    sun_factor: f64,
    /// Scale of the table of lines past the Earth: relative altitude up to which entries are nearly
    /// equidistant, and the logarithm at the greatest altitude.
    near: f64,
    far: f64,
    /// Tables of each kind of line, computed on first use.
    kinds: [OnceLock<Kind>; 3],
}

/// Tables of one kind of line.
#[derive(Debug, Clone)]
struct Kind {
    /// Scattered light with undimmed sunlight at every point, 4 pi L, at 1 au; airglow;
    /// ph/s/m^2/sr.
    scattered: Table,
    airglow: Table,
    /// Lines with a row, and the rows, computed on first use.
    lines: Vec<f64>,
    rows: Vec<OnceLock<SunlitLine>>,
}

/// A line with a row.
#[derive(Debug, Clone)]
struct SunlitLine {
    row: Row,
    line: Line,
    /// The air along it, from the observer on.
    segments: Vec<Segment>,
}

impl Limb {
    /// The light of `atmosphere` around the Earth from `observer_m`, lit from `sun_m`
    /// ([`Bodies::sun_apparent_m`](crate::sky::bodies::Bodies::sun_apparent_m)); both GCRF, m. None
    /// for an observer inside the Earth.
    ///
    /// A direction takes 0.1 us, and some 10 us more if it needs new table entries: 2 ms for all.
    /// Make one per frame.
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
            sun_factor: AU_M * AU_M / sun_m.norm_squared() / (4.0 * PI),
            near: 0.0,
            far: 0.0,
            kinds: Default::default(),
        };
        let near_m = if limb.inside() { NEAR_M / 2.0 } else { NEAR_M };
        limb.near = near_m / limb.highest_m();
        limb.far = libm::log(1.0 + 1.0 / limb.near);
        Some(limb)
    }

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

    /// Radiance along `direction` (GCRF axes, any length) in the band, ph/s/m^2/sr. For a line to
    /// the ground, the light of the air in front of it.
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
            let sunlit = rows[i].get_or_init(move || self.sunlit(kind, lines[i]));
            let parts = move |sin_elevation| self.sun_along(sunlit, sin_elevation);
            *side = sunlit.row.at([along, across], parts);
        }
        let [[direct, from_below], next] = sides;
        let direct = direct + (next[0] - direct) * part;
        let from_below = from_below + (next[1] - from_below) * part;
        let cos_scattering = direction.dot(&self.to_sun) / direction.norm();
        let sunlit = phase_function(cos_scattering) * direct + from_below;
        [scattered * self.sun_factor * sunlit, airglow]
    }

    /// The transmission (0..1) of the air for the light of the Earth's disc in `direction`.
    ///
    /// The whole optical depth toward the observer counts, since light scattered into the line is
    /// in [`Limb::radiance`]. Of the depth toward the Sun half counts: half of the scattered light
    /// continues to the ground (a symmetric phase function, two streams; Coakley & Chylek 1975, J.
    /// Atmos. Sci. 32, 409). Seen from straight above, the disc with its air has the albedo of the
    /// disc within 5 %, from 400 nm on while the Sun is more than 20 deg high. On slant lines, with
    /// a low Sun behind the observer, it is up to 18 % brighter.
    pub fn ground_transmission(&self, direction: &Vector3<f64>) -> f64 {
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

    /// Minimum and maximum angle (rad) of the atmosphere's edge from the direction of the Earth's
    /// centre; pi for an observer inside it.
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

    /// The kind of a line and its coordinate within the kind.
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

    /// Greatest altitude of a line past the Earth: at most the observer's own.
    fn highest_m(&self) -> f64 {
        (self.radius - EARTH_RADIUS_M).clamp(1.0, TOP_M)
    }

    /// Position of a coordinate in its table, 0..1. Altitudes are spaced logarithmically; from
    /// inside the atmosphere also by the dip, near the observer's own altitude.
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

    /// `integral n sum E s exp(-s N_v) dl` along a line, ph/s/m^2: scattered light if the whole
    /// line were in undimmed sunlight, times 4 pi.
    fn undimmed(&self, line: &Line) -> f64 {
        let segments = self.segments(line);
        segments.iter().map(|segment| segment.undimmed).sum()
    }

    /// The air along a line, from the observer on.
    fn segments(&self, line: &Line) -> Vec<Segment> {
        let Atmosphere { air, scattered, .. } = &*self.atmosphere;
        let mut behind = 0.0;
        let segment = |step: Step| {
            let air = air.at(step.altitude);
            let molecules = air.molecules_m3 * step.length;
            let column = behind + molecules / 2.0;
            behind += molecules;
            Segment {
                step,
                air,
                molecules,
                column,
                undimmed: molecules * scattered.at(column),
            }
        };
        line.steps(POINTS).map(segment).collect()
    }

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

    /// A line, and its row for all elevations of the Sun.
    fn sunlit(&self, kind: usize, at: f64) -> SunlitLine {
        let line = Limb::sight(kind, at).line(self.radius);
        // The reference point is at p along the zenith of the lowest point and at s along the line.
        // That zenith is sin(zenith) - cos(horizontal).
        let position = line.position();
        let far = (line.p * line.p + position * position).sqrt();
        let weights = [
            (line.p * line.sin + position * line.cos) / far,
            (position * line.sin - line.p * line.cos) / far,
        ];
        let [along, max] = self.sun_above();
        let height = |across| weights[0] * along + weights[1] * across;
        SunlitLine {
            row: Row::of(weights, [height(-max), height(max)]),
            segments: self.segments(&line),
            line,
        }
    }

    /// Cosine and sine of the angle between the Sun and the observer's zenith.
    fn sun_above(&self) -> [f64; 2] {
        let cos = self.along;
        [cos, ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt()]
    }

    /// Light from direct sunlight and from the day side, relative to the undimmed light, for the
    /// sine `sin_elevation` of the Sun's elevation at the line's reference point.
    fn sun_along(&self, sunlit: &SunlitLine, sin_elevation: f64) -> [f64; 2] {
        let SunlitLine {
            row,
            line,
            segments,
        } = sunlit;
        let [along, max] = self.sun_above();
        let across = row.across(sin_elevation, along).clamp(-max, max);
        let Atmosphere { air, scattered, .. } = &*self.atmosphere;
        let lowest = line.sin * along - line.cos * across;
        let ahead = line.cos * along + line.sin * across;
        let [mut all, mut direct, mut from_below] = [0.0; 3];
        for segment in segments {
            all += segment.undimmed;
            let radius = EARTH_RADIUS_M + segment.step.altitude;
            let sin_elevation = (line.p * lowest + segment.step.s * ahead) / radius;
            let visible = visible_sun(radius, sin_elevation);
            if visible <= 0.0 {
                continue;
            }
            let to_sun = air.column_from(radius, segment.air, sin_elevation);
            direct += segment.molecules * visible * scattered.at(segment.column + to_sun);
            if sin_elevation > 0.0 {
                let part = (EARTH_RADIUS_M / radius).min(1.0);
                let sky = ((1.0 - part) * (1.0 + part)).sqrt();
                from_below += segment.undimmed * 2.0 * EARTH_ALBEDO * sin_elevation * (1.0 - sky);
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
struct Segment {
    step: Step,
    air: Density,
    /// Molecules per square metre across the line: its own, and from the observer to its middle.
    molecules: f64,
    column: f64,
    /// Scattered light with undimmed sunlight, 4 pi L, ph/s/m^2.
    undimmed: f64,
}

/// Altitude (m) up to which entries of lines past the Earth are nearly equidistant.
const NEAR_M: f64 = 60e3;

/// The fraction of the Sun's disc that the Earth does not hide from a point at `radius` (m);
/// `sin_elevation` is the sine of the Sun's elevation. It rises from 0 to 1 while the disc, of
/// radius SUN_RADIUS_M / AU_M (rad), clears the horizon.
fn visible_sun(radius: f64, sin_elevation: f64) -> f64 {
    if sin_elevation >= 0.0 {
        return 1.0;
    }
    let lowest = radius * ((1.0 - sin_elevation) * (1.0 + sin_elevation)).sqrt() - EARTH_RADIUS_M;
    let disc = -sin_elevation * radius * (SUN_RADIUS_M / AU_M);
    let part = ((lowest / disc.max(1.0) + 1.0) / 2.0).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}
