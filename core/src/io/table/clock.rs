//! Whether the time stamps of a table are those of an even clock, and how many lines are missing between
//! them.

use super::stamp::Stamp;
use crate::quantity::readable;

/// Units of the last digit by which a stamp may be off: rounding is half of one, and a writer that computes
/// in few digits adds a little.
const ROUNDING: f64 = 0.75;
/// The rounding alone.
const HALF: f64 = 0.5;
/// Share of a step by which a stamp may be off besides: the sums of a writer. At the highest frequency it is
/// an error of -110 dB.
const SUMS: f64 = 1e-6;
/// Share of the usual step by which the true one differs at most.
const STEP_RANGE: f64 = 0.25;
/// Share of steps without length from which on the digits are at fault, not the lines.
const REPEATED: f64 = 0.25;
/// Share of a step up to which the number of missing lines is known.
const COUNTED: f64 = 0.25;
/// Most lines that are missing in all, 2^26: a wrong stamp would lead to endless output.
const MOST_MISSING: f64 = (1_u64 << 26) as f64;

/// Why a time stamp is none of an even clock. Times are in the unit of the column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Unsteady {
    /// All stamps are the same, or most lines have that of the line before.
    Coarse { digit: f64, step: f64 },
    /// The same stamp as the line before.
    Doubled,
    /// Earlier than the line before.
    Back { by: f64 },
    /// Later by no whole number of steps.
    Uneven { step: f64, usual: f64, least: f64, most: f64, digit: f64 },
    /// More lines are missing than can be counted.
    Gap { lines: f64 },
}

impl Unsteady {
    /// What is wrong and what to do, with times in a unit in seconds, or in no known one.
    pub(super) fn message(self, unit: Option<f64>) -> String {
        let time = |value: f64| match unit {
            Some(unit) => readable(value * unit, "s"),
            None => format!("{:.6}", value).trim_end_matches('0').trim_end_matches('.').to_owned(),
        };
        match self {
            Self::Coarse { digit, step } => format!(
                "the last digit of its time is {}, which does not show the step of about {}; write more digits, or state \
                 that no column is the time and which ones are channels (--time-column none, and --columns with theirs), or \
                 give `measure` the --rate",
                time(digit),
                time(step)
            ),
            Self::Doubled => {
                "it has the time of the line before; leave out what was written twice".to_owned()
            }
            Self::Back { by } => format!(
                "its time is {} before that of the line before, so the lines are not sorted; sort them, or cut the table where a new recording or day begins",
                time(by)
            ),
            Self::Uneven { step, usual, least, most, digit } => format!(
                "the times are not evenly spaced: the step to this line is {} where {} is due, steps lie between {} and \
                 {}, and the last digit is {}; fuse --stamps and hybank merge take \
                 samples at their own times; if they are even in truth, state that no column is the time (--time-column \
                 none, and --columns with theirs)",
                time(step),
                time(usual),
                time(least),
                time(most),
                time(digit)
            ),
            Self::Gap { lines } => format!(
                "its time is {lines:.0} lines after that of the line before, more than can be counted as lost; cut the \
                 table in two there"
            ),
        }
    }
}

/// A line through the stamps seen so far: stamp k lies at the first one plus k times a step between `low`
/// and `high`, up to the rounding of both stamps.
#[derive(Debug, Clone)]
pub(super) struct Clock {
    first: Stamp,
    /// The last stamp after the first, and the steps between them.
    last: f64,
    steps: u64,
    /// Lines that are missing so far.
    missing: f64,
    low: f64,
    high: f64,
    /// The step by the stamps that were read at first.
    usual: f64,
    /// How far the last stamp may be off, with the first one: half of the last digit of both.
    error: f64,
    /// Least digit and most digits of all stamps: some writers leave out zeros at the end, and some write
    /// fewer decimals as the time grows.
    digit: f64,
    digits: i32,
    /// The shortest and the longest step.
    least: f64,
    most: f64,
}

