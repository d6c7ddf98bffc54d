//! What `[uncertainty]` adds to the figures, against virtual converters that are off.

use super::*;
use hybank_core::spec::{HALF_WIDTH, OneOrEach, UncertaintySpec};
use hybank_core::units::Seconds;

const RMS: f64 = 0.25;
const FRAMES: usize = 211;
const SETTLED: usize = 14;

/// Half-widths of the errors of a channel.
#[derive(Debug, Clone, Copy)]
struct HalfWidths {
    delay: f64,
    gain: f64,
    offset: f64,
}

/// A bank of two converters, of which the second one and both offsets may be off.
struct Case {
    errors: HalfWidths,
    bank: Bank,
    plain: Problem,
}

impl Case {
    fn new(errors: HalfWidths) -> Self {
        let mut spec = System { band: 0.3, ..THESIS }.spec(FIR_24);
        spec.signal.as_mut().unwrap().rms = RMS;
        spec.uncertainty = Some(UncertaintySpec {
            delay: Some(OneOrEach::Same(Seconds(errors.delay))),
            gain: Some(OneOrEach::Same(errors.gain)),
            offset: Some(OneOrEach::Same(errors.offset)),
            ..UncertaintySpec::default()
        });
        let bank = designed(&spec).bank;
        let plain = without_signal(&spec, bank.latency).unwrap();
        Self { errors, bank, plain }
    }

    /// Output and target for tones at these bins. Each error is one standard deviation, whose signs are the
    /// bits of `signs`: over all signs their means and powers are those of the normal law.
    fn run(&self, bins: &[usize], signs: usize, random: &mut Random) -> [Vec<f64>; 2] {
        let deviation = |half: f64, bit: usize| {
            if signs >> bit & 1 == 0 { half / HALF_WIDTH } else { -half / HALF_WIDTH }
        };
        let mut problem = self.plain.clone();
        let channel = &mut problem.channels[1];
        channel.delay = channel.delay.moved_by(FastPeriods(deviation(self.errors.delay, 0)));
        channel.gain *= 1.0 + deviation(self.errors.gain, 1);
        let tones = drawn(bins, 2 * FRAMES, random);
        let mut captured = captured(&problem, &tones, FRAMES + SETTLED);
        let target = captured.target.split_off(2 * SETTLED);
        let full_scale = (power(target.iter().copied()) / target.len() as f64).sqrt() / RMS;
        for (channel, bit) in captured.channels.iter_mut().zip(2..) {
            let offset = full_scale * deviation(self.errors.offset, bit);
            channel.iter_mut().for_each(|x| *x += offset);
        }
        let SynthesisFilters::Fir(taps) = &self.bank.filters else { panic!("FIR") };
        [fused(taps, 2, &captured.channels).split_off(2 * SETTLED), target]
    }
}

/// Tones that fill the band for the SNR, and one tone for image and gain, over all signs of the errors.
#[test]
fn uncertain_values_count_as_converters_that_are_off() {
    for (delay, gain, offset) in [(0.0, 0.01, 0.0), (0.0, 0.0, 0.005), (0.02, 0.0, 0.0), (0.01, 0.02, 0.002)]
    {
        let errors = HalfWidths { delay, gain, offset };
        let case = Case::new(errors);
        let mut random = Random(7);
        let bin = 57;
        let (mut error, mut wanted, mut image, mut gains) = (0.0, 0.0, 0.0, 0.0);
        for signs in 0..16 {
            let tones = orthogonal_tones(&mut random, [0.0, 0.3], 2, FRAMES);
            let [output, target] = case.run(&tones, signs, &mut random);
            error += power(output.iter().zip(&target).map(|(y, z)| y - z));
            wanted += power(target.into_iter());
            let lines =
                case.run(&[bin], signs, &mut random).map(|x| hybank_linalg::fourier::real_spectrum(&x));
            let [output, target] = lines;
            image += output[FRAMES - bin].norm_sqr() / output[bin].norm_sqr() / 16.0;
            gains += (output[bin] / target[bin] - 1.0).norm_sqr() / 16.0;
        }
        let told = Figures::new(&case.bank).unwrap().snr.total_db;
        let found = Decibels::of_power(wanted / error);
        println!("{errors:?}: SNR {:.2} dB simulated, {:.2} dB predicted", found.0, told.0);
        assert!((found - told).0.abs() < 0.5, "{errors:?}: {found:?} {told:?}");
        let spread = Deviations::of_spec(case.bank.spec.as_ref().unwrap());
        let tones = ToneResponse::of_bank(&case.bank.filters, case.plain, spread).unwrap();
        let there = tones.at(bin as f64 / (2 * FRAMES) as f64);
        for (power, told) in [(image, there.image), (gains, there.gain_error)] {
            let found = power.sqrt();
            println!("{errors:?}: {found:.3e} simulated, {told:.3e} predicted");
            assert!((found / told - 1.0).abs() < 0.02, "{errors:?}: {found} {told}");
        }
    }
}

/// The largest image over the corners of the box, by moving the channels; curvature is below a hundredth.
#[test]
fn the_worst_image_is_that_of_a_corner() {
    let errors = HalfWidths { delay: 1e-3, gain: 5e-3, offset: 0.0 };
    let Case { bank, plain, .. } = Case::new(errors);
    let told = Figures::new(&bank).unwrap().image_at_worst.unwrap();
    let band = [CyclesPerFastPeriod(0.0), CyclesPerFastPeriod(0.3)];
    let corner = |signs: usize| {
        let mut moved = plain.clone();
        // The first channel is the reference.
        let channel = &mut moved.channels[1];
        let sign = |bit: usize| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
        channel.delay = channel.delay.moved_by(FastPeriods(errors.delay * sign(0)));
        channel.gain *= 1.0 + errors.gain * sign(1);
        let exact = vec![Deviations::default(); 2];
        let tones = ToneResponse::of_bank(&bank.filters, moved, exact).unwrap();
        Decibels::of_amplitude(tones.worst(band).image.unwrap().image).0
    };
    let worst = (0..4).map(corner).fold(f64::NEG_INFINITY, f64::max);
    assert!((told.db.0 - worst).abs() < 0.1, "{told:?} {worst}");
}
