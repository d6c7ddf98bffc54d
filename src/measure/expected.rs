//! The lines that theory expects: their frequencies, and which of them coincide.

use super::Cause;

/// The spurs at a frequency and, in complex records, at its negative.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Sides {
    pub(super) forward: Vec<Cause>,
    pub(super) backward: Vec<Cause>,
}

/// A line at which at least one spur is expected.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    /// Cycles per sample, 0 to 1/2.
    pub(super) cycles: f64,
    pub(super) causes: Sides,
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
    /// Frequencies of the tones in cycles per sample; those of a complex record may be negative.
    pub(super) tones: &'a [f64],
    /// Complex records tell a frequency from its negative, and hold an image there of whatever they hold.
    pub(super) is_complex: bool,
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
        expected.add_harmonics(pattern);
        expected.add_intermodulation(pattern);
        expected.add_offsets(pattern);
        for (tone, f) in pattern.tones.iter().enumerate() {
            let seen = pattern.seen(*f);
            for k in 1..pattern.converters {
                let of = pattern.converters;
                let causes = pattern.displaced(seen, k, pattern.number(tone));
                expected.add(pattern, seen + k as f64 / of as f64, causes);
            }
        }
        expected
    }

    fn add_harmonics(&mut self, pattern: &Pattern<'_>) {
        for (tone, f) in pattern.tones.iter().enumerate() {
            let f = if pattern.is_complex { *f } else { f.abs() };
            for order in 2..=pattern.harmonics {
                let (cycles, tone) = (order as f64 * f, pattern.number(tone));
                let cause = Cause::Harmonic { order, folded: cycles.abs() > 0.5, tone };
                self.add(pattern, cycles, [cause, Cause::Image { order, tone }]);
            }
        }
    }

    fn add_intermodulation(&mut self, pattern: &Pattern<'_>) {
        for (j, g) in pattern.tones.iter().enumerate() {
            for (i, f) in pattern.tones[..j].iter().enumerate() {
                for (a, b) in [(1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (-1, 2)] {
                    let cause = |a, b| Cause::Intermodulation { a, first: i + 1, b, second: j + 1 };
                    let cycles = f64::from(a) * f + f64::from(b) * g;
                    self.add(pattern, cycles, [cause(a, b), cause(-a, -b)]);
                }
            }
        }
    }

    fn add_offsets(&mut self, pattern: &Pattern<'_>) {
        let of = pattern.converters;
        // No sine can be fitted there, so that it is never found among the unexpected lines.
        self.half_rate = Some(Cause::Unknown);
        for k in 1..=of / 2 {
            let cause = Cause::Offset { k, of };
            if 2 * k == of {
                self.half_rate = Some(cause);
            } else {
                self.add(pattern, k as f64 / of as f64, [cause, Cause::Offset { k: of - k, of }]);
            }
        }
    }

    /// Adds a line at the alias of `cycles`, or to the one that is there: its cause, and that of its image.
    fn add(&mut self, pattern: &Pattern<'_>, cycles: f64, [cause, image]: [Cause; 2]) {
        let place = folded(cycles);
        let is_near = |other: f64| (place - other).abs() < pattern.resolution;
        if is_near(0.0) || is_near(0.5) || pattern.tones.iter().any(|f| is_near(folded(*f))) {
            return self.hidden.push(cause);
        }
        let line = match self.lines.iter().position(|line| is_near(line.cycles)) {
            Some(at) => &mut self.lines[at],
            None => {
                self.lines.push(Line { cycles: place, causes: Sides::default() });
                self.lines.last_mut().expect("it was pushed")
            }
        };
        let is_backward = pattern.is_complex && cycles - cycles.round() < 0.0;
        let Sides { forward, backward } = &mut line.causes;
        let (own, other) = if is_backward { (backward, forward) } else { (forward, backward) };
        own.push(cause);
        if pattern.is_complex {
            other.push(image);
        }
    }

    /// True for a frequency within the resolution of a tone or of an expected line.
    pub(super) fn holds(&self, pattern: &Pattern<'_>, cycles: f64) -> bool {
        let tones = pattern.tones.iter().map(|f| folded(*f));
        let mut all = self.lines.iter().map(|line| line.cycles).chain(tones);
        all.any(|other| (cycles - other).abs() < pattern.resolution)
    }
}

impl Pattern<'_> {
    /// What messages call a tone: 0 for the only one.
    pub(super) fn number(&self, tone: usize) -> usize {
        if self.tones.len() == 1 { 0 } else { tone + 1 }
    }

    /// Where the record shows a frequency, in cycles per sample.
    pub(super) fn seen(&self, cycles: f64) -> f64 {
        if self.is_complex { cycles - cycles.round() } else { folded(cycles) }
    }

    /// The causes of the line at seen + k / of and of its image.
    fn displaced(&self, seen: f64, k: usize, tone: usize) -> [Cause; 2] {
        let of = self.converters;
        if !self.is_complex {
            return [image(seen, k, of, tone); 2];
        }
        let cause = |k, is_sum| Cause::GainOrSkew { k, of, is_sum, tone };
        [cause(k, true), cause(of - k, false)]
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

/// The cause of a line that was found at `cycles` beside the expected ones. What the fit of a line leaves,
/// because it is not steady, is unknown.
pub(super) fn unexpected(pattern: &Pattern<'_>, expected: &Expected, cycles: f64) -> Cause {
    let of = pattern.converters;
    let [f] = pattern.tones else { return Cause::Unknown };
    if expected.holds(pattern, folded(cycles)) {
        return Cause::Unknown;
    }
    for order in 2..=pattern.harmonics {
        for k in 1..of {
            let displaced = pattern.seen(order as f64 * f + k as f64 / of as f64);
            if (displaced - cycles).abs() < pattern.resolution {
                return Cause::HarmonicImage { order, k, of };
            }
        }
    }
    Cause::Unknown
}