impl Clock {
    /// From the first stamps, two at least, which are judged too: the lines that are missing before each.
    ///
    /// # Errors
    /// The place of the first wrong stamp, and what is wrong with it.
    pub(super) fn of(stamps: &[Stamp]) -> Result<(Self, Vec<u64>), (usize, Unsteady)> {
        let first = stamps[0];
        let mut clock = Self {
            first,
            last: 0.0,
            steps: 0,
            missing: 0.0,
            low: 0.0,
            high: 0.0,
            usual: 0.0,
            error: 0.0,
            digit: first.digit(),
            digits: first.digits(),
            least: 0.0,
            most: 0.0,
        };
        stamps.iter().for_each(|stamp| clock.learn_digits(*stamp));
        let steps: Vec<f64> = stamps.windows(2).map(|pair| pair[1].since(pair[0])).collect();
        let usual = clock.usual_step(&steps)?;
        clock.usual = usual;
        clock.least = steps.iter().copied().fold(usual, f64::min);
        clock.most = steps.iter().copied().fold(usual, f64::max);
        let range = STEP_RANGE * usual + 2.0 * ROUNDING * clock.digit;
        (clock.low, clock.high) = ((usual - range).max(0.0), usual + range);
        let mut missing = vec![0];
        for (k, stamp) in stamps.iter().enumerate().skip(1) {
            missing.push(clock.take(*stamp).map_err(|fault| (k, fault))?);
        }
        Ok((clock, missing))
    }

    fn learn_digits(&mut self, stamp: Stamp) {
        self.digit = self.digit.min(stamp.digit());
        self.digits = self.digits.max(stamp.digits());
    }

    /// The mean of the steps that are no longer than usual; all of one digit or two have several lengths.
    fn usual_step(&self, steps: &[f64]) -> Result<f64, (usize, Unsteady)> {
        let count = steps.len() as f64;
        let repeated = steps.iter().filter(|step| **step == 0.0).count() as f64;
        let mean = (steps.iter().sum::<f64>() / count).abs();
        if repeated > REPEATED * count && steps.len() > 1 {
            return Err((1, Unsteady::Coarse { digit: self.digit, step: mean }));
        }
        let mut forward: Vec<f64> = steps.iter().copied().filter(|step| *step > 0.0).collect();
        if forward.is_empty() {
            let by = -steps[0];
            return Err((1, if by > 0.0 { Unsteady::Back { by } } else { Unsteady::Doubled }));
        }
        forward.sort_by(f64::total_cmp);
        let most = 1.5 * forward[forward.len() / 2] + self.digit;
        let single = &forward[..forward.partition_point(|step| *step <= most)];
        Ok(single.iter().sum::<f64>() / single.len() as f64)
    }

    /// Half of the range in which the true time of a stamp lies.
    fn rounding(&self, stamp: Stamp) -> f64 {
        // As many digits as any stamp has, but none below the last decimal.
        let magnitude = stamp.value().abs();
        let last = |decade: f64| 10f64.powi(decade as i32 + 1 - self.digits);
        let significant = if magnitude > 0.0 { last(magnitude.log10().floor()) } else { 0.0 };
        ROUNDING * self.digit.max(significant) + SUMS * self.usual
    }

    /// The next stamp: the lines that are missing before it.
    ///
    /// # Errors
    /// [`Unsteady`].
    pub(super) fn take(&mut self, stamp: Stamp) -> Result<u64, Unsteady> {
        self.learn_digits(stamp);
        let at = stamp.since(self.first);
        let (step, usual) = (at - self.last, self.usual.clamp(self.low, self.high));
        if step <= 0.0 {
            return Err(if step < 0.0 { Unsteady::Back { by: -step } } else { Unsteady::Doubled });
        }
        let lines = (step / usual).round();
        let is_counted = lines * (self.high - self.low) <= 2.0 * COUNTED * usual || self.is_exact();
        if self.missing + lines > MOST_MISSING || lines > 1.0 && self.steps > 1 && !is_counted {
            return Err(Unsteady::Gap { lines });
        }
        let total = self.steps + lines as u64;
        let error = self.rounding(self.first) + self.rounding(stamp);
        let low = self.low.max((at - error) / total as f64);
        let high = self.high.min((at + error) / total as f64);
        let (least, most) = (self.least.min(step), self.most.max(step));
        if lines < 1.0 || low > high {
            return Err(Unsteady::Uneven { step, usual, least, most, digit: self.digit });
        }
        (self.least, self.most) = (least, most);
        (self.low, self.high, self.last, self.steps) = (low, high, at, total);
        self.error = error * HALF / ROUNDING;
        self.missing += lines - 1.0;
        Ok(lines as u64 - 1)
    }

    /// The step: the mean of all, or the nearest that fits every stamp.
    pub(super) fn step(&self) -> f64 {
        let mean = if self.steps > 0 { self.last / self.steps as f64 } else { self.usual };
        mean.clamp(self.low, self.high)
    }

