//! Streams through the public interface.

mod allocations;
mod formats;
mod states;
