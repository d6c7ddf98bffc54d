use super::super::exact::Exact;
use super::*;
use num_bigint::{BigInt, Sign};
use proptest::prelude::*;

fn error_of(found: Float512, exact: Float512) -> f64 {
    let (gap, size) = ((found - exact).nearest().abs(), exact.nearest().abs());
    if gap == 0.0 { 0.0 } else { gap / size }
}

/// A number with digits all along its mantissa.
fn number(parts: [i64; 3], power: i32) -> Float512 {
    let tail = parts[1..].iter().enumerate().fold(Float512::ZERO, |sum, (k, &part)| {
        sum + Float512::from(part as f64).scaled(-200 * (k as i64 + 1))
    });
    (Float512::from(parts[0] as f64) + tail).scaled(i64::from(power))
}

fn parts() -> impl Strategy<Value = [i64; 3]> {
    [1i64 << 40..1 << 52, -1i64 << 52..1 << 52, -1i64 << 52..1 << 52]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    /// Sums and products of integers of up to 120 bits, against the machine's integers.
    #[test]
    fn integers_are_exact(a in -1i128 << 60..1 << 60, b in -1i128 << 60..1 << 60) {
        let big = |x: i128| Float512::from((x >> 50) as f64).scaled(50) + Float512::from((x & ((1 << 50) - 1)) as f64);
        let (x, y) = (big(a), big(b));
        prop_assert_eq!((x + y) - big(a + b), Float512::ZERO);
        prop_assert_eq!((x - y) - big(a - b), Float512::ZERO);
        let exact = |v: i128| big(v >> 60).scaled(60) + big(v & ((1 << 60) - 1));
        prop_assert_eq!(x * y - exact(a * b), Float512::ZERO);
    }

    #[test]
    fn operations_undo_each_other(a in parts(), b in parts(), p in -300i32..300, q in -300i32..300) {
        let (x, y) = (number(a, p), number(b, q));
        prop_assert!(error_of((x * y) / y, x) <= 3.0 * Float512::ROUNDING);
        prop_assert!(error_of((x / y) * y, x) <= 3.0 * Float512::ROUNDING);
        let root = x.sqrt();
        prop_assert!(error_of(root * root, x) <= 4.0 * Float512::ROUNDING);
        // Whatever is smaller in modulus: (x + y) - x = y up to the digits that y loses.
        let large = if p > q { x } else { y };
        let gap = ((x + y) - x) - y;
        prop_assert!(gap.nearest().abs() <= 3.0 * Float512::ROUNDING * large.nearest().abs().max(y.nearest().abs()).max(x.nearest().abs()));
    }

    /// (a + b) (a - b) = a^2 - b^2 where nothing is rounded.
    #[test]
    fn products_distribute(a in parts(), b in parts()) {
        let short = |v: [i64; 3]| Float512::from(v[0] as f64) + Float512::from(v[1] as f64).scaled(-100);
        let (x, y) = (short(a), short(b));
        prop_assert_eq!((x + y) * (x - y) - (x * x - y * y), Float512::ZERO);
    }

    #[test]
    fn doubles_come_back(x in any::<f64>()) {
        let back = Float512::from(x).nearest();
        prop_assert!(back == x || (!x.is_finite() && back.is_nan()));
    }
}

impl<const WORDS: usize> From<BigFloat<WORDS>> for Exact {
    fn from(x: BigFloat<WORDS>) -> Self {
        assert!(!x.nan);
        let bytes: Vec<u8> = x.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let sign = if x.negative { Sign::Minus } else { Sign::Plus };
        Self { mantissa: BigInt::from_bytes_le(sign, &bytes), power: x.exponent - 64 * WORDS as i64 }
    }
}

