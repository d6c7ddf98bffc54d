//! Normal numbers.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Normal numbers of variance one: sums of twelve uniform ones.
pub(crate) fn normal(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut part = move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    move || (0..12).map(|_| part()).sum::<f64>() - 6.0
}
