//! Warnings about specs that are legal but probably not meant.

use super::DesignError;
use super::problem::Problem;
use hybank_core::messages::counted;
use hybank_core::quantity::readable;
use hybank_core::spec::{Band, FilterSpec, Passband, Spec};
use hybank_core::units::{Hertz, RadiansPerFastPeriod};
use hybank_verify::analog::{SignalFilter, resolved_band};
use std::f64::consts::{PI, TAU};

/// Bandwidths below this share of the output's Nyquist frequency are implausible.
const NARROW_BAND: f64 = 0.01;
/// Samples nearer to each other than this (in fast periods) hardly differ.
const SAME_SAMPLES: f64 = 1e-3;
/// An edge is on a multiple of half the fast rate within this share of it: the edges are found by bisection.
const EDGE_ROUNDING: f64 = 1e-9;
/// A band that ends above this share of what the samples resolve has no room.
const FULL_BAND: f64 = 0.98;
/// Floors that differ by less serve as well.
const SAME_FLOOR_DB: f64 = 10.0;
/// Bandwidths in rad/s between these look as if one sample were the unit of time.
const NORMALISED_BANDWIDTHS: std::ops::RangeInclusive<f64> = 1e-3..=10.0;

/// What in `spec` is probably not meant, the target first.
///
/// # Errors
/// [`DesignError::Analog`] for a filter that is not stable or not strictly proper.
pub fn warnings(spec: &Spec) -> Result<Vec<String>, DesignError> {
    let problem = Problem::before_sizing(spec)?;
    let mut found: Vec<String> = band(spec, &problem, None).into_iter().collect();
    found.extend(signal_band(spec));
    let other = |i: &usize| spec.channels[*i].filter != spec.target;
    found.extend((0..spec.channels.len()).filter(other).filter_map(|i| band(spec, &problem, Some(i))));
    // Of converters with unequal rates some samples coincide, and each has others.
    if spec.layout().is_plain() {
        found.extend(same_instants(&problem));
        found.extend(later(spec.wait()));
    }
    found.extend(long_span(spec));
    Ok(found)
}

/// That negative delays are counted from a later instant.
fn later(wait: usize) -> Option<String> {
    let periods = counted(wait, "fast period");
    (wait > 0)
        .then(|| format!("a delay is negative, so all count as {periods} later; the latency includes them"))
}

/// The band of the target (`None`) or of a channel.
fn band(spec: &Spec, problem: &Problem, channel: Option<usize>) -> Option<String> {
    let (filter, front_end) = match channel {
        Some(i) => {
            let channel = problem.channels.iter().find(|channel| channel.converter == i)?;
            (&spec.channels[i].filter, channel.front_end)
        }
        None => (&spec.target, problem.target),
    };
    let place = channel.map_or_else(|| "the target".to_owned(), |i| format!("channel {}", i + 1));
    let band = problem.front_ends[front_end].half_power_band();
    let [low, edge] = band.map(|w| Hertz(w.0 / TAU / spec.fast_period.0));
    let nyquist = Hertz(0.5 / spec.fast_period.0);
    if band[1].0 < NARROW_BAND * PI {
        let share = edge.0 / nyquist.0;
        return Some(format!(
            "{place}: -3 dB at {}, {share:.2e} of the output's Nyquist frequency {}; {}",
            text(edge),
            text(nyquist),
            remedy(filter, edge)
        ));
    }
    // A track-and-hold may be wider than the output's band, the filter of the ideal converter may not,
    // unless the signal is narrower.
    let may_be_wide = channel.is_some() || spec.signal.is_some();
    let multiple = folding_multiple(band).filter(|_| !may_be_wide)?;
    Some(if band[0].0 == 0.0 {
        format!(
            "{place}: -3 dB at {}, above the output's Nyquist frequency {}; what lies above it aliases, also in the ideal \
             converter",
            text(edge),
            text(nyquist)
        )
    } else {
        format!(
            "{place}: -3 dB at {} and {}, with {multiple} times the output's Nyquist frequency {} between them; there the \
             band folds onto itself, also in the ideal converter. Move the band or the fast rate until it lies between \
             two multiples",
            text(low),
            text(edge),
            text(nyquist)
        )
    })
}

