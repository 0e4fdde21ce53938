//! Table A1 of Clark et al. 2021 (Sensors 21, 7868), reproduced row by row.

use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::label::{Label, ObjectLabel};
use skyloop::load::{DEFAULT_SCENE, Folder};

/// The published table: epoch, object, SBOIS pixel, STK pixel, SBOIS error, STK error.
/// `error = simulated - FAI`.
const PRINTED: &str = include_str!("../../configs/scenes/rcm-2019-06-15/table_a1.csv");
/// Time between the table's images, s.
const PERIOD_S: f64 = 5.0;

/// A pixel, or the difference of two.
pub type Pixel = [f64; 2];

/// One row.
#[derive(Debug, Clone)]
pub struct Row {
    /// UTC time of day.
    pub epoch: String,
    /// `HR6111` or `RCM-1`.
    pub object: String,
    /// Pixel of SBOIS, with its misprint corrected.
    pub sbois: Option<Pixel>,
    /// Pixel of STK-EOIR.
    pub stk: Pixel,
    /// STK-EOIR minus FAI, as printed.
    pub stk_error_printed: Pixel,
    /// Pixel of the real image: SBOIS minus its error, or STK minus its own where SBOIS has none.
    pub fai: Pixel,
    /// Pixel of skyloop.
    pub ours: Pixel,
}

impl Row {
    /// Whether it is one of the reference stars.
    pub fn is_star(&self) -> bool {
        self.object.starts_with("HR")
    }
}

/// Distance of two pixels, px.
pub fn distance(a: Pixel, b: Pixel) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Mean over the rows with a value.
pub fn mean<'a>(
    rows: impl IntoIterator<Item = &'a Row>,
    value: impl Fn(&Row) -> Option<f64>,
) -> f64 {
    let values: Vec<f64> = rows.into_iter().filter_map(value).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean distances of stars and of RSOs, px, with state sets B (`fitted`) and A (`predicted`): the
/// table of docs/explanation/accuracy.md.
pub fn mean_distances(fitted: &[Row], predicted: &[Row]) -> [(&'static str, [f64; 2]); 6] {
    let to_sbois = |row: &Row| row.sbois.map(|sbois| distance(row.ours, sbois));
    let to_fai = |row: &Row| Some(distance(row.ours, row.fai));
    // The published comparison has the misprint in the pixel and in the distance.
    let sbois_to_fai = |row: &Row| {
        let undone = f64::from(is_misprint(&row.epoch, &row.object));
        row.sbois.map(|[x, y]| distance([x, y - undone], row.fai))
    };
    let stk_to_fai = |row: &Row| Some(distance(row.stk, row.fai));
    [
        ("skyloop, state set B, to SBOIS", by_kind(fitted, to_sbois)),
        (
            "skyloop, state set A, to SBOIS",
            by_kind(predicted, to_sbois),
        ),
        ("skyloop, set B, to FAI", by_kind(fitted, to_fai)),
        ("skyloop, set A, to FAI", by_kind(predicted, to_fai)),
        ("SBOIS to FAI", by_kind(fitted, sbois_to_fai)),
        ("STK-EOIR to FAI", by_kind(fitted, stk_to_fai)),
    ]
}

fn by_kind(rows: &[Row], value: impl Fn(&Row) -> Option<f64>) -> [f64; 2] {
    [true, false].map(|stars| mean(rows.iter().filter(|row| row.is_star() == stars), &value))
}

/// Whether SBOIS's y is printed one pixel low: 171.8 where the row's error and its neighbours give
/// 172.8.
fn is_misprint(epoch: &str, object: &str) -> bool {
    (epoch, object) == ("23:36:00", "HR6195")
}

/// The scene with state set `A` (public elements) or `B` (fitted to the table's SBOIS columns).
pub fn scene(set: char) -> anyhow::Result<Config> {
    let folder = Folder::Embedded(DEFAULT_SCENE.0);
    let (file, text) = folder.read(DEFAULT_SCENE.1)?;
    let text = text.replace("-B.oem", &format!("-{set}.oem"));
    let mut config = Config::parse(&file, &text, &folder)?;
    if let Some(sequence) = &mut config.sequence {
        sequence.frames = sequence.attitudes.len() as u32;
        sequence.period_s = PERIOD_S;
    }
    Ok(config)
}

/// The table with our pixels, from the engine of `skyloop render`.
pub fn reproduce(mut config: Config) -> anyhow::Result<Vec<Row>> {
    let mission = flight::mission(&config)?;
    let mut emulator = Emulator::new(&mut config);
    let labels: Vec<Label> = (0..mission.frames)
        .map(|number| {
            anyhow::Ok(
                emulator
                    .expose(&flight::vehicle(&mission, number)?, 0)?
                    .label,
            )
        })
        .collect::<Result<_, _>>()?;
    PRINTED
        .lines()
        .skip(1)
        .map(|line| row(line, &labels))
        .collect()
}

fn row(line: &str, labels: &[Label]) -> anyhow::Result<Row> {
    let fields: Vec<&str> = line.split(',').collect();
    let [epoch, object, numbers @ ..] = &fields[..] else {
        anyhow::bail!("table_a1.csv: {line:?} has no epoch and object");
    };
    let numbers: Vec<Option<f64>> = numbers.iter().map(|n| n.parse().ok()).collect();
    let pixel = |at: usize| -> Option<Pixel> {
        Some([numbers.get(at).copied()??, numbers.get(at + 1).copied()??])
    };
    let missing = || anyhow::anyhow!("table_a1.csv: {line:?} lacks a number");
    let (stk, stk_error) = (pixel(2).ok_or_else(missing)?, pixel(6).ok_or_else(missing)?);
    let fai = match (pixel(0), pixel(4)) {
        (Some(sbois), Some(error)) => [sbois[0] - error[0], sbois[1] - error[1]],
        // RCM-2 at 23:35:55, where STK's error in x is printed with the wrong sign, as in the rows
        // next to it.
        _ => [stk[0] + stk_error[0], stk[1] - stk_error[1]],
    };
    let mut sbois = pixel(0);
    if is_misprint(epoch, object) {
        sbois = sbois.map(|[x, y]| [x, y + 1.0]);
    }
    let label = labels
        .iter()
        .find(|label| label.epoch_mid.contains(epoch))
        .ok_or_else(|| anyhow::anyhow!("no frame at {epoch}"))?;
    let name = object.replace("HR", "HR ");
    let named = |o: &&ObjectLabel| o.names.contains(&name) || o.id == name;
    let ours = label
        .objects
        .iter()
        .find(named)
        .ok_or_else(|| anyhow::anyhow!("{name} is not in the label of {epoch}"))?;
    Ok(Row {
        epoch: epoch.to_string(),
        object: object.to_string(),
        sbois,
        stk,
        stk_error_printed: stk_error,
        fai,
        ours: [ours.x_px, ours.y_px],
    })
}
