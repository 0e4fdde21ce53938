//! Objects in orbit, their shapes and attitudes: `[objects]` of a scene, and its population file.

use super::shapes::{LIMITS, RawAttitude, RawShape, RawSphere, SCENE_LIMITS};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Needs, NotBoth, OneOf};
use skyloop_base::load::orbits::{FileCache, Findings, Pool, named};
use skyloop_base::load::{
    Check, ConfigError, Folder, Limit, advice, named_tables, read, schema_of, some_table,
    some_tables,
};
use skyloop_orbit::{Object, places};
use skyloop_render::sky::look::Body;
use skyloop_render::sky::photometry::Sphere;
use skyloop_render::sky::population::{Appearance, Appearances};
use skyloop_render::sky::shape::Shape;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The objects of a scene.
#[derive(Debug, Default)]
pub struct Objects {
    /// Orbits and names.
    pub objects: Vec<Object>,
    /// Shapes and spheres of some objects.
    pub looks: Appearances,
    /// Refusals and notices of their files.
    pub findings: Findings,
    /// The default sphere.
    pub sphere: Sphere,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RawObjects {
    /// Population file: objects with shapes and attitudes
    population: Option<String>,
    /// Orbit files (TLE, 3LE, OMM, OEM), or folders of them, in addition to the population
    files: Vec<String>,
    /// Diameter of the sphere for objects without an entry in the population, m
    diameter_m: f64,
    /// Reflectance of this sphere
    reflectance: f64,
    /// Diffuse part of the reflected light (B_diff)
    diffuse: f64,
    /// Specular part of the reflected light (B_spec)
    specular: f64,
}

impl Default for RawObjects {
    fn default() -> Self {
        let RawSphere {
            diameter_m,
            reflectance,
            diffuse,
            specular,
        } = RawSphere::default();
        RawObjects {
            population: None,
            files: Vec::new(),
            diameter_m,
            reflectance,
            diffuse,
            specular,
        }
    }
}

/// A valid population file with all required keys.
const EXAMPLE: &str = r#"
objects = []
[shapes.NAME]
parts = [{ kind = "sphere", diameter_m = 1.0 }]
[[spare.objects]]
attitude = { mode = "spin", q = [0.0, 0.0, 0.0, 1.0], utc = "2026-01-01T00:00:00Z", rates_deg_s = [0.0, 0.0, 0.0] }
"#;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawPopulation {
    /// The objects with their shapes.
    #[serde(default, deserialize_with = "some_tables")]
    objects: Option<Vec<RawEntry>>,
    /// Shapes by name.
    #[serde(default, deserialize_with = "named_tables")]
    shapes: BTreeMap<String, RawShape>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawEntry {
    /// All objects of these orbit files, or of folders of them
    files: Option<Vec<String>>,
    /// One object: FILE, or FILE:NAME by name, id or number
    object: Option<String>,
    /// A reflecting sphere.
    #[serde(default, deserialize_with = "some_table")]
    sphere: Option<RawSphere>,
    /// Instead of a sphere: the name of a shape of this file, with an attitude
    shape: Option<String>,
    /// Attitude of its shape.
    #[serde(default, deserialize_with = "some_table")]
    attitude: Option<RawAttitude>,
}

/// The JSON Schema of population files.
pub fn schema() -> schemars::Schema {
    schema_of::<RawPopulation>("skyloop population file", &[LIMITS, ENTRIES])
}

/// The keys that name the orbits of an entry, with their forms.
const ORBITS: [(&str, &str); 2] = [
    ("object", "object = \"FILE:NAME\""),
    ("files", "files = [\"FILE\", ...]"),
];

/// Rules between the keys of an entry.
const ENTRIES: &[Limit] = &[
    ("objects[]", OneOf(&ORBITS)),
    ("objects[]", NotBoth(["sphere", "shape"])),
    ("objects[]", Needs(["shape", "attitude"])),
    ("objects[]", Needs(["attitude", "shape"])),
];

impl RawObjects {
    /// The objects of the population file, followed by those of `files`.
    pub fn validate(self, check: &Check, folder: &Folder) -> Result<Objects, ConfigError> {
        let sphere = RawSphere {
            diameter_m: self.diameter_m,
            reflectance: self.reflectance,
            diffuse: self.diffuse,
            specular: self.specular,
        };
        let mut all = Objects {
            sphere: sphere.validate("objects", SCENE_LIMITS, check)?,
            ..Objects::default()
        };
        let mut entries = Entries::default();
        if let Some(name) = &self.population {
            let (file, text) = folder
                .read(name)
                .map_err(|error| check.explain("objects.population", error))?;
            let read = read(
                &file,
                &text,
                EXAMPLE,
                &[LIMITS, ENTRIES],
                |raw: RawPopulation, check| raw.entries(check, &folder.folder_of(name)),
            );
            entries = read.map_err(|error| check.named("objects.population", error))?;
        }
        for (i, name) in self.files.iter().enumerate() {
            let read = &mut entries.pool;
            read.read(folder, name, FILES, &mut entries.findings)
                .map_err(|error| check.explain(&format!("objects.files[{i}]"), error))?;
        }
        entries.add_to(&mut all);
        Ok(all)
    }
}

/// Ranks of orbits. The population file overrides `files`, and in it an entry for a single object
/// overrides those for files.
const ONE: u8 = 0;
const POPULATION: u8 = 1;
const FILES: u8 = 2;

/// The entries of a population file, and all orbits of a scene.
#[derive(Default)]
struct Entries {
    pool: Pool,
    /// Origin of each source in the pool that comes from the population file.
    sources: Vec<Origin>,
    findings: Findings,
}

/// The entry of a population file that a source comes from.
struct Origin {
    entry: usize,
    key: String,
    file: String,
    name: String,
    look: Appearance,
}

impl Entries {
    /// Refuses an object that two entries select.
    fn check_selected(&self, check: &Check) -> Result<(), ConfigError> {
        let selected = self.pool.of_rank(ONE);
        let groups = places(selected.clone().map(|(_, object)| object));
        let mut known = BTreeSet::new();
        for ((source, object), group) in selected.zip(groups) {
            if let Some(Origin { key, .. }) =
                self.sources.get(source).filter(|_| !known.insert(group))
            {
                let label = object.label();
                let reason =
                    format!("{label} is selected by an earlier entry: keep one of the two");
                return Err(check.explain(key, reason));
            }
        }
        Ok(())
    }

