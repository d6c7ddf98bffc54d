//! The binary as a user runs it: exit code, standard output and standard error apart.

#[path = "../support/mod.rs"]
mod support;

mod abuse;
mod agreement;
mod algorithms;
mod align;
mod analyze;
#[cfg(target_os = "linux")]
mod band;
mod bit_true;
mod calibrate;
mod converter_errors;
mod design;
mod docs;
mod doors;
mod examples;
#[cfg(target_os = "linux")]
mod export;
mod faults;
mod formats;
mod fuse;
#[cfg(target_os = "linux")]
mod interrupts;
#[cfg(unix)]
mod live;
#[cfg(target_os = "linux")]
mod long_files;
mod lost;
mod measure;
mod merge;
mod messages;
mod nonlinearity;
mod notes;
#[cfg(unix)]
mod outputs;
mod pooled;
mod rates;
mod report;
mod schema;
mod simulate;
#[cfg(unix)]
mod stream;
mod tables;
mod understanding;
mod usage;
mod verify;
mod verilog;
