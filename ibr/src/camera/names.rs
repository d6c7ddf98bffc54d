//! Which image of a list a path means: one rule for COLMAP models, transforms files and `--view`.

use hybank_core::messages::Quoted;
use std::cmp::Reverse;

/// Most names that a message lists.
const MOST_NAMES: usize = 8;

/// An image of a list that a path means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// Its number in the list, from 0.
    pub index: usize,
    /// Whether no folder of the path contradicts the name: one of them is the end of the other.
    pub whole: bool,
}

/// Why a path means no image of a list, or several.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// No name of the list has this file name.
    #[error("there is no image \"{}\"; the images are {known}", Quoted(wanted))]
    Unknown {
        /// The path.
        wanted: String,
        /// The names that are most like it.
        known: String,
    },
    /// Several names fit equally well.
    #[error("\"{}\" may be {candidates}; write as many of its folders as tell them apart", Quoted(wanted))]
    Ambiguous {
        /// The path.
        wanted: String,
        /// The names that fit.
        candidates: String,
    },
}

/// The name that a path means: the one with which it shares most parts (folders and file name) at its end.
///
/// A name that is the end of the path goes before a longer one. File names that differ in their extension
/// count only where no file name is the same.
///
/// # Errors
/// [`NameError::Unknown`] if no file name fits, [`NameError::Ambiguous`] if several names fit equally well.
pub fn find(names: &[impl AsRef<str>], wanted: &str) -> Result<Found, NameError> {
    let path = parts(wanted);
    let fits: Vec<Option<Fit>> = names.iter().map(|name| Fit::of(&parts(name.as_ref()), &path)).collect();
    let Some(best) = fits.iter().flatten().max().copied() else {
        return Err(NameError::Unknown { wanted: wanted.into(), known: most_like(names, wanted) });
    };
    let equal: Vec<usize> = (0..names.len()).filter(|i| fits[*i] == Some(best)).collect();
    match equal[..] {
        [index] => Ok(Found { index, whole: best.whole }),
        _ => {
            let candidates: Vec<&str> = equal.iter().map(|i| names[*i].as_ref()).collect();
            Err(NameError::Ambiguous { wanted: wanted.into(), candidates: list(&candidates, " or ") })
        }
    }
}

/// How well a name fits a path; the order of the fields is their rank.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Fit {
    /// Whether the file names are the same, with their extension.
    same_file: bool,
    /// Parts that are the same, from the end.
    shared: usize,
    /// Whether the name and the path are the same.
    same: bool,
    /// Whether the whole name is the end of the path.
    within: bool,
    whole: bool,
}

impl Fit {
    fn of(name: &[&str], path: &[&str]) -> Option<Self> {
        let ((file, folders), (wanted, above)) = (name.split_last()?, path.split_last()?);
        let same_file = file == wanted;
        if !same_file && stem(file) != stem(wanted) {
            return None;
        }
        let pairs = folders.iter().rev().zip(above.iter().rev());
        let shared = 1 + pairs.take_while(|(a, b)| a == b).count();
        let (within, around) = (shared == name.len(), shared == path.len());
        Some(Self { same_file, shared, same: within && around, within, whole: within || around })
    }
}

/// The file name of a path without its extension: names that differ in it do not fit.
pub(super) fn stem_of(path: &str) -> &str {
    stem(parts(path).last().copied().unwrap_or(""))
}

/// The parts of a path, whichever slash is between them, without `.`.
fn parts(path: &str) -> Vec<&str> {
    path.split(['/', '\\']).filter(|part| !part.is_empty() && *part != ".").collect()
}

/// A file name without its extension.
fn stem(file: &str) -> &str {
    file.rsplit_once('.').map_or(file, |(stem, _)| if stem.is_empty() { file } else { stem })
}

/// The names that are most like `wanted`, in the order of the list if it is short.
fn most_like(names: &[impl AsRef<str>], wanted: &str) -> String {
    let mut order: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    if order.len() > MOST_NAMES {
        let last = |path: &str| parts(path).last().copied().unwrap_or("").to_string();
        let likeness = |name: &&str| (1e6 * strsim::jaro_winkler(&last(name), &last(wanted))) as u64;
        order.sort_by_cached_key(|name| Reverse(likeness(name)));
    }
    list(&order, ", ")
}

/// At most eight names, and how many more there are.
pub(crate) fn list(names: &[impl AsRef<str>], between: &str) -> String {
    let shown: Vec<String> =
        names.iter().take(MOST_NAMES).map(|name| Quoted(name.as_ref()).to_string()).collect();
    let shown = shown.join(between);
    match names.len().saturating_sub(MOST_NAMES) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn index(names: &[&str], wanted: &str) -> Option<usize> {
        find(names, wanted).ok().map(|found| found.index)
    }

    #[test]
    fn most_parts_at_the_end_win() {
        let both = ["left/0001.png", "right/0001.png"];
        for (names, wanted, want) in [
            (&both[..], "images/right/0001.png", Some(1)),
            (&both, "./left/0001.png", Some(0)),
            (&both, "right\\0001.png", Some(1)),
            (&["0001.png", "right/0001.png"], "images/0001.png", Some(0)),
            (&["right/0001.png", "a/right/0001.png"], "./right/0001.png", Some(0)),
            (&["images/a.jpg", "images/b.jpg"], "undistorted/b.jpg", Some(1)),
            (&["a.jpg", "a.png"], "sub/a.png", Some(1)),
            (&["a.jpg", "b.jpg"], "sub/a.png", Some(0)),
            (&["train/r_0.png", "train/r_1.png"], "r_1", Some(1)),
            (&both, "0001.png", None),
            (&["a.jpg", "a.tif"], "a.png", None),
            (&both, "0002.png", None),
            (&both, "", None),
        ] {
            assert_eq!(index(names, wanted), want, "{names:?} {wanted}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]
        /// Names find themselves, and those that are in no folder of another one also below a folder.
        #[test]
        fn every_name_of_a_list_is_found(list in prop::collection::btree_set("([ab]/){0,3}[ab]\\.(png|jpg)", 1..12)) {
            let names: Vec<&str> = list.iter().map(String::as_str).collect();
            for (i, name) in names.iter().enumerate() {
                let want = Found { index: i, whole: true };
                prop_assert_eq!(find(&names, name), Ok(want));
                prop_assert_eq!(find(&names, &format!("photos/./{name}")), Ok(want));
            }
        }
    }

    #[test]
    fn folders_that_contradict_are_known() {
        let whole = |name, wanted| find(&[name], wanted).unwrap().whole;
        assert!(whole("left/1.png", "1.png") && whole("1.png", "left/1.png") && whole("1.png", "1.png"));
        assert!(!whole("left/1.png", "right/1.png"));
    }

    #[test]
    fn messages_name_the_candidates() {
        let message = |names: &[&str], wanted| find(names, wanted).unwrap_err().to_string();
        let twice = message(&["left/1.png", "right/1.png"], "1.png");
        assert!(twice.contains("left/1.png or right/1.png"), "{twice}");
        let many: Vec<String> = (0..200).map(|k| format!("img_{k:04}.jpg")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        let missing = message(&many, "img_015O.jpg");
        assert!(missing.contains("img_0150.jpg") && missing.ends_with("and 192 more"), "{missing}");
    }
}
