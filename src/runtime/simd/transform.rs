//! Fourier transforms across channels, and the product with a matrix of spectra between them.
//!
//! A *row* is a group of lanes (see `channels`) of real parts and one of imaginary parts; a transform of length F
//! takes F rows to F rows, every lane for itself. That is why it is written here and not taken from a crate: those
//! transform one stream, and frames of N channels would have to be brought into N streams and back. Here they
//! are transformed as they lie.
//!
//! Forward is decimation in frequency, X(f) = sum_t x(t) exp(-2 pi i f t / F), in passes of radix 4 and one of
//! radix 2 if log2 F is odd; it leaves the rows in the order of reversed digits, in which the product is made, and
//! the inverse (decimation in time, without the factor 1 / F) takes them in that order (Gentleman and Sande
//! 1966; Cooley and Tukey 1965).
//!
//! Two real blocks a and b are one complex block a + ib. As the filters are real, the product with their spectra
//! gives y_a + i y_b: the parts need not be told apart. Spectra at f and F - f are conjugate, so both
//! frequencies are made together from one load.
//!
//! Bits: all lanes do the same in the same order, whatever the instruction set.

use super::Isa;
use super::channels::ChannelVector;
use super::vector::Portable;
#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2F32, Avx2F64};
use crate::runtime::aligned::Aligned;
use std::f64::consts::TAU;

/// The shortest transform: two passes of radix 4.
pub(crate) const SHORTEST_TRANSFORM: usize = 16;

/// Lanes of a group.
pub(crate) const fn group_lanes<T>() -> usize {
    32 / size_of::<T>()
}

/// Samples of a row: real and imaginary parts.
pub(crate) const fn row_samples<T>() -> usize {
    2 * group_lanes::<T>()
}

/// The length F of a transform, its factors, and which rows belong together.
#[derive(Debug)]
pub(crate) struct Transform<T: Copy + Default> {
    len: usize,
    /// exp(-2 pi i r j / L), r = 1, 2, 3, for 1 <= j < L / 4, for L = F, F / 4 ... > 4.
    factors: Aligned<T>,
    /// Rows of the frequencies f and F - f, for 0 <= f <= F / 2.
    pairs: Vec<[u32; 2]>,
}

impl<T: Copy + Default> Transform<T> {
    /// # Panics
    /// If the length is no power of two from [`SHORTEST_TRANSFORM`] on, or too large for 32-bit places.
    pub(crate) fn new(len: usize, from_f64: impl Fn(f64) -> T) -> Self {
        assert!(len.is_power_of_two() && len >= SHORTEST_TRANSFORM && u32::try_from(len).is_ok());
        let mut factors = Vec::new();
        let mut span = len;
        while span > 4 {
            for (j, r) in (1..span / 4).flat_map(|j| [(j, 1), (j, 2), (j, 3)]) {
                let (sin, cos) = (TAU * (r * j) as f64 / span as f64).sin_cos();
                factors.extend([from_f64(cos), from_f64(-sin)]);
            }
            span /= 4;
        }
        let place = |f: usize| row_of(f, len) as u32;
        let pairs = (0..=len / 2).map(|f| [place(f), place((len - f) % len)]).collect();
        Self { len, factors: Aligned::from_slice(&factors), pairs }
    }

    /// The row of each frequency 0 <= f <= F / 2.
    pub(crate) fn half_rows(&self) -> impl Iterator<Item = usize> {
        self.pairs.iter().map(|&[row, _]| row as usize)
    }
}

/// Where the forward transform leaves frequency `f`.
fn row_of(f: usize, len: usize) -> usize {
    match len {
        1 => 0,
        2 => f,
        _ => f % 4 * (len / 4) + row_of(f / 4, len / 4),
    }
}

/// Frames to be transformed, where they lie.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segments<'a, T> {
    /// From the first frame of the real and of the imaginary parts on.
    pub(crate) parts: [&'a [T]; 2],
    /// Samples from frame to frame.
    pub(crate) stride: usize,
    /// Samples from segment to segment.
    pub(crate) hop: usize,
}

