//! Files that appear only when they are whole, sets of them, and reading with a bound.
//!
//! # What a file system allows
//!
//! An [`AtomicFile`] is written under a hidden name in the folder of its target, brought to the disk
//! (`fsync`) and closed, and only then gets its final name; so an error of the disk is noticed before the
//! file appears. A file that appeared under the name in the meantime is not replaced unless replacing was
//! asked for.
//!
//! Several files can not get their names in one step. [`commit_all`] brings all of them to the disk first
//! and then gives the names one after the other. If one is refused, the error names those that are there
//! already. A power failure or `kill -9` between two names leaves a part of the set, too.
//!
//! A replaced file keeps its permission bits; other names of it (hard links) keep the old content, and its
//! owner and extended attributes are not carried over. A symbolic link is followed: the file that it leads
//! to is replaced, the link stays.
//!
//! A run that is killed (`kill -9`) leaves its unfinished files: hidden ones whose names end in `.part`.
//! Where a signal can be caught, a program calls [`remove_unfinished`].
//!
//! ```
//! use hybank_core::files::AtomicFile;
//! use std::io::Write;
//! let path = std::env::temp_dir().join(format!("hybank-files-{}.txt", std::process::id()));
//! let mut file = AtomicFile::create(&path, false)?;
//! file.write_all(b"whole")?;
//! assert!(!path.exists() && file.hidden_name().exists());
//! file.commit()?;
//! assert_eq!(std::fs::read(&path)?, b"whole");
//! # std::fs::remove_file(path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod atomic;
mod bounded;
mod error;
mod identity;

pub use atomic::{AtomicFile, check_output, commit_all, remove_unfinished};
pub(crate) use bounded::fill;
pub use bounded::{Bound, SPEC_OR_BANK, bytes_of, read_bytes, read_text, text_in};
pub use error::FileError;
pub use identity::{is_same_file, refuse_overlaps};
