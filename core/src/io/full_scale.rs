//! From the numbers of an input to samples of full scale 1.
//!
//! Full scale belongs to the converter, not to the word that holds its codes: 12 bits in a word of 16 reach
//! 2047. They stand in the low bits of the word, or in the high ones where all codes are multiples of 16;
//! the first codes other than 0 tell which. Words that count from 0 hold codes that count from 0.

mod flat_tops;
mod seen;

use self::flat_tops::FlatTops;
use self::seen::{Codes, Seen};
use super::block::{Block, Numbers, with_numbers};
use super::{InputFault, StreamHeader};
use crate::quantity::FullScale;
use crate::runtime::{PcmFormat, Sample};
use std::f64::consts::FRAC_2_PI;

/// A quiet signal leaves one or two bits of its converter unused; more are unusual enough to be said.
const UNUSED_BITS: u32 = 3;
/// Fewer codes do not tell which bits a converter has.
const ENOUGH_CODES: u64 = 256;
/// So many times as often as a sine of full scale does a signal that is clipped reach the ends of the range.
const CLIPPED_FACTOR: f64 = 2.0;
/// And so many times as often as a tone that is there often because it has few levels.
const CHANCE: f64 = 1.5;
/// As many samples may be there by chance in a short recording.
const FEW_AT_RAILS: f64 = 16.0;
/// Floats of streams have full scale 1 by convention and may exceed it; a peak of this size is a mistake.
const WILD_PEAK: f64 = 1e3;

/// What is stated of the full scale of inputs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StatedScale {
    /// By the user, for every input.
    pub given: Option<FullScale>,
    /// By the spec, for inputs [that state none](StreamHeader::is_scaled); of WAV and FLAC it is taken where
    /// their codes fit it.
    pub of_spec: Option<FullScale>,
    /// Bits of the converters by the spec, for integers that state none.
    pub bits: Option<u32>,
}

impl StatedScale {
    /// The full scale of an input, and whether codes beyond it are an error. A WAV header that states fewer
    /// bits than its words have is often wrong.
    fn of(self, header: &StreamHeader) -> Option<(FullScale, bool)> {
        let narrower = |bits: &u32| header.word.is_some_and(|word| *bits < word.bits);
        let of_header = header.valid_bits.filter(narrower).map(|bits| (FullScale::Signed(bits), false));
        let of_spec = || self.of_spec.or(self.bits.filter(narrower).map(FullScale::Signed));
        // What a header states is what its writer believed.
        let codes = |scale: &FullScale| header.word.is_some() && scale.rails().is_some();
        let against_header = || self.of_spec.filter(codes).map(|scale| (scale, false));
        match self.given {
            Some(scale) => Some((scale, true)),
            None if header.is_scaled => against_header().or(of_header),
            None => of_spec().map(|scale| (scale, true)),
        }
    }

    /// A number of a table, of full scale 1.
    pub fn of_number(self, x: f64) -> f64 {
        self.given.or(self.of_spec).map_or(x, |scale| (x - scale.middle()) / scale.amplitude())
    }

    /// True if samples stored so have another full scale than 1.
    pub fn changes(self, header: &StreamHeader) -> bool {
        self.of(header).is_some()
    }

    /// Lowest and highest sample of an input, if its samples are codes.
    pub(super) fn rails(self, header: &StreamHeader) -> Option<(f64, f64)> {
        match self.of(header) {
            Some((FullScale::Number(_), _)) => None,
            Some((codes, _)) => codes.rails(),
            None => header.rails,
        }
    }
}

/// An integer word of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    /// Its bits.
    pub bits: u32,
    /// It counts from 0, and the middle of its range is zero (offset binary).
    pub is_unsigned: bool,
}

impl Word {
    /// Of integers; `None` for floats.
    pub fn of(format: PcmFormat) -> Option<Self> {
        let word = Self { bits: 8 * format.bytes() as u32, is_unsigned: format.is_unsigned() };
        (!format.is_float()).then_some(word)
    }

    /// Lowest and highest number that it holds, of its full scale.
    pub(super) fn rails(self) -> (f64, f64) {
        (-1.0, 1.0 - 1.0 / self.amplitude())
    }

    fn amplitude(self) -> f64 {
        2f64.powi(self.bits as i32 - 1)
    }

    /// The code of the middle of the range.
    fn middle(self) -> f64 {
        if self.is_unsigned { self.amplitude() } else { 0.0 }
    }

    /// The codes of a converter in such words.
    fn codes(self, scale: FullScale) -> FullScale {
        match scale {
            FullScale::Signed(bits) if self.is_unsigned => FullScale::Unsigned(bits),
            other => other,
        }
    }
}