/// N by M spectra: for each pair of frequencies, each group of phases and each channel a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spectra<'a, T> {
    pub(crate) channels: usize,
    pub(crate) rows: &'a [T],
}

/// Where rows go: the last rows of each segment's real parts, then of its imaginary parts, segment after segment.
#[derive(Debug)]
pub(crate) struct Frames<'a, T> {
    pub(crate) samples: &'a mut [T],
    /// M, samples from frame to frame.
    pub(crate) stride: usize,
    /// B, the last rows that are wanted.
    pub(crate) count: usize,
}

struct ScatterJob<T> {
    rows: *const T,
    /// Samples of the rows of one group of lanes, and groups.
    plane: usize,
    groups: usize,
    out: *mut T,
    stride: usize,
    count: usize,
}

struct ForwardJob<T> {
    parts: [*const T; 2],
    stride: usize,
    hop: usize,
    len: usize,
    factors: *const T,
    rows: *mut T,
}

struct InverseJob<T> {
    len: usize,
    /// Behind the last one.
    factors: *const T,
    rows: *mut T,
}

struct ProductJob<'a, T> {
    pairs: &'a [[u32; 2]],
    channels: usize,
    /// Samples of the rows of one group of lanes.
    plane: usize,
    spectra: *const T,
    input: *const T,
    output: *mut T,
    /// Groups of phases.
    outputs: usize,
}

/// The kernels of one sample type.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TransformKernel<T: 'static> {
    /// By log2 D.
    forward: &'static [unsafe fn(&ForwardJob<T>)],
    product: &'static [unsafe fn(&ProductJob<'_, T>)],
    inverse: unsafe fn(&InverseJob<T>),
    scatter: &'static [unsafe fn(&ScatterJob<T>)],
}

impl<T: Copy + Default + 'static> TransformKernel<T> {
    /// Transforms F frames of each segment, of which `depth` samples are lanes, to F rows.
    ///
    /// # Panics
    /// If `depth` is no power of two up to a group, or a slice is too short: the last frame needs `depth`
    /// samples.
    pub(crate) fn forward(
        &self,
        transform: &Transform<T>,
        depth: usize,
        from: Segments<'_, T>,
        rows: &mut [T],
    ) {
        let Segments { parts, stride, hop } = from;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        let needed = (transform.len - 1) * stride + (group_lanes::<T>() / depth - 1) * hop + depth;
        assert!(parts.iter().all(|part| part.len() >= needed));
        assert!(rows.len() >= transform.len * row_samples::<T>());
        let job = ForwardJob {
            parts: parts.map(<[T]>::as_ptr),
            stride,
            hop,
            len: transform.len,
            factors: transform.factors.as_ptr(),
            rows: rows.as_mut_ptr(),
        };
        // SAFETY: the kernel was chosen for an available instruction set; the bounds are asserted above.
        unsafe { self.forward[depth.ilog2() as usize](&job) };
    }

    /// F times the inverse transform, in place.
    ///
    /// # Panics
    /// If there are less than F rows.
    pub(crate) fn inverse(&self, transform: &Transform<T>, rows: &mut [T]) {
        assert!(rows.len() >= transform.len * row_samples::<T>());
        let factors = transform.factors.as_ptr_range().end;
        let job = InverseJob { len: transform.len, factors, rows: rows.as_mut_ptr() };
        // SAFETY: as above.
        unsafe { (self.inverse)(&job) };
    }

    /// Brings rows to where they belong, `depth` lanes to a frame from each of its groups. Each frame is written as
    /// whole lanes and what is too much overwritten by the next one, which also goes for what follows the
    /// last one.
    ///
    /// # Panics
    /// If slices do not fit: the last frame needs whole lanes.
    pub(crate) fn scatter(&self, transform: &Transform<T>, depth: usize, rows: &[T], to: Frames<'_, T>) {
        let plane = transform.len * row_samples::<T>();
        let groups = rows.len() / plane;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        assert!(groups > 0 && rows.len() == groups * plane && (1..=transform.len).contains(&to.count));
        let frames = 2 * group_lanes::<T>() / depth * to.count;
        assert!((frames - 1) * to.stride + groups * depth <= to.samples.len());
        let job = ScatterJob {
            rows: rows[(transform.len - to.count) * row_samples::<T>()..].as_ptr(),
            plane,
            groups,
            out: to.samples.as_mut_ptr(),
            stride: to.stride,
            count: to.count,
        };
        // SAFETY: as above.
        unsafe { self.scatter[depth.ilog2() as usize](&job) };
    }

    /// Y(f) = H(f) X(f): from F rows for each `depth` channels to F rows for each group of phases.
    ///
    /// # Panics
    /// If slices do not fit.
    pub(crate) fn product(
        &self,
        transform: &Transform<T>,
        depth: usize,
        spectra: Spectra<'_, T>,
        input: &[T],
        output: &mut [T],
    ) {
        let row = row_samples::<T>();
        let plane = transform.len * row;
        let outputs = output.len() / plane;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        assert!(input.len() >= spectra.channels.div_ceil(depth) * plane && output.len() == outputs * plane);
        assert!(spectra.rows.len() >= transform.pairs.len() * outputs * spectra.channels * row);
        let job = ProductJob {
            pairs: &transform.pairs,
            channels: spectra.channels,
            plane,
            spectra: spectra.rows.as_ptr(),
            input: input.as_ptr(),
            output: output.as_mut_ptr(),
            outputs,
        };
        // SAFETY: as above; the pairs are rows below F, see `Transform::new`.
        unsafe { self.product[depth.ilog2() as usize](&job) };
    }
}

