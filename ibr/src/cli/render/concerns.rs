//! Warnings about what the figures of merit alone do not show, gathered over all virtual views.

use super::Rendered;
use crate::cli::failure::PROGRAM;
use crate::cli::inputs;
use crate::pipeline::Agreement;
use crate::pipeline::uncalibrated::OrderBy;
use crate::scene::Kind;

/// Share of covered pixels below which a view is hardly one.
const LEAST_COVERAGE: f64 = 0.5;

/// What is doubtful about the views of a command.
#[derive(Default)]
pub(super) struct Concerns {
    views: usize,
    /// Views that samples hardly cover, by number from 1, and their coverage.
    bare: Vec<(usize, f64)>,
    /// Views whose fit stopped early, with its relative residual and its steps.
    unfinished: Vec<(usize, f64, usize)>,
    /// Views whose order of depth is undecided.
    undecided: usize,
    /// The agreement of the inputs, which all views have in common.
    agreement: Option<Agreement>,
}

impl Concerns {
    /// Looks at the next view.
    pub(super) fn add(&mut self, done: &Rendered) {
        self.views += 1;
        let coverage = done.rendering.coverage();
        if coverage < LEAST_COVERAGE && done.hull.is_none() {
            self.bare.push((self.views, coverage));
        }
        if let Some(c) = done.rendering.report.convergence.filter(|c| !c.reached) {
            self.unfinished.push((self.views, c.residual, c.steps));
        }
        let undecided = done.geometry.as_ref().is_some_and(|g| g.order_by == OrderBy::Nothing);
        self.undecided += usize::from(undecided);
        self.agreement.get_or_insert_with(|| done.rendering.agreement.clone());
    }

    /// Prints one warning of each kind, with the worst view.
    pub(super) fn warn(&self, kind: &Kind) {
        if let Some(agreement) = &self.agreement {
            inputs::warn_of_contradictions(agreement, kind);
        }
        self.texts().iter().for_each(|text| PROGRAM.warn(text));
    }

    fn texts(&self) -> Vec<String> {
        let mut texts = Vec::new();
        if let Some((view, coverage)) = self.bare.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            let percent = 100.0 * coverage;
            let said = format!("only {percent:.1} % of the image is covered by samples");
            texts.push(self.of_views(self.bare.len(), *view, &said));
        }
        if let Some((view, residual, steps)) = self.unfinished.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            let said =
                format!("the plane fit stopped after {steps} steps at a relative residual of {residual:.1e}");
            texts.push(self.of_views(self.unfinished.len(), *view, &said));
        }
        if self.undecided > 0 {
            texts.push(
                "the order of depth is undecided: guessed calibrations contradict each other, and colours do not show it; so no surface hides another".into(),
            );
        }
        texts
    }

    /// What is said of the worst of several views; of one view as it is.
    fn of_views(&self, count: usize, worst: usize, said: &str) -> String {
        match self.views {
            1 => said.into(),
            all => format!("{count} of {all} virtual views, worst number {worst}: {said}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_view_speaks_for_all() {
        let one = Concerns { views: 1, bare: vec![(1, 0.25)], ..Concerns::default() };
        assert_eq!(one.texts(), ["only 25.0 % of the image is covered by samples"]);
        let path = Concerns {
            views: 9,
            bare: vec![(3, 0.4), (7, 0.1), (8, 0.3)],
            unfinished: vec![(2, 1e-3, 500)],
            undecided: 9,
            ..Concerns::default()
        };
        let texts = path.texts();
        assert_eq!(texts.len(), 3);
        assert!(texts[0].starts_with("3 of 9 virtual views, worst number 7: only 10.0 %"), "{texts:?}");
        assert!(texts[1].starts_with("1 of 9 virtual views, worst number 2: the plane fit"), "{texts:?}");
        assert!(texts[2].contains("order of depth"), "{texts:?}");
        assert!(Concerns::default().texts().is_empty());
    }
}
