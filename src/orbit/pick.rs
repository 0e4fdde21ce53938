//! Selects one object of a file by name.

use crate::{Designator, Loaded, Object, Rejected, catalogue_number};

const MAX_LISTED: usize = 8;

/// File and object of a selector `FILE` or `FILE:NAME`, with the longest path that `exists`.
pub fn file_and_name(selector: &str, exists: impl Fn(&str) -> bool) -> (&str, Option<&str>) {
    let colons = selector.rmatch_indices(':');
    let mut parts = colons.map(|(at, _)| (&selector[..at], Some(&selector[at + 1..])));
    let last = parts.clone().next();
    if exists(selector) {
        return (selector, None);
    }
    let known = parts.find(|(file, _)| exists(file));
    known.or(last).unwrap_or((selector, None))
}

impl Loaded {
    /// The object with this name (its id, the number in it, or one of its names; case is ignored),
    /// and the rejected records. Without a name the file must have one object and nothing rejected.
    ///
    /// # Errors
    ///
    /// Lists the objects of the file, and the rejected records.
    pub fn pick(mut self, name: Option<&str>) -> Result<(Object, Vec<Rejected>), String> {
        let index = self.index_of(name)?;
        Ok((self.objects.swap_remove(index), self.rejected))
    }

    /// [`Loaded::pick`] by reference, with the same errors.
    pub fn find(&self, name: Option<&str>) -> Result<&Object, String> {
        Ok(&self.objects[self.index_of(name)?])
    }

    fn index_of(&self, name: Option<&str>) -> Result<usize, String> {
        let mut found: Vec<usize> = (0..self.objects.len())
            .filter(|i| name.is_none_or(|name| self.objects[*i].is_called(name)))
            .collect();
        // Ids are unique, numbers in them are not: `NORAD 99999` and `NORAD 99999 #2`.
        let has_id =
            |i: &usize| name.is_some_and(|name| self.objects[*i].id.eq_ignore_ascii_case(name));
        if let Some(exact) = found.iter().copied().find(has_id) {
            found = vec![exact];
        }
        let why = match (found.as_slice(), name) {
            ([one], Some(_)) => return Ok(*one),
            ([one], None) if self.rejected.is_empty() => return Ok(*one),
            ([], Some(name)) => format!("no object called {name:?}"),
            (_, Some(name)) => format!(
                "{} objects called {name:?}: pick one by its id",
                found.len()
            ),
            ([], None) => "no usable object".to_string(),
            (_, None) => format!("{} usable objects: pick one as FILE:NAME", found.len()),
        };
        let has = match (found.as_slice(), name) {
            ([], Some(name)) => self.like(name),
            ([], None) => String::new(),
            (found, _) => list(found.iter().map(|i| &self.objects[*i])),
        };
        let refused = match self.rejected.as_slice() {
            [] => String::new(),
            [one] => format!("; refused is {one}"),
            [first, ..] => format!("; refused are {}, the first: {first}", self.rejected.len()),
        };
        let remedy = match name {
            Some(name) if found.is_empty() => self.unnumbered_hint(name),
            _ => String::new(),
        };
        Err(format!("{why}{has}{remedy}{refused}"))
    }

    /// A remedy where `name` is a catalogue number and some objects have none.
    fn unnumbered_hint(&self, name: &str) -> String {
        let unnumbered = self.objects.iter();
        let unnumbered = unnumbered.filter(|one| one.identity.number().is_none());
        let (count, all) = (unnumbered.count(), self.objects.len());
        if count == 0 || catalogue_number(name).is_none() {
            return String::new();
        }
        let verb = if count == 1 { "has" } else { "have" };
        format!("; {count} of {all} {verb} no catalogue number: use an id or a name of theirs")
    }

    /// Objects with names similar to `name`, or else the first objects.
    fn like(&self, name: &str) -> String {
        let name = name.to_ascii_uppercase();
        let begin: String = name.chars().take(3).collect();
        let near = |object: &&Object| {
            let mut names = object.names.iter().map(|known| known.to_ascii_uppercase());
            names.any(|known| known.contains(&name) || known.starts_with(&begin))
        };
        match list(self.objects.iter().filter(near)) {
            none if none.is_empty() => list(self.objects.iter()),
            some => some,
        }
    }
}

fn list<'a>(objects: impl Iterator<Item = &'a Object>) -> String {
    let labels: Vec<String> = objects.take(MAX_LISTED + 1).map(Object::label).collect();
    match labels.len() {
        0 => String::new(),
        n if n > MAX_LISTED => format!("; it has {}, ...", labels[..MAX_LISTED].join(", ")),
        _ => format!("; it has {}", labels.join(", ")),
    }
}

impl Object {
    /// Compares with its names, id, catalogue number and international designator.
    fn is_called(&self, name: &str) -> bool {
        let names = self.names.iter().map(String::as_str);
        let mut known = names.chain([self.id.as_str()]);
        known.any(|known| known.eq_ignore_ascii_case(name))
            || catalogue_number(name).is_some_and(|number| {
                [self.written_number(), self.identity.number()].contains(&Some(number))
            })
            || Designator::parse(name).is_some_and(|name| self.identity.designator == Some(name))
    }
}

#[cfg(test)]
mod tests {
    use super::file_and_name;
    use crate::texts::{OMM, oem, rows};

