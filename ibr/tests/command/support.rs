//! What both crates' tests share.

#[path = "../../../tests/support/jobs.rs"]
pub(crate) mod jobs;
#[path = "../../../tests/support/kills.rs"]
pub(crate) mod kills;
#[path = "../../../tests/support/random.rs"]
pub(crate) mod random;
