//! The static nonlinearity of a converter as a table: the mean of what sines leave of its samples, code by
//! code, smoothed.
//!
//! A sample belongs to the code that is nearest to the sines. Of samples that have one code the noise has a
//! mean, because where a sine is flat more of them came from below than from beyond: a table of these means
//! would bend what is straight.
//!
//! Cells halve from level to level. Both halves of a cell differ by D, of which the noise s^2 of the samples
//! explains v = s^2 (1/n_1 + 1/n_2). What all differences of a level have beyond that is their variance t^2,
//! and D counts by t^2 / (t^2 + v): steps at the bits of a converter stay, and what is noise goes (empirical
//! Bayes; B. Efron and C. Morris, *Stein's estimation rule and its competitors*, J. Am. Stat. Assoc. 68,
//! 1973, of Haar's wavelets). Codes without samples have the value of the cell that holds them.

use super::nonlinearity::is_clearly_less;
use crate::runtime::Nonlinearity;

/// Cells of the finest level: the codes of 12 bits.
const CELLS: usize = 1 << 12;
/// Cells of the shortest table.
const FEWEST_CELLS: usize = 16;
/// Rounds in which the table and the lines of the parts are fitted in turn: each takes what the other one
/// has left, and the levels of tones differ by far less than the range.
const ROUNDS: usize = 12;
/// Steps of the entries, relative to full scale: a thousandth of a step of 12 bits in few digits.
const ENTRIES_PER_FULL_SCALE: f64 = 1e7;

/// Bits of converters whose codes are looked for, and the share of a step that a file may have rounded off.
const FEWEST_BITS: i32 = 2;
const MOST_BITS: i32 = 20;
const STEP_TOLERANCE: f64 = 1.0 / 64.0;
/// Least variance of samples of one code: what rounding leaves of sums.
const LEAST_NOISE: f64 = 1e-24;

/// Sums over the samples of a cell.
#[derive(Debug, Clone, Copy, Default)]
struct CellSums {
    count: f64,
    x: f64,
    left: f64,
}

/// Sums over the samples of a part.
#[derive(Debug, Clone)]
struct PartSums {
    cells: Vec<CellSums>,
    xx: f64,
    x_left: f64,
    squares: f64,
}

/// What a fit of sines takes of a table in a part: a constant and a part along x, which differ with the
/// levels of the sines.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    constant: f64,
    slope: f64,
}

/// The sums of a table in parts, of which each is left out in turn.
#[derive(Debug, Clone, Default)]
pub struct TableFit {
    parts: Vec<PartSums>,
}

impl TableFit {
    pub(super) fn add(&mut self, part: impl Iterator<Item = (f64, f64)>) {
        let cells = vec![CellSums::default(); CELLS];
        let mut sums = PartSums { cells, xx: 0.0, x_left: 0.0, squares: 0.0 };
        let part: Vec<(f64, f64)> = part.collect();
        let step = step(&part);
        for (sample, left) in part {
            let x = sample - left;
            let code = step.map_or(x, |step| (x / step).round() * step);
            let cell = &mut sums.cells[Nonlinearity::cell(CELLS, code)];
            (cell.count, cell.x, cell.left) = (cell.count + 1.0, cell.x + x, cell.left + left);
            sums.xx += x * x;
            sums.x_left += x * left;
            sums.squares += left * left;
        }
        self.parts.push(sums);
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.parts.extend_from_slice(&other.parts);
    }

    /// The table, of as few entries as have all values; none if it leaves no less of the parts left out
    /// than lines do.
    pub(super) fn curve(&self) -> Nonlinearity {
        let zeros = vec![0.0; CELLS];
        let line: Vec<f64> = self.parts.iter().map(|part| part.left(&zeros)).collect();
        let others = |k: usize| self.table(|other| other != k);
        let left: Vec<f64> = self.parts.iter().enumerate().map(|(k, part)| part.left(&others(k))).collect();
        match is_clearly_less(&line, &left) {
            true => Nonlinearity::Table { table: shortened(self.table(|_| true)) },
            false => Nonlinearity::default(),
        }
    }

    /// The entries of all cells, from some of the parts.
    fn table(&self, takes_part: impl Fn(usize) -> bool) -> Vec<f64> {
        let parts = self.parts.iter().enumerate().filter(|(k, _)| takes_part(*k));
        let parts: Vec<&PartSums> = parts.map(|(_, part)| part).collect();
        let noise = noise(&parts);
        let mut lines = vec![Line::default(); parts.len()];
        let mut table = Vec::new();
        for _ in 0..ROUNDS {
            let mut cells = vec![[0.0; 2]; CELLS];
            for (part, line) in parts.iter().zip(&lines) {
                for ([count, left], own) in cells.iter_mut().zip(&part.cells) {
                    *count += own.count;
                    *left += own.left - line.constant * own.count - line.slope * own.x;
                }
            }
            table = smoothed(cells, noise);
            lines = parts.iter().map(|part| part.line(&table)).collect();
        }
        table
    }
}