#[derive(Clone, Copy)]
struct Complex<V> {
    re: V,
    im: V,
}

/// # Safety
/// As for [`Vector`](super::vector::Vector).
impl<V: ChannelVector> Complex<V> {
    /// A row's lanes.
    #[inline(always)]
    unsafe fn load(row: *const V::Sample) -> Self {
        unsafe { Self { re: V::load(row), im: V::load(row.add(group_lanes::<V::Sample>())) } }
    }

    #[inline(always)]
    unsafe fn store(self, row: *mut V::Sample) {
        unsafe {
            self.re.store(row);
            self.im.store(row.add(group_lanes::<V::Sample>()));
        }
    }

    /// The same number in all lanes.
    #[inline(always)]
    unsafe fn splat(at: *const V::Sample) -> Self {
        unsafe { Self { re: V::splat(*at), im: V::splat(*at.add(1)) } }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        unsafe { Self { re: self.re.add(other.re), im: self.im.add(other.im) } }
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        unsafe { Self { re: self.re.sub(other.re), im: self.im.sub(other.im) } }
    }

    /// self + i other.
    #[inline(always)]
    unsafe fn add_turned(self, other: Self) -> Self {
        unsafe { Self { re: self.re.sub(other.im), im: self.im.add(other.re) } }
    }

    /// self - i other.
    #[inline(always)]
    unsafe fn sub_turned(self, other: Self) -> Self {
        unsafe { Self { re: self.re.add(other.im), im: self.im.sub(other.re) } }
    }

    #[inline(always)]
    unsafe fn mul(self, w: Self) -> Self {
        unsafe {
            Self {
                re: self.im.mul_sub(w.im, self.re.mul(w.re)),
                im: self.re.mul_add(w.im, self.im.mul(w.re)),
            }
        }
    }

    /// self times the conjugate of w.
    #[inline(always)]
    unsafe fn mul_conjugate(self, w: Self) -> Self {
        unsafe {
            Self {
                re: self.im.mul_add(w.im, self.re.mul(w.re)),
                im: self.re.mul_sub(w.im, self.im.mul(w.re)),
            }
        }
    }
}

/// The transform of length 4, or four times its inverse.
#[inline(always)]
unsafe fn quarter<V: ChannelVector, const BACK: bool>([a, b, c, d]: [Complex<V>; 4]) -> [Complex<V>; 4] {
    unsafe {
        let (even, odd) = (a.add(c), b.add(d));
        let (even_far, odd_far) = (a.sub(c), b.sub(d));
        let (minus, plus) = (even_far.sub_turned(odd_far), even_far.add_turned(odd_far));
        let (first, third) = if BACK { (plus, minus) } else { (minus, plus) };
        [even.add(odd), first, even.sub(odd), third]
    }
}

