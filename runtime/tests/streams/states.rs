//! States as bytes: a stream goes on from them with the bits of the one that never stopped, and refuses what
//! is no state of its plan.

use hybank_runtime::{
    Algorithm, Options, Plan, Precision, STATE_COUNTS, Shape, StateError, StateMatrices, Stream,
};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

const M: usize = 3;

/// Numbers between -1 and 1 that follow no simple rule.
fn numbers(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|i| ((i + seed) * (i + 3 * seed) * 7919 % 2003) as f64 / 1001.0 - 1.0).collect()
}

fn options(algorithm: Algorithm, precision: Precision) -> Options {
    Options { algorithm, precision, ..Options::default() }
}

/// Filters of so many taps per phase on so many channels.
fn fir(channels: usize, phase_taps: usize, algorithm: Algorithm, precision: Precision) -> Plan {
    let taps: Vec<_> = (0..channels).map(|i| numbers(phase_taps * M, 5 + 17 * i)).collect();
    Plan::from_taps(&taps, M, 4, options(algorithm, precision)).unwrap()
}

/// States in a row after a delay line of two frames of channel 1; all of them depend on the next one
/// (`dense`), or two on each other (`parallel-form`).
fn recursion(channels: usize, order: usize) -> Plan {
    let size = order + 2;
    let mut a = vec![vec![0.0; size]; size];
    for i in 0..order {
        a[i][i] = 0.6 - 0.1 * i as f64;
        if order > 2 || i == 0 {
            a[i][(i + 1) % order] = 0.3;
        }
    }
    (a[0][order], a[order][order + 1]) = (0.5, 1.0);
    let mut b: Vec<Vec<f64>> = (0..size).map(|i| numbers(channels, 3 + i)).collect();
    b[order].fill(0.0);
    b[order + 1] = (0..channels).map(|i| if i == 0 { 1.0 } else { 0.0 }).collect();
    let (c, d) = ((0..M).map(|i| numbers(size, 11 + i)).collect(), vec![vec![0.5; channels]; M]);
    let system = StateMatrices { a, b, c, d };
    Plan::from_state_space(&system, Shape { channels, ratio: M }, 4, Options::default()).unwrap()
}

/// Every algorithm in both precisions, with K odd and even, with and without offsets.
fn plans() -> Vec<Plan> {
    let mut plans = Vec::new();
    for precision in [Precision::Single, Precision::Double] {
        for algorithm in [Algorithm::Direct, Algorithm::OverlapSave] {
            plans.extend([(1, 2), (2, 9), (3, 10)].map(|(n, k)| fir(n, k, algorithm, precision)));
        }
    }
    plans.extend([(1, 2), (2, 2), (2, 5)].map(|(n, order)| recursion(n, order)));
    let offset = plans[3].clone().with_corrections(&[0.25], &[]).unwrap();
    plans.push(offset);
    plans
}

/// Frames with a NaN here and there.
fn frames(plan: &Plan, frames: usize) -> Vec<f64> {
    let mut input = numbers(frames * plan.channels(), 29);
    input.iter_mut().skip(40).step_by(97).for_each(|x| *x = f64::NAN);
    input
}

fn process(stream: &mut Stream, input: &[f64]) -> Vec<u64> {
    let mut output = vec![0.0; input.len() / stream.channels() * M];
    stream.process(input, &mut output).unwrap();
    output.into_iter().map(f64::to_bits).collect()
}

fn counts(stream: &Stream) -> [u64; 3] {
    [stream.position(), stream.replaced(), stream.state_resets()]
}

#[test]
fn a_stream_goes_on_with_the_bits_of_the_one_that_never_stopped() {
    let all = plans();
    let names: std::collections::BTreeSet<_> = all.iter().map(Plan::algorithm).collect();
    assert_eq!(Vec::from_iter(names), ["dense", "direct", "overlap-save", "parallel-form"]);
    let case = (0..all.len(), 0..700usize, 1..300usize, 0..200usize);
    let config = Config { cases: 400, failure_persistence: None, ..Config::default() };
    let test = TestRunner::new(config).run(&case, |(plan, cut, more, dirt)| {
        let plan = &all[plan];
        let (input, dirt) = (frames(plan, cut + more), frames(plan, dirt));
        let (before, after) = input.split_at(cut * plan.channels());
        let mut running = Stream::new(plan);
        process(&mut running, before);
        let state = running.state();
        prop_assert_eq!(state.len(), running.state_bytes());
        let mut other = Stream::new(plan);
        process(&mut other, &dirt);
        prop_assert_eq!(other.resume(&state), Ok(()));
        prop_assert_eq!(other.state(), state);
        prop_assert_eq!(process(&mut other, after), process(&mut running, after));
        prop_assert_eq!(counts(&other), counts(&running));
        prop_assert_eq!(other.state(), running.state());
        Ok(())
    });
    test.unwrap();
}

