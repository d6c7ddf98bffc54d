//! Streams against the definition.

use super::*;
use proptest::prelude::*;

/// A generator whose stream never changes (Knuth's MMIX).
pub(super) struct Noise(pub(super) u64);

impl Noise {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(super) fn samples(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.next() as f32).collect()
    }
}

/// The coefficients of a test.
#[derive(Clone)]
pub(super) enum Filters {
    Fir(Vec<Vec<f64>>),
    StateSpace(StateSpace),
}

#[derive(Clone)]
pub(super) struct Bank {
    pub(super) filters: Filters,
    pub(super) ratio: usize,
    pub(super) latency: usize,
}

impl Bank {
    pub(super) fn channel_count(&self) -> usize {
        match &self.filters {
            Filters::Fir(taps) => taps.len(),
            Filters::StateSpace(filter) => filter.d[0].len(),
        }
    }
}

pub(super) fn start(bank: &Bank, options: Options) -> Result<Stream, BuildError> {
    let plan = match &bank.filters {
        Filters::Fir(taps) => Plan::from_taps(taps, bank.ratio, bank.latency, options),
        Filters::StateSpace(filter) => {
            Plan::from_state_space(filter, [filter.d[0].len(), bank.ratio], bank.latency, options)
        }
    };
    plan.map(|plan| Stream::new(&plan))
}

pub(super) fn fir_bank(taps: Vec<Vec<f64>>, ratio: usize) -> Bank {
    Bank { filters: Filters::Fir(taps), ratio, latency: 3 }
}

pub(super) fn recursive_bank(filter: StateSpace) -> Bank {
    Bank { ratio: filter.d.len(), filters: Filters::StateSpace(filter), latency: 3 }
}

pub(super) fn random_taps(channels: usize, taps: usize, noise: &mut Noise) -> Vec<Vec<f64>> {
    (0..channels).map(|_| (0..taps).map(|_| noise.next()).collect()).collect()
}

/// The outputs of a stream that gets `input` in pieces of so many frames, for N inputs and M outputs a frame.
pub(super) fn in_pieces(stream: &mut Stream, [n, m]: [usize; 2], input: &[f32], cuts: &[usize]) -> Vec<f32> {
    let mut pieces = vec![0.0; input.len() / n * m];
    let (mut from, mut to) = (input, &mut pieces[..]);
    for cut in cuts {
        let (head, tail) = to.split_at_mut(cut * m);
        assert_eq!(stream.process(&from[..cut * n], head).unwrap(), cut * m);
        (from, to) = (&from[cut * n..], tail);
    }
    pieces
}

/// The steps of a window in the order of use. Phases beside each other take the newest first. A single phase takes
/// pairs c apart, the older first, where c steps are a whole number of frames and of groups.
fn order(n: usize, ratio: usize, depth: usize, steps: usize) -> Vec<usize> {
    if ratio > 1 {
        return (0..steps).collect();
    }
    let apart = (1..).find(|&c| [n, 8].iter().all(|&k| (c * depth).is_multiple_of(k))).unwrap();
    let mut order = Vec::new();
    for block in (0..steps).step_by(2 * apart) {
        for s in block..(block + apart).min(steps) {
            order.extend((s + apart < steps).then_some(s + apart).into_iter().chain([s]));
        }
    }
    order
}

/// The scalar twin: the same sums in the same order, fused if the kernels fuse. The window of a frame
/// is cut into steps of D samples; each of D lanes sums its place of the steps, and the lanes are added as a tree.
fn twin(taps: &[Vec<f64>], ratio: usize, input: &[f32], fused: bool) -> Vec<f32> {
    let n = taps.len();
    let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap().max(1);
    let depth = if [1, 2, 4].contains(&n) { n } else { 8 };
    let order = order(n, ratio, depth, (lags * n).div_ceil(depth));
    let output = |k: usize, p: usize| {
        let end = (k + 1) * n;
        let mut lanes = [0f32; 8];
        for &s in &order {
            for (d, lane) in lanes.iter_mut().enumerate().take(depth) {
                let Some(at) = end.checked_sub((s + 1) * depth - d) else { continue };
                let (x, c) =
                    (input[at], taps[at % n].get(p + (k - at / n) * ratio).map_or(0.0, |&c| c as f32));
                *lane = if fused { x.mul_add(c, *lane) } else { x * c + *lane };
            }
        }
        let four = |l: &[f32]| (l[0] + l[2]) + (l[1] + l[3]);
        match depth {
            1 => lanes[0],
            2 => lanes[0] + lanes[1],
            4 => four(&lanes),
            _ => four(&lanes) + four(&lanes[4..]),
        }
    };
    (0..input.len() / n).flat_map(|k| (0..ratio).map(move |p| (k, p))).map(|(k, p)| output(k, p)).collect()
}

