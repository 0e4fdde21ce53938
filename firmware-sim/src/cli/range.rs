//! Numbers of the command line that have a range.

use std::ops::RangeInclusive;

/// Reads a number of `unit` within `range`.
pub fn within(
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| match text.trim().parse() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(format!(
            "it must be {} to {} {unit}",
            range.start(),
            range.end()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::within;

    #[test]
    fn numbers_out_of_their_range_are_refused_with_it() {
        let read = within(0.001..=1e6, "s");
        assert_eq!((read("0.001"), read("1e6")), (Ok(1e-3), Ok(1e6)));
        for text in ["0", "-1", "1e300", "nan", "inf", "soon", ""] {
            assert_eq!(read(text), Err("it must be 0.001 to 1000000 s".into()));
        }
    }
}
