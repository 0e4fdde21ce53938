//! Options with a fixed number of numbers.

/// Exactly N finite numbers, separated by commas.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> std::str::FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|t| t.trim().parse()).collect();
        let numbers = numbers.map_err(|_| format!("must be {N} numbers separated by commas"))?;
        match <[f64; N]>::try_from(numbers) {
            Ok(numbers) if numbers.iter().all(|n| n.is_finite()) => Ok(Numbers(numbers)),
            Ok(_) => Err("every number must be finite".to_string()),
            Err(numbers) => Err(format!("{N} numbers are wanted, not {}", numbers.len())),
        }
    }
}
