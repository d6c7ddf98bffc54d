//! Values over time whose smoothness is learned from their readings, and whether they change at all.

use super::nonuniform::Measured;
use super::smoothing::{LeftOut, SmoothingSpline};

/// Readings beyond this many standard deviations of what the others say are refused.
const GATE_SIGMAS: f64 = 5.0;
/// Rounds in which readings are refused, those that contradict the others most in each.
const ROUNDS: usize = 12;
/// Readings on each side of the worst one that are judged again without it.
const BESIDE: usize = 4;
/// Readings scatter by no less than this share of their deviations, which are those of the Cramer-Rao bound
/// as far as few samples say it: else a rate that walks through all of them would explain them.
const LEAST_SCALE: f64 = 0.7;
/// A sum of negative logarithms that is larger than the least by this may be the right one: half the 95 %
/// point of chi-square with one degree of freedom.
const LIKELY_SURPRISE: f64 = 1.92;
/// A value changes if a constant surprises by this more: half the 99.8 % point of chi-square with one degree
/// of freedom.
const CLEAR_SURPRISE: f64 = 4.77;
/// Walks that are tried, by powers of ten: from one that acts over the whole length to one that acts over
/// that of a reading.
const MOST_WALKS: usize = 20;
/// Median of the absolute values of a normal law, in its deviations.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;
/// Least deviation of a reading over the largest: without noise it may be 0.
const LEAST_DEVIATION: f64 = 1e-9;

/// A smoothing spline through readings whose deviations are right up to a factor.
#[derive(Debug, Clone)]
pub struct LearnedSpline {
    spline: SmoothingSpline,
    scale: f64,
    surprise: f64,
}

/// What is known of a value at one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// A value that changes only if its readings say so.
#[derive(Debug, Clone)]
pub enum LearnedCourse {
    /// The mean of the readings.
    Steady(Known),
    /// The smoothest of the likely splines.
    Changing(LearnedSpline),
}

impl LearnedSpline {
    /// The smoothest spline whose readings are predicted by the others as well as by any (leave-one-out
    /// predictive density; S. Geisser, *The predictive sample reuse method*, J. Am. Stat. Assoc. 70, 1975).
    /// `None` for readings of fewer than two positions and for those that are no numbers.
    pub fn new(readings: &[Measured]) -> Option<Self> {
        let walks = std::iter::once(0.0).chain(walks(readings));
        let splines = walks.filter_map(|walk| SmoothingSpline::new(readings.to_vec(), walk).ok());
        let judged: Vec<(Prediction, SmoothingSpline)> =
            splines.map(|spline| (Prediction::new(&spline.left_out().collect::<Vec<_>>()), spline)).collect();
        let least = judged.iter().map(|(judged, _)| judged.surprise).fold(f64::INFINITY, f64::min);
        let (judged, spline) =
            judged.into_iter().find(|(judged, _)| judged.surprise <= least + LIKELY_SURPRISE)?;
        let freedom = readings.len().saturating_sub(2).max(1) as f64;
        let scale = judged.scale * few_readings(freedom).sqrt();
        Some(Self { spline, scale, surprise: judged.surprise })
    }

    /// The same through the readings that do not contradict the others, with their indices. Readings are in
    /// the order of their positions.
    pub fn through(readings: &[Measured]) -> Option<(Self, Vec<usize>)> {
        let mut kept: Vec<usize> = (0..readings.len()).collect();
        let of = |kept: &[usize]| Self::new(&kept.iter().map(|k| readings[*k]).collect::<Vec<_>>());
        let mut learned = of(&kept)?;
        for _ in 0..ROUNDS {
            let worst = contradictory(&learned.spline);
            // Without two readings nothing is left to be judged by.
            if worst.is_empty() || kept.len() < worst.len() + 2 {
                break;
            }
            kept = (0..kept.len()).filter(|k| !worst.contains(k)).map(|k| kept[k]).collect();
            learned = of(&kept)?;
        }
        Some((learned, kept))
    }

    /// The value at x, in less time than [`Self::at`].
    pub fn value(&self, x: f64) -> f64 {
        self.spline.value(x)
    }

