//! What a link's address says about a bus: `can://vcan0?bitrate=500000&fd=8000000&load=0.9`.

use super::pacing::Rates;
use std::time::Duration;

/// A bus by its address.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Interface (`can`) or device (`slcan`).
    pub place: String,
    /// Whether frames are FD with bit rate switch.
    pub fd: bool,
    /// How fast, and which share of the bus.
    pub rates: Rates,
    /// Speed of the serial line of an adapter, baud; none where no line limits the bus.
    pub baud: Option<u32>,
}

/// Bit rates of a classic bus, or of the arbitration phase.
const BITRATES: std::ops::RangeInclusive<u32> = 10_000..=1_000_000;
/// Highest bit rate of the data phase.
const MOST_DATA_BITRATE: u32 = 8_000_000;

impl Settings {
    /// A bus at `place` with what is usual: classic frames at 500 kbit/s, a tenth of the bus time left to others.
    #[must_use]
    pub fn new(place: &str) -> Settings {
        const BITRATE: u32 = 500_000;
        Settings {
            place: place.to_string(),
            fd: false,
            rates: Rates {
                bitrate: BITRATE,
                data_bitrate: BITRATE,
                load: 0.9,
            },
            baud: None,
        }
    }

    /// A bus by what follows `://`. Of its keys those in `known` are allowed.
    pub fn parse(text: &str, known: &[&str]) -> Result<Settings, String> {
        let (place, query) = text.split_once('?').unwrap_or((text, ""));
        if place.is_empty() {
            return Err("it names no interface or device".to_string());
        }
        let mut settings = Settings::new(place);
        for pair in query.split('&').filter(|pair| !pair.is_empty()) {
            let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
            if !known.contains(&key) {
                return Err(format!(
                    "unknown option \"{key}\"; it has {}, roles",
                    known.join(", ")
                ));
            }
            settings.set(key, value)?;
        }
        settings.check()?;
        Ok(settings)
    }

    /// Takes the value of one key.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let whole = || {
            let number = value.parse::<u32>();
            number.map_err(|_| format!("{key} = \"{value}\" must be a whole number"))
        };
        match key {
            "bitrate" => self.rates.bitrate = whole()?,
            "fd" => (self.fd, self.rates.data_bitrate) = (true, whole()?),
            "baud" => self.baud = Some(whole()?),
            "load" => {
                let share = value.parse().ok();
                let share = share.filter(|load| (0.01..=1.0).contains(load));
                self.rates.load = share.ok_or_else(|| {
                    format!("load = \"{value}\" must be a share of the bus, 0.01 to 1")
                })?;
            }
            _ => return Err(format!("unknown key \"{key}\"")),
        }
        Ok(())
    }

    /// Whether its values fit each other.
    pub fn check(&self) -> Result<(), String> {
        let Rates {
            bitrate,
            data_bitrate,
            ..
        } = self.rates;
        if !BITRATES.contains(&bitrate) {
            return Err(format!(
                "bitrate = {bitrate} must be {} to {} bit/s",
                BITRATES.start(),
                BITRATES.end()
            ));
        }
        if self.fd && !(bitrate..=MOST_DATA_BITRATE).contains(&data_bitrate) {
            return Err(format!(
                "fd = {data_bitrate}, the bit rate of FD data, must be {bitrate} (the bitrate) to {MOST_DATA_BITRATE} bit/s"
            ));
        }
        if self.baud == Some(0) {
            return Err("baud = 0 must be above 0".to_string());
        }
        Ok(())
    }

    /// Time of one packet of so many octets: on the bus or, where that takes longer, on the serial line of the adapter
    /// (10 bit times an octet, two hexadecimal digits an octet of data).
    #[must_use]
    pub fn packet_duration(&self, octets: usize) -> Duration {
        let on_bus = self.rates.packet_duration(octets, self.fd);
        let Some(baud) = self.baud else {
            return on_bus;
        };
        // Octets of data that a segment carries, and octets of its line: letter, identifier 3, length 1, digits, CR.
        let (carried, line) = if self.fd {
            (63, 6 + 2 * 64)
        } else {
            (7, 6 + 2 * 8)
        };
        // The first segment of a packet carries one octet less.
        let segments = u32::try_from((octets + 1).div_ceil(carried)).unwrap_or(u32::MAX);
        let on_line = (Duration::from_secs(10) * line / baud.max(1)).saturating_mul(segments);
        on_bus.max(on_line)
    }

    /// Its keys again, for people.
    #[must_use]
    pub fn describe(&self) -> String {
        let Rates {
            bitrate,
            data_bitrate,
            load,
        } = self.rates;
        let fd = self.fd.then(|| format!("&fd={data_bitrate}"));
        let baud = self.baud.map(|baud| format!("&baud={baud}"));
        let [fd, baud] = [fd, baud].map(Option::unwrap_or_default);
        format!("{}?bitrate={bitrate}{fd}&load={load}{baud}", self.place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: &[&str] = &["bitrate", "fd", "load", "baud"];

    #[test]
    fn addresses_are_read() {
        let plain = Settings::parse("can0", ALL).unwrap();
        assert_eq!((plain.fd, plain.rates.bitrate), (false, 500_000));
        let text = "vcan0?bitrate=250000&fd=8000000&load=0.5";
        let fd = Settings::parse(text, ALL).unwrap();
        assert!(fd.fd);
        assert_eq!((fd.rates.data_bitrate, fd.rates.load), (8_000_000, 0.5));
        assert_eq!(fd.describe(), text);
        // X-Val: 8 octets go in two segments of 7, each a line of 22 octets of 10 bits at 9600 baud.
        let slow = Settings::parse("x?baud=9600", ALL).unwrap();
        assert_eq!(
            slow.packet_duration(8).as_micros(),
            2 * 22 * 10_000_000 / 9600
        );
    }

    #[test]
    fn wrong_ones_are_refused_with_the_reason() {
        for row in [
            " => names no interface",
            "can0?bitrate=fast => bitrate = \"fast\" must be a whole number",
            "can0?bitrate=2000000 => 10000 to 1000000",
            "can0?bitrate=500000&fd=250000 => 500000 (the bitrate) to 8000000",
            "can0?fd => fd = \"\" must be a whole number",
            "can0?load=0 => 0.01 to 1",
            "can0?load=nan => 0.01 to 1",
            "can0?baud=0 => above 0",
            "can0?speed=3 => unknown option \"speed\"; it has bitrate, fd, load, baud, roles",
        ] {
            let (text, part) = row.split_once(" => ").unwrap();
            let error = Settings::parse(text, ALL).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