/// The definition in f64.
pub(super) fn definition(taps: &[Vec<f64>], ratio: usize, input: &[f32]) -> Vec<f64> {
    let n = taps.len();
    let mut out = vec![0.0; input.len() / n * ratio];
    for (t, y) in out.iter_mut().enumerate() {
        for (i, f) in taps.iter().enumerate() {
            *y += (0..=t / ratio)
                .filter_map(|k| f.get(t - k * ratio).map(|c| c * f64::from(input[k * n + i])))
                .sum::<f64>();
        }
    }
    out
}

fn run(bank: &Bank, options: Options, input: &[f32]) -> Vec<f32> {
    let mut stream = start(bank, options).unwrap();
    let mut out = vec![0.0; input.len() / stream.channels() * stream.ratio()];
    assert_eq!(stream.process(input, &mut out).unwrap(), out.len());
    out
}

#[test]
fn every_small_shape_has_the_bits_of_the_scalar_twin() {
    let mut noise = Noise(1);
    for n in 1..=9 {
        for m in 1..=17 {
            let taps = random_taps(n, 1 + (7 * n + 5 * m) % 40, &mut noise);
            let input = noise.samples(n * (100 + 13 * m));
            for isa in Isa::available() {
                let got = run(&fir_bank(taps.clone(), m), Options { isa, ..Options::default() }, &input);
                assert_eq!(got, twin(&taps, m, &input, isa.fuses()), "N {n} M {m} {isa}");
            }
        }
    }
}

#[test]
fn every_tap_count_and_length_has_the_bits_of_the_scalar_twin() {
    let mut noise = Noise(2);
    for count in 1..=70 {
        let taps = random_taps(2, count, &mut noise);
        let input = noise.samples(2 * count);
        for isa in Isa::available() {
            let got = run(&fir_bank(taps.clone(), 2), Options { isa, ..Options::default() }, &input);
            assert_eq!(got, twin(&taps, 2, &input, isa.fuses()), "{count} taps, {isa}");
        }
    }
}

#[test]
fn many_channels_and_many_phases_work() {
    let mut noise = Noise(3);
    for (n, m) in [(40, 3), (3, 40), (33, 33)] {
        let taps = random_taps(n, 3 * m + 1, &mut noise);
        let input = noise.samples(n * 300);
        for isa in Isa::available() {
            let got = run(&fir_bank(taps.clone(), m), Options { isa, ..Options::default() }, &input);
            assert_eq!(got, twin(&taps, m, &input, isa.fuses()), "N {n} M {m} {isa}");
        }
    }
}