    /// The step is a whole number of last digits, so that nothing was rounded.
    fn is_exact(&self) -> bool {
        let digits = self.step() / self.digit;
        (digits - digits.round()).abs() < SUMS
    }

    /// How far the true step may be from [`Clock::step`].
    pub(super) fn step_error(&self) -> f64 {
        self.error / self.steps.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(texts: &[String]) -> Result<(f64, f64, u64), (usize, Unsteady)> {
        let stamps: Vec<Stamp> = texts.iter().map(|text| Stamp::parse(text).unwrap()).collect();
        // Some at first, the rest one by one.
        let (mut clock, mut missing) = Clock::of(&stamps[..stamps.len().min(64)])?;
        for (k, stamp) in stamps.iter().enumerate().skip(64) {
            missing.push(clock.take(*stamp).map_err(|fault| (k, fault))?);
        }
        assert_eq!(clock.steps, stamps.len() as u64 - 1 + missing.iter().sum::<u64>());
        Ok((clock.step(), clock.step_error(), missing.iter().sum()))
    }

    fn texts(count: u32, text: impl Fn(f64) -> String) -> Vec<String> {
        (0..count).map(|k| text(f64::from(k))).collect()
    }

    /// Formats as `%.6g` of C does, in scientific notation.
    fn six_digits(time: f64) -> String {
        let text = format!("{time:.5e}");
        let (mantissa, power) = text.split_once('e').unwrap();
        format!("{}e{power}", mantissa.trim_end_matches('0').trim_end_matches('.'))
    }

    #[test]
    fn rounded_stamps_of_an_even_clock_are_even_to_the_end() {
        let step = 1.0 / 24e3;
        for lines in [
            texts(100_000, |k| format!("{:.6}", k * step)),
            texts(100_000, |k| format!("{:.6}", 1.764e9 + k * step)),
            texts(100_000, |k| format!("{:.5e}", k * step)),
            texts(20_000, |k| six_digits(k * step)),
            texts(20_000, |k| (k * step).to_string()),
            // Truncated.
            texts(20_000, |k| format!("{:.6}", (k * step * 1e6).floor() / 1e6)),
        ] {
            let (found, error, missing) =
                judged(&lines).unwrap_or_else(|(k, fault)| panic!("{k} {} {fault:?}", lines[k]));
            assert!((found - step).abs() <= error && error < 1e-4 * step, "{found} {error}");
            assert_eq!(missing, 0);
        }
        // 1.4 digits in a step, and one.
        assert_eq!(judged(&texts(5000, |k| format!("{:.3}", k / 700.0))).unwrap().2, 0);
        assert_eq!(judged(&texts(5000, |k| format!("{k}"))).unwrap().0, 1.0);
    }

    #[test]
    fn missing_lines_are_counted() {
        for (text, digits) in [(1.0, 0), (1.0 / 24e3, 6), (0.1, 1)] {
            let mut lines = texts(1000, |k| format!("{:.digits$}", k * text));
            lines.drain(701..703);
            lines.remove(300);
            lines.remove(5);
            assert_eq!(judged(&lines).unwrap().2, 4, "{text}");
        }
    }

    #[test]
    fn every_other_stamp_is_named_for_what_it_is() {
        let even = || texts(1000, |k| format!("{:.6}", k / 24e3));
        for at in [30, 900] {
            for (text, want) in [
                (even()[at - 1].clone(), "Doubled"),
                (even()[at - 3].clone(), "Back"),
                (format!("{:.6}", (at as f64 + 0.2) / 24e3), "Uneven"),
                ("1e9".to_owned(), "Gap"),
            ] {
                let mut lines = even();
                lines[at] = text;
                let (k, fault) = judged(&lines).unwrap_err();
                assert!(k == at && format!("{fault:?}").starts_with(want), "{k} {at} {fault:?}");
            }
        }
        let coarse = texts(600, |k| six_digits(0.01 + 2e-8 * k));
        let message = judged(&coarse).unwrap_err().1.message(Some(1.0));
        assert!(message.contains("100 ns") && message.contains("about 20."), "{message}");
        let drifting = texts(3000, |k| format!("{:.6}", k / 24e3 * (1.0 + 1e-7 * k)));
        assert!(matches!(judged(&drifting), Err((64.., Unsteady::Uneven { .. }))));
    }
}
