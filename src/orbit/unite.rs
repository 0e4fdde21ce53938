//! Objects of several sources, each once. All sources are read first: the last one may show that
//! earlier records are of one object.

use crate::{Object, Orbit, Rejected, identity};
use std::collections::HashMap;

/// The objects of a file, or of another source, one for each record or ephemeris.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Its name in messages; empty: none.
    pub name: String,
    /// In the order of the source.
    pub objects: Vec<Object>,
    /// The line that each begins at; may be shorter where the source has no lines.
    pub lines: Vec<usize>,
    /// An object of several sources is left out of those with a higher rank, without a message.
    pub rank: u8,
}

/// The objects of some sources, each once, in the order in which they first appear.
#[derive(Clone, Debug, Default)]
pub struct United {
    /// With every element set that differs. The id of an object of several records is its catalogue
    /// number, `NORAD 25544`, where any of them has it.
    pub objects: Vec<Object>,
    /// The source that each comes from first.
    pub sources: Vec<usize>,
    /// Records of objects that came before: the object's place, and the record's source.
    pub joined: Vec<(usize, usize)>,
    /// Orbits that cannot be used beside an earlier one of the same object, each with its source.
    pub refused: Vec<(usize, Rejected)>,
}

/// What all records say of an object.
#[derive(Clone)]
struct Known {
    number: Option<u32>,
    records: usize,
    rank: u8,
    place: Option<usize>,
}

/// Joins the element sets of each object. Only one ephemeris, or element sets alone, can be used of an object.
pub fn unite(mut sources: Vec<Source>) -> United {
    let places = identity::places(sources.iter().flat_map(|source| &source.objects));
    if let [Source { objects, .. }] = sources.as_mut_slice()
        && places.is_sorted_by(|a, b| a < b)
        && objects
            .iter()
            .all(|object| object.identity.number().is_some())
    {
        // Catalogues are long: none is moved.
        return United {
            sources: vec![0; objects.len()],
            objects: std::mem::take(objects),
            ..United::default()
        };
    }
    let count = places.iter().max().map_or(0, |last| last + 1);
    let unknown = Known {
        number: None,
        records: 0,
        rank: u8::MAX,
        place: None,
    };
    let mut all = vec![unknown; count];
    let ranked = sources
        .iter()
        .flat_map(|one| one.objects.iter().map(|object| (object, one.rank)));
    for ((object, rank), place) in ranked.zip(&places) {
        let known = &mut all[*place];
        known.number = known.number.or(object.identity.number());
        known.rank = known.rank.min(rank);
        known.records += 1;
    }
    let names = sources.iter().map(|source| source.name.clone());
    let names: Vec<String> = names.collect();
    let mut united = United::default();
    let mut ids = HashMap::new();
    let mut places = places.into_iter();
    for (source, one) in sources.into_iter().enumerate() {
        let lines = one.lines.into_iter().chain(std::iter::repeat(1));
        for ((object, line), place) in one.objects.into_iter().zip(lines).zip(places.by_ref()) {
            let known = &mut all[place];
            if one.rank > known.rank {
                continue;
            }
            if let Err(reason) = united.add(object, source, known, (&mut ids, &names)) {
                let refused = Rejected::new(&one.name, line, &reason);
                united.refused.push((source, refused));
            }
        }
    }
    united.objects.shrink_to_fit();
    united
}

impl United {
    /// Adds an object of a source.
    ///
    /// Errors: why its orbit cannot be used beside an earlier one of the same object.
    fn add(
        &mut self,
        mut object: Object,
        source: usize,
        known: &mut Known,
        (ids, names): (&mut Ids, &[String]),
    ) -> Result<(), String> {
        let Some(place) = known.place else {
            known.place = Some(self.objects.len());
            object.identify(known.number.filter(|_| known.records > 1), ids);
            self.objects.push(object);
            self.sources.push(source);
            return Ok(());
        };
        let first = &mut self.objects[place];
        if let (Orbit::Elements(..), Orbit::Elements(..)) = (&first.orbit, &object.orbit) {
            first.join(object);
            self.joined.push((place, source));
            return Ok(());
        }
        first.identity.join(object.identity);
        let first = if first.id == object.id {
            String::new()
        } else {
            format!("{} ", first.label())
        };
        let earlier = match self.sources[place] {
            same if same == source => "this file already",
            other if names[other].is_empty() => "an earlier file",
            other => &names[other],
        };
        let object = object.label();
        Err(format!(
            "{object} is {first}in {earlier}: keep one of the two"
        ))
    }
}

