//! The fewest taps that are enough: for a wanted SNR, or to be almost as good as any number.

use super::reach::{self, Reach};
use super::{with_uncertain_instants, with_usual_noise};
use crate::design::DesignError;
use crate::design::history_errors::HistoryErrors;
use crate::design::merging::Repeats;
use crate::design::problem::{Problem, common_delay};
use crate::spec::{MAX_OPTIMISED_TAPS, Method, Spec};

/// More taps are chosen only if they lower the whole error by more than this share.
const WORTHWHILE: f64 = 0.01;
/// The length suffices when its doubling lowers the mean square by no more than this share.
const SAME_SQUARE: f64 = 1e-3;
/// Frames at first.
const FIRST_FRAMES: usize = 8;
/// Frames at most; a longer bank is a case for recursive filters.
const MOST_FRAMES: usize = 2048;

/// The fewest taps per channel whose least error reaches the SNR that `spec` asks for, or which is within
/// [`WORTHWHILE`] of the least of all lengths. `spec` has a latency.
///
/// # Errors
/// [`DesignError::SnrOutOfReach`] if no number of taps reaches it; else as [`HistoryErrors::new`].
pub(super) fn fewest_taps(spec: &Spec) -> Result<usize, DesignError> {
    let wanted = spec.design.target_snr_db;
    // A wanted SNR is that of the noise which the spec states; without one the usual rounding limits it.
    let noisy = if wanted.is_some() { with_uncertain_instants(spec) } else { with_usual_noise(spec) };
    let latency = spec.latency.unwrap_or_default();
    let problem =
        Problem::new(&noisy, latency)?.merge_channels(Repeats::AtOneInstant).of_unit_size()?.problem;
    let lengths = Lengths { problem: &problem, most: most_frames(spec) };
    let best = lengths.best()?;
    let enough = match wanted {
        Some(snr) => best.power * 10f64.powf(-snr / 10.0),
        None => best.square * (1.0 + WORTHWHILE).powi(2),
    };
    if best.square > enough {
        let best_db = 10.0 * (best.power / best.square).log10();
        return Err(DesignError::SnrOutOfReach {
            wanted: wanted.unwrap_or_default(),
            best: best_db,
            latency,
        });
    }
    lengths.fewest(enough, best.frames)
}

/// What a spec that leaves both open gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LengthAndLatency {
    pub(super) taps: usize,
    pub(super) latency: usize,
}

/// As [`fewest_taps`], over all latencies; then the shortest latency at which that many taps are enough, or
/// almost the best of that length.
///
/// # Errors
/// As [`fewest_taps`].
pub(super) fn with_latency(spec: &Spec) -> Result<LengthAndLatency, DesignError> {
    let wanted = spec.design.target_snr_db;
    let common = common_delay(spec);
    let noisy = if wanted.is_some() { with_uncertain_instants(spec) } else { with_usual_noise(spec) };
    let problem = Problem::new(&noisy, common)?.earlier(common);
    let problem = problem.merge_channels(Repeats::AtOneInstant).of_unit_size()?.problem;
    let most = most_frames(spec) * spec.ratio;
    let mut taps = FIRST_FRAMES * spec.ratio;
    let mut best = OverLatencies::new(&problem, taps)?;
    while taps < most {
        taps = (2 * taps).min(most);
        let more = OverLatencies::new(&problem, taps)?;
        let done = best.least().powi(2) - more.least().powi(2) <= SAME_SQUARE * best.least().powi(2);
        best = more;
        if done {
            break;
        }
    }
    let enough =
        wanted.map_or(best.least() * (1.0 + WORTHWHILE), |snr| best.zero_output * 10f64.powf(-snr / 20.0));
    if best.least() > enough {
        let best_db = 20.0 * (best.zero_output / best.least()).log10();
        let latency = common + super::shortest(&best.rms);
        return Err(DesignError::SnrOutOfReach {
            wanted: wanted.unwrap_or_default(),
            best: best_db,
            latency,
        });
    }
    let (mut too_few, mut taps) = (0, taps);
    while taps - too_few > 1 {
        let middle = too_few + (taps - too_few) / 2;
        if OverLatencies::new(&problem, middle)?.least() <= enough { taps = middle } else { too_few = middle }
    }
    Ok(LengthAndLatency { taps, latency: common + super::shortest(&OverLatencies::new(&problem, taps)?.rms) })
}

