//! Files that appear only when they are whole, sets of them, and reading with a bound.
//!
//! # What a file system allows
//!
//! An [`AtomicFile`] is written under a hidden name in the folder of its target, brought to the disk
//! (`fsync`) and closed, and only then gets its final name; so an error of the disk is noticed before the
//! file appears. A file that appeared under the name in the meantime is not replaced unless replacing was
//! asked for.
//!
//! Several files can not get their names in one step. [`commit_all`] brings all of them to the disk first,
//! gives the names one after the other, and takes them back if one of them is refused; an output that cannot
//! be taken back is named. Three limits remain.
//! For some microseconds only a part of the set is visible. A power failure or `kill -9` in that time
//! leaves that part. If the system cannot exchange two names (systems other than Linux, some network file
//! systems), a replaced file is not restored.
//!
//! A replaced file keeps its permission bits, and its owner if root replaces it; other names of it (hard
//! links) keep the old content, and extended attributes are not carried over. A symbolic link is followed:
//! the file that it leads to is replaced, the link stays.
//!
//! A run that is killed (`kill -9`) leaves its unfinished files. [`leftovers`] finds them for the next run,
//! which names them. `remove_unfinished_on_signals` (feature `signals`) removes them where a signal can be
//! caught.
//!
//! ```
//! use hybank::files::{AtomicFile, leftovers};
//! use std::io::Write;
//! let path = std::env::temp_dir().join(format!("hybank-files-{}.txt", std::process::id()));
//! let mut file = AtomicFile::create(&path, false)?;
//! file.write_all(b"whole")?;
//! assert!(!path.exists() && file.hidden_name().exists());
//! // This process can still finish its file.
//! assert!(leftovers(&[&path]).is_empty());
//! file.commit()?;
//! assert_eq!(std::fs::read(&path)?, b"whole");
//! # std::fs::remove_file(path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod atomic;
mod bounded;
mod error;
mod hidden;
mod identity;
mod rename;
#[cfg(all(unix, feature = "signals"))]
pub mod signals;
mod streams;
mod watched;

pub use atomic::{AtomicFile, check_output, commit_all, remove_unfinished};
#[cfg(feature = "runtime")]
pub(crate) use bounded::fill;
pub use bounded::{Bound, SPEC_OR_BANK, bytes_of, parsing_bytes, read_bytes, read_text, text_in};
pub use error::FileError;
pub use hidden::{Leftover, leftovers};
pub use identity::{is_same_file, refuse_overlaps};
#[cfg(all(unix, feature = "signals"))]
pub use signals::{fail_at_file_size_limit, remove_unfinished_on_signals};
pub use streams::{StandardStream, note_closed_streams, unprinted};
#[cfg(feature = "runtime")]
pub(crate) use watched::{REPORT_WRITE_BEGAN, STDOUT_WRITE_BEGAN};
pub use watched::{Watched, is_output_stalled, stderr, stdout};