    /// What is known at x.
    pub fn at(&self, x: f64) -> Known {
        let known = self.spline.at(x);
        Known { value: known.value, deviation: self.scale * known.variance.sqrt() }
    }

    /// The factor of the deviations.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

impl LearnedCourse {
    /// Through readings in the order of their positions; those that contradict the others are left out.
    /// `None` as [`LearnedSpline::new`].
    pub fn new(readings: &[Measured]) -> Option<Self> {
        let largest = readings.iter().map(|reading| reading.error).fold(0.0, f64::max);
        let floor = if largest > 0.0 { LEAST_DEVIATION * largest } else { LEAST_DEVIATION };
        let of = |error: f64| if error < floor { floor } else { error };
        let floored = |reading: &Measured| Measured { error: of(reading.error), ..*reading };
        let readings: Vec<Measured> = readings.iter().map(floored).collect();
        let (spline, kept) = LearnedSpline::through(&readings)?;
        let (mean, surprise) = constant(&kept.iter().map(|k| readings[*k]).collect::<Vec<_>>());
        let changes = surprise > spline.surprise + CLEAR_SURPRISE;
        Some(if changes { Self::Changing(spline) } else { Self::Steady(mean) })
    }

    /// What is known at x.
    pub fn at(&self, x: f64) -> Known {
        match self {
            Self::Steady(known) => *known,
            Self::Changing(spline) => spline.at(x),
        }
    }

    /// Whether the readings say that the value changes.
    pub fn changes(&self) -> bool {
        matches!(self, Self::Changing(_))
    }
}

/// How well each reading is predicted by the others.
struct Prediction {
    /// Root mean square of what readings miss the others by, over the stated deviations.
    scale: f64,
    /// Sum of the negative logarithms of the predictive densities.
    surprise: f64,
}

impl Prediction {
    fn new(all: &[LeftOut]) -> Self {
        let ratios = || all.iter().map(|out| out.miss / out.deviation);
        let most = GATE_SIGMAS * usual_deviation(ratios().collect());
        let count = all.len() as f64;
        let squares = ratios().map(|ratio| ratio.min(most).powi(2)).sum::<f64>();
        let scale = (squares / count).sqrt().max(LEAST_SCALE);
        let deviations = all.iter().map(|out| out.deviation.ln()).sum::<f64>();
        Self { scale, surprise: deviations + count * scale.ln() + 0.5 * squares / (scale * scale) }
    }
}

/// The weighted mean of readings, and the surprise of these if it is the value at all times.
fn constant(readings: &[Measured]) -> (Known, f64) {
    let weight = |reading: &Measured| reading.error.powi(-2);
    let weights: f64 = readings.iter().map(weight).sum();
    let value = readings.iter().map(|reading| weight(reading) * reading.value).sum::<f64>() / weights;
    // As of a spline: a reading has the share w / sum w in the mean.
    let left_out = |reading: &Measured| {
        let others = (1.0 - weight(reading) / weights).max(f64::EPSILON);
        let deviation = reading.error / others.sqrt();
        LeftOut { miss: (reading.value - value).abs() / others, deviation }
    };
    let found = Prediction::new(&readings.iter().map(left_out).collect::<Vec<_>>());
    let freedom = readings.len().saturating_sub(1).max(1) as f64;
    let deviation = found.scale * few_readings(freedom).sqrt() / weights.sqrt();
    (Known { value, deviation }, found.surprise)
}

/// Variances by which a rate may walk per unit of x: with the noise s^2 of readings at the distance D one
/// acts over the length l = (s^2 D / q)^(1/4).
fn walks(readings: &[Measured]) -> impl Iterator<Item = f64> + use<> {
    let ends = |ends: (f64, f64), reading: &Measured| (ends.0.min(reading.x), ends.1.max(reading.x));
    let (first, last) = readings.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    let (length, count) = (last - first, readings.len() as f64);
    let noise = median(readings.iter().map(|reading| reading.error.powi(2)).collect());
    let longest = noise / (count * length.powi(3));
    let shortest = longest * count.powi(4);
    (0..MOST_WALKS)
        .map(move |power| longest * 10f64.powi(power as i32))
        .take_while(move |walk| *walk <= shortest)
}

/// The readings that contradict the others, each the worst of those beside it.
fn contradictory(spline: &SmoothingSpline) -> Vec<usize> {
    let found: Vec<f64> = spline.left_out().map(|out| out.miss / out.deviation).collect();
    let gate = GATE_SIGMAS * usual_deviation(found.clone());
    let is_worst = |k: &usize| {
        let beside = k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(found.len());
        found[*k] > gate && beside.into_iter().all(|j| j == *k || found[j] < found[*k])
    };
    (0..found.len()).filter(is_worst).collect()
}

/// Square of the factor by which a deviation that was measured with so many degrees of freedom is short of
/// that whose 95 % interval is that of the normal law: Student's law, within 3 %.
pub fn few_readings(freedom: f64) -> f64 {
    (1.0 + 1.2 / freedom + 2.4 / (freedom * freedom)).powi(2)
}

/// The standard deviation of a normal law that has the same median of absolute values.
pub fn usual_deviation(misfits: Vec<f64>) -> f64 {
    median(misfits) / MEDIAN_OF_NORMAL
}

/// The median; 0 of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Readings of a value with normal errors of deviation 0.1 that state half of that.
    fn readings(count: usize, seed: u64, value: impl Fn(f64) -> f64) -> Vec<Measured> {
        let mut random = Random(seed);
        let mut normal = || (0..12).map(|_| random.part()).sum::<f64>() - 6.0;
        let reading = |k| {
            let x = 1e9 * k as f64;
            Measured { x, value: value(x) + 0.1 * normal(), error: 0.05, jitter: 0.0 }
        };
        (0..count).map(reading).collect()
    }

