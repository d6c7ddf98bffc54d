//! Virtual converters: exact samples of analytic sources and of recordings.