/// Where a pass takes its rows from. No closure: what is not inlined is not compiled for the instruction set.
///
/// # Safety
/// As for [`Vector`](super::vector::Vector), and the rows exist.
trait Rows<V: ChannelVector> {
    unsafe fn row(&self, row: usize) -> Complex<V>;

    /// Four rows, `quarter` apart.
    #[inline(always)]
    unsafe fn four(&self, first: usize, quarter: usize) -> [Complex<V>; 4] {
        unsafe {
            [
                self.row(first),
                self.row(first + quarter),
                self.row(first + 2 * quarter),
                self.row(first + 3 * quarter),
            ]
        }
    }
}

/// Frames where they lie, D lanes of each segment, from lane `part` on.
struct Gathered<'a, V: ChannelVector, const D: usize> {
    job: &'a ForwardJob<V::Sample>,
    part: usize,
}

impl<V: ChannelVector, const D: usize> Rows<V> for Gathered<'_, V, D> {
    #[inline(always)]
    unsafe fn row(&self, row: usize) -> Complex<V> {
        let ForwardJob { parts: [re, im], stride, hop, .. } = *self.job;
        unsafe {
            Complex {
                re: V::gather::<D>(re.add(row * stride), hop, self.part),
                im: V::gather::<D>(im.add(row * stride), hop, self.part),
            }
        }
    }
}

/// Some lanes of all rows.
#[derive(Clone, Copy)]
struct Work<V: ChannelVector> {
    rows: *mut V::Sample,
    len: usize,
}

impl<V: ChannelVector> Rows<V> for Work<V> {
    #[inline(always)]
    unsafe fn row(&self, row: usize) -> Complex<V> {
        unsafe { Complex::load(self.at(row)) }
    }
}

/// # Safety
/// As for [`Rows`].
impl<V: ChannelVector> Work<V> {
    #[inline(always)]
    unsafe fn at(&self, row: usize) -> *mut V::Sample {
        unsafe { self.rows.add(row * row_samples::<V::Sample>()) }
    }

    #[inline(always)]
    unsafe fn store(&self, first: usize, quarter: usize, [a, b, c, d]: [Complex<V>; 4]) {
        unsafe {
            a.store(self.at(first));
            b.store(self.at(first + quarter));
            c.store(self.at(first + 2 * quarter));
            d.store(self.at(first + 3 * quarter));
        }
    }

    /// The factors of place j >= 1 of a pass.
    #[inline(always)]
    unsafe fn turns(factors: *const V::Sample, j: usize) -> [Complex<V>; 3] {
        unsafe {
            let at = factors.add(6 * (j - 1));
            [Complex::splat(at), Complex::splat(at.add(2)), Complex::splat(at.add(4))]
        }
    }

    /// One pass over `base .. base + span`.
    #[inline(always)]
    unsafe fn forward_pass(&self, from: &impl Rows<V>, base: usize, span: usize, factors: *const V::Sample) {
        let next = span / 4;
        unsafe {
            self.store(base, next, quarter::<V, false>(from.four(base, next)));
            for j in 1..next {
                let [w1, w2, w3] = Self::turns(factors, j);
                let [a, b, c, d] = quarter::<V, false>(from.four(base + j, next));
                self.store(base + j, next, [a, b.mul(w1), c.mul(w2), d.mul(w3)]);
            }
        }
    }

    #[inline(always)]
    unsafe fn inverse_pass(&self, base: usize, span: usize, factors: *const V::Sample) {
        let next = span / 4;
        unsafe {
            self.store(base, next, quarter::<V, true>(self.four(base, next)));
            for j in 1..next {
                let [w1, w2, w3] = Self::turns(factors, j);
                let [a, b, c, d] = self.four(base + j, next);
                let turned = [a, b.mul_conjugate(w1), c.mul_conjugate(w2), d.mul_conjugate(w3)];
                self.store(base + j, next, quarter::<V, true>(turned));
            }
        }
    }

