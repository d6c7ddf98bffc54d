//! Calls on several threads.
//!
//! A call is halved until the spans are short, or many; each span has a state of its own, made from the filter memory before it,
//! so its outputs have the bits that one thread would give them. There are more spans than threads: who is done first takes
//! the next one, so that a thread that was held up does not hold up all.

use super::ticks::{FastSink, TickSource};
use std::io;
use std::ops::Range;

/// Threads that wait for work; any number of streams may use them.
#[derive(Debug)]
pub struct Workers {
    pool: rayon::ThreadPool,
}

impl Workers {
    /// Starts `threads` threads, one for each processor if that is 0.
    ///
    /// # Errors
    /// If the system starts no more threads.
    pub fn new(threads: usize) -> io::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        Ok(Self { pool: pool.map_err(io::Error::other)? })
    }

    /// How many there are.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }
}

/// Multiply-adds that are worth a span: some tens of microseconds, many times what it costs to hand it over.
const SPAN: usize = 1 << 20;

/// Spans of a long call for each thread, at most: enough for those that are faster to help out, and each long against making its
/// state.
const SPANS: usize = 8;

/// A plan whose calls can be cut into spans.
pub(super) trait Spans: Sync {
    type State: Send;
    /// Ticks from one where a span may begin to the next.
    const PERIOD: usize;
    /// Multiply-adds of a tick.
    fn products(&self) -> usize;
    /// M.
    fn ratio(&self) -> usize;
    /// Ticks that a state must know.
    fn reach(&self) -> usize;
    /// Ticks since a span could have begun, for a stream in this state.
    fn lead(state: &Self::State) -> usize;
    /// All ticks; returns how many samples were not finite.
    fn process(
        &self,
        state: &mut Self::State,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64;
    /// A state before tick `first`, which has so many ticks before it and at which a span may begin.
    fn state_at(&self, source: &(impl TickSource + ?Sized), first: usize) -> Self::State;
}

/// Runs a call on all workers and leaves the state after its last tick; returns how many samples were not finite.
pub(super) fn process<P: Spans>(
    plan: &P,
    state: &mut P::State,
    source: &(impl TickSource + ?Sized),
    sink: &mut (impl FastSink + ?Sized),
    workers: &Workers,
) -> u64 {
    let ticks = source.ticks();
    let least = SPAN.div_ceil(plan.products()).max(4 * plan.reach());
    if workers.threads() == 1 || ticks < 2 * least {
        return plan.process(state, source, sink);
    }
    let span = least.max(ticks / (SPANS * workers.threads()));
    let call = Call { plan, source, lead: P::lead(state), span };
    let (replaced, last) = workers.pool.install(|| call.spans(0..ticks, Some(state), sink));
    if let Some(last) = last {
        *state = last;
    }
    replaced
}

/// A call whose spans are shared out.
struct Call<'a, P, S: ?Sized> {
    plan: &'a P,
    source: &'a S,
    /// Ticks since a span could have begun, before the call.
    lead: usize,
    /// Least ticks of a span.
    span: usize,
}

impl<P: Spans, S: TickSource + ?Sized> Call<'_, P, S> {
    /// The ticks of a range to a sink of their own. The first span has the stream's `state`, the others make theirs;
    /// returns how many samples were not finite, and the state after the last span if it is not the stream's.
    fn spans(
        &self,
        ticks: Range<usize>,
        state: Option<&mut P::State>,
        sink: &mut (impl FastSink + ?Sized),
    ) -> (u64, Option<P::State>) {
        if ticks.len() < 2 * self.span {
            return self.span(ticks, state, sink);
        }
        let middle = ticks.start + ticks.len() / 2;
        let middle = middle - (self.lead + middle) % P::PERIOD;
        sink.halves((middle - ticks.start) * self.plan.ratio(), |earlier, later| {
            let ((some, _), (more, last)) = rayon::join(
                || self.spans(ticks.start..middle, state, earlier),
                || self.spans(middle..ticks.end, None, later),
            );
            (some + more, last)
        })
    }

    fn span(
        &self,
        ticks: Range<usize>,
        state: Option<&mut P::State>,
        sink: &mut (impl FastSink + ?Sized),
    ) -> (u64, Option<P::State>) {
        let mut run = |state: &mut P::State| {
            self.source.part(ticks.clone(), |part| self.plan.process(state, part, sink))
        };
        match state {
            Some(state) => (run(state), None),
            None => {
                let mut own = self.plan.state_at(self.source, ticks.start);
                (run(&mut own), Some(own))
            }
        }
    }
}
