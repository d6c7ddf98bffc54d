//! Least and largest numbers of many, several at a time.

/// The least and the largest number; those that are not numbers do not count. In lanes, so that the compiler
/// compares several at a time.
#[inline]
pub(crate) fn bounds<T: Copy + PartialOrd, const LANES: usize>(numbers: &[T], none: (T, T)) -> (T, T) {
    let (mut low, mut high) = ([none.0; LANES], [none.1; LANES]);
    let (whole, rest) = numbers.as_chunks::<LANES>();
    for values in whole {
        for lane in 0..LANES {
            low[lane] = least(low[lane], values[lane]);
            high[lane] = largest(high[lane], values[lane]);
        }
    }
    let low = low.iter().chain(rest).fold(none.0, |low, v| least(low, *v));
    (low, high.iter().chain(rest).fold(none.1, |high, v| largest(high, *v)))
}

/// The lesser of two numbers, the first if the second is not a number.
#[inline]
pub(crate) fn least<T: PartialOrd>(a: T, b: T) -> T {
    if b < a { b } else { a }
}

/// The larger of two numbers, the first if the second is not a number.
#[inline]
pub(crate) fn largest<T: PartialOrd>(a: T, b: T) -> T {
    if b > a { b } else { a }
}