/// The latency of a spec with taps: the shortest that is almost the best.
///
/// # Errors
/// As [`HistoryErrors::new`].
pub(super) fn latency_of(problem: &Problem, taps: usize) -> Result<usize, DesignError> {
    Ok(super::shortest(&OverLatencies::new(problem, taps)?.rms))
}

/// The least errors of banks of one length at all latencies.
struct OverLatencies {
    rms: Vec<f64>,
    zero_output: f64,
}

impl OverLatencies {
    fn new(problem: &Problem, taps: usize) -> Result<Self, DesignError> {
        let latencies = reach::candidates(problem, taps);
        let reach = Reach::new(problem, taps, &latencies)?;
        Ok(Self {
            rms: latencies.map(|latency| reach.rms(latency)).collect(),
            zero_output: reach.zero_output(),
        })
    }

    fn least(&self) -> f64 {
        self.rms.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Frames at most for the method of `spec`.
fn most_frames(spec: &Spec) -> usize {
    let most = match spec.design.method {
        Method::Fir => MAX_OPTIMISED_TAPS / (spec.channels.len() * spec.ratio),
        _ => MOST_FRAMES,
    };
    most.clamp(1, MOST_FRAMES)
}

/// The lengths of a problem with a latency.
struct Lengths<'a> {
    problem: &'a Problem,
    /// Frames at most.
    most: usize,
}

/// The least error of all lengths.
struct Best {
    frames: usize,
    /// Mean square of the error and of the target.
    square: f64,
    power: f64,
}

impl Lengths<'_> {
    fn best(&self) -> Result<Best, DesignError> {
        let oldest =
            (self.problem.latency + self.problem.longest_delay().0.ceil() as usize) / self.problem.ratio;
        let mut frames = (oldest + FIRST_FRAMES).min(self.most);
        let mut best = self.of(frames)?;
        while frames < self.most {
            frames = (2 * frames).min(self.most);
            let more = self.of(frames)?;
            let done = best.square - more.square <= SAME_SQUARE * best.square;
            best = more;
            if done {
                break;
            }
        }
        Ok(best)
    }

    fn of(&self, frames: usize) -> Result<Best, DesignError> {
        let errors = self.errors(frames)?;
        let square = self.phases(&errors).sum::<f64>() / self.problem.ratio as f64;
        Ok(Best { frames, square, power: errors.power })
    }

    fn errors(&self, frames: usize) -> Result<HistoryErrors, DesignError> {
        let last = self.problem.ratio as i64 - 1 - self.problem.latency as i64;
        HistoryErrors::new(self.problem, frames, -(self.problem.latency as i64)..=last)
    }

    /// The errors of the phases of the output.
    fn phases<'a>(&'a self, errors: &'a HistoryErrors) -> impl Iterator<Item = f64> + 'a {
        (0..self.problem.ratio).map(|p| errors.at(p as i64 - self.problem.latency as i64))
    }

    /// The fewest taps with a mean square of at most `enough`, which `frames` frames have.
    fn fewest(&self, enough: f64, frames: usize) -> Result<usize, DesignError> {
        let (mut too_few, mut frames) = (0, frames);
        while frames - too_few > 1 {
            let middle = too_few + (frames - too_few) / 2;
            if self.of(middle)?.square <= enough { frames = middle } else { too_few = middle }
        }
        let (long, short) = (self.errors(frames)?, self.errors(frames - 1)?);
        let ratio = self.problem.ratio;
        let square = |longer: usize| {
            let phases = self.phases(&long).take(longer).chain(self.phases(&short).skip(longer));
            phases.sum::<f64>() / ratio as f64
        };
        let longer = (1..ratio).find(|&longer| square(longer) <= enough).unwrap_or(ratio);
        Ok((frames - 1) * ratio + longer)
    }
}