    /// The pass over spans of 4 rows, or of 2.
    #[inline(always)]
    unsafe fn short_spans<const BACK: bool>(&self, span: usize) {
        for base in (0..self.len).step_by(4) {
            unsafe {
                let [a, b, c, d] = self.four(base, 1);
                let done = if span == 4 {
                    quarter::<V, BACK>([a, b, c, d])
                } else {
                    [a.add(b), a.sub(b), c.add(d), c.sub(d)]
                };
                self.store(base, 1, done);
            }
        }
    }

    #[inline(always)]
    unsafe fn forward(&self, from: &impl Rows<V>, mut factors: *const V::Sample) {
        unsafe {
            self.forward_pass(from, 0, self.len, factors);
            let mut span = self.len / 4;
            while span > 4 {
                // Those of the pass before, whose spans were four times as long.
                factors = factors.add(6 * (span - 1));
                for base in (0..self.len).step_by(span) {
                    self.forward_pass(self, base, span, factors);
                }
                span /= 4;
            }
            self.short_spans::<false>(span);
        }
    }

    #[inline(always)]
    unsafe fn inverse(&self, mut factors: *const V::Sample) {
        unsafe {
            let mut span = if self.len.ilog2().is_multiple_of(2) { 4 } else { 2 };
            self.short_spans::<true>(span);
            while span < self.len {
                (factors, span) = (factors.sub(6 * (span - 1)), 4 * span);
                for base in (0..self.len).step_by(span) {
                    self.inverse_pass(base, span, factors);
                }
            }
        }
    }
}

#[inline(always)]
unsafe fn forward<V: ChannelVector, const D: usize>(job: &ForwardJob<V::Sample>) {
    for part in (0..group_lanes::<V::Sample>()).step_by(V::LANES) {
        // SAFETY: the caller's.
        unsafe {
            let work = Work::<V> { rows: job.rows.add(part), len: job.len };
            work.forward(&Gathered::<V, D> { job, part }, job.factors);
        }
    }
}

#[inline(always)]
unsafe fn inverse<V: ChannelVector>(job: &InverseJob<V::Sample>) {
    for part in (0..group_lanes::<V::Sample>()).step_by(V::LANES) {
        // SAFETY: the caller's.
        unsafe { Work::<V> { rows: job.rows.add(part), len: job.len }.inverse(job.factors) };
    }
}

#[inline(always)]
unsafe fn product<V: ChannelVector, const D: usize>(job: &ProductJob<'_, V::Sample>) {
    let row = row_samples::<V::Sample>();
    let mut spectra = job.spectra;
    for &pair in job.pairs {
        for output in 0..job.outputs {
            for part in (0..group_lanes::<V::Sample>()).step_by(V::LANES) {
                // SAFETY: the caller's.
                unsafe { product_at::<V, D>(job, pair, spectra, output, part) };
            }
            spectra = spectra.wrapping_add(job.channels * row);
        }
    }
}

#[inline(always)]
unsafe fn scatter<V: ChannelVector, const D: usize>(job: &ScatterJob<V::Sample>) {
    let (row, group) = (row_samples::<V::Sample>(), group_lanes::<V::Sample>());
    let (mut out, count, stride) = (job.out, job.count, job.stride);
    for part in 0..2 * group / D {
        // Real and imaginary parts take turns.
        let mut lanes = job.rows.wrapping_add(part % 2 * group + part / 2 * D);
        for _ in 0..count {
            // SAFETY: the caller's.
            unsafe {
                if D < group {
                    out.cast::<[V::Sample; D]>()
                        .write_unaligned(lanes.cast::<[V::Sample; D]>().read_unaligned());
                } else {
                    for g in 0..job.groups {
                        for l in (0..group).step_by(V::LANES) {
                            V::load(lanes.add(g * job.plane + l)).store(out.add(g * group + l));
                        }
                    }
                }
            }
            (lanes, out) = (lanes.wrapping_add(row), out.wrapping_add(stride));
        }
    }
}

