//! Campaigns of random trials: damaged inputs and foreign text.
//!
//! Every run makes a short campaign with the same seeds.
//! `HYBANK_CAMPAIGN=50 cargo test --release --test robustness -- --nocapture` makes 50 times as many trials;
//! the counts are printed.

#[path = "../support/mod.rs"]
mod support;

mod foreign;
mod inputs;
mod parsers;

use support::random::Random;
use support::{Desk, THESIS, wav};

/// Two recordings of forty samples, a spec and its bank.
fn desk() -> Desk {
    let desk = Desk::with_model();
    desk.write("spec.toml", THESIS);
    let mut dice = Random(18);
    let mut noise = || (0..40).map(|_| dice.sample() as f32).collect::<Vec<_>>();
    wav::write_pair(&desk, &noise(), &noise());
    desk
}
