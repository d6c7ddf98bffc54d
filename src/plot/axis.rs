//! The division of an axis, its range and its numbers.

use std::ops::Range;

/// Share of an axis by which it goes on after its last point.
const END_SHARE: f64 = 1e-9;

/// How an axis is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AxisScale {
    /// Evenly.
    #[default]
    Linear,
    /// By factors of ten; numbers that are not positive are left out.
    Decades,
}

/// Numbers at an axis.
pub(super) enum Labels {
    /// With the decimals that tell neighbours apart.
    Decimals(usize),
    /// Very large or small ones.
    Scientific,
    /// With the digits that they have.
    OfDecades,
}

impl Labels {
    pub(super) fn over(range: &Range<f64>) -> Self {
        let size = (range.end - range.start).log10();
        if (-9.0..7.0).contains(&size) {
            Self::Decimals((2.0 - size).ceil().clamp(0.0, 12.0) as usize)
        } else {
            Self::Scientific
        }
    }

    pub(super) fn text(&self, value: f64) -> String {
        let decimals = match self {
            Self::Scientific => return format!("{value:.3e}"),
            Self::OfDecades => {
                let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
                return rounded.to_string();
            }
            Self::Decimals(decimals) => *decimals,
        };
        let text = format!("{value:.decimals$}");
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        // A rounded zero may have a sign.
        if text == "-0" { "0".to_owned() } else { text.to_owned() }
    }
}

pub(super) fn extent(values: impl Iterator<Item = f64>) -> Range<f64> {
    values.fold(f64::INFINITY..f64::NEG_INFINITY, |range, v| range.start.min(v)..range.end.max(v))
}

/// With `share` of the length on both sides; at least `least` of the size of the numbers long.
pub(super) fn widened(range: &Range<f64>, share: f64, least: f64) -> Range<f64> {
    let (low, high, size) = (range.start, range.end, range.start.abs().max(range.end.abs()));
    let margin = match high - low {
        0.0 => 0.5 * size.max(1.0),
        span => (share * span).max(0.5 * (least * size - span)),
    };
    // A tick at the end must not be lost by rounding.
    let slack = END_SHARE * (high - low);
    low - margin - slack..high + margin + slack
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_tell_neighbours_apart() {
        let label = |range: Range<f64>, value: f64| Labels::over(&range).text(value);
        assert_eq!(label(-1.0..1.0, -1e-17), "0");
        assert_eq!(label(-1.0..1.0, 0.300_000_000_000_000_04), "0.3");
        assert_eq!(label(0.0..1200.0, 400.0), "400");
        assert_eq!(label(0.031_29..0.031_31, 0.031_295), "0.031295");
        assert_eq!(label(0.0..1e-12, 5e-13), "5.000e-13");
    }
}
