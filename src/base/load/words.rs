//! Parser errors in the terms of the files: no Rust types, the key that may be meant, the remedy.

use skyloop_orbit::time::parse_utc;

/// Rewrites serde's message on a key or a value, `text` in the file. `allowed` is the allowed value
/// in words, if the key has a limit.
pub(crate) fn plain(message: &str, text: &str, allowed: Option<&str>) -> String {
    let quoted = |text: &str| -> Vec<String> {
        let words = text.split('`').skip(1).step_by(2);
        words.map(str::to_string).collect()
    };
    let of_type = ["invalid type: ", "invalid value: "];
    if let Some(rest) = of_type.iter().find_map(|head| message.strip_prefix(head))
        && let Some((given, wanted)) = rest.rsplit_once(", expected ")
    {
        let given = given_value(given);
        let wanted = match (given.parse::<f64>(), allowed) {
            (_, Some(allowed)) if WHOLE.contains(&wanted) => format!("a whole number, {allowed}"),
            (_, Some(allowed)) => allowed.to_string(),
            (Ok(number), None) if wanted == "u32" && number > f64::from(u32::MAX) => {
                "a whole number below 4294967296".to_string()
            }
            _ => wanted_value(wanted),
        };
        return format!("must be {wanted}, not {given}");
    }
    let words = quoted(message);
    if let Some((given, known)) = words.split_first() {
        if message.starts_with("unknown field ") {
            return format!("unknown key `{given}`{}", advice(given, known));
        }
        if message.starts_with("unknown variant ") {
            let known: Vec<&str> = known.iter().map(String::as_str).collect();
            return format!("must be {}, not {given:?}", one_of(&known));
        }
        if missing_key(message).is_some() {
            return format!("the key `{given}` is missing");
        }
    }
    if message.ends_with("overflowed") {
        let wanted = allowed.unwrap_or("a number that 64 bits hold");
        return format!("must be {wanted}, not {text}");
    }
    match allowed.filter(|_| message.starts_with("must be a number")) {
        Some(allowed) => format!("must be {allowed}, not {text}"),
        None => message.to_string(),
    }
}

/// Serde's names of whole numbers.
const WHOLE: &[&str] = &["u8", "u16", "u32", "u64", "i64"];

/// The key that is missing by serde's message.
pub(crate) fn missing_key(message: &str) -> Option<&str> {
    message.strip_prefix("missing field `")?.strip_suffix('`')
}

/// Text before a suggested key.
pub const MEANT: &str = ": did you mean `";

/// A choice of words in a message.
pub fn one_of(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
    match quoted.as_slice() {
        [only] => only.clone(),
        all => format!("one of {}", all.join(", ")),
    }
}

/// Suggests a word for an unknown one, or lists the known words.
pub fn advice(given: &str, known: &[impl AsRef<str>]) -> String {
    let known: Vec<&str> = known.iter().map(AsRef::as_ref).collect();
    match nearest(given, &known) {
        Some(meant) => format!("{MEANT}{meant}`?"),
        None => format!(", known: {}", known.join(", ")),
    }
}

/// The known word nearest to `given`, if within 1 to 3 typing errors, depending on the length
/// (Damerau's distance). A missing or added end, such as a unit, is one error.
pub fn nearest<'a>(given: &str, known: &[&'a str]) -> Option<&'a str> {
    let normalized = |word: &str| word.to_lowercase().replace('-', "_");
    let given = normalized(given);
    let far = |word: &&str| {
        let word = normalized(word);
        let is_long = given.len().min(word.len()) >= 3;
        let unit_apart = is_long && (word.starts_with(&given) || given.starts_with(&word));
        match strsim::osa_distance(&given, &word) {
            errors if unit_apart => errors.min(1),
            errors => errors,
        }
    };
    let meant = known.iter().min_by_key(|word| far(word))?;
    let letters = given.chars().count();
    // At least one letter must agree.
    let near = far(meant) <= (letters / 3).clamp(1, 3) && far(meant) < letters;
    near.then_some(*meant)
}

fn wanted_value(serde: &str) -> String {
    let text = match serde {
        "f64" => "a number",
        "u64" => "a whole number, 0 to 18446744073709551615",
        "u8" | "u16" | "u32" => "a whole number, 0 or more",
        "i64" => "a whole number",
        "a boolean" => "true or false",
        "a string" => "a text in quotes",
        "a sequence" => "a list in brackets",
        "a map" => "a table of keys",
        other if other.starts_with("struct ") => "a table of keys",
        other => other,
    };
    text.to_string()
}

fn given_value(serde: &str) -> String {
    let kinds = ["integer ", "floating point ", "boolean "];
    let value = kinds.iter().find_map(|kind| serde.strip_prefix(kind));
    match (serde, value) {
        ("sequence", _) => "a list".to_string(),
        ("map", _) => "a table or a date".to_string(),
        (_, Some(value)) => value.replace(" as i128", "").replace('`', ""),
        _ => serde.strip_prefix("string ").unwrap_or(serde).to_string(),
    }
}

/// A reminder of TOML's form.
const FORM: &str = "write key = value, a key a line, texts in quotes";

