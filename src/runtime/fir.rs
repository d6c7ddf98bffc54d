//! FIR banks: the direct polyphase form.
//!
//! y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j]: for each phase p one sum over channels i and
//! taps j, in that order.

use super::BuildError;
use super::aligned::Aligned;
use super::sample::Sample;
use super::simd::{FirKernel, Isa, PhaseGroup};
use super::ticks::{FastSink, TickSource};
use super::window::{Window, block_frames};

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) struct FirPlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K - 1: ticks that the filters look back.
    pub(crate) history: usize,
    /// Ticks a block.
    pub(crate) block: usize,
    groups: Vec<PhaseGroup<T>>,
    /// For step (i, j): the place of x_i[k - j] in the window.
    offsets: Vec<u32>,
    kernel: FirKernel<T>,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct FirState<T: Sample> {
    window: Window<T>,
    /// One block of output, a row a phase.
    rows: Aligned<T>,
}

impl<T: Sample> FirPlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let channels = taps.len();
        let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1);
        let history = lags - 1;
        let block = block_frames(channels, history);
        let stride = Window::<T>::stride(history, block);
        if channels.saturating_mul(stride) > u32::MAX as usize {
            return Err(BuildError::TooLong { history, channels });
        }
        let offsets =
            (0..channels * lags).map(|s| ((s / lags) * stride + history - s % lags) as u32).collect();
        let groups =
            widths(ratio).map(|(first, width)| phase_group(taps, ratio, lags, first, width)).collect();
        Ok(Self { channels, ratio, history, block, groups, offsets, kernel: T::fir_kernel(isa) })
    }

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> FirState<T> {
        FirState {
            window: Window::new(self.channels, self.history, self.block),
            rows: Aligned::new(self.ratio * self.out_stride()),
        }
    }

    fn out_stride(&self) -> usize {
        self.block + 16
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
            let ticks = (source.ticks() - first).min(self.block);
            state.window.make_room(ticks);
            let (rows, stride) = state.window.room();
            replaced += source.gather(first, ticks, rows, stride);
            self.filter(state, ticks);
            sink.scatter(first, ticks, self.ratio, &state.rows, self.out_stride());
            first += ticks;
        }
        replaced
    }

    fn filter(&self, state: &mut FirState<T>, ticks: usize) {
        let stride = self.out_stride();
        for group in &self.groups {
            let out = &mut state.rows[group.first * stride..];
            self.kernel.run(group, state.window.view(), &self.offsets, ticks, out, stride);
        }
        state.window.advance(ticks);
    }
}

impl<T: Sample> FirState<T> {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.window.reset();
    }
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

fn phase_group<T: Sample>(
    taps: &[Vec<f64>],
    ratio: usize,
    lags: usize,
    first: usize,
    width: usize,
) -> PhaseGroup<T> {
    let mut coefficients = Aligned::new(taps.len() * lags * width);
    let places =
        (0..taps.len()).flat_map(|i| (0..lags).flat_map(move |j| (0..width).map(move |p| (i, j, p))));
    for (slot, (i, j, p)) in coefficients.iter_mut().zip(places) {
        *slot = T::from_f64(taps[i].get(first + p + j * ratio).copied().unwrap_or(0.0));
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
