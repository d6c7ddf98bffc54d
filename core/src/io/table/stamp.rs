//! Time stamps as they are written: decimals, dates and times of day, without a rounding.

/// Most decimals of the seconds of a date, so that all digits fit an `i64`.
const DATE_DECIMALS: usize = 9;
/// Most digits of minutes.
const MINUTE_DIGITS: usize = 6;
/// Largest power of ten; doubles have none beyond it.
const MOST_POWER: i32 = 350;
/// Most decades by which two stamps may be brought to one exponent exactly.
const EXACT_DECADES: u32 = 18;

/// `mantissa` times 10^`exponent`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamp {
    mantissa: i64,
    exponent: i32,
    /// It was a date or a time of day, in seconds.
    pub(super) is_date: bool,
    /// It was a time of day alone.
    is_of_day: bool,
}

/// Seconds of a day.
const DAY: i64 = 86_400;

/// The days of a recording whose stamps are times of day.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Days {
    last: Option<Stamp>,
    midnights: i64,
}

impl Days {
    /// The next stamp, after the midnights so far: one that is more than half a day before the last follows
    /// another midnight.
    pub(super) fn count(&mut self, stamp: Stamp) -> Stamp {
        if !stamp.is_of_day {
            return stamp;
        }
        if self.last.is_some_and(|last| last.since(stamp) > 0.5 * DAY as f64) {
            self.midnights += 1;
        }
        self.last = Some(stamp);
        let days = self.midnights.saturating_mul(DAY * 10_i64.pow(stamp.exponent.unsigned_abs()));
        Stamp { mantissa: stamp.mantissa.saturating_add(days), ..stamp }
    }
}

impl Stamp {
    /// Of a number, a date, or a time of day.
    pub(super) fn parse(text: &str) -> Option<Self> {
        if text.contains(':') { date_time(text) } else { decimal(text) }
    }

    pub(super) fn value(self) -> f64 {
        self.mantissa as f64 * 10f64.powi(self.exponent)
    }

    /// The value of one unit of its last digit.
    pub(super) fn digit(self) -> f64 {
        10f64.powi(self.exponent)
    }

    /// Its digits from the first that is not zero.
    pub(super) fn digits(self) -> i32 {
        self.mantissa.unsigned_abs().checked_ilog10().map_or(0, |log| log as i32 + 1)
    }

    /// How much later than `origin` it is, without the rounding of both.
    pub(super) fn since(self, origin: Self) -> f64 {
        let exponent = self.exponent.min(origin.exponent);
        let at = |stamp: Self| {
            let decades = stamp.exponent.abs_diff(exponent);
            (decades <= EXACT_DECADES).then(|| i128::from(stamp.mantissa) * 10i128.pow(decades))
        };
        match (at(self), at(origin)) {
            // The quotient of two exact numbers is rounded once.
            (Some(a), Some(b)) if exponent < 0 => (a - b) as f64 / 10f64.powi(-exponent),
            (Some(a), Some(b)) => (a - b) as f64 * 10f64.powi(exponent),
            _ => self.value() - origin.value(),
        }
    }
}

/// A decimal number, with a point or a comma.
fn decimal(text: &str) -> Option<Stamp> {
    let (number, power) = match text.split_once(['e', 'E']) {
        Some((number, power)) => {
            (number, power.parse().ok().filter(|power: &i32| power.abs() <= MOST_POWER)?)
        }
        None => (text, 0),
    };
    let unsigned = number.strip_prefix(['-', '+']).unwrap_or(number);
    let (mut mantissa, mut exponent, mut is_after, mut any, mut is_full) =
        (0_i64, power, false, false, false);
    for byte in unsigned.bytes() {
        match byte {
            b'.' | b',' if !is_after => is_after = true,
            b'0'..=b'9' => {
                any = true;
                let digit = i64::from(byte - b'0');
                let longer = mantissa.checked_mul(10).and_then(|longer| longer.checked_add(digit));
                match longer.filter(|_| !is_full) {
                    Some(longer) => {
                        mantissa = longer;
                        exponent = exponent.saturating_sub(i32::from(is_after));
                    }
                    // Digits beyond those of the mantissa are left out.
                    None => {
                        is_full = true;
                        exponent = exponent.saturating_add(i32::from(!is_after));
                    }
                }
            }
            _ => return None,
        }
    }
    let mantissa = if number.starts_with('-') { -mantissa } else { mantissa };
    any.then_some(Stamp { mantissa, exponent, is_date: false, is_of_day: false })
}

/// `2026-11-28T10:00:00.125Z`, with a space for the T, with / for the -, with an offset from UTC, or the
/// time of day alone, or minutes and seconds with decimals. Seconds count from 1970, or from midnight.
fn date_time(text: &str) -> Option<Stamp> {
    let start = text.find(['T', ' ', '_']);
    let (date, time) = match start {
        Some(at) => (days(&text[..at])?, &text[at + 1..]),
        None => (0, text),
    };
    let is_of_day = start.is_none();
    let time = time.trim_end_matches("UTC").trim_end_matches(['Z', ' ']);
    let (time, offset) = match time.rfind(['+', '-']) {
        Some(at) => (&time[..at], offset(&time[at..])?),
        None => (time, 0),
    };
    let (clock, decimals) = time.split_once(['.', ',']).unwrap_or((time, ""));
    let decimals = decimals.get(..decimals.len().min(DATE_DECIMALS))?;
    let fraction = if decimals.is_empty() { 0 } else { whole(decimals, DATE_DECIMALS)? };
    let stamp = |seconds: i64, is_of_day| {
        let mantissa = seconds.checked_mul(10_i64.pow(decimals.len() as u32))?.checked_add(fraction)?;
        Some(Stamp { mantissa, exponent: -(decimals.len() as i32), is_date: true, is_of_day })
    };
    if let Some((minutes, seconds)) =
        clock.split_once(':').filter(|(_, seconds)| is_of_day && !seconds.contains(':'))
    {
        // 10:00 may be hours or minutes.
        let seconds = whole(seconds, 2).filter(|seconds| *seconds < 60 && !decimals.is_empty())?;
        return stamp(60 * whole(minutes, MINUTE_DIGITS)? + seconds, false);
    }
    let mut parts = clock.split(':').map(|part| whole(part, 2));
    let (hour, minute) = (parts.next()??, parts.next()??);
    let second = parts.next().unwrap_or(Some(0))?;
    if parts.next().is_some() || hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    stamp(DAY * date + 3600 * hour + 60 * minute + second - offset, is_of_day)
}

