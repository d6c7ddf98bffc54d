//! Calls of a stream allocate nothing, whatever the algorithm, the precision, the entry point and the form
//! of the samples.

use hybank_runtime::{
    Algorithm, FrameSink, FrameSource, Interleaved, Options, PcmFormat, PcmFrames, PcmOutput, Plan, Planar,
    Precision, SampleLayout, Shape, SideBySide, StateMatrices, Stream, Zeros,
};

const N: usize = 2;
const M: usize = 3;
const FRAMES: usize = 700;
/// Frames per call: one, more than a block of a recursion, many.
const CALLS: [usize; 3] = [1, 65, FRAMES];

/// Every algorithm in both precisions, and all of one channel, which planar input has as it lies; and all of
/// them with offsets to subtract.
fn plans() -> Vec<Plan> {
    let both = [Precision::Single, Precision::Double];
    let plans = |channels| both.into_iter().flat_map(move |precision| plans_of(channels, precision));
    let plain: Vec<Plan> = plans(N).chain(plans(1)).collect();
    let subtracting = plain.iter().map(|plan| {
        let offsets = [0.25, -0.5];
        plan.clone().with_corrections(&offsets[..plan.channels()], &[]).unwrap()
    });
    plain.iter().cloned().chain(subtracting).collect()
}

fn plans_of(channels: usize, precision: Precision) -> Vec<Plan> {
    let options = |algorithm| Options { algorithm, precision, ..Options::default() };
    let fir = [Algorithm::Direct, Algorithm::OverlapSave];
    let taps = vec![vec![0.25; 20 * M]; channels];
    let by = |algorithm| Plan::from_taps(&taps, M, 4, options(algorithm)).unwrap();
    // Two states side by side, which run as a section, and five that all depend on one another.
    let recursive = |order: usize| {
        let system = StateMatrices {
            a: (0..order).map(|i| (0..order).map(|j| 0.25 / (1 + i + j) as f64).collect()).collect(),
            b: vec![vec![1.0; channels]; order],
            c: vec![vec![1.0; order]; M],
            d: vec![vec![0.5; channels]; M],
        };
        Plan::from_state_space(&system, Shape { channels, ratio: M }, 4, options(Algorithm::Direct)).unwrap()
    };
    fir.map(by).into_iter().chain([2, 5].map(recursive)).collect()
}

/// Fails if `call` allocates.
fn quiet<R>(plan: &Plan, form: &str, call: impl FnOnce() -> R) -> R {
    let mut result = None;
    let count = allocation_counter::measure(|| result = Some(call())).count_total;
    assert_eq!(count, 0, "{form} by {:?}", plan.summary());
    result.unwrap()
}

/// An input and an output through [`Stream::run`].
fn quiet_run(stream: &mut Stream, form: &str, input: &dyn FrameSource, output: &mut dyn FrameSink) {
    let plan = stream.plan().clone();
    let wanted = input.frames() * M;
    assert_eq!(quiet(&plan, form, || stream.run(input, output)), Ok(wanted), "{form}");
}

#[test]
fn the_counter_counts() {
    assert!(allocation_counter::measure(|| drop(Stream::new(&plans()[0]))).count_total > 0);
}

#[test]
fn all_algorithms_are_among_the_plans() {
    let names: std::collections::BTreeSet<_> = plans().iter().map(Plan::algorithm).collect();
    assert_eq!(Vec::from_iter(names), ["dense", "direct", "overlap-save", "parallel-form"]);
}