impl PartSums {
    /// The line of least squares through what a table leaves.
    fn line(&self, table: &[f64]) -> Line {
        let (mut count, mut x, mut left, mut x_left) = (0.0, 0.0, 0.0, self.x_left);
        for (cell, entry) in self.cells.iter().zip(table) {
            count += cell.count;
            x += cell.x;
            left += cell.left - entry * cell.count;
            x_left -= entry * cell.x;
        }
        let determinant = count * self.xx - x * x;
        if determinant <= f64::EPSILON * count * self.xx {
            return Line { constant: left / f64::max(count, 1.0), slope: 0.0 };
        }
        let slope = (count * x_left - x * left) / determinant;
        Line { constant: (left - slope * x) / count, slope }
    }

    /// The squares that a table and a line leave.
    fn left(&self, table: &[f64]) -> f64 {
        let Line { constant, slope } = self.line(table);
        let mut squares = self.squares - 2.0 * slope * self.x_left + slope * slope * self.xx;
        for (cell, entry) in self.cells.iter().zip(table) {
            let moved = entry + constant;
            squares += moved * (moved * cell.count - 2.0 * cell.left + 2.0 * slope * cell.x);
        }
        squares
    }
}

/// The step of the codes: the largest power of two of which all samples are multiples.
fn step(part: &[(f64, f64)]) -> Option<f64> {
    let is_multiple = |x: f64, step: f64| (x / step - (x / step).round()).abs() < STEP_TOLERANCE;
    let mut steps = (FEWEST_BITS..=MOST_BITS).map(|bits| f64::from(1 - bits).exp2());
    steps.find(|step| part.iter().all(|(x, _)| is_multiple(*x, *step)))
}

/// The variance of samples of one code, from all parts together.
fn noise(parts: &[&PartSums]) -> f64 {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for part in parts {
        squares += part.squares;
        for cell in part.cells.iter().filter(|cell| cell.count > 0.0) {
            squares -= cell.left * cell.left / cell.count;
            freedom += cell.count - 1.0;
        }
    }
    (squares / f64::max(freedom, 1.0)).max(LEAST_NOISE)
}

/// The entries of cells with counts and sums, by the differences of both halves of each larger cell.
fn smoothed(cells: Vec<[f64; 2]>, noise: f64) -> Vec<f64> {
    let mut levels = vec![cells];
    while let Some(fine) = levels.last().filter(|fine| fine.len() > 1) {
        let coarse = fine.chunks_exact(2).map(|pair| [pair[0][0] + pair[1][0], pair[0][1] + pair[1][1]]);
        let coarse = coarse.collect();
        levels.push(coarse);
    }
    // The constant of all cells is none of a converter's nonlinearity.
    let mut table = vec![0.0];
    for level in levels.iter().rev().skip(1) {
        let differences: Vec<Option<Difference>> =
            level.chunks_exact(2).map(|pair| Difference::new(pair, noise)).collect();
        let spread = spread(differences.iter().flatten());
        let halves = table.iter().zip(&differences);
        table = halves.flat_map(|(entry, difference)| halved(*entry, difference.as_ref(), spread)).collect();
    }
    table
}

/// By how much the second half of a cell is above the first.
struct Difference {
    value: f64,
    /// What the noise explains.
    variance: f64,
    /// The share of the second half in the samples.
    share: f64,
}

impl Difference {
    /// `None` if a half has no samples.
    fn new(pair: &[[f64; 2]], noise: f64) -> Option<Self> {
        let [[first, left], [second, right]] = [pair[0], pair[1]];
        (first > 0.0 && second > 0.0).then(|| Self {
            value: right / second - left / first,
            variance: noise * (1.0 / first + 1.0 / second),
            share: second / (first + second),
        })
    }
}

/// The variance of the true differences of a level, each weighted by what it says.
fn spread<'a>(differences: impl Iterator<Item = &'a Difference> + Clone) -> f64 {
    let weights: f64 = differences.clone().map(|one| one.variance.recip()).sum();
    let excess: f64 = differences.map(|one| one.value * one.value / one.variance - 1.0).sum();
    if weights > 0.0 { (excess / weights).max(0.0) } else { 0.0 }
}

/// The entries of both halves of a cell.
fn halved(entry: f64, difference: Option<&Difference>, spread: f64) -> [f64; 2] {
    let Some(Difference { value, variance, share }) = difference else { return [entry; 2] };
    let true_part = value * spread / (spread + variance);
    [entry - share * true_part, entry + (1.0 - share) * true_part]
}