    /// Adds the objects, each with the shape or sphere of the first entry that has it.
    fn add_to(mut self, all: &mut Objects) {
        let united = self.pool.unite(&mut self.findings);
        let origin = |source: usize| self.sources.get(source);
        // The objects of a source that are also in earlier entries.
        let mut again: BTreeMap<(usize, &str), BTreeSet<usize>> = BTreeMap::new();
        for (index, source) in united.joined {
            let first = united.sources.get(index).and_then(|first| origin(*first));
            if let (Some(first), Some(origin)) = (first, origin(source))
                && first.entry < origin.entry
            {
                let indices = again.entry((origin.entry, &origin.key)).or_default();
                indices.insert(index);
            }
        }
        for ((entry, key), indices) in again {
            let objects = indices
                .iter()
                .filter_map(|index| united.objects.get(*index));
            let objects: Vec<&Object> = objects.collect();
            let mut origins = self.sources.iter();
            let Some(Origin { file, name, .. }) =
                origins.find(|it| it.entry == entry && it.key == key)
            else {
                continue;
            };
            let count = match objects.len() {
                1 => "1 object is".to_string(),
                count => format!("{count} objects are"),
            };
            let objects = named(&objects);
            self.findings.notices.push(format!(
                "{file}: {key}: {count} in {name} and in an earlier entry, whose sphere or shape is used ({objects}): leave the file \
                 out of one of the entries"
            ));
        }
        for (object, source) in united.objects.iter().zip(united.sources) {
            if let Some(Origin { look, .. }) = self.sources.get(source) {
                all.looks.insert(object.id.clone(), look.clone());
            }
        }
        all.objects.extend(united.objects);
        all.findings = self.findings;
    }
}

impl RawPopulation {
    /// Reads the entries. Objects of single entries are later left out of files of other entries.
    fn entries(self, check: &Check, folder: &Folder) -> Result<Entries, ConfigError> {
        let Some(listed) = self.objects else {
            let reason = "is missing: a population is a list of [[objects]], each with its files and what they look like; \
                          docs/how-to/populations.md has the form";
            return Err(check.explain("objects", reason));
        };
        let mut shapes = BTreeMap::new();
        for (name, raw) in self.shapes {
            let shape = raw.validate(&format!("shapes.{name}"), check)?;
            shapes.insert(name, shape);
        }
        let mut all = Entries::default();
        let mut cache = FileCache::new(folder);
        for (i, entry) in listed.into_iter().enumerate() {
            let key = format!("objects[{i}]");
            let look = entry.look(&key, &shapes, check)?;
            let mut origins = Vec::new();
            if let Some(selector) = &entry.object {
                let key = format!("{key}.object");
                let one = cache
                    .one(selector, &mut all.findings)
                    .map_err(|error| check.explain(&key, error))?;
                all.pool.push(one, ONE);
                origins.push((key, selector));
            }
            for (i, name) in entry.files.iter().flatten().enumerate() {
                let key = format!("{key}.files[{i}]");
                let read = all.pool.read(folder, name, POPULATION, &mut all.findings);
                read.map_err(|error| check.explain(&key, error))?;
                let sources = all.pool.len() - all.sources.len() - origins.len();
                origins.extend(std::iter::repeat_n((key, name), sources));
            }
            all.sources
                .extend(origins.into_iter().map(|(key, name)| Origin {
                    entry: i,
                    key,
                    file: check.file.to_owned(),
                    name: name.clone(),
                    look: look.clone(),
                }));
        }
        all.check_selected(check)?;
        Ok(all)
    }
}

impl RawEntry {
    /// The shape or sphere of the entry's objects.
    fn look(
        &self,
        key: &str,
        shapes: &BTreeMap<String, Shape>,
        check: &Check,
    ) -> Result<Appearance, ConfigError> {
        let sphere = self.sphere.as_ref();
        let sphere = sphere.map(|own| own.validate(&format!("{key}.sphere"), LIMITS, check));
        let attitude = self.attitude.as_ref();
        let attitude = attitude.map(|own| own.validate(&format!("{key}.attitude"), check));
        match (sphere.transpose()?, &self.shape, attitude.transpose()?) {
            (None, Some(name), Some(attitude)) => {
                let Some(shape) = shapes.get(name) else {
                    let known: Vec<&str> = shapes.keys().map(String::as_str).collect();
                    let allowed = if known.is_empty() {
                        format!("a shape of this file: add [shapes.{name}]")
                    } else {
                        format!("one of the shapes{}", advice(name, &known))
                    };
                    let error = check.refuse(&format!("{key}.shape"), format!("{name:?}"), allowed);
                    return Err(error.needs(&[&format!("shapes.{name}")]));
                };
                Ok(Appearance::Body(Arc::new(Body {
                    shape: shape.clone(),
                    attitude,
                })))
            }
            (None, None, None) => {
                let reason = "says nothing of its objects: give sphere = { diameter_m = ... }, or shape and attitude";
                Err(check.explain(key, reason))
            }
            // Rules between keys refuse all other combinations.
            (sphere, ..) => Ok(Appearance::Sphere(sphere.unwrap_or_default())),
        }
    }
}

#[cfg(test)]
pub(super) use tests::load as load_population;

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_base::load::{agree, both};

