//! `skyloop schema`: the JSON Schemas of files.

use super::common::say_json;
use clap::{Args as ClapArgs, ValueEnum};
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::label;

#[derive(ClapArgs)]
pub struct Args {
    /// Kind of file
    kind: Kind,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    /// Camera files
    Camera,
    /// Scene files, for `skyloop render --scene` and others
    Scene,
    /// Run files, for `skyloop run --config`, with the keys of scene files
    Run,
    /// Population files, named by `[objects]` of a scene
    Population,
    /// Lines of labels.jsonl
    Labels,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let schema = match args.kind {
        Kind::Camera => Camera::schema(),
        Kind::Scene => Config::schema("skyloop scene file"),
        Kind::Run => Config::schema("skyloop run file"),
        Kind::Population => Config::population_schema(),
        Kind::Labels => label::schema(),
    };
    say_json(&schema)
}