    /// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification sets 00005 and 06251. The checksums
    /// of the third set are wrong.
    const SETS: &str = "VANGUARD 1\n\
        1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
        2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n\
        DELTA 1 DEB\n\
        1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n\
        2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n\
        DAMAGED\n\
        1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3986\n\
        2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";

    fn pick(lines: std::ops::Range<usize>, name: Option<&str>) -> Result<String, String> {
        let text: Vec<&str> = SETS.lines().skip(lines.start).take(lines.len()).collect();
        let loaded = crate::parse(&text.join("\n"), "sets.tle").unwrap();
        loaded
            .pick(name)
            .map(|(object, refused)| format!("{} {}", object.id, refused.len()))
    }

    #[test]
    fn a_selector_is_split_at_the_colon_after_an_existing_file() {
        let split = |selector| file_and_name(selector, |file| file == "a:b.oem");
        assert_eq!(split("a.oem"), ("a.oem", None));
        assert_eq!(split("a.oem:ISS"), ("a.oem", Some("ISS")));
        assert_eq!(split("a:b.oem"), ("a:b.oem", None));
        assert_eq!(split("a:b.oem:ISS"), ("a:b.oem", Some("ISS")));
        assert_eq!(split("a:b.oem:ISS:Z"), ("a:b.oem", Some("ISS:Z")));
        let both = |file: &str| ["a", "a:b.oem"].contains(&file);
        let longest = file_and_name("a:b.oem:ISS", both);
        assert_eq!(longest, ("a:b.oem", Some("ISS")));
    }

    #[test]
    fn objects_are_found_by_id_number_or_name() {
        for name in ["NORAD 5", "norad5", "5", "00005", "Vanguard 1"] {
            assert_eq!(pick(0..9, Some(name)).unwrap(), "NORAD 5 1", "{name}");
        }
        for name in ["1958-002B", "58002b", "1958-2B", "1958-002-B", "1958002B"] {
            assert_eq!(pick(0..9, Some(name)).unwrap(), "NORAD 5 1", "{name}");
        }
        // X-Val: space-track.org, Alpha-5: A0005 is 100005; a letter counts as 0 in checksums.
        let six = SETS.replace("00005", "A0005");
        let loaded = crate::parse(&six[..six.find("DELTA").unwrap()], "six.tle").unwrap();
        for name in ["A0005", "a0005", "100005", "0100005", "NORAD A0005"] {
            assert_eq!(
                loaded.find(Some(name)).unwrap().id,
                "NORAD 100005",
                "{name}"
            );
        }
        assert_eq!(pick(3..6, None).unwrap(), "NORAD 6251 0");
    }

    #[test]
    fn an_ambiguous_or_unknown_name_is_refused_with_the_objects() {
        // Lines of the sets, the name, and words of the refusal.
        for [lines, name, says] in rows(
            r#"
            0 6 |        | 2 usable objects, FILE:NAME, NORAD 5 (VANGUARD 1), 6251
            3 9 |        | 1 usable, sets.tle, checksum
            6 9 |        | no usable object, checksum
            0 9 | ISS    | no object called "ISS", VANGUARD, checksum
            0 3 | ISS    | it has NORAD 5
            0 9 | Deltan | it has NORAD 6251 (DELTA 1 DEB)
            "#,
        ) {
            let (from, to) = lines.split_once(' ').unwrap();
            let lines = from.parse().unwrap()..to.parse().unwrap();
            let why = pick(lines, Some(&*name).filter(|name| !name.is_empty())).unwrap_err();
            assert!(says.split(", ").all(|part| why.contains(part)), "{why}");
            assert!(name != "Deltan" || !why.contains("VANGUARD"), "{why}");
        }
        // Not every OBJECT_ID of an OEM has a catalogue number.
        let states = [
            "2019-06-15T00:00:00 7000 0 0 1 0 0",
            "2019-06-15T00:00:10 7010 0 0 1 0 0",
        ];
        let oem = crate::parse(&oem("", &states), "iss.oem").unwrap();
        let remedy = "1 of 1 has no catalogue number: use an id or a name";
        for (name, has_remedy) in [("25544", true), ("X", false)] {
            let why = oem.find(Some(name)).unwrap_err();
            assert!(why.contains("it has 2019-001A (MADE UP)"), "{why}");
            assert_eq!(why.contains(remedy), has_remedy, "{why}");
            assert_eq!(why.contains("catalogue number"), has_remedy, "{why}");
        }
        // An id counts before the number in it.
        let other = OMM.replace("15.2", "15.3");
        let two = format!("{OMM}{other}").replace("2026-101A", "UNKNOWN");
        let two = two.replace("100001", "99999").replace("MADE UP", "DEB");
        let two = crate::parse(&two, "two.omm").unwrap();
        for id in ["NORAD 99999 DEB", "NORAD 99999 DEB #2"] {
            assert_eq!(two.find(Some(id)).unwrap().id, id);
        }
        let twice = SETS.replace("VANGUARD 1", "DELTA 1 DEB");
        let twice = crate::parse(&twice, "sets.tle").unwrap();
        for (loaded, name, says) in [
            (
                &two,
                "99999",
                ["2 objects called", "by its id", "NORAD 99999 DEB #2"],
            ),
            (
                &twice,
                "delta 1 deb",
                ["2 objects called", "by its id", "NORAD 5"],
            ),
        ] {
            let why = loaded.find(Some(name)).unwrap_err();
            assert!(says.iter().all(|part| why.contains(part)), "{why}");
        }
    }
}
