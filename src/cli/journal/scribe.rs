//! Writes events down: each kind at most once a second as text, and as JSON lines in the report.

use super::event::{Event, Span};
use super::report_file::ReportFile;
use crate::pipeline::Gap;
use std::time::{Duration, Instant};

/// Least time between two lines of one kind. The first one comes no earlier than this after the beginning:
/// what ends before then has its report at once.
const INTERVAL: Duration = Duration::from_secs(1);
/// Most gaps of a report, as in [`GapFiller::gaps`](crate::pipeline::GapFiller::gaps).
const MOST_GAPS: u64 = 65_536;

/// Where the lines of text go.
pub(super) type Say = Box<dyn FnMut(&str) + Send>;

/// Writes events.
pub(super) struct Scribe {
    begun: Instant,
    say: Say,
    report: Option<ReportFile>,
    gaps: Limit<Gaps>,
    replaced: Limit<Span>,
    clipped: Limit<Span>,
    /// Gaps in the report.
    listed: u64,
    /// Gaps were said.
    pub(super) has_said_gaps: bool,
}

/// Gaps of one line.
#[derive(Debug, Clone, Copy)]
struct Gaps {
    last: Gap,
    count: u64,
    missing: u64,
}

/// What waits for the time of its line.
struct Limit<T> {
    next: Instant,
    held: Option<T>,
}

impl<T> Limit<T> {
    /// The held value, if its time has come.
    fn due(&mut self, now: Instant) -> Option<T> {
        if now < self.next {
            return None;
        }
        let held = self.held.take()?;
        self.next = now + INTERVAL;
        Some(held)
    }
}

impl Scribe {
    pub(super) fn new(report: Option<ReportFile>, begun: Instant, say: Say) -> Self {
        let next = begun + INTERVAL;
        Self {
            begun,
            say,
            report,
            gaps: Limit { next, held: None },
            replaced: Limit { next, held: None },
            clipped: Limit { next, held: None },
            listed: 0,
            has_said_gaps: false,
        }
    }

    /// Takes an event that happens `now`.
    pub(super) fn take(&mut self, event: Event, now: Instant) {
        match event {
            Event::Gap(gap) => {
                if self.listed < MOST_GAPS {
                    self.write(&event, now);
                }
                self.listed += 1;
                let held = self.gaps.held.get_or_insert(Gaps { last: gap, count: 0, missing: 0 });
                *held = Gaps { last: gap, count: held.count + 1, missing: held.missing + gap.length };
            }
            Event::Replaced(span) => hold(&mut self.replaced, span),
            Event::Clipped(span) => hold(&mut self.clipped, span),
            event => {
                self.write(&event, now);
                self.has_said_gaps |= matches!(event, Event::GapGoesOn(_));
                (self.say)(&event.to_string());
            }
        }
        self.say_due(now);
    }

    /// Says what has waited long enough.
    pub(super) fn say_due(&mut self, now: Instant) {
        if let Some(Gaps { last, count, missing }) = self.gaps.due(now) {
            let more = match count {
                1 => String::new(),
                _ => format!("; {count} gaps with {missing} samples in the last second"),
            };
            (self.say)(&format!("{}{more}", Event::Gap(last)));
            self.has_said_gaps = true;
        }
        let spans = [self.replaced.due(now).map(Event::Replaced), self.clipped.due(now).map(Event::Clipped)];
        for event in spans.into_iter().flatten() {
            self.write(&event, now);
            (self.say)(&event.to_string());
        }
    }

    /// When the next line is due.
    pub(super) fn next(&self) -> Option<Instant> {
        let gaps = self.gaps.held.map(|_| self.gaps.next);
        let spans = [&self.replaced, &self.clipped].map(|limit| limit.held.map(|_| limit.next));
        spans.into_iter().chain([gaps]).flatten().min()
    }

    /// Says nothing more of what waits: the summary does. The report gets it.
    pub(super) fn quiet(&mut self, now: Instant) {
        self.gaps.held = None;
        let spans =
            [self.replaced.held.take().map(Event::Replaced), self.clipped.held.take().map(Event::Clipped)];
        spans.into_iter().flatten().for_each(|event| self.write(&event, now));
    }

    /// Writes the last line of the report.
    pub(super) fn end(&mut self, last: &serde_json::Value, now: Instant) -> Result<(), String> {
        self.write(last, now);
        self.report.take().map_or(Ok(()), ReportFile::close)
    }

    fn write(&mut self, line: &impl serde::Serialize, now: Instant) {
        if let Some(report) = &mut self.report {
            report.write(line, now.duration_since(self.begun));
        }
    }
}

fn hold(limit: &mut Limit<Span>, span: Span) {
    match &mut limit.held {
        Some(held) => held.merge(span),
        None => limit.held = Some(span),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    fn gap(first: u64) -> Event {
        Event::Gap(Gap { channel: 2, first, length: 10 })
    }

    #[test]
    fn each_kind_has_a_line_a_second_and_what_ends_early_none() {
        let said = Arc::new(Mutex::new(Vec::new()));
        let lines = Arc::clone(&said);
        let begun = Instant::now();
        let say = Box::new(move |line: &str| lines.lock().unwrap().push(line.to_owned()));
        let mut scribe = Scribe::new(None, begun, say);
        let at = |milliseconds: u64| begun + Duration::from_millis(milliseconds);
        let clipped = |first, last, samples| Event::Clipped(Span { first, last, samples });
        scribe.take(gap(5), at(200));
        scribe.take(clipped(0, 9, 3), at(300));
        assert!(said.lock().unwrap().is_empty() && scribe.next() == Some(at(1000)));
        scribe.take(gap(50), at(400));
        scribe.say_due(at(1000));
        scribe.take(clipped(20, 29, 4), at(1500));
        scribe.take(clipped(30, 39, 1), at(1600));
        assert_eq!(scribe.next(), Some(at(2000)));
        scribe.say_due(at(2000));
        // Long after the last line it comes at once.
        scribe.take(gap(900), at(5000));
        scribe.take(gap(990), at(5001));
        scribe.quiet(at(5002));
        scribe.say_due(at(9000));
        let want = [
            "gap: channel 2, sample 50, 10 missing; 2 gaps with 20 samples in the last second",
            "clipped: 3 of the output samples 0 to 9",
            "clipped: 5 of the output samples 20 to 39",
            "gap: channel 2, sample 900, 10 missing",
        ];
        assert_eq!(*said.lock().unwrap(), want);
    }
}
