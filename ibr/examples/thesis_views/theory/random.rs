//! Random numbers of the virtual experiments: one seed gives the same numbers on every machine.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

pub(crate) fn seeded(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A uniform number in \[0, 1).
pub(crate) fn part(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// A uniform number in \[-limit, limit).
pub(crate) fn within(limit: f64, random: &mut Pcg64) -> f64 {
    limit * (2.0 * part(random) - 1.0)
}
