//! What a command says of inputs that contradict each other, or that nothing was compared with.

use super::failure::PROGRAM;
use crate::pipeline::Agreement;
use crate::scene::{Kind, Scene};

/// Prints what was decided on reading a scene and the user may not expect.
pub(super) fn notes(scene: &Scene) {
    scene.notes.iter().for_each(|note| PROGRAM.say_line(&format!("note: {note}")));
}

/// Warns of every pair of views that agrees in too few points, and names the keys to check.
pub(super) fn warn_of_contradictions(agreement: &Agreement, kind: &Kind) {
    let suspects = match kind {
        Kind::Rectified { .. } => {
            "positions (swapped?), disparity_scale and disparity_offset, and whether they are rectified"
        }
        _ => "cameras and depth_scale",
    };
    for pair in agreement.pairs.iter().filter(|p| p.is_poor()) {
        PROGRAM.warn(&format!("{pair}; check their {suspects}"));
    }
}

/// The line of a report about the inputs; none for views without depth.
pub(super) fn line(agreement: &Agreement) -> Option<String> {
    let unchecked = |why: String| Some(format!("inputs    unchecked: {why}"));
    let Some(worst) = agreement.worst() else {
        return match agreement.gains.len() {
            0 => None,
            1 => unchecked(
                "a single view has no other to compare with, so a wrong depth scale or position would not show"
                    .into(),
            ),
            views => unchecked(format!("the {views} views share too few points to compare")),
        };
    };
    // What a viewer notices; smaller differences are matched too.
    let exposures = agreement.gains.iter().flatten().any(|g| g.ln().abs() > 0.02);
    Some(format!(
        "inputs    views agree in depth and colour at {:.0} % of the points{}",
        100.0 * worst.share,
        if exposures { "; exposures differ and are matched" } else { "" }
    ))
}

/// The line of a report about the weights of a prediction.
pub(super) fn weights_line(calibrated_on: usize) -> String {
    match calibrated_on {
        0 => "weights   those of typical photographs: a single view cannot be left out".into(),
        views => format!("weights   calibrated on {views} views, each left out in turn"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::PairAgreement;

    #[test]
    fn the_line_says_what_was_checked() {
        let of = |views: usize, pairs: Vec<PairAgreement>| {
            line(&Agreement { pairs, gains: vec![[1.0; 3]; views], ..Agreement::default() })
        };
        let pair =
            PairAgreement { views: [0, 1], points: 500, share: 0.876, gain: [1.0; 3], difference: 2.0 };
        assert_eq!(of(0, Vec::new()), None);
        assert!(of(1, Vec::new()).is_some_and(|l| l.contains("unchecked: a single view")));
        assert!(of(3, Vec::new()).is_some_and(|l| l.contains("unchecked: the 3 views share too few points")));
        assert!(of(2, vec![pair]).is_some_and(|l| l.ends_with("at 88 % of the points")));
    }
}