/// Where the codes of a converter stand in words that have more bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// No code but 0 so far.
    Open,
    Low,
    /// The words have the full scale of the converter.
    High,
}

/// Brings the samples of an input to full scale 1, and notes what is odd about them.
#[derive(Debug, Clone)]
pub(super) struct Scaling {
    word: Option<Word>,
    scale: Option<FullScale>,
    /// Codes beyond the full scale are an error.
    is_binding: bool,
    /// The full scale of integers is not stated.
    is_open: bool,
    /// Floats beyond it are said.
    usual_peak: f64,
    place: Place,
    codes: Codes,
    rails: Option<(f64, f64)>,
    seen: Seen,
    flat_tops: FlatTops,
    frames: u64,
}

impl Scaling {
    /// Of an input with this header.
    ///
    /// # Errors
    /// Codes that its words cannot hold.
    pub(super) fn new(header: &StreamHeader, stated: StatedScale) -> Result<Self, String> {
        let found = stated.of(header);
        let scale = found.map(|(scale, _)| header.word.map_or(scale, |word| word.codes(scale)));
        let is_binding = found.is_some_and(|(_, is_binding)| is_binding);
        let bits = scale.and_then(|scale| match scale {
            FullScale::Signed(bits) | FullScale::Unsigned(bits) => Some(bits),
            FullScale::Number(_) => None,
        });
        let too_wide = bits.zip(header.word).filter(|(bits, word)| *bits > word.bits);
        if let Some((bits, word)) = too_wide.filter(|_| is_binding) {
            return Err(format!(
                "codes of {bits} bits do not fit its words of {} bits; state fewer",
                word.bits
            ));
        }
        let scale = scale.filter(|_| too_wide.is_none());
        Ok(Self {
            word: header.word,
            scale,
            is_binding,
            is_open: found.is_none() && stated.bits.is_none() && !header.is_scaled,
            usual_peak: WILD_PEAK,
            place: Place::Open,
            codes: Codes::NONE,
            rails: stated.rails(header),
            seen: Seen::new(stated.rails(header)),
            flat_tops: FlatTops::default(),
            frames: 0,
        })
    }

    /// The same for floats of a table or an array, which may be codes.
    pub(super) fn of_table(self) -> Self {
        Self { usual_peak: 1.0, ..self }
    }

    /// Takes the frames of a block from frame `first` on.
    ///
    /// # Errors
    /// The first code beyond the full scale.
    pub(super) fn take(&mut self, block: &mut Block, first: usize) -> Result<(), String> {
        let begin = first * block.channels();
        match (self.word, self.scale) {
            (Some(word), None) if self.is_open && self.codes.may_leave_bits(word) => {
                self.codes.take(block, begin, word);
            }
            (_, None) => {}
            (Some(word), Some(scale @ (FullScale::Signed(bits) | FullScale::Unsigned(bits)))) => {
                self.codes.take(block, begin, word);
                self.choose(word, scale, word.bits - bits);
                if self.place == Place::Low {
                    apply(block, begin, word.amplitude(), scale.middle() - word.middle(), scale.amplitude());
                } else if !self.codes.are_multiples(word.bits - bits) && self.is_binding {
                    return Err(self.in_all_bits(word, scale));
                }
            }
            (word, Some(scale)) => {
                apply(block, begin, word.map_or(1.0, Word::amplitude), scale.middle(), scale.amplitude());
            }
        }
        block.parts.iter().for_each(|part| self.seen.take(part, begin));
        self.flat_tops.take(block, first);
        if self.is_binding
            && self.limit().is_some_and(|limit| self.seen.least < -1.0 || self.seen.most > limit)
        {
            return Err(self.beyond(block, first));
        }
        self.frames += (block.frames() - first) as u64;
        Ok(())
    }

    /// Decides where codes stand, `spare` bits fewer than their words have. If codes exceed a full scale
    /// that is not binding, they are codes of the whole word.
    fn choose(&mut self, word: Word, scale: FullScale, spare: u32) {
        let (middle, amplitude) = (scale.middle() - word.middle(), scale.amplitude());
        let is_within =
            self.codes.least as f64 >= middle - amplitude && (self.codes.most as f64) < middle + amplitude;
        self.place = match self.place {
            Place::Open if self.codes.used == 0 => Place::Open,
            Place::Open if self.codes.are_multiples(spare) => Place::High,
            Place::Open if !is_within && !self.is_binding => Place::High,
            Place::Open => Place::Low,
            chosen => chosen,
        };
    }

