//! A bus by its address: `can://vcan0?bitrate=500000&fd=8000000&load=0.9`.

use super::pacing::Rates;
use crate::address::Address;
use std::time::Duration;

/// A bus by its address.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Interface (`can`) or device (`slcan`).
    pub place: String,
    /// Whether frames are FD with bit rate switch.
    pub fd: bool,
    /// Bit rates and load.
    pub rates: Rates,
    /// Baud rate of an adapter's serial line; none if no line limits the bus.
    pub baud: Option<u32>,
}

/// Options of a CAN interface.
pub const KEYS: &[&str] = &["bitrate", "fd", "load"];
/// Options of an adapter on a serial line.
pub const ADAPTER_KEYS: &[&str] = &["bitrate", "fd", "load", "baud"];

/// Bit rates of a classic bus and of the arbitration phase.
const BITRATES: std::ops::RangeInclusive<u32> = 10_000..=1_000_000;
const MAX_DATA_BITRATE: u32 = 8_000_000;

impl Settings {
    /// A bus with defaults: classic frames at 500 kbit/s, a tenth of the time left to other nodes.
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

    /// Settings from an address.
    ///
    /// # Errors
    /// The reason, if the target is missing or an option is wrong.
    pub fn of(address: &Address) -> Result<Settings, String> {
        if address.target.is_empty() {
            return Err("it names no interface or device".to_string());
        }
        let mut settings = Settings::new(&address.target);
        settings.apply(address)?;
        Ok(settings)
    }

    /// Applies the options of an address.
    ///
    /// # Errors
    /// The reason, if an option is wrong.
    pub fn apply(&mut self, address: &Address) -> Result<(), String> {
        let rates = &mut self.rates;
        if let Some(bitrate) = address.whole_in("bitrate", BITRATES)? {
            rates.bitrate = bitrate;
        }
        if let Some(load) = address.decimal_in("load", 0.01..=1.0)? {
            rates.load = load;
        }
        if let Some(baud) = address.whole_in("baud", 1..=u32::MAX)? {
            self.baud = Some(baud);
        }
        if let Some(data_bitrate) = address.whole_in("fd", 0..=u32::MAX)? {
            (self.fd, rates.data_bitrate) = (true, data_bitrate);
        }
        let (min, max) = (rates.bitrate, MAX_DATA_BITRATE);
        if self.fd && !(min..=max).contains(&rates.data_bitrate) {
            return Err(format!(
                "fd = {}, the bit rate of FD data, must be {min} (the bitrate) to {max} bit/s",
                rates.data_bitrate
            ));
        }
        Ok(())
    }

    /// Time of one packet: on the bus or, if longer, on the adapter's serial line (10 bit times a
    /// byte, two hexadecimal digits per data byte).
    #[must_use]
    pub fn packet_duration(&self, bytes: usize) -> Duration {
        let on_bus = self.rates.packet_duration(bytes, self.fd);
        let Some(baud) = self.baud else {
            return on_bus;
        };
        // Data bytes of a segment, and bytes of its line: letter, identifier 3, length 1, digits,
        // CR.
        let (carried, line) = if self.fd {
            (63, 6 + 2 * 64)
        } else {
            (7, 6 + 2 * 8)
        };
        // The first segment of a packet carries one byte less.
        let segments = u32::try_from((bytes + 1).div_ceil(carried)).unwrap_or(u32::MAX);
        let on_line = (Duration::from_secs(10) * line / baud.max(1)).saturating_mul(segments);
        on_bus.max(on_line)
    }

    /// The settings in the form of an address.
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

    fn read(text: &str) -> Result<Settings, String> {
        Settings::of(&Address::parse(&format!("can://{text}"))?)
    }

    #[test]
    fn addresses_are_read() {
        let plain = read("can0").unwrap();
        assert_eq!((plain.fd, plain.rates.bitrate), (false, 500_000));
        let text = "vcan0?bitrate=250000&fd=8000000&load=0.5";
        let fd = read(text).unwrap();
        assert!(fd.fd);
        assert_eq!((fd.rates.data_bitrate, fd.rates.load), (8_000_000, 0.5));
        assert_eq!(fd.describe(), text);
        // X-Val: 8 bytes go in two segments of 7, each a line of 22 bytes of 10 bits at 9600 baud.
        let slow = read("x?baud=9600").unwrap();
        assert_eq!(
            slow.packet_duration(8).as_micros(),
            2 * 22 * 10_000_000 / 9600
        );
    }

    #[test]
    fn wrong_settings_are_refused_with_the_reason() {
        for row in [
            " => names no interface",
            "can0?bitrate=fast => bitrate = \"fast\" must be a whole number",
            "can0?bitrate=2000000 => 10000 to 1000000",
            "can0?bitrate=500000&fd=250000 => 500000 (the bitrate) to 8000000",
            "can0?fd=9000000 => 500000 (the bitrate) to 8000000",
            "can0?fd => fd = \"\" must be a whole number",
            "can0?load=0 => 0.01 to 1",
            "can0?load=nan => 0.01 to 1",
            "can0?baud=0 => baud = 0 must be 1 to",
        ] {
            let (text, part) = row.split_once(" => ").unwrap();
            let error = read(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
