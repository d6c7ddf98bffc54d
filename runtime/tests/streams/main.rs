//! Streams through the public interface.

mod allocations;
mod in_place;
mod states;
