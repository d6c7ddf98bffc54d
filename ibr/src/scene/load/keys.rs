//! What to do about a key that a table of a scene does not have.

use crate::scene::{SceneSpec, TargetSpec, ViewSpec};
use serde::de::DeserializeOwned;

/// Most bytes of a key that is compared with the known ones; a longer one is like none of them.
const MOST_COMPARED: usize = 64;

/// The table that has the key, or the known key most like it; empty if the message is about something else.
pub(super) fn hint(message: &str) -> String {
    let Some(rest) = message.strip_prefix("unknown field ") else { return String::new() };
    let mut quoted = rest.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next() else { return String::new() };
    if unknown.len() > MOST_COMPARED {
        return String::new();
    }
    let tables = tables_with(unknown);
    if !tables.is_empty() {
        return format!("; `{unknown}` belongs {}", tables.join(" or "));
    }
    nearest(unknown, quoted).map_or(String::new(), |key| format!("; did you mean `{key}`?"))
}

/// The tables that have a key.
fn tables_with(key: &str) -> Vec<&'static str> {
    let plain = key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    let tables = [
        ("in [[view]]", knows::<ViewSpec>(key)),
        ("in [virtual]", knows::<TargetSpec>(key)),
        ("at the top of the file", knows::<SceneSpec>(key)),
    ];
    tables.into_iter().filter(|(_, knows)| plain && *knows).map(|(table, _)| table).collect()
}

/// Whether a table has a key: any other complaint than that it is unknown means that it is known.
fn knows<T: DeserializeOwned>(key: &str) -> bool {
    match toml::from_str::<T>(&format!("{key} = 0")) {
        Ok(_) => true,
        Err(e) => !e.message().starts_with("unknown field"),
    }
}

/// The known key most like the unknown one, if any is like it enough.
fn nearest<'a>(unknown: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = |key: &str| strsim::jaro_winkler(unknown, key);
    known.filter(|key| likeness(key) > 0.7).max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_other_tables_are_named_with_them() {
        let unknown = |key: &str| hint(&format!("unknown field `{key}`, expected one of `view`, `virtual`"));
        assert!(unknown("step").ends_with("`step` belongs in [[view]]"), "{}", unknown("step"));
        assert!(unknown("position").ends_with("belongs in [[view]] or in [virtual]"));
        assert!(unknown("transforms").ends_with("belongs at the top of the file"));
        assert!(unknown("camera_of").ends_with("belongs in [virtual]"));
        assert!(unknown("veiw").ends_with("did you mean `view`?"));
        assert_eq!(unknown("\" = 1\n"), "");
        let long = |length: usize| format!("position{}", "n".repeat(length));
        let hint = |key: &str| hint(&format!("unknown field `{key}`, expected `position`"));
        assert!(hint(&long(9)).ends_with("did you mean `position`?"));
        assert_eq!(hint(&long(MOST_COMPARED)), "");
        assert_eq!(hint("invalid type"), "");
    }
}
