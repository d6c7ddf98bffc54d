//! The delays of all channels at one frame.

use crate::spec::HALF_WIDTH;
use crate::units::Seconds;
use serde::Serialize;

/// The delays at one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The frame, from 0.
    pub frame: u64,
    /// D_i and its standard deviation; `None` for a channel of which the line says nothing.
    pub delays: Vec<Option<(Seconds, Seconds)>>,
}

/// A line: absolute delays in seconds with the half-widths of their 95 % intervals.
#[derive(Serialize)]
struct ReadingLine {
    frame: u64,
    delay: Vec<Option<f64>>,
    half_width: Vec<Option<f64>>,
}

impl Reading {
    /// The reading as a line of JSON.
    pub fn line(&self) -> String {
        let delay = self.delays.iter().map(|known| known.map(|(delay, _)| delay.0)).collect();
        let half_width =
            self.delays.iter().map(|known| known.map(|(_, sigma)| sigma.0 * HALF_WIDTH)).collect();
        serde_json::to_string(&ReadingLine { frame: self.frame, delay, half_width }).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_delays_and_intervals() {
        let reading = Reading { frame: 9, delays: vec![None, Some((Seconds(3e-6), Seconds(1e-8)))] };
        let line: serde_json::Value = serde_json::from_str(&reading.line()).unwrap();
        let want =
            serde_json::json!({"frame": 9, "delay": [null, 3e-6], "half_width": [null, 1e-8 * HALF_WIDTH]});
        assert_eq!(line, want);
    }
}