/// The fault of a line that is not TOML, from the parser's `message` and the offset of the fault.
pub(crate) fn no_toml(message: &str, line: &str, offset: usize) -> String {
    if let Some(reason) = no_date(line, offset) {
        return reason;
    }
    if message.starts_with("duplicate key") {
        return "a key or a table that is there already: leave one out".to_string();
    }
    let code = line.split('#').next().unwrap_or_default().trim();
    let Some((key, value)) = code.split_once('=') else {
        return format!("{message}; {FORM}");
    };
    let (key, value) = (key.trim(), value.trim());
    let number = value.trim_start_matches(['+', '-']);
    let begins = |is: fn(&char) -> bool| number.chars().next().is_some_and(|c| is(&c));
    if value.is_empty() {
        format!("{key} has no value: write {key} = value")
    } else if ["true", "false", "yes", "no", "on", "off"].contains(&&*value.to_lowercase()) {
        format!("{key} = {value}: write true or false, in small letters")
    } else if begins(|c| c.is_alphabetic()) {
        format!("{key} = {value}: texts stand in quotes, {key} = {value:?}")
    } else if begins(|c| c.is_ascii_digit() || *c == '.') {
        let remedy = if number.contains(',') {
            "a number has a decimal point, no comma"
        } else if number.starts_with('.') || number.ends_with('.') {
            "a decimal point has digits on both sides, as in 0.5"
        } else if number.contains(char::is_whitespace) || number.ends_with(char::is_alphabetic) {
            "a number stands alone, without its unit"
        } else {
            return format!("{key} = {value}: {message}");
        };
        format!("{key} = {value}: {remedy}")
    } else {
        format!("{message}; {FORM}")
    }
}

/// The fault of an unquoted date or time at an offset of a line; none where there is none.
fn no_date(line: &str, offset: usize) -> Option<String> {
    let (before, rest) = line.split_at_checked(offset)?;
    let value = rest.split([',', ']', '}', '#']).next()?.trim();
    let (year, _) = value.split_once('-')?;
    if year.len() != 4 || !year.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let key = before.trim_end().strip_suffix('=')?.trim_end();
    let key = key.rsplit([' ', '\t', '{', ',']).next()?;
    Some(match parse_utc(&value.replacen(' ', "T", 1)) {
        Ok(_) => {
            format!("{key} = {value}: a time of this form stands in quotes, {key} = {value:?}")
        }
        Err(why) => format!("{key}: {why}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_errors_and_missing_units_are_recognised() {
        let keys = ["focal_length_mm", "aperture_mm", "band", "psf"];
        for (given, meant) in [
            ("focal_length", Some("focal_length_mm")),
            ("focal_lenght_mm", Some("focal_length_mm")),
            ("Focal-Length-mm", Some("focal_length_mm")),
            ("aperture_m", Some("aperture_mm")),
            ("bandwidth", Some("band")),
            ("spf", Some("psf")),
            ("gain", None),
            ("x", None),
        ] {
            assert_eq!(nearest(given, &keys), meant, "{given}");
        }
        assert_eq!(nearest("x", &[]), None);
        assert_eq!(nearest("t", &["q", "utc"]), None);
        assert_eq!(nearest("k1", &["k", "p"]), Some("k"));
        assert_eq!(nearest("kind", &["model", "k", "p"]), None);
    }

    #[test]
    fn messages_of_serde_are_in_the_terms_of_the_files() {
        for (given, words) in [
            ("integer `-3`", "a whole number, 0 or more, not -3"),
            ("floating point `3.5`", "a whole number, 0 or more, not 3.5"),
            (
                "integer `5000000000`",
                "a whole number below 4294967296, not 5000000000",
            ),
            (
                "integer `5000000000` as i128",
                "a whole number below 4294967296, not 5000000000",
            ),
        ] {
            let message = format!("invalid value: {given}, expected u32");
            assert_eq!(plain(&message, "", None), format!("must be {words}"));
        }
        for row in "
            variant `sun`, expected `stepped` or `wall` | must be one of \"stepped\", \"wall\", not \"sun\"
            field `bnad`, expected one of `band`, `psf` | unknown key `bnad`: did you mean `band`?
            field `gain`, expected `band` or `psf`      | unknown key `gain`, known: band, psf"
            .lines()
            .skip(1)
        {
            let (message, words) = row.split_once('|').unwrap();
            assert_eq!(plain(&format!("unknown {}", message.trim()), "", None), words.trim());
        }
    }

    #[test]
    fn lines_that_are_not_toml_have_a_remedy() {
        for row in "
            gain =   # e-/DN | gain has no value: write gain = value
            name = one  | name = one: texts stand in quotes, name = \"one\"
            cos4 = True | write true or false
            gain = 7,5  | a decimal point, no comma
            gain = -.5  | as in 0.5
            gain = 5 mm | without its unit
            gain = 5mm  | without its unit
            gain = 05   | gain = 05: why
            utc = 2026-13-01T00:00:00Z | there is no month 13
            utc = 2026-13-01T00:00:00  | utc: \"2026-13-01T00:00:00\"
            a = [{ q = [0, 1], utc = 2026-13-01T00:00:00Z }, { }] | utc: \"2026-13-01T00:00:00Z\"
            utc = 2026-02-30 00:00:00Z # day | 2026-02 has days 1 to 28
            utc = 2026-01-01T24:00:00Z | hours are 00 to 23
            utc = 2026-400T00:00:00Z   | 2026 has days 1 to 365
            utc = 2026-001T00:00:00Z   | stands in quotes, utc = \"2026-001T00:00:00Z\"
            gain | why; write key = value
            name = \"one | why; write key = value"
            .lines()
            .skip(1)
        {
            let (line, words) = row.split_once(" | ").unwrap();
            let line = line.trim();
            let offset = line.rfind("= ").map_or(0, |at| at + 2);
            let text = no_toml("why", line, offset);
            assert!(text.contains(words), "{line}: {text}");
        }
        assert!(no_toml("duplicate key", "a = 1", 0).contains("leave one out"));
    }
}
