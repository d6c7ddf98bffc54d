//! Circles of a directed graph.

use std::collections::BTreeSet;

/// A shortest circle through each node that lies on one; each circle once.
pub(crate) fn circles(count: usize, arrows: &[(usize, usize)]) -> Vec<Vec<usize>> {
    let mut next = vec![Vec::new(); count];
    arrows.iter().for_each(|&(from, to)| next[from].push(to));
    let mut seen = BTreeSet::new();
    (0..count)
        .filter_map(|start| shortest(&next, start))
        .filter(|circle| seen.insert(circle.iter().copied().collect::<BTreeSet<_>>()))
        .collect()
}

/// Breadth first from `start` back to it.
fn shortest(next: &[Vec<usize>], start: usize) -> Option<Vec<usize>> {
    let mut before = vec![None; next.len()];
    let mut queue = vec![start];
    let mut at = 0;
    while at < queue.len() {
        let node = queue[at];
        at += 1;
        for &to in &next[node] {
            if to == start {
                let mut circle = vec![node];
                while let Some(previous) = before[circle[circle.len() - 1]] {
                    circle.push(previous);
                }
                circle.reverse();
                return Some(circle);
            }
            if before[to].is_none() {
                before[to] = Some(node);
                queue.push(to);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::circles;

    #[test]
    fn each_circle_is_found_once() {
        let arrows = [(0, 1), (1, 2), (2, 1), (2, 3), (3, 4), (4, 5), (5, 3), (0, 5)];
        assert_eq!(circles(6, &arrows), [vec![1, 2], vec![3, 4, 5]]);
    }

    #[test]
    fn a_graph_without_circles_has_none() {
        assert!(circles(4, &[(0, 1), (0, 2), (1, 3), (2, 3)]).is_empty());
    }
}
