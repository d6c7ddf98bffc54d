//! The lines that theory expects: their frequencies, and which of them coincide.

use super::Cause;

/// A line at which at least one spur is expected.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    /// Cycles per sample, 0 to 1/2.
    pub(super) cycles: f64,
    pub(super) causes: Vec<Cause>,
}

/// The expected lines of a record.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Expected {
    pub(super) lines: Vec<Line>,
    /// The line at exactly half the rate, where there is no phase: offsets, if there is an even number of
    /// converters.
    pub(super) half_rate: Option<Cause>,
    /// Spurs that coincide with a tone, with the constant or with half the rate.
    pub(super) hidden: Vec<Cause>,
}

/// Which lines are expected.
pub(super) struct Pattern<'a> {
    /// Frequencies of the tones in cycles per sample.
    pub(super) tones: &'a [f64],
    /// Converters in turn; 1 for none.
    pub(super) converters: usize,
    /// Highest order of harmonics.
    pub(super) harmonics: usize,
    /// Lines closer than this are one (cycles per sample).
    pub(super) resolution: f64,
}

impl Expected {
    /// All lines of a pattern. Where lines coincide, harmonics come first, then offsets, then images.
    pub(super) fn of(pattern: &Pattern<'_>) -> Self {
        let mut expected = Self::default();
        let number = |tone: usize| if pattern.tones.len() == 1 { 0 } else { tone + 1 };
        for (tone, f) in pattern.tones.iter().enumerate() {
            for order in 2..=pattern.harmonics {
                let cycles = order as f64 * f.abs();
                let folded = cycles > 0.5;
                expected.add(pattern, cycles, Cause::Harmonic { order, folded, tone: number(tone) });
            }
        }
        expected.add_intermodulation(pattern);
        let of = pattern.converters;
        // No sine can be fitted there, so that it is never found among the unexpected lines.
        expected.half_rate = Some(Cause::Unknown);
        for k in 1..=of / 2 {
            let cause = Cause::Offset { k, of };
            if 2 * k == of {
                expected.half_rate = Some(cause);
            } else {
                expected.add(pattern, k as f64 / of as f64, cause);
            }
        }
        for (tone, f) in pattern.tones.iter().enumerate() {
            for k in 1..of {
                let seen = folded(*f);
                expected.add(pattern, seen + k as f64 / of as f64, image(seen, k, of, number(tone)));
            }
        }
        expected
    }

    fn add_intermodulation(&mut self, pattern: &Pattern<'_>) {
        for (j, g) in pattern.tones.iter().enumerate() {
            for (i, f) in pattern.tones[..j].iter().enumerate() {
                for (a, b) in [(1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (-1, 2)] {
                    let cause = Cause::Intermodulation { a, first: i + 1, b, second: j + 1 };
                    self.add(pattern, f64::from(a) * f + f64::from(b) * g, cause);
                }
            }
        }
    }

    /// Adds a line at the alias of `cycles`, or to the one that is there.
    fn add(&mut self, pattern: &Pattern<'_>, cycles: f64, cause: Cause) {
        let cycles = folded(cycles);
        let is_near = |other: f64| (cycles - other).abs() < pattern.resolution;
        if is_near(0.0) || is_near(0.5) || pattern.tones.iter().any(|f| is_near(folded(*f))) {
            return self.hidden.push(cause);
        }
        match self.lines.iter_mut().find(|line| is_near(line.cycles)) {
            Some(line) => line.causes.push(cause),
            None => self.lines.push(Line { cycles, causes: vec![cause] }),
        }
    }
}

/// The alias in 0 ..= 1/2.
pub(super) fn folded(cycles: f64) -> f64 {
    (cycles - cycles.round()).abs()
}

/// The name of the line at the alias of f + k / of, for f in 0 ..= 1/2: 0 < f + k / of < 3/2.
fn image(f: f64, k: usize, of: usize, tone: usize) -> Cause {
    let is_sum = f + k as f64 / of as f64 <= 0.5;
    Cause::GainOrSkew { k: if is_sum { k } else { of - k }, of, is_sum, tone }
}

impl Expected {
    /// True for a frequency within the resolution of a tone or of an expected line.
    fn holds(&self, pattern: &Pattern<'_>, cycles: f64) -> bool {
        let tones = pattern.tones.iter().map(|f| folded(*f));
        let mut all = self.lines.iter().map(|line| line.cycles).chain(tones);
        all.any(|other| (cycles - other).abs() < pattern.resolution)
    }
}

/// The cause of a line that was found at `cycles` beside the expected ones. What the fit of a line leaves,
/// because it is not steady, is unknown.
pub(super) fn unexpected(pattern: &Pattern<'_>, expected: &Expected, cycles: f64) -> Cause {
    let of = pattern.converters;
    let [f] = pattern.tones else { return Cause::Unknown };
    if expected.holds(pattern, cycles) {
        return Cause::Unknown;
    }
    for order in 2..=pattern.harmonics {
        for k in 1..of {
            let image = folded(order as f64 * f + k as f64 / of as f64);
            if (image - cycles).abs() < pattern.resolution {
                return Cause::HarmonicImage { order, k, of };
            }
        }
    }
    Cause::Unknown
}
