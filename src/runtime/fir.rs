//! FIR banks: the direct polyphase form.
//!
//! y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j]: for each phase p one sum over channels i and
//! taps j, in that order. Every output is one such chain, wherever it stands in its block.

use super::BuildError;
use super::aligned::Aligned;
use super::rows::{Fold, Rows, RowsMut};
use super::sample::Sample;
use super::simd::{FirKernel, Isa, OVERRUN, PhaseGroup, Steps};
use super::ticks::{FastSink, TickSource};
use super::window::{Window, block_frames};

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) struct FirPlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K - 1: ticks that the filters look back.
    pub(crate) history: usize,
    /// T: ticks in a super-tick.
    pub(crate) fold: usize,
    /// Super-ticks that the filters look back, and in a block.
    window: usize,
    block: usize,
    groups: Vec<PhaseGroup<T>>,
    /// For each step the place of its input in the window.
    steps: Steps,
    kernel: FirKernel<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct FirState<T: Sample> {
    window: Window<T>,
    /// Ticks of the next super-tick that are in the window already.
    lead: usize,
    /// One block of output, a row a phase.
    rows: Aligned<T>,
}

/// The input of a step: channel, and how many ticks it lies before the super-tick's first
/// (negative: after it).
type Step = (usize, isize);

impl<T: Sample> FirPlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let channels = taps.len();
        let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1);
        let fold = fold_for::<T>(ratio, isa);
        let window = (lags - 1).div_ceil(fold);
        let block = block_frames(channels * fold, window);
        let stride = Window::<T>::stride(window, block);
        if channels.saturating_mul(fold).saturating_mul(stride) > u32::MAX as usize {
            return Err(BuildError::TooLong { history: lags - 1, channels });
        }
        // Per channel the taps in rising order, for each of the T ticks of a super-tick.
        let steps: Vec<Step> =
            (0..channels).flat_map(|i| (1 - fold as isize..lags as isize).map(move |lag| (i, lag))).collect();
        let offset = |&(i, lag): &Step| {
            let row = (-lag).rem_euclid(fold as isize) as usize * channels + i;
            let column = window as isize + (-lag).div_euclid(fold as isize);
            (row * stride) as u32 + column as u32
        };
        let groups = widths(ratio * fold)
            .map(|(first, width)| phase_group(taps, ratio, &steps, first, width))
            .collect();
        Ok(Self {
            channels,
            ratio,
            history: lags - 1,
            fold,
            window,
            block,
            groups,
            steps: Steps::new(steps.iter().map(offset).collect()),
            kernel: T::fir_kernel(isa),
            isa,
        })
    }

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> FirState<T> {
        FirState {
            window: Window::new(self.channels * self.fold, self.window, self.block),
            lead: 0,
            rows: Aligned::new(self.ratio * self.fold * self.out_stride()),
        }
    }

    fn out_stride(&self) -> usize {
        self.block + OVERRUN
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut FirState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let mut replaced = 0;
        let mut first = 0;
        while first < source.ticks() {
            let ticks = (source.ticks() - first).min(self.block * self.fold - state.lead);
            let fold = Fold { ticks: self.fold, lead: state.lead };
            state.window.make_room(fold.super_ticks(ticks));
            let (samples, stride) = state.window.room();
            let rows = RowsMut { samples, stride, channels: self.channels, fold, isa: self.isa };
            replaced += source.gather(first, ticks, rows);
            self.filter(state, fold.super_ticks(ticks));
            let rows = Rows {
                samples: &state.rows[..],
                stride: self.out_stride(),
                phases: self.ratio,
                fold,
                isa: self.isa,
            };
            sink.scatter(first, ticks, rows);
            state.window.advance((state.lead + ticks) / self.fold);
            state.lead = (state.lead + ticks) % self.fold;
            first += ticks;
        }
        replaced
    }

    fn filter(&self, state: &mut FirState<T>, super_ticks: usize) {
        let stride = self.out_stride();
        for group in &self.groups {
            let out = &mut state.rows[group.first * stride..];
            self.kernel.run(group, state.window.view(), &self.steps, super_ticks, out, stride);
        }
    }
}

impl<T: Sample> FirState<T> {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.window.reset();
        self.lead = 0;
    }
}

/// One phase alone would load a vector for every multiply-add, which no processor can: two ticks at a
/// time are two phases.
fn fold_for<T: Sample>(ratio: usize, isa: Isa) -> usize {
    if ratio == 1 && T::BYTES == 4 && isa != Isa::Portable { 2 } else { 1 }
}

fn check_finite<T: Sample>(taps: &[Vec<f64>]) -> Result<(), BuildError> {
    for (i, f) in taps.iter().enumerate() {
        if let Some(index) = f.iter().position(|&value| !T::from_f64(value).finite()) {
            let place = format!("the filter of channel {}", i + 1);
            return Err(BuildError::NotFinite { place, index, value: f[index] });
        }
    }
    Ok(())
}

/// M phases in groups of 4, and of 3 or 2 for the rest; 1 only if M is 1.
fn widths(ratio: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let width = match ratio - first {
            0 => return None,
            5 | 6 | 9 => 3,
            left => left.min(4),
        };
        first += width;
        Some((first - width, width))
    })
}

/// Phases first .. first + width of a super-tick: phase r M + p is phase p of its tick r, whose
/// tap for the input `lag` ticks before the super-tick is p + (r + lag) M.
fn phase_group<T: Sample>(
    taps: &[Vec<f64>],
    ratio: usize,
    steps: &[Step],
    first: usize,
    width: usize,
) -> PhaseGroup<T> {
    let mut coefficients = Aligned::new(steps.len() * width);
    let places = steps.iter().flat_map(|&step| (first..first + width).map(move |phase| (step, phase)));
    for (slot, ((i, lag), phase)) in coefficients.iter_mut().zip(places) {
        let tap = usize::try_from((phase / ratio) as isize + lag)
            .ok()
            .and_then(|j| taps[i].get(phase % ratio + j * ratio));
        *slot = T::from_f64(tap.copied().unwrap_or(0.0));
    }
    PhaseGroup { first, width, coefficients }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_cover_every_phase_once_and_are_never_narrow() {
        for ratio in 1..100 {
            let all: Vec<_> = widths(ratio).collect();
            let phases: Vec<usize> = all.iter().flat_map(|&(first, width)| first..first + width).collect();
            assert_eq!(phases, (0..ratio).collect::<Vec<_>>());
            assert!(all.iter().all(|&(_, width)| (2..=4).contains(&width) || ratio == 1), "{ratio}: {all:?}");
        }
    }
}