/// The band of the signal, where the spec states one.
fn signal_band(spec: &Spec) -> Option<String> {
    let Band { low, high } = spec.signal.as_ref()?.band()?;
    let (width, resolved) = (high - low, resolved_band(spec));
    let nyquist = Hertz(0.5 / spec.fast_period.0);
    if high.0 < NARROW_BAND * nyquist.0 {
        return Some(format!(
            "the band of the signal ends at {}, {:.2e} of the output's Nyquist frequency {}; a number without a unit is in \
             hertz, so write the unit if another one is meant",
            text(high),
            high.0 / nyquist.0,
            text(nyquist)
        ));
    }
    if let Some(multiple) =
        folding_multiple([low, high].map(|f| f.angular().per_fast_period(spec.fast_period)))
    {
        let folding = Hertz(0.5 / spec.fast_period.0 * multiple as f64);
        return Some(format!(
            "the band of the signal, {} to {}, reaches over {}, {multiple} times the output's Nyquist frequency; there it \
             folds onto itself, also in an ideal converter. State the band that matters, or choose another fast rate",
            text(low),
            text(high),
            text(folding)
        ));
    }
    if width > resolved {
        return Some(format!(
            "the band of the signal is {} wide, and the samples of all converters together resolve {}; part of it aliases, \
             whatever the filters do. Use more converters, or state a narrower band",
            text(width),
            text(resolved)
        ));
    }
    let (floor, asked) = (SignalFilter::of(spec)?.floor_db?, SignalFilter::asked_floor(spec)?);
    let ends_with_the_samples = low.0 == 0.0 && high >= resolved * FULL_BAND;
    (floor < asked - SAME_FLOOR_DB || ends_with_the_samples).then(|| {
        format!(
            "the band of the signal ends at {}, and the samples resolve {}: near its end tones and their images cannot be \
             told apart, and its floor outside is {floor:.0} dB instead of {asked:.0} dB. Leave some per cent of room, or \
             use more converters",
            text(high),
            text(resolved)
        )
    })
}

/// The lowest multiple of half the fast rate between two edges. A band between two multiples is undersampled
/// without loss.
fn folding_multiple([low, high]: [RadiansPerFastPeriod; 2]) -> Option<u64> {
    let multiple = (low.0 / PI * (1.0 + EDGE_ROUNDING)).floor() + 1.0;
    (high.0 > multiple * PI * (1.0 + EDGE_ROUNDING)).then_some(multiple as u64)
}

fn text(frequency: Hertz) -> String {
    readable(frequency.0, "Hz")
}

fn remedy(filter: &FilterSpec, edge: Hertz) -> &'static str {
    match filter {
        FilterSpec::Family { passband: Passband::BandPass { .. }, .. } => {
            "bare numbers are in Hz; write the unit, as in band = [\"60 MHz\", \"80 MHz\"]"
        }
        FilterSpec::Family { .. } => "a bare number is in Hz; write the unit, as in cutoff = \"9 kHz\"",
        _ if NORMALISED_BANDWIDTHS.contains(&(edge.0 * TAU)) => {
            "coefficients are in rad/s, and these look normalised to one sample; scale them to seconds, or give \
             fast_period = 1.0"
        }
        _ => "coefficients are in rad/s",
    }
}

/// The first pair of channels whose samples nearly coincide.
fn same_instants(problem: &Problem) -> Option<String> {
    let period = problem.ratio as f64;
    let phase = |i: usize| problem.channels[i].delay.in_fast_periods().0.rem_euclid(period);
    let mut order: Vec<usize> = (0..problem.channels.len()).collect();
    order.sort_by(|&i, &j| phase(i).total_cmp(&phase(j)).then(i.cmp(&j)));
    let pairs = order.iter().copied().zip(order.iter().copied().cycle().skip(1));
    let apart = |i: usize, j: usize| {
        let gap = (phase(j) - phase(i)).rem_euclid(period);
        gap.min(period - gap)
    };
    let near = pairs.filter(|&(i, j)| i != j && apart(i, j) < SAME_SAMPLES);
    let (i, j) = near.min_by_key(|&(i, j)| (i.min(j), i.max(j)))?;
    let [a, b] = [i, j].map(|i| problem.channels[i].delay);
    let distance = if a.periods_since(b, problem.ratio).is_some() {
        "at one instant".to_owned()
    } else {
        format!("{:.1e} fast periods apart", a.from_whole_periods(b, problem.ratio).1.0.abs())
    };
    Some(format!(
        "channels {} and {} sample {distance} modulo the slow period: in a bank with enough taps or states such channels \
         lower the noise and nothing else",
        i.min(j) + 1,
        i.max(j) + 1
    ))
}

