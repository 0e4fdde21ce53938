//! Unites the objects of several sources. All sources are read first, since the last one may show
//! that earlier records are of one object.

use crate::{Object, Orbit, Rejected, identity};
use std::collections::HashMap;

/// The objects of a file or other source, one for each record or ephemeris.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Name in messages, or empty.
    pub name: String,
    /// In the order of the source.
    pub objects: Vec<Object>,
    /// First line of each object; shorter where the source has no lines.
    pub lines: Vec<usize>,
    /// An object of several sources is dropped from those with a higher rank, without a message.
    pub rank: u8,
}

/// United objects, in the order of first appearance.
#[derive(Clone, Debug, Default)]
pub struct United {
    /// Each has all its different element sets. An object of several records has its catalogue
    /// number, `NORAD 25544`, as its id where any of them has it.
    pub objects: Vec<Object>,
    /// The first source of each object.
    pub sources: Vec<usize>,
    /// Records that were added to an earlier object: index of the object, and source of the record.
    pub joined: Vec<(usize, usize)>,
    /// Orbits that cannot be combined with an earlier one of the same object, with their source.
    pub refused: Vec<(usize, Rejected)>,
}

/// Properties of an object, from all its records.
#[derive(Clone)]
struct Known {
    number: Option<u32>,
    records: usize,
    rank: u8,
    index: Option<usize>,
}

/// Unites the element sets of each object. An object has element sets alone, or one ephemeris.
pub fn unite(mut sources: Vec<Source>) -> United {
    let groups = identity::places(sources.iter().flat_map(|source| &source.objects));
    if let [Source { objects, .. }] = sources.as_mut_slice()
        && groups.is_sorted_by(|a, b| a < b)
        && objects
            .iter()
            .all(|object| object.identity.number().is_some())
    {
        // Fast path for large catalogues: no object is moved.
        return United {
            sources: vec![0; objects.len()],
            objects: std::mem::take(objects),
            ..United::default()
        };
    }
    let count = groups.iter().max().map_or(0, |last| last + 1);
    let unknown = Known {
        number: None,
        records: 0,
        rank: u8::MAX,
        index: None,
    };
    let mut all = vec![unknown; count];
    let ranked = sources
        .iter()
        .flat_map(|one| one.objects.iter().map(|object| (object, one.rank)));
    for ((object, rank), group) in ranked.zip(&groups) {
        let known = &mut all[*group];
        known.number = known.number.or(object.identity.number());
        known.rank = known.rank.min(rank);
        known.records += 1;
    }
    let names = sources.iter().map(|source| source.name.clone());
    let names: Vec<String> = names.collect();
    let mut united = United::default();
    let mut ids = HashMap::new();
    let mut groups = groups.into_iter();
    for (source, one) in sources.into_iter().enumerate() {
        let lines = one.lines.into_iter().chain(std::iter::repeat(1));
        for ((object, line), group) in one.objects.into_iter().zip(lines).zip(groups.by_ref()) {
            let known = &mut all[group];
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
    /// # Errors
    ///
    /// The reason why its orbit cannot be combined with an earlier one of the same object.
    fn add(
        &mut self,
        mut object: Object,
        source: usize,
        known: &mut Known,
        (ids, names): (&mut Ids, &[String]),
    ) -> Result<(), String> {
        let Some(index) = known.index else {
            known.index = Some(self.objects.len());
            object.identify(known.number.filter(|_| known.records > 1), ids);
            self.objects.push(object);
            self.sources.push(source);
            return Ok(());
        };
        let first = &mut self.objects[index];
        if let (Orbit::Elements(..), Orbit::Elements(..)) = (&first.orbit, &object.orbit) {
            first.join(object);
            self.joined.push((index, source));
            return Ok(());
        }
        first.identity.join(object.identity);
        let first = if first.id == object.id {
            String::new()
        } else {
            format!("{} ", first.label())
        };
        let earlier = match self.sources[index] {
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

/// How often each id of an object without a number was used.
pub(crate) type Ids = HashMap<String, usize>;

impl Object {
    /// Gives an object the catalogue number of its records or, without one, a unique id such as
    /// `UNKNOWN #2`.
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

    /// An object from `NUMBER+DESIGNATOR`, an element set, or from `oem:OBJECT_ID`; its name is its
    /// index in the list.
    fn object(index: usize, text: &str) -> Object {
        let text = match text.strip_prefix("oem:") {
            Some(id) => {
                let meta = format!("OBJECT_NAME = N{index}\nOBJECT_ID = {id}\n");
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
                omm_json(&OMM.replace("MADE UP", &format!("N{index}")))
                    .replace("2026-101A", designator)
                    .replace("100001", number)
                    .replace("2026-07-12", &format!("2026-07-1{index}"))
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

    /// Records, and the objects that they form: beginning of the id, and names.
    const RECORDS: &str = "
            // A record with number and designator links the other two.
            25544+ 0+1998-067A 25544+98067A       | NORAD 25544: N0 N1 N2
            0+1998-067A 25544+ 99999+98067A 25544+1998-067-A | NORAD 25544: N0 N1 N2 N3
            25544+ 25544+98067A oem:1998-067A     | NORAD 25544: N0 N1 N2
            25544+ 0+98067A 25544+98067A oem:1998-067A | NORAD 25544: N0 N1 N2 N3
            oem:25544 oem:1998-067A 25544+98067A  | NORAD 25544: N0 N1 N2
            oem:1998-067A 25544+98067A            | NORAD 25544: N0 N1
            // Without such a record there are two objects.
            25544+ 0+1998-067A 0+98067A           | NORAD 25544: N0; NORAD 0 N: N1 N2
            25544+UNKNOWN oem:UNKNOWN 0+          | NORAD 25544: N0; UNKNOWN N1: N1; NORAD 0 N2: N2
            // A number with two designators is one object, also for each designator alone.
            25544+98067A 25544+98067B 0+98067B 0+98067A | NORAD 25544: N0 N1 N2 N3
            25544+98067A 25544+98067B oem:1998-067B | NORAD 25544: N0 N1 N2
            // Two numbers are two objects; a designator alone belongs to the smaller number.
            6+98067A 5+98067A                     | NORAD 5: N1; NORAD 6: N0
            6+98067A 5+98067A 0+98067A            | NORAD 5: N1 N2; NORAD 6: N0
            6+98067A 7+98067B 6+98067B 0+98067B   | NORAD 6: N0 N2 N3; NORAD 7: N1
            6+98067A 5+98067A 5+98067B oem:1998-067B | NORAD 5: N1 N2 N3; NORAD 6: N0
            oem:5 oem:1958-002B oem:1958-002B     | 5: N0; 1958-002B: N1 N2
            5+58002B 5+58002A 6+58002A            | NORAD 5: N0 N1; NORAD 6: N2
            ";

    #[test]
    fn records_are_united_alike_in_every_order_and_split_into_files() {
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
                // Each bit of `cuts` ends a source after a record.
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
                    for (object, group) in objects
                        .iter()
                        .zip(identity::places(objects.iter().copied()))
                    {
                        groups[group].push(object.names[0].clone());
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
    fn an_object_is_dropped_from_sources_of_higher_rank() {
        let source = |rank, records: &[&str]| Source {
            objects: records.iter().map(|text| object(0, text)).collect(),
            rank,
            ..Source::default()
        };
        // The record that links the first two comes last, in the source of the highest rank.
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