/// How often the ids of objects without a number were used.
pub(crate) type Ids = HashMap<String, usize>;

impl Object {
    /// Gives an object the catalogue number of its records or, without one, a unique id: `UNKNOWN
    /// #2`.
    pub(crate) fn identify(&mut self, number: Option<u32>, ids: &mut Ids) {
        if let Some(number) = number {
            self.identity.set_number(number);
            self.id = format!("NORAD {number}");
        }
        if self.identity.number().is_some() {
            return;
        }
        if ids.contains_key(&self.id) {
            let base = match self.id.rsplit_once(" #") {
                Some((base, count)) if count.bytes().all(|b| b.is_ascii_digit()) => base,
                _ => &self.id,
            };
            let base = base.to_owned();
            while ids.contains_key(&self.id) {
                let count = ids.entry(base.clone()).or_insert(1);
                *count += 1;
                self.id = format!("{base} #{count}");
            }
        }
        ids.insert(self.id.clone(), 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texts::{OMM, oem, omm_json, rows};

    /// An object from `NUMBER+DESIGNATOR`, an element set, or `oem:OBJECT_ID`; its name is its
    /// place in the list.
    fn object(place: usize, text: &str) -> Object {
        let text = match text.strip_prefix("oem:") {
            Some(id) => {
                let meta = format!("OBJECT_NAME = N{place}\nOBJECT_ID = {id}\n");
                oem(
                    &meta,
                    &[
                        "2019-06-15T00:00:00 7000 0 0 1 0 0",
                        "2019-06-15T00:00:10 7010 0 0 1 0 0",
                    ],
                )
            }
            None => {
                let (number, designator) = text.split_once('+').unwrap();
                omm_json(&OMM.replace("MADE UP", &format!("N{place}")))
                    .replace("2026-101A", designator)
                    .replace("100001", number)
                    .replace("2026-07-12", &format!("2026-07-1{place}"))
            }
        };
        let contents = crate::parse_contents(&text, "here").unwrap();
        contents.into_objects().swap_remove(0)
    }

    /// All orders of a list.
    fn permutations(all: &[usize]) -> Vec<Vec<usize>> {
        if all.is_empty() {
            return vec![Vec::new()];
        }
        let first = |&first: &usize| {
            let others: Vec<usize> = all.iter().copied().filter(|one| *one != first).collect();
            let others = permutations(&others).into_iter();
            others.map(move |others| [&[first], others.as_slice()].concat())
        };
        all.iter().flat_map(first).collect()
    }

    fn sorted(texts: impl Iterator<Item = String>) -> Vec<String> {
        let mut texts: Vec<String> = texts.collect();
        texts.sort();
        texts
    }

    /// Records, and their objects: the beginning of the id, and names.
    const RECORDS: &str = "
            // The number of a record that has both links the other two.
            25544+ 0+1998-067A 25544+98067A       | NORAD 25544: N0 N1 N2
            0+1998-067A 25544+ 99999+98067A 25544+1998-067-A | NORAD 25544: N0 N1 N2 N3
            25544+ 25544+98067A oem:1998-067A     | NORAD 25544: N0 N1 N2
            25544+ 0+98067A 25544+98067A oem:1998-067A | NORAD 25544: N0 N1 N2 N3
            oem:25544 oem:1998-067A 25544+98067A  | NORAD 25544: N0 N1 N2
            oem:1998-067A 25544+98067A            | NORAD 25544: N0 N1
            // Without such a record they are two.
            25544+ 0+1998-067A 0+98067A           | NORAD 25544: N0; NORAD 0 N: N1 N2
            25544+UNKNOWN oem:UNKNOWN 0+          | NORAD 25544: N0; UNKNOWN N1: N1; NORAD 0 N2: N2
            // One number with two designators is one object, and either designator alone is it.
            25544+98067A 25544+98067B 0+98067B 0+98067A | NORAD 25544: N0 N1 N2 N3
            25544+98067A 25544+98067B oem:1998-067B | NORAD 25544: N0 N1 N2
            // Two numbers are two objects whatever their designators; a designator alone is the
            // smaller number's.
            6+98067A 5+98067A                     | NORAD 5: N1; NORAD 6: N0
            6+98067A 5+98067A 0+98067A            | NORAD 5: N1 N2; NORAD 6: N0
            6+98067A 7+98067B 6+98067B 0+98067B   | NORAD 6: N0 N2 N3; NORAD 7: N1
            6+98067A 5+98067A 5+98067B oem:1998-067B | NORAD 5: N1 N2 N3; NORAD 6: N0
            oem:5 oem:1958-002B oem:1958-002B     | 5: N0; 1958-002B: N1 N2
            5+58002B 5+58002A 6+58002A            | NORAD 5: N0 N1; NORAD 6: N2
            ";

    #[test]
    fn records_are_joined_alike_in_every_order_and_split_into_files() {
        for [records, objects] in rows(RECORDS) {
            let all = records
                .split(' ')
                .enumerate()
                .map(|(at, text)| object(at, text));
            let all: Vec<Object> = all.collect();
            let wanted = objects.split("; ").map(|one| one.split_once(": ").unwrap());
            let known = sorted(wanted.clone().map(|(id, _)| id.to_owned()));
            let names = sorted(wanted.map(|(_, names)| names.to_owned()));
            for order in permutations(&(0..all.len()).collect::<Vec<_>>()) {
                // Each bit of `cuts` ends a source behind a record.
                for cuts in 0..1 << (all.len() - 1) {
                    let case = format!("{records} {order:?} {cuts:b}");
                    let mut sources = vec![Source::default()];
                    for (at, record) in order.iter().enumerate() {
                        let source = sources.last_mut().unwrap();
                        source.objects.push(all[*record].clone());
                        if cuts >> at & 1 == 1 {
                            sources.push(Source::default());
                        }
                    }
                    let objects: Vec<&Object> = sources.iter().flat_map(|s| &s.objects).collect();
                    let mut groups = vec![Vec::new(); names.len()];
                    for (object, place) in objects
                        .iter()
                        .zip(identity::places(objects.iter().copied()))
                    {
                        groups[place].push(object.names[0].clone());
                    }
                    let groups = groups
                        .into_iter()
                        .map(|names| sorted(names.into_iter()).join(" "));
                    assert_eq!(sorted(groups), names, "{case}");
                    let united = unite(sources);
                    let count = united.objects.len() + united.joined.len() + united.refused.len();
                    assert_eq!(count, all.len(), "{case}");
                    let ids = sorted(united.objects.into_iter().map(|one| one.id));
                    let alike = |(id, known): (&String, &String)| id.starts_with(known.as_str());
                    let is_known = ids.len() == known.len() && ids.iter().zip(&known).all(alike);
                    assert!(is_known, "{case}: {ids:?}");
                }
            }
        }
    }

    #[test]
    fn a_source_of_lower_rank_has_its_objects_alone() {
        let source = |rank, records: &[&str]| Source {
            objects: records.iter().map(|text| object(0, text)).collect(),
            rank,
            ..Source::default()
        };
        // The record that shows that the first two are one comes last, and in the least source.
        let united = unite(vec![
            source(1, &["25544+", "5+"]),
            source(0, &["oem:1998-067A"]),
            source(2, &["25544+98067A", "6+"]),
        ]);
        let ids: Vec<&str> = united.objects.iter().map(|one| one.id.as_str()).collect();
        assert_eq!(ids, ["NORAD 5", "NORAD 25544", "NORAD 6"]);
        assert_eq!(united.sources, [0, 1, 2]);
        assert!(united.joined.is_empty() && united.refused.is_empty());
    }
}
