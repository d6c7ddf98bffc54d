//! "Did you mean ...?"

/// The entry of `known` with the least edit distance to `word`, if that is at most a third of its length.
pub(crate) fn nearest(word: &str, known: &[&'static str]) -> Option<&'static str> {
    // A typing error does not make a key far longer; the limit also bounds the work.
    let letters: Vec<char> = word.chars().take(65).flat_map(char::to_lowercase).collect();
    if letters.len() > 64 {
        return None;
    }
    known
        .iter()
        .map(|candidate| (distance(&letters, candidate), *candidate))
        .filter(|(d, candidate)| 3 * d <= candidate.chars().count())
        .min_by_key(|(d, _)| *d)
        .map(|(_, candidate)| candidate)
}

/// Optimal string alignment: insertions, deletions, replacements and swaps of neighbours.
fn distance(a: &[char], b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut before: Vec<usize> = Vec::new();
    let mut previous: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replaced = previous[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replaced.min(previous[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            row.push(best);
        }
        before = std::mem::replace(&mut previous, row);
    }
    previous[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_the_four_kinds_of_edits() {
        let d = |a: &str, b| distance(&a.chars().collect::<Vec<_>>(), b);
        assert_eq!(d("delay", "delay"), 0);
        assert_eq!(d("dealy", "delay"), 1);
        assert_eq!(d("delays", "delay"), 1);
        assert_eq!(d("dely", "delay"), 1);
        assert_eq!(d("", "delay"), 5);
        assert_eq!(d("filter", ""), 6);
    }

    #[test]
    fn suggests_only_what_is_near() {
        let known = ["delay", "delay_samples", "filter"];
        assert_eq!(nearest("Delay", &known), Some("delay"));
        assert_eq!(nearest("delay_sample", &known), Some("delay_samples"));
        assert_eq!(nearest("fitler", &known), Some("filter"));
        assert_eq!(nearest("gain", &known), None);
        assert_eq!(nearest("d", &["a", "b", "c"]), None);
        assert_eq!(nearest(&"x".repeat(1_000_000), &known), None);
    }
}