/// The same values by as few entries as have them, in few digits.
fn shortened(table: Vec<f64>) -> Vec<f64> {
    let rounded = |entry: f64| (entry * ENTRIES_PER_FULL_SCALE).round() / ENTRIES_PER_FULL_SCALE + 0.0;
    let mut table: Vec<f64> = table.into_iter().map(rounded).collect();
    while table.len() > FEWEST_CELLS && table.chunks_exact(2).all(|pair| pair[0] == pair[1]) {
        table = table.into_iter().step_by(2).collect();
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Codes of a converter of 8 bits with these errors, of sines of one level, and what the sines leave of
    /// them: all that is not noise.
    fn part(errors: &[f64], level: f64, noise: f64, dice: &mut Random) -> Vec<(f64, f64)> {
        let phase = dice.part();
        let sample = |n: usize| {
            let code = (127.0 * level * (0.37 * n as f64 + phase).sin()).round();
            (code / 128.0, errors[(code + 128.0) as usize] + noise * dice.sample())
        };
        (0..6000).map(sample).collect()
    }

    /// Steps where the bits of the code change, as converters by successive approximation have them.
    fn steps() -> Vec<f64> {
        let weights = [2e-5, -3e-4, 4e-4, 1e-4, -5e-4, 8e-4, 1e-3, -1e-3];
        let of = |code: usize| (0..8).filter(|bit| code >> bit & 1 == 1).map(|bit| weights[bit]).sum();
        (0..256).map(of).collect()
    }

    fn fitted(errors: &[f64], levels: &[f64], noise: f64) -> Nonlinearity {
        let (mut fit, mut dice) = (TableFit::default(), Random(4));
        for level in levels {
            fit.add(part(errors, *level, noise, &mut dice).into_iter());
        }
        fit.curve()
    }

    /// A table differs from the errors by a line only, which is gain and offset.
    #[test]
    fn steps_are_found_in_noise_by_tones_of_several_levels() {
        let errors = steps();
        let found = fitted(&errors, &[0.99, 0.9, 0.97, 0.6, 0.99, 0.8], 5e-4);
        let Nonlinearity::Table { table } = &found else { panic!("{found:?}") };
        assert_eq!(table.len(), 256);
        let left: Vec<(f64, f64)> =
            (3..253).map(|code| (code as f64 / 128.0 - 1.0, errors[code] - table[code])).collect();
        let mut sums = TableFit::default();
        sums.add(left.iter().copied());
        let rms = |left: &[(f64, f64)]| (left.iter().map(|(_, r)| r * r).sum::<f64>() / 250.0).sqrt();
        let beside_a_line = (sums.parts[0].left(&vec![0.0; CELLS]) / 250.0).sqrt();
        let all: Vec<(f64, f64)> = (3..253).map(|code| (0.0, errors[code])).collect();
        assert!(beside_a_line < 0.1 * rms(&all), "{beside_a_line:e} of {:e}", rms(&all));
    }

    #[test]
    fn noise_alone_has_no_table() {
        assert!(fitted(&[0.0; 256], &[0.9; 8], 1e-3).is_straight());
    }

    /// A straight converter of 8 bits with noise of a step: its codes tell of the noise only.
    #[test]
    fn noise_of_a_step_does_not_bend_a_straight_converter() {
        let mut dice = Random(11);
        let mut normal = || (0..12).map(|_| dice.part()).sum::<f64>() - 6.0;
        let mut fit = TableFit::default();
        for _ in 0..8 {
            let sample = |n: usize| {
                let x = 0.9 * (0.37 * n as f64).sin();
                let code = (128.0 * x + normal()).round() / 128.0;
                (code, code - x)
            };
            fit.add((0..6000).map(sample).collect::<Vec<_>>().into_iter());
        }
        let largest = fit.curve().values().iter().fold(0.0, |most: f64, e| most.max(e.abs()));
        assert!(largest < 5e-4, "{largest:e}");
    }

    /// The means of the codes, where there is no noise to smooth.
    #[test]
    fn without_noise_the_entries_are_the_means() {
        let errors: Vec<f64> = (0..256).map(|code| 1e-3 * ((code * code) as f64).sin()).collect();
        let mut fit = TableFit::default();
        let mut dice = Random(9);
        (0..4).for_each(|_| fit.add(part(&errors, 0.9, 0.0, &mut dice).into_iter()));
        let Nonlinearity::Table { table } = fit.curve() else { panic!() };
        let line = fit.parts[0].line(&fit.table(|_| true));
        for code in 20..236 {
            let x = code as f64 / 128.0 - 1.0;
            let want = errors[code] - line.constant - line.slope * x;
            assert!((table[code] - want).abs() < 2e-7, "{code}: {} {want}", table[code]);
        }
    }
}
