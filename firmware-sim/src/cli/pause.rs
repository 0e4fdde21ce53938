//! A pause as the command line of `skyloop-fc` names it.

use std::time::Duration;

use anyhow::{Result, anyhow};
use skyloop_firmware_sim::flight_computer::Pause;

/// Reads `AFTER:S`, both in seconds.
///
/// # Errors
/// What is wrong with it.
pub fn parse_pause(text: &str) -> Result<Pause> {
    /// As long as anybody would wait.
    const MOST_S: f64 = 1e6;
    let time = |text: &str| {
        let seconds: f64 = text.trim().parse().ok()?;
        let fits = (0.0..=MOST_S).contains(&seconds);
        fits.then(|| Duration::from_secs_f64(seconds))
    };
    let times = text.split_once(':');
    let times = times.and_then(|(after, lasts)| Some((time(after)?, time(lasts)?)));
    let (after, lasts) =
        times.ok_or_else(|| anyhow!("\"{text}\" is not AFTER:S, both 0 to {MOST_S} s, as 5:30"))?;
    Ok(Pause { after, lasts })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_are_read() {
        let pause = parse_pause("5:0.25").unwrap();
        assert_eq!(pause.after, Duration::from_secs(5));
        assert_eq!(pause.lasts, Duration::from_millis(250));
        for wrong in [
            "", "5", "5:", ":5", "-1:5", "1:-5", "nan:1", "1:inf", "1e7:1", "1:2:3",
        ] {
            let error = parse_pause(wrong).unwrap_err().to_string();
            assert!(
                error.contains("AFTER:S") && error.contains("5:30"),
                "{error}"
            );
        }
    }
}
