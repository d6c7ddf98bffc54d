//! Campaigns of random trials: killed runs, failing system calls, full disks, little memory, forged banks,
//! damaged inputs, very large ones, and foreign text.
//!
//! Every run makes a short campaign with the same seeds.
//! `HYBANK_CAMPAIGN=50 cargo test --release --test robustness -- --nocapture` makes 50 times as many trials;
//! the counts are printed. `docs/robustness.md` has them.

#[path = "../support/mod.rs"]
mod support;

#[cfg(unix)]
#[path = "../../../tests/support/kills.rs"]
mod kill_campaign;

#[cfg(target_os = "linux")]
mod disks;
mod foreign;
mod forged;
mod inputs;
#[cfg(unix)]
mod kills;
#[cfg(unix)]
mod large;
#[cfg(target_os = "linux")]
mod memory;
mod norm;
mod parsers;
#[cfg(target_os = "linux")]
mod system_calls;
#[cfg(unix)]
mod times;
#[cfg(unix)]
mod work;