    /// The highest sample of codes. Numbers that are no words may be means of codes, and those of a full
    /// scale in volts may be beyond it.
    fn limit(&self) -> Option<f64> {
        let highest = self.scale?.rails().map(|(_, highest)| highest);
        if self.word.is_some() { highest.or(Some(1.0)) } else { highest.and(Some(1.0)) }
    }

    fn in_all_bits(&self, word: Word, scale: FullScale) -> String {
        let (frames, bits) = (self.frames, word.bits);
        format!(
            "its first {frames} frames are multiples as codes of {scale} in the high bits of {bits} are, later ones are not; \
             state the bits that it has"
        )
    }

    /// Names the first sample beyond full scale.
    fn beyond(&self, block: &Block, first: usize) -> String {
        let channels = block.channels();
        let limit = self.limit().unwrap_or(1.0);
        let find = |part: &Numbers| -> Option<(usize, f64)> {
            let beyond = |x: f64| x < -1.0 || x > limit;
            with_numbers!(part, numbers => {
                let at = numbers.iter().skip(first * channels).position(|x| beyond(x.to_f64()))?;
                Some((at, numbers[first * channels + at].to_f64()))
            })
        };
        let (at, sample) = block.parts.iter().find_map(find).unwrap_or((0, f64::NAN));
        let scale = self.scale.unwrap_or(FullScale::Number(1.0));
        let code = sample * scale.amplitude() + scale.middle();
        // Samples of words are codes up to the rounding of single precision.
        let code = if self.word.is_some() { code.round() } else { code };
        let (frame, channel) = (self.frames + (at / channels) as u64, at % channels + 1);
        let from_0 = match scale {
            FullScale::Signed(bits) if self.seen.least >= 0.0 => {
                format!("; codes that count from 0 are u{bits}bits")
            }
            _ => String::new(),
        };
        format!(
            "frame {frame} (from 0) of channel {channel} has the code {code}, beyond a full scale of {scale}; state \
             that of the converter{from_0}"
        )
    }

    /// Lowest and highest sample of codes; `None` for floats.
    pub(super) fn rails(&self) -> Option<(f64, f64)> {
        self.rails
    }

    /// What is odd about the samples; complete at the end.
    pub(super) fn faults(&self) -> impl Iterator<Item = InputFault> {
        let tells = self.is_open && self.seen.count >= ENOUGH_CODES;
        let unused = self.word.filter(|_| tells).and_then(|word| self.codes.unused(word));
        let (peak, is_float) = (self.seen.peak(), self.word.is_none());
        let likely =
            if self.seen.are_whole { FullScale::of_codes(self.seen.least, self.seen.most) } else { None };
        let beyond =
            (is_float && peak > self.usual_peak).then_some(InputFault::BeyondFullScale { peak, likely });
        let Seen { count, at_rails, .. } = self.seen;
        let clipped = self.rails.is_some_and(|rails| {
            // A sine of full scale is within half a step of an end of the range for this share of the time.
            let of_sine = FRAC_2_PI * (1.0 - rails.1).sqrt();
            let share = (CLIPPED_FACTOR * of_sine).max(CHANCE * self.flat_tops.share_at_rails(rails));
            let by_chance = (share * count as f64).max(FEW_AT_RAILS);
            peak <= 1.0 && at_rails as f64 > by_chance
        });
        let clipped = clipped.then_some(InputFault::AtRails { count: at_rails, of: count });
        let flat_top = self.flat_tops.fault(self.rails.unwrap_or((f64::NEG_INFINITY, f64::INFINITY)));
        unused.into_iter().chain(beyond).chain(clipped).chain(flat_top)
    }
}

