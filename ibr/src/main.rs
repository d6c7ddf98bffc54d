//! The `hybank-ibr` binary.
fn main() {}
