//! Random numbers of the virtual experiments: one seed gives the same numbers on every machine.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

pub(super) fn seeded(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A uniform number in \[0, 1).
fn part(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Nearly normal with the variance one: the sum of three uniform numbers in \[-1, 1). Its tails are bounded.
pub(super) fn bounded_normal(random: &mut Pcg64) -> f64 {
    2.0 * (part(random) + part(random) + part(random)) - 3.0
}
