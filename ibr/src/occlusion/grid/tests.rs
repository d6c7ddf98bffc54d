use super::*;
use crate::depth::Origin;
use crate::sample::Sample;
use proptest::prelude::*;

/// Which samples are hidden.
fn hidden<const C: usize>(samples: &[Sample<C>], test: &DepthTest) -> Vec<bool> {
    let points = Points::of(samples.iter().copied());
    let mut flags = vec![false; samples.len()];
    PlaneSearch::default().hidden(&points, test).iter().for_each(|i| flags[*i as usize] = true);
    flags
}

/// Removes the hidden samples and keeps the order of the others; returns how many were removed.
pub(crate) fn remove<const C: usize>(samples: &mut Vec<Sample<C>>, test: &DepthTest) -> usize {
    let (before, hidden) = (samples.len(), hidden(samples, test));
    let mut hidden = hidden.iter();
    samples.retain(|_| !hidden.next().unwrap());
    before - samples.len()
}

fn sample(x: f64, y: f64, depth: f32) -> Sample<1> {
    Sample { x, y, depth, ..Sample::BLANK }
}

fn check(samples: &[Sample<1>], test: &DepthTest) {
    assert_eq!(hidden(samples, test), test.hidden_by_definition(samples), "{test:?}");
}

#[test]
fn empty_single_and_coinciding() {
    let test = DepthTest::default();
    check(&[], &test);
    check(&[sample(1.0, 1.0, 1.0)], &test);
    check(&[sample(1.0, 1.0, 1.0); 5], &test);
    check(&[sample(1.0, 1.0, 1.0), sample(1.0, 1.0, 2.0), sample(1e9, -1e9, 2.0)], &test);
    check(&[sample(f64::NAN, 1.0, 1.0), sample(1.0, 1.0, 1.0), sample(1.0, f64::NAN, 2.0)], &test);
    check(&[sample(f64::NAN, f64::NAN, 1.0); 2], &test);
    check(&[sample(1.0, 1.0, f32::NAN), sample(1.0, 1.0, 2.0), sample(1.0, 1.2, 1.0)], &test);
}

#[test]
fn exactly_on_the_circle_counts() {
    let test =
        DepthTest { epsilon: 5.0, relative: 0.0, absolute: 1.0, parallax: 0.0, ..DepthTest::default() };
    let mut pair = vec![sample(0.0, 0.0, -3.0), sample(3.0, 4.0, -2.0), sample(3.0, 4.1, -2.0)];
    assert_eq!(remove(&mut pair, &test), 1);
    assert_eq!(pair.len(), 2);
}

/// Many samples in few cells, at few places or at all different ones: the trees decide as the
/// definition.
#[test]
fn a_crowd_hides_as_the_definition_says() {
    let part = |k: usize, step: f64| (k as f64 * step).fract();
    for (places, spread) in [(1.0, 1.0), (4.0, 1.0), (1e9, 1.0), (1e9, 0.01)] {
        let at = |v: f64| (v * places).floor() / places * spread * 5.0;
        let crowd = |k: usize| Sample {
            spacing: (1.0 + 9.0 * part(k, 0.569_840_291)) as f32,
            ..sample(at(part(k, 0.754_877_666)), at(part(k, 0.618_033_989)), 1.0 + part(k, 0.437) as f32)
        };
        let samples: Vec<Sample<1>> = (0..3000).map(crowd).collect();
        for epsilon in [0.02, 0.7] {
            check(&samples, &DepthTest { epsilon, ..DepthTest::default() });
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn equal_to_the_definition(
        raw in prop::collection::vec((-20.0..20.0_f64, -3.0..9.0_f64, 0.5..9.0_f32, 0.2..12.0_f32), 0..150),
        coarse: bool, wide: bool, epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64, parallax in 0.0..0.4_f64,
        lift in -20.0..5.0_f32
    ) {
        let position = |x: f64| if coarse { (x * 2.0).round() / 2.0 } else { x };
        let samples: Vec<Sample<1>> = raw
            .iter()
            .map(|(x, y, d, spacing)| {
                let depth = if coarse { d.round() } else { *d };
                let origin = if *spacing > 9.0 { Origin::Filled } else { Origin::Known };
                let spacing = if wide { *spacing } else { 1.0 };
                Sample { spacing, origin, ..sample(position(*x), position(*y), depth) }
            })
            .collect();
        check(&samples, &DepthTest { epsilon: position(epsilon).max(0.5), relative, absolute: 0.1, parallax, ..DepthTest::default() });
        // Signed keys, as chi gives them, with an absolute threshold.
        let signed: Vec<Sample<1>> =
            samples.iter().map(|s| Sample { depth: s.depth + lift, ..*s }).collect();
        check(&signed, &DepthTest { epsilon, relative: 0.0, absolute: 0.5, parallax: 0.0, ..DepthTest::default() });
    }

    /// Samples that only hide others, places without a sample, and memory used before.
    #[test]
    fn a_search_decides_on_its_own_samples(
        raw in prop::collection::vec((0.0..30.0_f64, 0.0..9.0_f64, 0.5..9.0_f32, 0.2..12.0_f32, 0..4), 1..300),
        epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64
    ) {
        let samples: Vec<Sample<1>> = raw
            .iter()
            .map(|(x, y, d, spacing, kind)| match kind {
                0 => Sample { spacing: f32::NAN, ..sample(f64::NAN, f64::NAN, f32::NAN) },
                _ => Sample { spacing: *spacing, ..sample(*x, *y, *d) },
            })
            .collect();
        let test = DepthTest { epsilon, relative, absolute: 0.1, parallax: 0.0, ..DepthTest::default() };
        let mut points = Points::of(samples.iter().copied());
        raw.iter().enumerate().for_each(|(i, s)| points.own[i] = s.4 > 1);
        let own = |i: &usize| points.own[*i];
        let hidden = test.hidden_by_definition(&samples);
        let want: Vec<u32> = (0..raw.len()).filter(|i| hidden[*i]).filter(own).map(|i| i as u32).collect();
        let mut search = PlaneSearch::default();
        for _ in 0..2 {
            prop_assert_eq!(search.hidden(&points, &test), &want);
        }
    }
}
