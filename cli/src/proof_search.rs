//! The search for the proof of a finished bank, within a time.

use super::design_watch::{DesignWatch, LOOK};
use super::interrupt::interrupts;
use super::print::{Failure, failed};
use crossbeam_channel::{Receiver, RecvTimeoutError, unbounded};
use hybank::design::{Design, Stage, Stop};
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

/// A proof is searched for as long as the design took, and at least for so long.
const SHORTEST: Duration = Duration::from_secs(3);

/// How long a proof is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ProofLimit {
    /// To the end of the search.
    Unlimited,
    /// For so long.
    Within(Duration),
    /// Not at all: no proof is wanted.
    NotWanted,
    /// Not at all: the design was ended.
    Ended,
}

impl ProofLimit {
    /// As the options say, for a design that took so long.
    pub(super) fn new(prove: bool, no_proof: bool, design: Duration) -> Self {
        match (prove, no_proof) {
            (true, _) => Self::Unlimited,
            (_, true) => Self::NotWanted,
            _ => Self::Within(design.max(SHORTEST)),
        }
    }
}

/// A design after the search for its proof.
pub(super) struct Searched {
    /// With what was proven.
    pub(super) design: Design,
    /// Why the search did not come to its end, if it did not.
    pub(super) cut: Option<SearchCut>,
}

/// Why a search did not come to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SearchCut {
    /// It reached its limit.
    OutOfTime(Duration),
    /// It was interrupted.
    Interrupted,
    /// No proof is wanted.
    NotWanted,
}

impl SearchCut {
    /// Of the gamma.
    pub(super) fn of_gamma(self) -> String {
        let goes_on = "`hybank verify --search` goes on";
        match self {
            Self::OutOfTime(limit) => format!("not proven within {:.0} s; {goes_on}", limit.as_secs_f64()),
            Self::Interrupted => format!("not proven, the search was interrupted; {goes_on}"),
            Self::NotWanted => "not proven, as asked".to_owned(),
        }
    }

    /// Of the worst case over a box, whose proof follows that of gamma.
    pub(super) fn of_box(self) -> String {
        match self {
            Self::OutOfTime(limit) => {
                format!("not within {:.0} s; --prove has no limit", limit.as_secs_f64())
            }
            Self::Interrupted => "the search was interrupted".to_owned(),
            Self::NotWanted => "as asked".to_owned(),
        }
    }
}

/// Searches for the proof of `design` and ends at the limit or at an interrupt, with what is proven by then.
pub(super) fn proved(design: Design, limit: ProofLimit) -> Result<Searched, Failure> {
    let time = match limit {
        ProofLimit::Ended => return Ok(Searched { design, cut: None }),
        ProofLimit::NotWanted => return Ok(Searched { design, cut: Some(SearchCut::NotWanted) }),
        ProofLimit::Unlimited => None,
        ProofLimit::Within(time) => Some(time),
    };
    let watch = DesignWatch {
        stop: Stop::default(),
        interrupts: interrupts(),
        at_interrupt: "interrupted: the search for the proof ends",
        limit: None,
        give_up: &|| (),
        stage: Mutex::new(Some(Stage::Proof)),
    };
    let results = search(design.clone())?;
    Ok(watch.during(|| latest(design, &results, time, &watch.stop)))
}

/// Begins the search. Some steps of it last for seconds and cannot be ended, so the thread is left to itself
/// when time is up; what it proved by then was sent.
fn search(mut design: Design) -> Result<Receiver<Design>, Failure> {
    let (sender, results) = unbounded();
    let work = move || {
        design.prove(&Stop::default(), &|proven| {
            // The search was given up.
            let _ = sender.send(proven.clone());
        });
    };
    thread::Builder::new().name("proof".into()).spawn(work).map_err(failed)?;
    Ok(results)
}

/// The last of the `results` within the time.
fn latest(mut design: Design, results: &Receiver<Design>, time: Option<Duration>, stop: &Stop) -> Searched {
    let begin = Instant::now();
    loop {
        let left = time.map_or(LOOK, |time| LOOK.min(time.saturating_sub(begin.elapsed())));
        let cut = match results.recv_timeout(left) {
            Ok(proven) => {
                design = proven;
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return Searched { design, cut: None },
            Err(RecvTimeoutError::Timeout) if stop.is_due() => SearchCut::Interrupted,
            Err(RecvTimeoutError::Timeout) => match time.filter(|time| begin.elapsed() >= *time) {
                Some(limit) => SearchCut::OutOfTime(limit),
                None => continue,
            },
        };
        design.proof_time = begin.elapsed();
        return Searched { design, cut: Some(cut) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybank::design::{DesignError, DesignOptions, design};
    use hybank::spec::Spec;

    fn designed() -> Design {
        let text = include_str!("../../filters/thesis-fir.toml");
        let spec = Spec::from_toml(text, "thesis-fir.toml").unwrap();
        design(&spec, &DesignOptions::without_proof()).unwrap()
    }

    #[test]
    fn a_proof_has_the_time_of_the_design_and_three_seconds_at_least() {
        let limit = |seconds| ProofLimit::new(false, false, Duration::from_secs(seconds));
        assert_eq!(limit(0), ProofLimit::Within(SHORTEST));
        assert_eq!(limit(60), ProofLimit::Within(Duration::from_secs(60)));
        assert_eq!(ProofLimit::new(true, false, SHORTEST), ProofLimit::Unlimited);
        assert_eq!(ProofLimit::new(false, true, SHORTEST), ProofLimit::NotWanted);
    }

    #[test]
    fn a_search_without_a_limit_comes_to_its_end() {
        let found = proved(designed(), ProofLimit::Unlimited).unwrap();
        assert!(found.cut.is_none() && found.design.proof.is_ok() && found.design.bank.proof.is_some());
    }

    #[test]
    fn a_search_that_is_cut_leaves_the_bank_as_it_was() {
        let (design, (_sender, never)) = (designed(), unbounded());
        let text = design.bank.to_json().unwrap();
        let cut = latest(design, &never, Some(Duration::ZERO), &Stop::default());
        assert_eq!(cut.cut, Some(SearchCut::OutOfTime(Duration::ZERO)));
        assert_eq!(cut.design.proof, Err(DesignError::ProofSkipped));
        assert_eq!(cut.design.bank.to_json().unwrap(), text);
        let (stop, asked) = (Stop::default(), designed());
        stop.now();
        assert_eq!(latest(asked, &never, None, &stop).cut, Some(SearchCut::Interrupted));
    }
}
