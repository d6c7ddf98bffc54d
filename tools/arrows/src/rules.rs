//! The arrows that ARCHITECTURE.md allows, read from the first block of code below "Who may import whom".
//!
//! One or more statements a line, two spaces apart: `rooms -> rooms`, both separated by commas; `everything`
//! and `nothing` are rooms, and what stands in parentheses is left out.

use std::collections::{BTreeMap, BTreeSet};

pub(crate) const HEADING: &str = "## Who may import whom";

#[derive(Debug, Default)]
pub(crate) struct Rules {
    allowed: BTreeMap<String, BTreeSet<String>>,
}

impl Rules {
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let (_, section) = text.split_once(HEADING).ok_or(format!("no heading \"{HEADING}\""))?;
        let block = section.split("```").nth(1).ok_or("no block of code below the heading")?;
        let mut rules = Self::default();
        // The first line holds the language.
        for line in block.lines().skip(1) {
            let line = without_parentheses(line);
            for statement in line.split("  ").map(str::trim).filter(|statement| !statement.is_empty()) {
                let (from, to) =
                    statement.split_once("->").ok_or_else(|| format!("no arrow in `{statement}`"))?;
                for room in rooms(from) {
                    rules.allowed.entry(room).or_default().extend(rooms(to));
                }
            }
        }
        Ok(rules)
    }

    pub(crate) fn knows(&self, room: &str) -> bool {
        self.allowed.contains_key(room)
    }

    /// All rooms that the text names.
    pub(crate) fn rooms(&self) -> BTreeSet<&str> {
        let right =
            self.allowed.values().flatten().filter(|room| !matches!(room.as_str(), "everything" | "nothing"));
        self.allowed.keys().chain(right).map(String::as_str).collect()
    }

    pub(crate) fn allow(&self, from: &str, to: &str) -> bool {
        let Some(allowed) = self.allowed.get(from) else { return false };
        from == to || allowed.contains(to) || allowed.contains("everything")
    }

    /// The allowed arrows, by name; `everything` left out.
    pub(crate) fn arrows(&self) -> Vec<(&str, &str)> {
        let named = |(from, to): (&'_ String, &'_ String)| {
            self.allowed.contains_key(to).then_some((from.len(), to.len()))
        };
        let pairs = self.allowed.iter().flat_map(|(from, to)| to.iter().map(move |to| (from, to)));
        pairs.filter(|&pair| named(pair).is_some()).map(|(from, to)| (from.as_str(), to.as_str())).collect()
    }
}

fn rooms(list: &str) -> impl Iterator<Item = String> {
    list.split(',')
        .map(|room| room.trim().trim_start_matches("hybank::").to_owned())
        .filter(|room| !room.is_empty())
}

fn without_parentheses(line: &str) -> String {
    let mut depth = 0;
    let outside = |c: &char| {
        depth += i32::from(*c == '(');
        let outside = depth == 0;
        depth -= i32::from(*c == ')');
        outside
    };
    line.chars().filter(outside).collect()
}

#[cfg(test)]
mod tests {
    use super::Rules;

    const TEXT: &str = "## Who may import whom\n\n```text\na -> everything\nb, c -> d (as, such), e    \
        d -> nothing\ne -> nothing  b-f -> hybank::d\n```\n";

    #[test]
    fn statements_are_read() {
        let rules = Rules::parse(TEXT).unwrap();
        for (from, to) in [("a", "e"), ("b", "d"), ("c", "e"), ("b-f", "d"), ("e", "e")] {
            assert!(rules.allow(from, to), "{from} -> {to}");
        }
        for (from, to) in [("d", "e"), ("b", "c"), ("x", "d"), ("b", "as")] {
            assert!(!rules.allow(from, to), "{from} -> {to}");
        }
        assert_eq!(rules.arrows().len(), 5);
    }

    #[test]
    fn what_is_no_statement_is_an_error() {
        assert!(Rules::parse("nothing").is_err());
        assert!(Rules::parse("## Who may import whom\n```text\na b\n```").unwrap_err().contains("a b"));
    }
}