/// Mantissas whose digits are random, all zero but the ends, or all one but a few.
fn any_number<const WORDS: usize>() -> impl Strategy<Value = BigFloat<WORDS>> {
    let words = prop_oneof![
        any::<[u64; WORDS]>(),
        (0..WORDS, any::<u64>()).prop_map(|(i, word)| {
            let mut words = [0; WORDS];
            words[i] = word;
            words
        }),
        (0..WORDS, 0..64).prop_map(|(i, bit)| {
            let mut words = [u64::MAX; WORDS];
            words[i] ^= 1u64 << bit;
            words
        }),
    ];
    let exponent = prop_oneof![-3i64..4, -1100i64..1100, -1i64 << 40..1 << 40];
    (words, exponent, any::<bool>()).prop_map(|(mut words, exponent, negative)| {
        words[WORDS - 1] |= 1 << 63;
        BigFloat { words, exponent, negative, nan: false }
    })
}

/// The bounds that the text of the module derives.
fn proven(power: i64, of: &Exact) -> Exact {
    of.times(&Exact::power_of_two(power))
}

/// Against exact integers; a sum of numbers that lie close together, too.
fn errors_are_proven<const WORDS: usize>(
    x: BigFloat<WORDS>,
    y: BigFloat<WORDS>,
    shift: i64,
) -> Result<(), TestCaseError> {
    let bits = 64 * WORDS as i64;
    let y = BigFloat { exponent: if shift % 2 == 0 { x.exponent + shift } else { y.exponent }, ..y };
    let [a, b] = [x, y].map(Exact::from);
    if (x.exponent - y.exponent).abs() < 3000 {
        let sum = a.plus(&b);
        prop_assert!(Exact::from(x + y).minus(&sum).is_within(&proven(2 - bits, &sum)));
    }
    let product = a.times(&b);
    prop_assert!(Exact::from(x * y).minus(&product).is_within(&proven(2 - bits, &product)));
    prop_assert!(Exact::from(x / y).times(&b).minus(&a).is_within(&proven(4 - bits, &a)));
    let positive = BigFloat { negative: false, ..x };
    let root = Exact::from(positive.sqrt());
    prop_assert!(root.times(&root).minus(&a.abs()).is_within(&proven(5 - bits, &a)));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2048, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn errors_are_those_that_are_proven(x in any_number(), y in any_number(), shift in -600i64..600) {
        errors_are_proven::<8>(x, y, shift)?;
    }

    #[test]
    fn errors_of_256_bits_are_those_that_are_proven(
        x in any_number(),
        y in any_number(),
        shift in -400i64..400,
        long in any_number::<8>(),
    ) {
        errors_are_proven::<4>(x, y, shift)?;
        let exact = Exact::from(long);
        prop_assert!(Exact::from(long.rounded::<4>()).minus(&exact).is_within(&proven(-255, &exact)));
    }
}

#[test]
fn an_exponent_beyond_the_range_makes_a_number_unknown() {
    for start in [2.0, 0.5] {
        let mut x = Float512::from(start);
        for _ in 0..70 {
            x = x * x;
        }
        assert!(x.nearest().is_nan());
    }
}

#[test]
fn the_ends_of_the_doubles_come_back() {
    for x in
        [f64::MAX, -f64::MAX, f64::MAX / 2.0, f64::MIN_POSITIVE, f64::from_bits(1), f64::from_bits(0xfffff)]
    {
        assert_eq!(Float512::from(x).nearest(), x);
    }
    assert_eq!((Float512::from(f64::MAX) + Float512::from(f64::MAX)).nearest(), f64::INFINITY);
    assert_eq!(Float512::from(f64::from_bits(1)).scaled(-2).nearest(), 0.0);
}

#[test]
fn a_seventh_repeats_its_digits() {
    let seventh = Float512::from(1.0) / Float512::from(7.0);
    // 1/7 = 0.001001..b: 8 / 7 = 1 + 1/7.
    assert!(error_of(seventh.scaled(3) - Float512::from(1.0), seventh) <= 16.0 * Float512::ROUNDING);
    assert!(Float512::from(-1.0).sqrt().nearest().is_nan());
    assert!((Float512::from(1.0) / Float512::ZERO).nearest().is_nan());
    assert!((Float512::from(f64::NAN) + Float512::from(1.0)).nearest().is_nan());
}