    pub fn load(text: &str) -> Option<String> {
        let folder = Folder::current();
        let read = read(
            "population.toml",
            text,
            EXAMPLE,
            &[LIMITS, ENTRIES],
            |raw: RawPopulation, check| raw.entries(check, &folder).map(drop),
        );
        read.err().map(|error| error.to_string())
    }

    fn population(entry: &str, part: &str) -> String {
        format!("[[objects]]\nfiles = [\"no\"]\n{entry}\n[shapes.NAME]\nparts = [{part}]\n")
    }

    const SPHERE: &str =
        "sphere = { diameter_m = 1.0, reflectance = 0.2, diffuse = 0.5, specular = 0.1 }";
    const BODY: &str = "shape = \"NAME\"\nattitude = { mode = \"spin\", q = [0.0, 0.0, 0.0, 1.0], utc = \"2026-01-01T00:00:00Z\", \
                        rates_deg_s = [0.0, 0.0, 0.0] }";

    #[test]
    fn the_schema_has_the_loaders_limits() {
        let bases = [
            population(
                SPHERE,
                "{ kind = \"box\", size_m = [1.0, 1.0, 1.0], reflectance = 0.2, diffuse = 0.5, specular = 0.1, lobe_deg = 5.0 }",
            ),
            population(
                BODY,
                "{ kind = \"plate\", area_m2 = 1.0, normal = [1.0, 0.0, 0.0], sun_axis = [0.0, 1.0, 0.0] }",
            ),
            population(
                BODY,
                "{ kind = \"cone\", axis = [1.0, 0.0, 0.0], diameter_m = 1.0, length_m = 1.0, top_diameter_m = 0.5, ends = \"both\" }",
            ),
        ];
        agree(
            &schema(),
            &[LIMITS, ENTRIES],
            &bases.each_ref().map(String::as_str),
            load,
        );
    }

    #[test]
    fn schema_and_loader_agree_on_keys_that_go_together() {
        let part = "{ kind = \"sphere\", diameter_m = 1.0 }";
        for (entry, part, is_valid) in [
            (&format!("object = \"x\"\n{SPHERE}")[..], part, false),
            (&format!("{SPHERE}\n{BODY}"), part, false),
            ("shape = \"NAME\"", part, false),
            ("attitude = { mode = \"nadir\" }", part, false),
            (
                "shape = \"NAME\"\nattitude = { mode = \"inertial\" }",
                part,
                false,
            ),
            (SPHERE, "{ kind = \"sphere\" }", false),
            (
                SPHERE,
                "{ kind = \"sphere\", diameter_m = 1.0, length_m = 1.0 }",
                false,
            ),
        ] {
            both(&schema(), &population(entry, part), load, is_valid);
        }
        both(&schema(), "objects = []", load, true);
    }
}
