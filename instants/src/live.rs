//! Fusion of samples as they arrive.

use super::clock::Clock;
use super::demand::within;
use super::estimator::Estimator;
use super::fusion::{FRAMES_PER_BLOCK, Fused, FusionSettings, KnownInstantFusion, Layout};
use super::knots::Stretch;
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::LinalgError;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Blocks of a stretch in which a clock of 120 ppm drifts by a sixteenth of its period.
const BLOCKS_OF_UNKNOWN_CLOCKS: usize = 8;

/// The taps of a stretch, once they are made.
type Taps = Arc<OnceLock<Result<Option<Stretch>, LinalgError>>>;

/// Estimates the target as samples arrive, a block of 64 frames as soon as all samples are there that may
/// count in it. An output has the same bits however the samples are cut. The taps of the next stretch are
/// made on another thread.
#[derive(Debug)]
pub struct LiveFusion {
    maker: Arc<TapMaker>,
    recordings: Vec<Recording>,
    /// Blocks so far.
    blocks: usize,
    /// By the number of their stretch: of the one that goes on and of the next one.
    taps: BTreeMap<usize, Taps>,
}

/// All that taps depend on.
#[derive(Debug, Clone)]
struct TapMaker {
    estimator: Arc<Estimator>,
    /// Without samples.
    clocks: Vec<Recording>,
    layout: Layout,
    /// How far from an output samples may lie.
    within: FastPeriods,
}

impl TapMaker {
    fn fusion<'a>(&'a self, recordings: &'a [Recording]) -> KnownInstantFusion<'a> {
        KnownInstantFusion { estimator: &self.estimator, recordings, layout: self.layout }
    }

    fn make(&self, number: usize) -> Result<Option<Stretch>, LinalgError> {
        let length = self.layout.length;
        self.fusion(&self.clocks).stretch(number * length..(number + 1) * length)
    }

    fn blocks_per_stretch(&self) -> usize {
        self.layout.length / FRAMES_PER_BLOCK
    }
}

impl LiveFusion {
    /// For `recordings` without samples so far, as [`fuse`](super::fuse). There is no end of outputs.
    pub fn new(estimator: Estimator, recordings: Vec<Recording>, first: FastPeriods, reach: usize) -> Self {
        let layout = Layout::new(&estimator, &recordings, FusionSettings { first, count: 0, reach });
        let within = within(&estimator);
        let maker = TapMaker { estimator: Arc::new(estimator), clocks: recordings.clone(), layout, within };
        Self { maker: Arc::new(maker), recordings, blocks: 0, taps: BTreeMap::new() }
    }

    /// The same for clocks of which nothing is known but that they differ by at most 120 ppm.
    pub fn with_unknown_clocks(mut self) -> Self {
        let maker = Arc::make_mut(&mut self.maker);
        maker.layout.length = maker.layout.length.min(FRAMES_PER_BLOCK * BLOCKS_OF_UNKNOWN_CLOCKS);
        self
    }

    /// From now on the recordings have these clocks: those that they had, as far as there are samples.
    pub fn follow(&mut self, clocks: impl IntoIterator<Item = Clock>) {
        let mut maker = TapMaker::clone(&self.maker);
        let recordings = self.recordings.iter_mut().zip(&mut maker.clocks);
        for ((own, other), clock) in recordings.zip(clocks) {
            let clock = Arc::new(clock);
            own.follow(Arc::clone(&clock));
            other.follow(clock);
        }
        self.maker = Arc::new(maker);
        self.taps.clear();
    }

    /// Outputs of a block.
    pub fn block(&self) -> usize {
        FRAMES_PER_BLOCK * self.maker.layout.grid.ratio
    }

    /// Takes the next samples of each recording, and gives the outputs that depend on no later ones.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn push<S: IntoIterator<Item = f64>>(
        &mut self,
        samples: impl IntoIterator<Item = S>,
    ) -> Result<Fused, LinalgError> {
        self.recordings.iter_mut().zip(samples).for_each(|(recording, samples)| recording.extend(samples));
        let next = self.recordings.iter().map(|recording| recording.next().0).fold(f64::INFINITY, f64::min);
        let known = (next - self.maker.within.0 - self.maker.layout.grid.first.0) / self.block() as f64;
        self.run(self.blocks..known.max(0.0) as usize)
    }

    /// The outputs that are left of the first `count`, from the samples that there are.
    ///
    /// # Errors
    /// As [`LiveFusion::push`].
    pub fn finish(mut self, count: usize) -> Result<Fused, LinalgError> {
        let per_block = self.block();
        let given = self.blocks * per_block;
        let mut fused = self.run(self.blocks..count.div_ceil(per_block))?;
        fused.samples.truncate(count.saturating_sub(given));
        Ok(fused)
    }

    fn run(&mut self, blocks: Range<usize>) -> Result<Fused, LinalgError> {
        if blocks.is_empty() {
            return Ok(self.maker.layout.fused(std::iter::empty()));
        }
        let per_stretch = self.maker.blocks_per_stretch();
        let last = (blocks.end - 1) / per_stretch;
        let numbers = blocks.start / per_stretch..last + 1;
        let all: Vec<(usize, Taps)> = numbers.map(|number| (number, self.taps(number))).collect();
        let (maker, fusion) = (&self.maker, self.maker.fusion(&self.recordings));
        let part = |(number, taps): &(usize, Taps)| {
            let stretch = taps.get_or_init(|| maker.make(*number)).as_ref().map_err(Clone::clone)?;
            let own = blocks.start.max(number * per_stretch)..blocks.end.min((number + 1) * per_stretch);
            let frames = |block: usize| block * FRAMES_PER_BLOCK..(block + 1) * FRAMES_PER_BLOCK;
            own.map(|block| fusion.block(stretch.as_ref(), frames(block))).collect::<Result<Vec<_>, _>>()
        };
        let parts = all.par_iter().map(part).collect::<Result<Vec<_>, _>>()?;
        self.taps = self.taps.split_off(&last);
        self.make_ahead(last + 1);
        self.forget(blocks.end);
        Ok(self.maker.layout.fused(parts.into_iter().flatten()))
    }

    fn taps(&mut self, number: usize) -> Taps {
        Arc::clone(self.taps.entry(number).or_default())
    }

    /// Begins to make taps.
    fn make_ahead(&mut self, number: usize) {
        if self.taps.contains_key(&number) {
            return;
        }
        let (taps, maker) = (self.taps(number), Arc::clone(&self.maker));
        rayon::spawn(move || {
            taps.get_or_init(|| maker.make(number));
        });
    }

    /// Lets go of the samples that no later block needs.
    fn forget(&mut self, blocks: usize) {
        self.blocks = blocks;
        let begin = self.maker.layout.grid.frame(blocks * FRAMES_PER_BLOCK) - self.maker.within;
        self.recordings.iter_mut().for_each(|recording| recording.forget(begin));
    }
}
