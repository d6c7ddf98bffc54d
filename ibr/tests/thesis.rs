//! The error analysis of the example `thesis_views`, with the tests that stand in its files.

use trials::random;
#[path = "../examples/thesis_views/theory/mod.rs"]
#[allow(dead_code, unreachable_pub, unused_imports)]
mod theory;
