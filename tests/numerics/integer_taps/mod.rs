//! Integer taps of small banks against all integers at all scales. `HYBANK_TRIALS=926` tries that
//! many random banks, `HYBANK_TRIALS=12..13` that one.

mod brute_force;

use crate::support::random::Random;
use crate::support::specs::{alike, butterworth, with_taps};
use crate::support::sweep::each;
use brute_force::{BruteForce, SCALES};
use hybank::bank::SynthesisFilters;
use hybank::design::{DesignError, LiftedPlant, Options, Problem, design};
use hybank::spec::{Spec, WordLengths};

/// Bits of all taps together: the brute force tries two to this power at each scale.
const MOST_BITS: usize = 14;

/// A bank of integer taps beside the best one.
#[derive(Debug)]
struct Outcome {
    name: String,
    /// gamma of the integers found over that of the best integers of their scale, in decibels.
    above_db: f64,
    /// The same over that of the best integers of all scales.
    above_all_db: f64,
    /// gamma of the integers found over that of zero output, in decibels.
    above_zero_output_db: f64,
    /// Time of the design.
    seconds: f64,
}

/// One to three channels, whose delays may nearly coincide, and one to four taps of 2 to 8 bits.
fn case(number: u64) -> (Spec, u32) {
    let mut dice = Random(number);
    loop {
        let (channels, ratio, taps) = (dice.count(1, 3), dice.count(1, 3), dice.count(1, 4));
        let bits = dice.count(2, 8);
        let filter = butterworth(dice.count(1, 4), 0.05 * 40f64.powf(dice.part()));
        let latency = dice.count(0, taps);
        let first = ratio as f64 * dice.part();
        let apart = 10f64.powf(-1.0 - 3.0 * dice.part());
        let nearly_equal = dice.part() < 0.4;
        let delays: Vec<f64> = (0..channels)
            .map(|i| if nearly_equal { first + apart * i as f64 } else { ratio as f64 * dice.part() })
            .collect();
        if bits * channels * taps <= MOST_BITS {
            let mut spec = with_taps(alike(&filter, ratio, latency, &delays), taps);
            spec.name = format!(
                "case {number}: M = {ratio}, latency {latency}, {delays:?}, {taps} taps, {bits} bits"
            );
            return (spec, bits as u32);
        }
    }
}

/// None for a latency that the taps do not reach, which is refused.
fn outcome(spec: &Spec, bits: u32) -> Option<Outcome> {
    let mut spec = spec.clone();
    spec.design.bits = Some(WordLengths::Same(bits));
    let begin = std::time::Instant::now();
    let found = match design(&spec, &Options::without_proof()) {
        Ok(found) => found,
        Err(DesignError::OutOfReach { .. }) => return None,
        Err(error) => panic!("{}: {error}", spec.name),
    };
    let seconds = begin.elapsed().as_secs_f64();
    let plant = LiftedPlant::new(&Problem::new(&spec, found.bank.latency).unwrap());
    let SynthesisFilters::Fir(taps) = &found.bank.filters else { panic!("no taps") };
    let gamma = found.bank.gamma.norm.unwrap();
    let brute_force = BruteForce::new(&plant, taps[0].len(), bits);
    let best = |scales| match brute_force.better_than(gamma, scales) {
        Some(best) => plant.fir_norm(&best).unwrap().gain,
        None => gamma,
    };
    let scale = found.bank.fixed_point.as_ref().unwrap().fraction_bits;
    let zeros = vec![vec![0.0; taps[0].len()]; taps.len()];
    let zero_output = plant.fir_norm(&zeros).unwrap().gain;
    let db = |ratio: f64| 20.0 * ratio.log10();
    Some(Outcome {
        name: spec.name.clone(),
        above_db: db(gamma / best(scale..=scale)),
        above_all_db: db(gamma / best(SCALES)),
        above_zero_output_db: db(gamma / zero_output),
        seconds,
    })
}

#[test]
fn small_banks_are_within_a_tenth_of_a_decibel_of_all_integers() {
    let cases = trials::trials(5);
    let tried = cases.end - cases.start;
    let all: Vec<Option<Outcome>> = each(cases, |number| {
        let (spec, bits) = case(number);
        outcome(&spec, bits)
    });
    let all: Vec<Outcome> = all.into_iter().flatten().collect();
    println!("{} of {tried} refused", tried as usize - all.len());
    let above = |db: f64| all.iter().filter(|case| case.above_db > db).count();
    let above_all = |db: f64| all.iter().filter(|case| case.above_all_db > db).count();
    for Outcome { name, above_db, above_all_db, above_zero_output_db, .. } in &all {
        if *above_all_db > 0.1 || *above_zero_output_db > 1e-6 {
            println!(
                "{name}: {above_db:.3} dB above the best of this scale, {above_all_db:.3} dB above the best of \
                 all, {above_zero_output_db:.3} dB above zero output"
            );
        }
    }
    let worst = all.iter().map(|case| case.above_db).fold(0.0, f64::max);
    let worse_than_zero_output = all.iter().filter(|case| case.above_zero_output_db > 1e-6).count();
    let seconds: f64 = all.iter().map(|case| case.seconds).sum();
    println!(
        "{} cases: {} more than 0.1 dB above the best integers of their scale, {} more than 3 dB, worst \
         {worst:.2} dB; of all scales {} and {}; {worse_than_zero_output} worse than zero output; \
         {seconds:.1} s of design",
        all.len(),
        above(0.1),
        above(3.0),
        above_all(0.1),
        above_all(3.0)
    );
    assert_eq!(worse_than_zero_output, 0);
    assert!(above(0.1) * 100 <= all.len(), "{} of {}", above(0.1), all.len());
}