/// Calls of one thread and of several have the same bits, about calls of `long` frames, and count the same.
pub(super) fn spans_agree(
    bank: &Bank,
    options: Options,
    pools: &[ThreadPool],
    long: usize,
    noise: &mut Noise,
) {
    let mut one = start(bank, options).unwrap();
    let (n, m) = (one.channels(), one.ratio());
    let mut many = vec![one.fresh(); pools.len()];
    for ticks in [1, long, 4096, 2, long - 12_345] {
        let mut input = noise.samples(n * ticks);
        input[n * ticks / 2] = f32::NAN;
        let mut want = vec![0.0; m * ticks];
        one.process(&input, &mut want).unwrap();
        for (stream, pools) in many.iter_mut().zip(pools) {
            let mut out = vec![0.0; m * ticks];
            assert_eq!(stream.process_parallel(&input, &mut out, pools), Ok(m * ticks));
            assert!(out == want, "N {n} M {m} {:?} {ticks} ticks {pools:?}", stream.history());
            assert_eq!(one.replaced(), stream.replaced());
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut noise = Noise(31);
    let pools: Vec<_> = [1, 2, 3].into_iter().map(|threads| ThreadPool::new(threads).unwrap()).collect();
    // Long enough for several spans of a million multiply-adds each.
    for (n, m, taps, long) in [
        (1, 1, 33, 90_000),
        (1, 4, 64, 50_000),
        (2, 2, 24, 100_001),
        (3, 1, 40, 60_001),
        (5, 3, 50, 20_000),
        (2, 2, 9000, 40_000),
        (3, 4, 1, 400_000),
    ] {
        for precision in [Precision::Single, Precision::Double] {
            let bank = fir_bank(random_taps(n, taps, &mut noise), m);
            spans_agree(&bank, Options { precision, ..Options::default() }, &pools, long, &mut noise);
        }
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let mut noise = Noise(33);
    let pools = ThreadPool::new(3).unwrap();
    for (n, m, format, out_format) in
        [(2, 3, PcmFormat::S16Le, PcmFormat::S16Le), (3, 2, PcmFormat::S24Be, PcmFormat::F64Le)]
    {
        // Loud enough to clip.
        let mut one = start(&fir_bank(random_taps(n, 80, &mut noise), m), Options::default()).unwrap();
        let mut many = one.fresh();
        let bytes: Vec<u8> =
            (0..n * 70_001 * format.bytes()).map(|_| (128.0 * noise.next()) as i8 as u8).collect();
        let layout = SampleLayout::packed(format);
        let rows: Vec<Vec<u8>> = (0..n)
            .map(|i| bytes.chunks_exact(format.bytes()).skip(i).step_by(n).flatten().copied().collect())
            .collect();
        let frames: Vec<_> = rows.iter().map(|row| PcmFrames { layout, channels: 1, bytes: row }).collect();
        let mut out = [vec![0; 70_001 * m * out_format.bytes()], vec![0; 70_001 * m * out_format.bytes()]];
        let [want, got] = &mut out;
        let mut want = PcmOutput { format: out_format, bytes: want, clipped: 5 };
        let mut got = PcmOutput { format: out_format, bytes: got, clipped: 5 };
        one.process_pcm(&frames, &mut want).unwrap();
        many.process_pcm_parallel(&frames, &mut got, &pools).unwrap();
        assert_eq!(want.clipped, got.clipped);
        assert!(want.clipped > 5 || out_format == PcmFormat::F64Le);
        assert!(want.bytes == got.bytes, "{format} to {out_format}");
    }
}

#[test]
fn a_recursion_stays_on_its_thread() {
    let mut noise = Noise(34);
    let input = noise.samples(50_000);
    let want = run(&rotation_bank(), Options::default(), &input);
    let mut out = vec![0.0; want.len()];
    let mut stream = start(&rotation_bank(), Options::default()).unwrap();
    stream.process_parallel(&input, &mut out, &ThreadPool::new(2).unwrap()).unwrap();
    assert_eq!(out, want);
}

#[test]
fn samples_that_are_not_finite_do_not_spread_in_long_calls() {
    let mut noise = Noise(32);
    for (n, m, taps) in [(1, 1, 30), (2, 2, 24), (3, 4, 70)] {
        let taps = random_taps(n, taps, &mut noise);
        let mut input = noise.samples(n * 9000);
        let places = [0, n * 3000 + 1, n * 3000 + 2, n * 8999];
        places.iter().for_each(|&place| input[place] = 0.0);
        let want = run(&fir_bank(taps.clone(), m), Options::default(), &input);
        places.iter().for_each(|&place| input[place] = f32::INFINITY);
        let mut stream = start(&fir_bank(taps, m), Options::default()).unwrap();
        let mut out = vec![0.0; want.len()];
        stream.process(&input, &mut out).unwrap();
        assert_eq!((out, stream.replaced()), (want, 4), "N {n} M {m}");
    }
}

#[test]
fn what_is_not_finite_is_found_wherever_it_is() {
    let mut noise = Noise(77);
    for (n, m) in (1..=9).flat_map(|n| (1..=5).map(move |m| (n, m))) {
        for lags in [1, 2, 3, 7, 20] {
            // Every second filter is silent: what it is not to multiply must be found all the same.
            let mut taps = random_taps(n, lags * m, &mut noise);
            taps.iter_mut().step_by(2).for_each(|f| f.fill(0.0));
            let bank = fir_bank(taps, m);
            let mut input = noise.samples(n * 420);
            let place = (noise.0 >> 33) as usize % input.len();
            input[place] = 0.0;
            let want = run(&bank, Options::default(), &input);
            input[place] = if lags % 2 == 0 { f32::NAN } else { f32::NEG_INFINITY };
            for call in [420, 60, 7] {
                let mut stream = start(&bank, Options::default()).unwrap();
                let mut out = vec![0.0; want.len()];
                for (x, y) in input.chunks(call * n).zip(out.chunks_mut(call * m)) {
                    stream.process(x, y).unwrap();
                }
                assert_eq!(
                    (&out, stream.replaced()),
                    (&want, 1),
                    "N {n} M {m} K {lags}, sample {place}, {call}"
                );
            }
        }
    }
}

#[test]
fn double_precision_is_double() {
    let mut noise = Noise(4);
    let taps = random_taps(4, 64, &mut noise);
    let input = noise.samples(4 * 1000);
    let wide: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
    let options = Options { precision: Precision::Double, ..Options::default() };
    let mut stream = start(&fir_bank(taps.clone(), 4), options).unwrap();
    let mut out = vec![0.0; wide.len()];
    stream.process(&wide, &mut out).unwrap();
    let worst = definition(&taps, 4, &input).iter().zip(&out).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // 64 products below 1 and their sums: 64 roundings of numbers below 64.
    assert!(worst < 64.0 * 64.0 * f64::EPSILON / 8.0, "{worst:e}");
}

#[test]
fn an_impulse_brings_out_the_taps() {
    let taps = vec![(1..=11).map(f64::from).collect(), (1..=7).map(|i| -f64::from(i)).collect()];
    let mut input = vec![0.0; 2 * 8];
    input[2 * 2] = 1.0;
    let out = run(&fir_bank(taps.clone(), 3), Options::default(), &input);
    assert_eq!(out[..6], [0.0; 6]);
    assert_eq!(out[6..17], (1..=11).map(|i| i as f32).collect::<Vec<_>>());
    assert_eq!(out[17..], [0.0; 7]);
}

#[test]
fn resets_and_fresh_streams_have_the_bits_of_a_new_one() {
    let mut noise = Noise(5);
    for bank in [fir_bank(random_taps(3, 50, &mut noise), 4), rotation_bank()] {
        let n = bank.channel_count();
        let input = noise.samples(n * 777);
        let want = run(&bank, Options::default(), &input);
        let mut stream = start(&bank, Options::default()).unwrap();
        let mut out = vec![0.0; want.len()];
        stream.process(&noise.samples(n * 123), &mut out).unwrap();
        stream.fresh().process(&input, &mut out).unwrap();
        assert_eq!(out, want);
        stream.reset();
        stream.process(&input, &mut out).unwrap();
        assert_eq!(out, want);
    }
}

#[test]
fn a_clone_goes_on_from_the_same_place() {
    let mut noise = Noise(6);
    let mut stream = start(&fir_bank(random_taps(2, 24, &mut noise), 2), Options::default()).unwrap();
    let mut out = [vec![0.0; 200], vec![0.0; 200]];
    stream.process(&noise.samples(200), &mut out[0]).unwrap();
    let mut twin = stream.clone();
    let input = noise.samples(200);
    stream.process(&input, &mut out[0]).unwrap();
    twin.process(&input, &mut out[1]).unwrap();
    assert_eq!(out[0], out[1]);
}

#[test]
fn streams_may_change_threads() {
    fn check<T: Send + Sync>() {}
    check::<Stream>();
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn cuts_do_not_change_a_bit(
        n in 1usize..10, m in 1usize..7, count in 1usize..60, seed: u64,
        cuts in prop::collection::vec(prop_oneof![0usize..20, 0usize..900], 1..16), double: bool,
    ) {
        let mut noise = Noise(seed);
        let precision = if double { Precision::Double } else { Precision::Single };
        let bank = fir_bank(random_taps(n, count, &mut noise), m);
        let mut stream = start(&bank, Options { precision, ..Options::default() }).unwrap();
        let input = noise.samples(n * cuts.iter().sum::<usize>());
        let mut whole = vec![0.0; input.len() / n * m];
        stream.process(&input, &mut whole).unwrap();
        stream.reset();
        let pieces = in_pieces(&mut stream, [n, m], &input, &cuts);
        prop_assert_eq!(pieces.iter().zip(&whole).position(|(a, b)| a != b), None);
    }

    #[test]
    fn every_form_of_bytes_gives_the_same_samples(
        n in 1usize..5, m in 1usize..5, which in 0usize..12, out_which in 0usize..12, seed: u64, ticks in 0usize..300,
    ) {
        let (format, out_format) = (PcmFormat::ALL[which], PcmFormat::ALL[out_which]);
        let mut noise = Noise(seed);
        let bank = fir_bank(random_taps(n, 13, &mut noise), m);
        let mut bytes = vec![0; n * ticks * format.bytes()];
        for slot in bytes.chunks_exact_mut(format.bytes()) {
            format.encode(noise.next(), slot);
        }
        let input: Vec<f32> = bytes.chunks_exact(format.bytes()).map(|b| format.decode(b) as f32).collect();
        let want = run(&bank, Options::default(), &input);
        let layout = SampleLayout::packed(format);
        let rows: Vec<Vec<u8>> = (0..n).map(|i| {
            bytes.chunks_exact(format.bytes()).skip(i).step_by(n).flatten().copied().collect()
        }).collect();
        let planar: Vec<_> = rows.iter().map(|row| PcmFrames { layout, channels: 1, bytes: row }).collect();
        for ticks in [&[PcmFrames { layout, channels: n, bytes: &bytes }][..], &planar] {
            let mut stream = start(&bank, Options::default()).unwrap();
            let mut out = vec![0; want.len() * out_format.bytes()];
            let mut output = PcmOutput { format: out_format, bytes: &mut out, clipped: 0 };
            prop_assert_eq!(stream.process_pcm(ticks, &mut output).unwrap(), want.len());
            let clipped = output.clipped;
            let mut expected = vec![0; out.len()];
            let clips = want.iter().zip(expected.chunks_exact_mut(out_format.bytes()))
                .map(|(y, slot)| out_format.encode(f64::from(*y), slot)).filter(|&clipped| clipped).count();
            prop_assert_eq!(&out, &expected);
            prop_assert_eq!(clipped, clips as u64);
        }
    }
}

/// Two states that turn by one radian and shrink a little; c picks them, d passes input on.
fn rotation_bank() -> Bank {
    let (s, c) = 1f64.sin_cos();
    let filter = StateSpace {
        a: vec![vec![0.9 * c, -0.9 * s], vec![0.9 * s, 0.9 * c]],
        b: vec![vec![1.0], vec![0.0]],
        c: vec![vec![1.0, 0.0], vec![0.0, 1.0], vec![1.0, 1.0]],
        d: vec![vec![0.5], vec![0.0], vec![-1.0]],
    };
    recursive_bank(filter)
}

#[test]
fn a_state_space_bank_has_the_response_of_its_matrices() {
    let out = run(&rotation_bank(), Options::default(), &[1.0, 0.0, 0.0, 0.0]);
    assert_eq!(out[..3], [0.5, 0.0, -1.0]);
    for k in 1..4 {
        let (s, c) = (k as f64 - 1.0).sin_cos();
        let r = 0.9f64.powi(k as i32 - 1);
        for (got, want) in out[3 * k..].iter().zip([r * c, r * s, r * (c + s)]) {
            assert!((f64::from(*got) - want).abs() < 1e-7, "tick {k}: {got} for {want}");
        }
    }
}

#[test]
fn what_is_not_finite_never_reaches_a_state() {
    let mut noise = Noise(7);
    for bank in [rotation_bank(), fir_bank(random_taps(1, 9, &mut noise), 1)] {
        let mut input = noise.samples(100);
        input[40] = 0.0;
        let want = run(&bank, Options::default(), &input);
        input[40] = f32::NAN;
        let mut stream = start(&bank, Options::default()).unwrap();
        let mut out = vec![0.0; want.len()];
        stream.process(&input, &mut out).unwrap();
        assert_eq!((out, stream.replaced(), stream.state_resets()), (want, 1, 0));
    }
}

#[test]
fn a_recursion_that_overflows_begins_anew_and_says_so() {
    let mut bank = rotation_bank();
    if let Filters::StateSpace(filter) = &mut bank.filters {
        filter.a = vec![vec![1e200, 0.0], vec![0.0, 0.5]];
    }
    let mut stream = start(&bank, Options::default()).unwrap();
    let mut input = [0.0; crate::algorithms::recursive::BLOCK];
    input[0] = 1.0;
    stream.process(&input, &mut [0.0; 3 * crate::algorithms::recursive::BLOCK]).unwrap();
    assert_eq!(stream.state_resets(), 1);
    let mut out = [0.0; 3];
    stream.process(&[2.0], &mut out).unwrap();
    assert_eq!(out, [1.0, 0.0, -2.0]);
}

#[test]
fn bytes_that_are_not_finite_become_zero_and_are_counted() {
    let bank = fir_bank(vec![vec![1.0]], 1);
    let bytes: Vec<u8> =
        [1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut stream = start(&bank, Options::default()).unwrap();
    let mut out = vec![0; 20];
    let layout = SampleLayout::packed(PcmFormat::F32Le);
    let mut output = PcmOutput { format: PcmFormat::F32Le, bytes: &mut out, clipped: 0 };
    stream.process_pcm(&[PcmFrames { layout, channels: 1, bytes: &bytes }], &mut output).unwrap();
    assert_eq!(stream.replaced(), 3);
    assert_eq!(out, [1f32, 0.0, 0.0, 0.0, 2.0].map(f32::to_le_bytes).concat());
}

#[test]
fn what_is_clipped_is_counted_once_also_beside_what_is_not_finite() {
    let mut stream = start(&fir_bank(vec![vec![1.0]], 1), Options::default()).unwrap();
    let mut samples = vec![0.25f32; 100];
    (samples[3], samples[50], samples[60]) = (2.0, f32::NAN, f32::INFINITY);
    let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut out = [0; 200];
    let mut output = PcmOutput { format: PcmFormat::S16Le, bytes: &mut out, clipped: 0 };
    let frames = PcmFrames { layout: SampleLayout::packed(PcmFormat::F32Le), channels: 1, bytes: &bytes };
    stream.process_pcm(&[frames], &mut output).unwrap();
    assert_eq!((output.clipped, stream.replaced()), (1, 2));
}

/// Filters that look back exactly as far as a block is long, or about, leave no whole vector of the first span behind it.
#[test]
fn filters_as_long_as_a_block_follow_their_definition() {
    let mut noise = Noise(97);
    for (n, m) in [(16, 5), (24, 7), (4, 4), (3, 1), (16, 1)] {
        for lags in [96, 97, 98, 193] {
            let taps = random_taps(n, lags * m, &mut noise);
            let input = noise.samples(n * (2 * lags + 1));
            let got = run(&fir_bank(taps.clone(), m), Options::default(), &input);
            let most = taps.iter().flatten().map(|tap| tap.abs()).sum::<f64>();
            for (y, want) in got.iter().zip(definition(&taps, m, &input)) {
                assert!((f64::from(*y) - want).abs() <= 1e-5 * most, "N {n} M {m} K {lags}: {y} {want}");
            }
        }
    }
}

#[test]
fn calls_and_banks_that_do_not_fit_are_refused() {
    let bank = fir_bank(vec![vec![1.0], vec![1.0]], 2);
    let mut stream = start(&bank, Options::default()).unwrap();
    let mut out = [0.0; 3];
    assert_eq!(
        stream.process(&[0.0; 3], &mut out),
        Err(ProcessError::PartialFrame { samples: 3, channels: 2 })
    );
    assert_eq!(
        stream.process(&[0.0; 4], &mut out),
        Err(ProcessError::OutputTooShort { given: 3, wanted: 4 })
    );
    assert_eq!(stream.process(&[], &mut out), Ok(0));
    let mut output = PcmOutput { format: PcmFormat::S8, bytes: &mut [], clipped: 0 };
    assert_eq!(stream.process_pcm(&[], &mut output), Err(ProcessError::Channels { given: 0, wanted: 2 }));

    let refused = |bank: Bank| start(&bank, Options::default()).unwrap_err();
    assert_eq!(refused(Bank { ratio: 0, ..bank.clone() }), BuildError::NoRatio);
    assert_eq!(refused(fir_bank(vec![], 2)), BuildError::NoChannels);
    // Finite in f64, infinite in f32.
    assert!(matches!(refused(fir_bank(vec![vec![0.0, 1e300]], 2)), BuildError::NotFinite { index: 1, .. }));
    let mut wrong = rotation_bank();
    if let Filters::StateSpace(filter) = &mut wrong.filters {
        filter.c.pop();
    }
    assert!(
        refused(wrong).to_string().contains("matrix c of the state-space filters is 2 x 2; 3 x 2 is needed")
    );
}

#[test]
fn empty_filters_give_silence() {
    let out = run(&fir_bank(vec![vec![], vec![]], 2), Options::default(), &[1.0; 20]);
    assert_eq!(out, [0.0; 20]);
}