#[test]
fn samples_in_memory() {
    for plan in plans() {
        let n = plan.channels();
        let (single, double) = (vec![0.5f32; FRAMES * n], vec![0.5f64; FRAMES * n]);
        let (mut out, mut wide) = (vec![0f32; FRAMES * M], vec![0f64; FRAMES * M]);
        let mut stream = Stream::new(&plan);
        for frames in CALLS {
            let (single, double) = (&single[..frames * n], &double[..frames * n]);
            quiet(&plan, "f32", || stream.process(single, &mut out)).unwrap();
            quiet(&plan, "f64", || stream.process(double, &mut wide)).unwrap();
            let channels = vec![&single[..frames]; n];
            quiet_run(&mut stream, "planar f32", &Planar::new(&channels).unwrap(), &mut out.as_mut_slice());
            let channels = vec![&double[..frames]; n];
            quiet_run(&mut stream, "planar f64", &Planar::new(&channels).unwrap(), &mut wide.as_mut_slice());
            let input = Interleaved::new(single, n).unwrap();
            quiet_run(&mut stream, "f32 to f64", &input, &mut wide.as_mut_slice());
            let input = Planar::new(&channels).unwrap();
            quiet_run(&mut stream, "planar f64 to f32", &input, &mut out.as_mut_slice());
            quiet_run(&mut stream, "zeros", &Zeros { channels: n, frames }, &mut out.as_mut_slice());
        }
    }
}

#[test]
fn samples_as_they_lie_in_files() {
    for plan in plans() {
        let n = plan.channels();
        let mut stream = Stream::new(&plan);
        for (from, to) in PcmFormat::ALL.into_iter().zip(PcmFormat::ALL.into_iter().rev()) {
            let bytes = vec![1; FRAMES * n * 8];
            let mut out = vec![0; FRAMES * M * 8];
            // A recording of all channels, one for each, and samples in containers of more bytes.
            let packed = SampleLayout::packed(from);
            let wide = SampleLayout { container: 8, ..packed };
            for (layout, channels, frames) in [packed, wide]
                .into_iter()
                .flat_map(|layout| [(layout, n), (layout, 1)])
                .flat_map(|(layout, channels)| CALLS.map(|frames| (layout, channels, frames)))
            {
                let bytes = &bytes[..frames * channels * layout.container];
                let recordings = vec![PcmFrames { layout, channels, bytes }; n / channels];
                let mut output = PcmOutput::packed(to, &mut out);
                let form = format!("{from} to {to}");
                let written =
                    quiet(&plan, &form, || stream.run(&SideBySide::new(&recordings[..]), &mut output));
                assert_eq!(written, Ok(frames * M));
            }
        }
    }
}

#[test]
fn flush_reset_and_calls_that_are_refused() {
    for plan in plans() {
        let n = plan.channels();
        let mut stream = Stream::new(&plan);
        let samples = plan.flush_frames() * M;
        assert!(samples > 0);
        let (mut out, mut bytes) = (vec![0f32; samples], vec![0; 2 * samples]);
        assert_eq!(quiet(&plan, "flush", || stream.flush(&mut out.as_mut_slice())), Ok(samples));
        let mut pcm = PcmOutput::packed(PcmFormat::S16Le, &mut bytes);
        assert_eq!(quiet(&plan, "flush to PCM", || stream.flush(&mut pcm)), Ok(samples));
        quiet(&plan, "no frames", || stream.process::<f32>(&[], &mut out)).unwrap();
        let input = vec![0f32; n * FRAMES];
        assert!(quiet(&plan, "too short", || stream.process(&input, &mut [])).is_err());
        quiet(&plan, "reset", || stream.reset());
    }
}

#[test]
fn samples_that_are_not_finite_or_overflow() {
    for plan in plans() {
        let mut stream = Stream::new(&plan);
        let mut out = vec![0f32; FRAMES * M];
        for (value, replaced) in [(f32::NAN, 1), (f32::INFINITY, 1), (f32::MAX, 0), (1e-40, 0)] {
            let input = vec![value; FRAMES * plan.channels()];
            let before = stream.replaced();
            quiet(&plan, &format!("{value:e}"), || stream.process(&input, &mut out)).unwrap();
            assert_eq!(stream.replaced() - before, replaced * input.len() as u64, "{value:e}");
        }
    }
}