fn long_span(spec: &Spec) -> Option<String> {
    let delays: Vec<f64> = spec.delays_in_fast_periods().iter().map(|delay| delay.0).collect();
    let extreme = |of: fn(f64, f64) -> f64| delays.iter().copied().reduce(of).unwrap_or_default();
    let span = extreme(f64::max) - extreme(f64::min);
    let ratio = spec.ratio;
    (span >= ratio as f64).then(|| {
        format!(
            "the delays span {span:.6} fast periods, more than the ratio {ratio}: to a bank with enough taps or states a \
             channel that is a whole slow period late adds nothing but latency"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<String> {
        warnings(&Spec::from_toml(text, "spec.toml").unwrap()).unwrap()
    }

    fn audio(cutoff: &str, delays: [f64; 2]) -> Vec<String> {
        let [first, second] = delays;
        found(&format!(
            "fast_rate = 48e3\nratio = 2\nlatency = 12\n\
             target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = {cutoff} }} }}\n\
             channel = [{{ delay_samples = {first} }}, {{ delay_samples = {second} }}]\n\
             design = {{ method = \"iir\" }}"
        ))
    }

    /// The first warning begins like this.
    fn first(found: &[String], begin: &str) {
        assert!(found.first().is_some_and(|warning| warning.starts_with(begin)), "{found:?}");
    }

    /// The only one does.
    fn one(found: &[String], begin: &str) {
        first(found, begin);
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn a_plausible_spec_gives_none() {
        assert!(audio("9000.0", [1.2, 0.6]).is_empty());
        assert!(audio("23999.0", [1.0, 0.0]).is_empty());
        assert!(audio("240.1", [1.998, 0.0]).is_empty());
    }

    #[test]
    fn cutoffs_in_the_wrong_unit_are_named() {
        let narrow = audio("9.0", [1.2, 0.6]);
        one(&narrow, "the target: -3 dB at 9 Hz, 3.75e-4 of the output's Nyquist frequency 24 kHz");
        assert!(narrow[0].ends_with("cutoff = \"9 kHz\""), "{narrow:?}");
        one(&audio("9e6", [1.2, 0.6]), "the target: -3 dB at 9 MHz, above the output");
    }

    #[test]
    fn a_band_is_undersampled_between_two_multiples_of_half_the_rate_and_nowhere_else() {
        let band = |edges: &str| {
            found(&format!(
                "fast_rate = 80e6\nratio = 2\nlatency = 12\n\
                 target = {{ filter = {{ family = \"butterworth\", order = 3, band = [{edges}] }} }}\n\
                 channel = [{{ delay_samples = 1.2 }}, {{ delay_samples = 0.6 }}]\ndesign = {{ method = \"iir\" }}"
            ))
        };
        for edges in ["62e6, 78e6", "41e6, 79e6", "40e6, 80e6", "3e6, 39e6", "4.01e9, 4.03e9"] {
            assert!(band(edges).is_empty(), "{edges}");
        }
        let words =
            "the target: -3 dB at 70 MHz and 90 MHz, with 2 times the output's Nyquist frequency 40 MHz";
        first(&band("70e6, 90e6"), words);
        let narrow = &band("6, 8")[0];
        assert!(narrow.ends_with("band = [\"60 MHz\", \"80 MHz\"]"), "{narrow}");
    }

    #[test]
    fn coefficients_for_one_sample_are_named() {
        let found = found(
            "fast_rate = 48e3\nratio = 2\nchannel = [{ delay_samples = 1.2 }, { delay_samples = 0.6 }]\n\
             target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\ndesign = { method = \"iir\" }",
        );
        assert_eq!(found.len(), 1);
        assert!(found[0].contains("look normalised to one sample"), "{}", found[0]);
    }

    #[test]
    fn samples_at_one_instant_and_late_ones_are_named() {
        let near = [
            ([0.6, 0.6], "at one instant"),
            ([1.9995, 0.0], "5.0e-4 fast periods apart"),
            ([0.6, 0.6009], "9.0e-4 fast periods apart"),
        ];
        for (delays, apart) in near {
            let words = format!("channels 1 and 2 sample {apart} modulo the slow period");
            one(&audio("9000.0", delays), &words);
        }
        // Two fast periods apart: rounding must not show as a distance.
        let whole = audio("9000.0", [2.6, 0.6]);
        first(&whole, "channels 1 and 2 sample at one instant modulo the slow period");
        one(&audio("9000.0", [2.5, 0.3]), "the delays span 2.200000 fast periods");
    }

    /// A band says what matters, so a wide target draws no warning beside it.
    #[test]
    fn a_band_of_the_signal_may_be_undersampled_but_not_folded() {
        let signal = |band: &str| {
            found(&format!(
                "fast_rate = 80e6\nratio = 4\nlatency = 12\nsignal = {{ band = {band} }}\n\
                 target = {{ filter = {{ family = \"butterworth\", order = 1, cutoff = 100e6 }} }}\n\
                 channel = [{{ delay_samples = 2.2 }}, {{ delay_samples = 0.6 }}]"
            ))
        };
        for band in ["15e6", "19e6", "[62e6, 78e6]", "[82e6, 98e6]"] {
            assert!(signal(band).is_empty(), "{band}");
        }
        for (band, words) in [
            ("20e6", " ends at 20 MHz, and the samples resolve 20 MHz"),
            ("[70e6, 90e6]", ", 70 MHz to 90 MHz, reaches over 80 MHz"),
            ("30e6", " is 30 MHz wide, and the samples of all converters together resolve 20 MHz"),
        ] {
            first(&signal(band), &format!("the band of the signal{words}"));
        }
    }
}