#[test]
fn a_state_that_overflowed_is_reset_at_the_same_frame() {
    let plan = recursion(2, 2);
    let mut running = Stream::new(&plan);
    process(&mut running, &[1.7e308; 2 * 10]);
    let mut other = Stream::new(&plan);
    other.resume(&running.state()).unwrap();
    let more = numbers(2 * 90, 1);
    assert_eq!(process(&mut other, &more), process(&mut running, &more));
    assert_eq!((other.state_resets(), counts(&other)), (1, counts(&running)));
}

#[test]
fn streams_that_had_the_same_history_agree_after_their_counts() {
    for plan in plans().iter().filter(|plan| plan.history().is_some()) {
        // Outputs that overlap-save still owes are those of the batch before.
        let unit = plan.alignment();
        let warm = plan.history().unwrap().div_ceil(unit) * unit + unit;
        let input = numbers((3 * unit + warm + 7) * plan.channels(), 2);
        let (mut whole, mut later) = (Stream::new(plan), Stream::new(plan));
        process(&mut whole, &input);
        process(&mut later, &input[3 * unit * plan.channels()..]);
        let [one, two] = [whole.state(), later.state()];
        assert_eq!(one[STATE_COUNTS..], two[STATE_COUNTS..], "{:?}", plan.summary());
        assert_ne!(one, two);
    }
}

#[test]
fn a_state_of_another_plan_is_refused() {
    let all = plans();
    for (i, from) in all.iter().enumerate() {
        let mut stream = Stream::new(from);
        process(&mut stream, &frames(from, 77));
        let state = stream.state();
        for (j, to) in all.iter().enumerate().filter(|&(j, _)| j != i) {
            assert_eq!(Stream::new(to).resume(&state), Err(StateError::OtherPlan), "{i} to {j}");
        }
        // A plan made again from the same numbers is the same plan.
        assert_eq!(Stream::new(&plans()[i]).resume(&state), Ok(()));
    }
}

#[test]
fn one_tap_tells_plans_apart() {
    let taps = vec![numbers(12, 1); 2];
    let plan = |taps: &[Vec<f64>], latency| Plan::from_taps(taps, M, latency, Options::default()).unwrap();
    let state = Stream::new(&plan(&taps, 4)).state();
    assert_eq!(Stream::new(&plan(&taps, 5)).resume(&state), Err(StateError::OtherPlan));
    for place in 0..24 {
        let mut other = taps.clone();
        let tap = &mut other[place / 12][place % 12];
        *tap = tap.next_up();
        assert_eq!(Stream::new(&plan(&other, 4)).resume(&state), Err(StateError::OtherPlan), "{place}");
    }
}

#[test]
fn damaged_states_are_refused_and_change_nothing() {
    for plan in &plans() {
        let mut stream = Stream::new(plan);
        process(&mut stream, &frames(plan, 50));
        let state = stream.state();
        process(&mut stream, &frames(plan, 31));
        let before = stream.state();
        let mut refuse = |bytes: &[u8], why| {
            assert_eq!(stream.resume(bytes), Err(why), "{:?}", plan.summary());
            assert_eq!(stream.state(), before);
        };
        (0..state.len()).for_each(|len| {
            let why = if len < 56 || len % 8 > 0 { StateError::NotAState } else { StateError::Damaged };
            refuse(&state[..len], why);
        });
        refuse(&[&state[..], &[0; 8]].concat(), StateError::Damaged);
        let changed = |place: usize, byte: u8| {
            let mut bytes = state.clone();
            bytes[place] = byte;
            bytes
        };
        refuse(&changed(7, 2), StateError::NotAState);
        refuse(&changed(STATE_COUNTS, !state[STATE_COUNTS]), StateError::OtherPlan);
        if plan.alignment() > 1 {
            refuse(&changed(8, 51), StateError::Damaged);
        }
        // The first number is an input where there is any history: 0xfff.. is NaN.
        if plan.history() != Some(0) {
            let mut bytes = state.clone();
            bytes[56..64].fill(0xff);
            refuse(&bytes, StateError::Damaged);
        }
    }
}

#[test]
fn going_on_allocates_nothing() {
    for plan in &plans() {
        let (mut running, mut other) = (Stream::new(plan), Stream::new(plan));
        process(&mut running, &frames(plan, 77));
        let mut bytes = Vec::with_capacity(running.state_bytes());
        let count = allocation_counter::measure(|| {
            running.save(&mut bytes);
            assert_eq!(other.resume(&bytes), Ok(()));
        });
        assert_eq!(count.count_total, 0, "{:?}", plan.summary());
    }
}
