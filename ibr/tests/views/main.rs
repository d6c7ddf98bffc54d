//! Rendered views against references, and the program as a user runs it.

mod allocation;
mod bound;
mod command;
mod damaged_depth;
mod figures;
mod generalisation;
mod morph;
mod mutations;
mod ray_traced;
mod support;
#[path = "../../examples/demo/synthetic.rs"]
mod synthetic;
mod thesis_page;
