//! Calls of a stream allocate nothing, whatever the algorithm, the precision and the form of the samples.

use hybank_runtime::{
    Algorithm, ComplexStream, Options, PcmFormat, PcmOutput, Plan, Precision, StateSpace, Stream,
};

const N: usize = 2;
const M: usize = 3;
const FRAMES: usize = 700;

fn plans() -> Vec<Plan> {
    let taps = vec![vec![0.25; 20 * M]; N];
    let system = StateSpace {
        a: vec![vec![0.5, 0.25], vec![-0.25, 0.5]],
        b: vec![vec![1.0; N]; 2],
        c: vec![vec![1.0, -1.0]; M],
        d: vec![vec![0.5; N]; M],
    };
    let fir = [Algorithm::Direct, Algorithm::FastFir, Algorithm::OverlapSave { transform: Some(64) }];
    let options = |precision| Options { precision, recursion: precision, ..Options::default() };
    let both = [Precision::Single, Precision::Double].map(options);
    let fir = both.iter().flat_map(|&options| fir.map(|algorithm| Options { algorithm, ..options }));
    fir.map(|options| Plan::from_taps(&taps, M, 0, options).unwrap())
        .chain(both.map(|options| Plan::from_state_space(&system, [N, M], 0, options).unwrap()))
        .collect()
}

/// Fails if `call` allocates.
fn quiet(plan: &Plan, form: &str, call: impl FnOnce()) {
    let count = allocation_counter::measure(call).count_total;
    assert_eq!(count, 0, "{form} by {:?}", plan.summary());
}

#[test]
fn no_call_allocates() {
    // The counter counts.
    assert!(allocation_counter::measure(|| drop(Stream::new(&plans()[0]))).count_total > 0);
    for plan in plans() {
        let (single, double) = ([0.5f32; FRAMES * N], [0.5f64; FRAMES * N]);
        let (mut out, mut wide) = ([0.0f32; FRAMES * M], [0.0f64; FRAMES * M]);
        let mut stream = Stream::new(&plan);
        for part in [1, 65, FRAMES] {
            quiet(&plan, "f32", || {
                stream.process(&single[..part * N], &mut out).unwrap();
            });
            quiet(&plan, "f64", || {
                stream.process(&double[..part * N], &mut wide).unwrap();
            });
            let channels = [&single[..part], &single[FRAMES..FRAMES + part]];
            quiet(&plan, "planar", || {
                stream.process_planar(&channels, &mut out).unwrap();
            });
        }
        let mut bytes = [0; FRAMES * M * 2];
        let mut pcm = PcmOutput { format: PcmFormat::S16Le, bytes: &mut bytes, clipped: 0 };
        let input = hybank_runtime::Interleaved::new(&single, N).unwrap();
        quiet(&plan, "PCM", || {
            stream.run(&input, &mut pcm).unwrap();
        });
        let broken = [f32::NAN; FRAMES * N];
        quiet(&plan, "NaN", || {
            stream.process(&broken, &mut out).unwrap();
        });
        assert_eq!(stream.replaced(), broken.len() as u64);
        quiet(&plan, "reset", || stream.reset());
        let complex = [[0.5f32, -0.5]; FRAMES * N];
        let mut output = [[0.0f32; 2]; FRAMES * M];
        let mut stream = ComplexStream::new(&plan);
        quiet(&plan, "complex", || {
            stream.process(&complex, &mut output).unwrap();
        });
    }
}

#[test]
fn going_on_by_another_plan_does_not_allocate() {
    let (old, new) = (plans(), plans());
    let pairs = old.iter().zip(&new).filter(|(plan, _)| plan.history().is_some());
    for (old, new) in pairs {
        let (running, mut next) = (Stream::new(old), Stream::new(new));
        quiet(new, "continuation", || next.continue_from(&running).unwrap());
    }
}
