//! A judge that shares neither mathematics nor code with the product, and campaigns of new random cases that
//! it judges. Every statement that `design`, `verify` and `analyze` make of a bank is compared with what the
//! judge finds from the written file: front ends from their coefficients in 640 bits, the spectra of the
//! samples as exact quotients, gains as singular values, optima by methods of its own.
//!
//! `HYBANK_CAMPAIGN=20` makes 20 times as many cases, `HYBANK_TRIALS=124..125` that one. `-- --nocapture`
//! shows the tables.

#![allow(clippy::result_large_err, reason = "a task that ends early gives what it has found")]

#[path = "../support/mod.rs"]
mod support;

mod bounds;
mod boxes;
mod checks;
mod families;
mod fronts;
mod judge;
mod latencies;
mod optimum;
mod plant;
mod plants;
mod real;
mod roots;
mod special;
mod statements;
