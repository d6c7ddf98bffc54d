//! How the sums of a call are cut into steps and tiles, and the arguments of the kernels.

/// How the windows of all frames are cut into steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Tiling {
    /// D, samples of a step: a power of two.
    pub(super) depth: usize,
    /// Steps of a window.
    pub(super) steps: usize,
    /// Samples from frame to frame; equal to D unless D fills a group.
    pub(crate) hop: usize,
    /// Samples before a frame that its window reaches back.
    pub(crate) history: usize,
    /// Frames of a vector, a power of two: calls for a multiple of them read nothing past their last frame.
    pub(crate) vector: usize,
    /// The order of steps for a single phase.
    pub(super) pairing: Pairing,
}

impl Tiling {
    /// Windows of at least `len` samples (no less than a hop) for frames of `hop` samples and `phases`
    /// phases, in groups of `group` lanes and vectors of `lanes`.
    pub(super) fn new([hop, len, phases]: [usize; 3], group: usize, lanes: usize) -> Self {
        let depth = if hop < group && hop.is_power_of_two() { hop } else { group };
        let steps = len.max(hop).div_ceil(depth);
        let vector = if phases == 1 { group } else { lanes / depth };
        Self {
            depth,
            steps,
            hop,
            history: steps * depth - hop,
            vector,
            pairing: Pairing::new(depth, hop, group, steps),
        }
    }

    /// The phase that lane `lane` of the p-th sum belongs to, in groups of `width` phases: along diagonals.
    pub(super) fn phase(&self, width: usize, p: usize, lane: usize) -> usize {
        match (width, self.depth) {
            (1, _) | (_, 1) => p,
            (3, _) if p == 2 => p,
            (3, _) => (p + lane) & 1,
            (_, 2) => p & 2 | (p + lane) & 1,
            _ => (p + lane) % width,
        }
    }

    /// The steps in the order of use for groups of `width` phases; step 0 is the newest.
    pub(super) fn order(&self, width: usize) -> Vec<usize> {
        if width == 1 { self.pairing.order() } else { (0..self.steps).collect() }
    }
}

/// The order of steps for a single phase, and how they share inputs: see `single`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pairing {
    /// c: the steps of a pair are c apart.
    pub(super) apart: usize,
    /// Times 2 c steps that are all pairs.
    pub(super) blocks: usize,
    /// Pairs and single steps of the rest.
    pub(super) pairs: usize,
    pub(super) singles: usize,
    /// q: tiles that cover all frames.
    pub(super) tiles: usize,
}

impl Pairing {
    fn new(depth: usize, hop: usize, group: usize, steps: usize) -> Self {
        let tiles = if depth < group { 1 } else { group >> hop.trailing_zeros().min(group.trailing_zeros()) };
        let apart = if depth < group { group / depth } else { hop * tiles / group };
        let rest = steps % (2 * apart);
        let pairs = rest.saturating_sub(apart);
        Self { apart, blocks: steps / (2 * apart), pairs, singles: rest.min(apart) - pairs, tiles }
    }

    /// All steps in the order of use.
    fn order(self) -> Vec<usize> {
        let pairs = |first: usize, count: usize| (first..first + count).flat_map(|s| [s + self.apart, s]);
        let rest = self.blocks * 2 * self.apart;
        (0..self.blocks)
            .flat_map(|b| pairs(b * 2 * self.apart, self.apart))
            .chain(pairs(rest, self.pairs))
            .chain((0..self.singles).map(|s| rest + self.pairs + s))
            .collect()
    }
}

/// Frames one after another, checked, as far as they fill vectors.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameChunk<T> {
    /// The newest step of the first frame.
    pub(super) x: *const T,
    /// The outputs of the first frame.
    pub(super) out: *mut T,
    /// A multiple of those of a vector.
    pub(super) frames: usize,
}

impl<T> FrameChunk<T> {
    pub(super) const NONE: Self = Self { x: std::ptr::null(), out: std::ptr::null_mut(), frames: 0 };
}

/// One call of a kernel, checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct FirJob<'a, T> {
    pub(super) tiling: &'a Tiling,
    pub(super) coefficients: *const T,
    pub(super) chunks: &'a [FrameChunk<T>],
    /// The first phase.
    pub(super) first: usize,
    pub(super) out_hop: usize,
    /// Room for the sums of a tile, [`SCRATCH`] samples. It comes from outside, or else the compiler keeps
    /// it in registers, which brings back what it is to avoid.
    pub(super) scratch: *mut T,
}

/// Samples of the largest scratch: the sums of the largest tile, in the largest vectors.
pub(super) const SCRATCH: usize = 768;

/// Vectors of the next tile if `left` of them are left: the most, or half of what is less than two such
/// tiles, and one of the sizes of [`sized`].
#[inline(always)]
pub(super) fn tile_size(left: usize, most: usize) -> usize {
    let size = if left >= 2 * most || left == most {
        most
    } else if left > most {
        left.div_ceil(2)
    } else {
        left
    };
    match size {
        5 => 3,
        7 => 4,
        9..=11 => 6,
        size => size,
    }
}

/// Runs `$body` with `$R`, the vectors of a tile, as a constant. Few sizes are compiled: the others are sums
/// of two.
macro_rules! sized {
    ($size:expr, $R:ident => $body:expr) => {
        sized!(@ $size, $R => $body; 1 2 3 4 6 8 12)
    };
    (@ $size:expr, $R:ident => $body:expr; $($known:literal)*) => {
        match $size {
            $($known => {
                const $R: usize = $known;
                $body
            })*
            size => unreachable!("tiles have no {size} vectors"),
        }
    };
}
pub(super) use sized;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_is_taken_once_and_pairs_share_inputs() {
        // Miri takes a thousand times as long.
        let hops = if cfg!(miri) { 1..10 } else { 1..40usize };
        for (hop, group) in hops.flat_map(|hop| [(hop, 4), (hop, 8)]) {
            let depth = if hop < group && hop.is_power_of_two() { hop } else { group };
            for steps in hop.div_ceil(depth)..if cfg!(miri) { 30 } else { 70 } {
                let pairing = Pairing::new(depth, hop, group, steps);
                let mut order = pairing.order();
                assert!(order[..steps - pairing.singles].chunks(2).all(|p| p[0] == p[1] + pairing.apart));
                order.sort_unstable();
                assert_eq!(order, (0..steps).collect::<Vec<_>>());
                // Vectors are whole frames apart: those of the tiles in between, or those of a vector.
                let frames = if depth < group { group / depth } else { pairing.tiles };
                assert_eq!(pairing.apart * depth, frames * hop);
            }
        }
    }

    #[test]
    fn tiles_have_compiled_sizes_and_none_is_larger_than_the_most() {
        for (left, most) in (1..60).flat_map(|left| [1, 2, 3, 4, 6, 8, 12].map(|most| (left, most))) {
            let size = tile_size(left, most);
            assert!(size <= most.min(left) && [1, 2, 3, 4, 6, 8, 12].contains(&size), "{size} of {left}");
        }
    }
}