/// Brings the numbers of a block from `begin` on to full scale: number times `unit` is a code.
fn apply(block: &mut Block, begin: usize, unit: f64, middle: f64, amplitude: f64) {
    if (unit, middle) == (amplitude, 0.0) {
        return;
    }
    for part in &mut block.parts {
        with_numbers!(part, numbers => {
            numbers[begin..].iter_mut().for_each(|x| *x = Sample::from_f64((x.to_f64() * unit - middle) / amplitude));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{PcmFormat, SampleLayout};
    use crate::runtime::PcmFrames;

    const U12: FullScale = FullScale::Unsigned(12);
    const S12: FullScale = FullScale::Signed(12);

    /// What becomes of bytes of one channel, in blocks of three frames.
    fn scaled(
        header: StreamHeader,
        stated: StatedScale,
        bytes: &[u8],
    ) -> Result<(Vec<f64>, Vec<InputFault>), String> {
        let mut scaling = Scaling::new(&header, stated)?.of_table();
        let mut samples = Vec::new();
        for bytes in bytes.chunks(3 * header.layout.container) {
            let mut block = Block::default();
            block.begin(&header);
            block.decode(&PcmFrames { layout: header.layout, channels: 1, bytes }).unwrap();
            scaling.take(&mut block, 0)?;
            samples.extend(block.view(0..block.frames(), 1).real.channel(0));
        }
        Ok((samples, scaling.faults().collect()))
    }

    fn header(format: PcmFormat) -> StreamHeader {
        StreamHeader::real(SampleLayout::packed(format), 1)
    }

    fn given(scale: FullScale) -> StatedScale {
        StatedScale { given: Some(scale), ..StatedScale::default() }
    }

    fn words(codes: &[i16]) -> Vec<u8> {
        codes.iter().flat_map(|code| code.to_le_bytes()).collect()
    }

    fn floats(samples: &[f64]) -> Vec<u8> {
        samples.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    #[test]
    fn floats_come_to_full_scale() {
        let read = |scale, samples: &[f64]| {
            scaled(header(PcmFormat::F64Le), given(scale), &floats(samples)).unwrap().0
        };
        assert_eq!(read(FullScale::Unsigned(8), &[0.0, 64.0, 255.0]), [-1.0, -0.5, 127.0 / 128.0]);
        let samples = read(FullScale::Number(0.5), &[f64::NAN, 1.0]);
        assert!(samples[0].is_nan() && samples[1] == 2.0);
    }

    #[test]
    fn samples_beyond_one_have_a_likely_full_scale() {
        let faults = |samples: &[f64]| {
            scaled(header(PcmFormat::F64Le), StatedScale::default(), &floats(samples)).unwrap().1
        };
        assert_eq!(faults(&[0.5, -0.5, 0.25]), []);
        assert_eq!(faults(&[]), []);
        assert_eq!(faults(&[1.0, 1.0, 0.25, -1.0]), []);
        let beyond = |peak, likely| [InputFault::BeyondFullScale { peak, likely }];
        assert_eq!(faults(&[f64::NAN, -100.0, 127.0]), beyond(127.0, Some(FullScale::Signed(8))));
        assert_eq!(faults(&[0.0, 4000.0]), beyond(4000.0, Some(U12)));
        assert_eq!(faults(&[0.5, -1.5]), beyond(1.5, None));
    }

    #[test]
    fn codes_stand_in_the_low_or_in_the_high_bits() {
        let want = [0.0, 0.0, 0.0, 0.5, -1.0, 1.0 / 2048.0];
        let low = words(&[0, 0, 0, 1024, -2048, 1]);
        let high = words(&[0, 0, 0, 16384, -32768, 16]);
        for bytes in [&low, &high] {
            let (samples, faults) = scaled(header(PcmFormat::S16Le), given(S12), bytes).unwrap();
            assert_eq!((samples, faults), (want.to_vec(), vec![]));
        }
        // Bits of the spec hold for integers that state none, and for no others.
        let of_spec = StatedScale { bits: Some(12), ..StatedScale::default() };
        assert_eq!(scaled(header(PcmFormat::S16Le), of_spec, &low).unwrap().0, want);
        let wav = StreamHeader { is_scaled: true, ..header(PcmFormat::S16Le) };
        assert_eq!(scaled(wav, of_spec, &low).unwrap().0[3], 1024.0 / 32768.0);
        // A full scale of the spec holds for WAV whose codes fit it.
        let of_spec = StatedScale { of_spec: Some(S12), ..StatedScale::default() };
        assert_eq!(scaled(wav, of_spec, &low).unwrap().0, want);
        assert_eq!(scaled(wav, of_spec, &words(&[1, 16384])).unwrap().0[1], 0.5);
    }

    #[test]
    fn codes_that_count_from_0_are_read_in_all_words() {
        let bytes = words(&[2048, 0, 4095]);
        let want = [0.0, -1.0, 2047.0 / 2048.0];
        assert_eq!(scaled(header(PcmFormat::S16Le), given(U12), &bytes).unwrap().0, want);
        for scale in [S12, U12] {
            assert_eq!(scaled(header(PcmFormat::U16Le), given(scale), &bytes).unwrap().0, want);
        }
    }

    #[test]
    fn codes_beyond_those_that_are_stated_are_an_error_with_their_place() {
        let beyond = scaled(header(PcmFormat::S16Le), given(S12), &words(&[1, 2, 3, 4, 2048])).unwrap_err();
        assert!(beyond.contains("frame 4 (from 0) of channel 1 has the code 2048"), "{beyond}");
        let mixed = scaled(header(PcmFormat::S16Le), given(S12), &words(&[16, 32, 48, 5])).unwrap_err();
        assert!(mixed.contains("first 3 frames are multiples"), "{mixed}");
        let narrow = scaled(header(PcmFormat::S8), given(S12), &[0]).unwrap_err();
        assert!(narrow.contains("codes of 12 bits do not fit its words of 8"), "{narrow}");
        let floats = scaled(header(PcmFormat::F64Le), given(S12), &floats(&[0.0, 3000.0])).unwrap_err();
        assert!(floats.contains("frame 1 (from 0)"), "{floats}");
    }

    #[test]
    fn a_header_that_states_too_few_bits_binds_nobody() {
        let wav = StreamHeader { is_scaled: true, valid_bits: Some(12), ..header(PcmFormat::S16Le) };
        let read = |codes: &[i16]| scaled(wav, StatedScale::default(), &words(codes)).unwrap().0;
        assert_eq!(read(&[1, 1024]), [1.0 / 2048.0, 0.5]);
        assert_eq!(read(&[16, 16384]), [1.0 / 2048.0, 0.5]);
        assert_eq!(read(&[1, 16384]), [1.0 / 32768.0, 0.5]);
    }

    #[test]
    fn a_tone_of_full_scale_that_repeats_is_not_said_to_clip() {
        let tone = |period: usize, peak: f64| {
            let at = |k: usize| peak * (std::f64::consts::TAU * (k % period) as f64 / period as f64).cos();
            let codes: Vec<i16> = (0..8000).map(|k| at(k).round().clamp(-32768.0, 32767.0) as i16).collect();
            scaled(header(PcmFormat::S16Le), StatedScale::default(), &words(&codes)).unwrap().1
        };
        for period in [2, 4, 8, 12, 16, 20] {
            assert_eq!(tone(period, 32767.0), [], "{period}");
        }
        // A quiet tone of few levels in one channel says nothing of another one.
        let quiet = |k: usize| [0, 11_585, 16_384, 11_585, 0, -11_585, -16_384, -11_585][k % 8];
        let loud = |k: usize| (4e4 * (0.1 * k as f64).sin()).clamp(-32768.0, 32767.0) as i16;
        let two = StreamHeader::real(SampleLayout::packed(PcmFormat::S16Le), 2);
        let mut block = Block::default();
        block.begin(&two);
        let bytes = words(&(0..8000).flat_map(|k| [quiet(k), loud(k)]).collect::<Vec<_>>());
        block.decode(&PcmFrames { layout: two.layout, channels: 2, bytes: &bytes }).unwrap();
        let mut scaling = Scaling::new(&two, StatedScale::default()).unwrap();
        scaling.take(&mut block, 0).unwrap();
        assert!(matches!(scaling.faults().collect::<Vec<_>>()[..], [InputFault::AtRails { .. }]));
        assert!(matches!(tone(97, 60_000.0)[..], [InputFault::AtRails { of: 8000, .. }]));
        // Most of its steps are at the rails: none is by chance.
        assert!(matches!(tone(64, 1e5)[..], [InputFault::AtRails { .. }]));
    }

    #[test]
    fn bits_of_the_spec_and_codes_beyond_a_number_are_heeded() {
        let of_spec = StatedScale { bits: Some(16), ..StatedScale::default() };
        let quiet = words(&[1, 2047, -2048].repeat(100));
        assert_eq!(scaled(header(PcmFormat::S16Le), of_spec, &quiet).unwrap().1, []);
        let thousand = given(FullScale::Number(1000.0));
        let codes = words(&[1000, -1000]);
        assert_eq!(scaled(header(PcmFormat::S16Le), thousand, &codes).unwrap().0, [1.0, -1.0]);
        let beyond = scaled(header(PcmFormat::S16Le), thousand, &words(&[1, 1001])).unwrap_err();
        assert!(beyond.contains("frame 1 (from 0) of channel 1 has the code 1001,"), "{beyond}");
    }

    #[test]
    fn bits_that_no_code_uses_are_said() {
        let faults = |codes: &[i16]| {
            scaled(header(PcmFormat::S16Le), StatedScale::default(), &words(codes)).unwrap().1
        };
        assert_eq!(faults(&[1, 2047, -2048].repeat(100)), [InputFault::UnusedBits { bits: 16, likely: S12 }]);
        let from_0 = scaled(header(PcmFormat::U16Le), StatedScale::default(), &words(&[1, 4095].repeat(200)));
        assert_eq!(from_0.unwrap().1, [InputFault::UnusedBits { bits: 16, likely: U12 }]);
        for codes in [[1, 8191, -8192].repeat(200), [16, 2032].repeat(200), vec![1, 2047]] {
            assert_eq!(faults(&codes), []);
        }
    }
}
