//! Tells from its first bytes what a file is that was given in place of another.

use crate::bank::FORMAT;

/// What a file is that should have been a spec or a bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileKind {
    Bank,
    Spec,
    Other,
}

impl FileKind {
    /// Of a file with this text.
    pub(super) fn of(text: &str) -> Self {
        let begin = text.trim_start_matches('\u{feff}').trim_start();
        if begin.starts_with('{') {
            return if begin.contains(FORMAT) { Self::Bank } else { Self::Other };
        }
        let is_key = |line: &str| {
            ["fast_rate", "fast_period", "ratio", "[target]", "[[channel]]"]
                .iter()
                .any(|key| line.trim_start().starts_with(key))
        };
        if begin.lines().any(is_key) { Self::Spec } else { Self::Other }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specs_and_banks_are_told_apart() {
        for spec in [
            include_str!("../../filters/interleaved-4x250M.toml"),
            include_str!("../../filters/thesis-iir.toml"),
        ] {
            assert_eq!(FileKind::of(spec), FileKind::Spec);
        }
        assert_eq!(FileKind::of(include_str!("../../filters/thesis-fir.json")), FileKind::Bank);
        for other in ["", "{}", "# nothing", "a = 1", "precious"] {
            assert_eq!(FileKind::of(other), FileKind::Other, "{other}");
        }
    }
}
