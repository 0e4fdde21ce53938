//! Faults on the command line of `skyloop-fc`.

use anyhow::{Result, anyhow, bail};
use skyloop_protocols::{Direction, Fault, FaultKind};

/// Reads `KIND:in|out:VALUE[:SECONDS]`.
pub fn parse_fault(text: &str) -> Result<Fault> {
    let parts: Vec<&str> = text.split(':').collect();
    let (kind, direction, value, seconds) = match parts[..] {
        [kind, direction, value] => (kind, direction, value, "0"),
        [kind, direction, value, seconds] => (kind, direction, value, seconds),
        _ => bail!("\"{text}\" is not KIND:in|out:VALUE[:SECONDS], as drop:out:0.05:20"),
    };
    let kinds = FaultKind::NAMES;
    let named = kinds.iter().find(|(name, _)| *name == kind);
    let (_, kind) = named.ok_or_else(|| {
        let names = kinds.map(|(name, _)| name);
        anyhow!(
            "no kind of fault is called \"{kind}\"; there are {}",
            names.join(", ")
        )
    })?;
    let direction = match direction {
        "in" => Direction::In,
        "out" => Direction::Out,
        other => bail!("the direction \"{other}\" is neither in (to the emulator) nor out"),
    };
    let number = |text: &str| -> Result<f64> {
        let number = text.trim().parse();
        number.map_err(|_| anyhow!("\"{text}\" is no number"))
    };
    let fault = Fault {
        kind: *kind,
        direction,
        value: number(value)?,
        seconds: number(seconds)?,
    };
    if kind.is_switch() && fault.value != 0.0 && fault.value != 1.0 {
        bail!("the value {value} is neither 1 (on) nor 0 (off)");
    }
    fault.check()?;
    Ok(fault)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read() {
        let (into, out) = (Direction::In, Direction::Out);
        for (text, kind, direction, value, seconds) in [
            ("drop:out:0.05", FaultKind::Drop, out, 0.05, 0.0),
            ("delay:in:2:20.5", FaultKind::Delay, into, 2.0, 20.5),
            ("stuck:in:1:3", FaultKind::Stuck, into, 1.0, 3.0),
        ] {
            let fault = Fault {
                kind,
                direction,
                value,
                seconds,
            };
            assert_eq!(parse_fault(text).unwrap(), fault);
        }
    }

    #[test]
    fn wrong_faults_are_refused() {
        for (text, says) in [
            ("drop", "KIND:in|out:VALUE"),
            ("drop:in:0.1:1:2", "KIND:in|out:VALUE"),
            ("lose:in:0.1", "bit_flips, drop"),
            ("drop:up:0.1", "\"up\""),
            ("drop:in:much", "\"much\" is no number"),
            ("drop:in:nan", "from 0 to 1"),
            ("drop:in:1.5", "from 0 to 1"),
            ("delay:in:61", "60 s"),
            ("drop:in:0.1:-1", "Fault.seconds"),
            ("stuck:in:0.5", "neither 1 (on) nor 0 (off)"),
        ] {
            let error = parse_fault(text).unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