/// Up to `most` digits.
fn whole(text: &str, most: usize) -> Option<i64> {
    let is_whole = (1..=most).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    is_whole.then(|| text.parse().ok()).flatten()
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
fn days(text: &str) -> Option<i64> {
    let mut parts = text.split(['-', '/']);
    let (year, month, day) = (parts.next()?, whole(parts.next()?, 2)?, whole(parts.next()?, 2)?);
    let year = whole(year, 4).filter(|_| year.len() == 4)?;
    if parts.next().is_some() || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Years begin in March, so that the leap day is the last one.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leaps = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    Some(365 * year + leaps + (153 * month + 2) / 5 + day - 1 - 719_468)
}

/// Seconds by which `+01:00` or `-0530` is before UTC.
fn offset(text: &str) -> Option<i64> {
    let digits: String = text[1..].chars().filter(|c| *c != ':').collect();
    let hours = whole(digits.get(..2)?, 2)?;
    let minutes = digits.get(2..).filter(|rest| !rest.is_empty()).map_or(Some(0), |rest| whole(rest, 2))?;
    let seconds = 3600 * hours + 60 * minutes;
    Some(if text.starts_with('-') { -seconds } else { seconds })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_last_digit() {
        for (text, value, digit, digits) in [
            ("2.125", 2.125, 1e-3, 4),
            ("-4.20e-5", -4.2e-5, 1e-7, 3),
            ("+17", 17.0, 1.0, 2),
            ("1E3", 1e3, 1e3, 1),
            ("0,000042", 42e-6, 1e-6, 2),
            ("0.000", 0.0, 1e-3, 0),
            ("123456789012345678901", 1.234_567_890_123_456_8e20, 1e2, 19),
        ] {
            let stamp = Stamp::parse(text).unwrap();
            assert!((stamp.value() - value).abs() <= 1e-15 * value.abs(), "{text}");
            assert!((stamp.digit() / digit - 1.0).abs() < 1e-12 && stamp.digits() == digits, "{text}");
        }
        for text in ["", "-", "1.2.3", "1e", "x", "nan", "1e99999999999", "0x1"] {
            assert_eq!(Stamp::parse(text), None, "{text}");
        }
    }

    #[test]
    fn differences_are_exact() {
        let since = |a: &str, b: &str| Stamp::parse(a).unwrap().since(Stamp::parse(b).unwrap());
        assert_eq!(since("1764324000123456789", "1764324000123456000"), 789.0);
        assert_eq!(since("0.3", "0.1"), 0.2);
        assert_eq!(since("2026-11-28T10:00:00.000123Z", "2026-11-28 09:59:59"), 1.000_123);
        assert_eq!(since("1e-300", "1"), -1.0);
    }

    #[test]
    fn times_of_day_go_on_after_midnight() {
        let mut days = Days::default();
        let mut count = |text: &str| days.count(Stamp::parse(text).unwrap()).value();
        assert_eq!(
            ["23:59:59.5", "00:00:00.5", "23:00:00", "01:00:00"].map(&mut count),
            [86_399.5, 86_400.5, 169_200.0, 176_400.0]
        );
        // A step back stays one, and dates say their day.
        assert_eq!(["00:59:00", "1970-01-01T01:00:00"].map(count), [176_340.0, 3600.0]);
    }

    /// Each second line of this table seems to be another day: more than nanoseconds of an `i64` can count.
    #[test]
    fn any_number_of_midnights_is_counted() {
        let mut days = Days::default();
        let stamps = ["23:00:00.000000000", "01:00:00.000000000"].map(|text| Stamp::parse(text).unwrap());
        let last = (0..300_000).map(|k| days.count(stamps[k % 2]).value()).last();
        assert!(last.is_some_and(|last| last > 9e9), "{last:?}");
    }

    #[test]
    fn dates_are_seconds_since_1970() {
        for (text, seconds) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2026-11-28T10:00:00.5Z", 1_795_860_000.5),
            ("2026/11/28 11:00:00,500+01:00", 1_795_860_000.5),
            ("2000-02-29 12:00 UTC", 951_825_600.0),
            ("2026-11-28 04:30:00-0530", 1_795_860_000.0),
            ("01:02:03.25", 3723.25),
            ("01:00.5", 60.5),
            ("75:00.0", 4500.0),
        ] {
            assert_eq!(Stamp::parse(text).map(Stamp::value), Some(seconds), "{text}");
        }
        for text in
            ["10:00", "10:", "25:00:00", "2026-13-01 00:00:00", "1:2:3:4", "2026-11-28T10:00:é", ":", "-1:00"]
        {
            assert_eq!(Stamp::parse(text), None, "{text}");
        }
    }
}