/// Both frequencies of a pair. Eight sums, so that none of them waits for the one before.
#[inline(always)]
unsafe fn product_at<V: ChannelVector, const D: usize>(
    job: &ProductJob<'_, V::Sample>,
    pair: [u32; 2],
    mut spectra: *const V::Sample,
    output: usize,
    part: usize,
) {
    let row = row_samples::<V::Sample>();
    let imaginary = group_lanes::<V::Sample>();
    // SAFETY: the caller's.
    unsafe {
        let places = pair.map(|place| place as usize * row);
        let zero = V::splat(V::Sample::default());
        // Of each frequency: real by real, imaginary by imaginary, real by imaginary, imaginary by real.
        let mut sums = [[zero; 4]; 2];
        let mut channel = 0;
        let mut input = job.input;
        while channel < job.channels {
            for n in 0..D.min(job.channels - channel) {
                let h = Complex::<V>::load(spectra.add(part));
                for (sums, place) in sums.iter_mut().zip(places) {
                    let re = V::spread::<D>(input.add(place), n, part);
                    let im = V::spread::<D>(input.add(place + imaginary), n, part);
                    sums[0] = h.re.mul_add(re, sums[0]);
                    sums[1] = h.im.mul_add(im, sums[1]);
                    sums[2] = h.re.mul_add(im, sums[2]);
                    sums[3] = h.im.mul_add(re, sums[3]);
                }
                spectra = spectra.add(row);
            }
            channel += D;
            input = input.wrapping_add(job.plane);
        }
        let to = job.output.add(output * job.plane + part);
        let [[rr, ii, ri, ir], [far_rr, far_ii, far_ri, far_ir]] = sums;
        Complex { re: rr.sub(ii), im: ri.add(ir) }.store(to.add(places[0]));
        Complex { re: far_rr.add(far_ii), im: far_ri.sub(far_ir) }.store(to.add(places[1]));
    }
}

/// The kernels of one instruction set, by depth.
macro_rules! kernels {
    ($module:ident, $vector:ty, $sample:ty, [$($depth:literal),*] $(, $features:literal)?) => {
        mod $module {
            use super::*;

            $(#[target_feature(enable = $features)])?
            unsafe fn run_forward<const D: usize>(job: &ForwardJob<$sample>) {
                // SAFETY: the caller's.
                unsafe { forward::<$vector, D>(job) }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn run_product<const D: usize>(job: &ProductJob<'_, $sample>) {
                // SAFETY: the caller's.
                unsafe { product::<$vector, D>(job) }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn run_inverse(job: &InverseJob<$sample>) {
                // SAFETY: the caller's.
                unsafe { inverse::<$vector>(job) }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn run_scatter<const D: usize>(job: &ScatterJob<$sample>) {
                // SAFETY: the caller's.
                unsafe { scatter::<$vector, D>(job) }
            }

            pub(super) const KERNEL: TransformKernel<$sample> = TransformKernel {
                forward: &[$(run_forward::<$depth>),*],
                product: &[$(run_product::<$depth>),*],
                inverse: run_inverse,
                scatter: &[$(run_scatter::<$depth>),*],
            };
        }
    };
}

kernels!(portable_f32, Portable<f32>, f32, [1, 2, 4, 8]);
kernels!(portable_f64, Portable<f64>, f64, [1, 2, 4]);
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f32, Avx2F32, f32, [1, 2, 4, 8], "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f64, Avx2F64, f64, [1, 2, 4], "avx2,fma");

impl TransformKernel<f32> {
    /// The kernel for an instruction set; the portable one where the processor does not have it. A group is as wide
    /// as a vector of AVX2, which AVX-512 includes.
    pub(crate) fn for_f32(isa: Isa) -> Self {
        match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 | Isa::Avx512 if isa.is_available() => avx2_f32::KERNEL,
            _ => portable_f32::KERNEL,
        }
    }
}

impl TransformKernel<f64> {
    /// As [`TransformKernel::for_f32`].
    pub(crate) fn for_f64(isa: Isa) -> Self {
        match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 | Isa::Avx512 if isa.is_available() => avx2_f64::KERNEL,
            _ => portable_f64::KERNEL,
        }
    }
}