    #[test]
    fn what_stays_is_a_mean_and_its_interval_holds_it() {
        let mut inside = 0;
        for seed in 0..200 {
            let LearnedCourse::Steady(Known { value, deviation }) =
                LearnedCourse::new(&readings(40, seed, |_| 3.0)).unwrap()
            else {
                continue;
            };
            // Of the scatter and not of what the readings state.
            assert!((deviation / 0.0158 - 1.0).abs() < 0.5, "{deviation}");
            inside += i32::from((value - 3.0).abs() < 1.96 * deviation);
        }
        // 98 % are said to stay, and of these 95 % hold the value.
        assert!((178..=198).contains(&inside), "{inside}");
    }

    #[test]
    fn what_changes_is_followed_within_its_intervals() {
        let value = |x: f64| 3.0 + 0.5 * (1.2e-10 * x).sin();
        let (mut inside, mut all) = (0, 0);
        for seed in 0..60 {
            let course = LearnedCourse::new(&readings(60, 1000 + seed, value)).unwrap();
            assert!(course.changes());
            for x in [5e9, 17e9, 30.5e9, 44e9] {
                let Known { value: found, deviation } = course.at(x);
                all += 1;
                inside += i32::from((found - value(x)).abs() < 1.96 * deviation);
                assert!(deviation < 0.1 && (found - value(x)).abs() < 0.25, "{found} {deviation}");
            }
        }
        let share = f64::from(inside) / f64::from(all);
        assert!((0.9..=1.0).contains(&share), "{share}");
    }

    /// Also a slope of twice the scatter over the whole length.
    #[test]
    fn small_changes_are_seen_and_false_readings_are_not() {
        let mut all = readings(64, 7, |x| 3.0 + 0.2 * x / 63e9);
        all[20].value += 30.0;
        let course = LearnedCourse::new(&all).unwrap();
        assert!(course.changes() && (course.at(20e9).value - 3.063).abs() < 0.06, "{:?}", course.at(20e9));
        let mut all = readings(64, 8, |_| 3.0);
        all[20].value += 30.0;
        assert!(!LearnedCourse::new(&all).unwrap().changes());
        assert!(LearnedCourse::new(&all[..1]).is_none());
    }
}
