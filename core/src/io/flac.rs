//! Captures as FLAC recordings, decoded by claxon, which checks the sums of every frame.
//!
//! A recording is read to its end or refused: what cannot be decoded is an error and never an unreported
//! gap. Integers have the full scale 1.0 and keep all their bits.

use super::block::Block;
use super::capture::Capture;
use super::{IoError, PcmFormat, SampleLayout, StreamHeader, Word};
use claxon::Error;
use std::fs::File;
use std::io;

/// An open recording.
pub(super) struct FlacReader {
    name: String,
    flac: claxon::FlacReader<File>,
    header: StreamHeader,
    /// Frames so far.
    frames: u64,
    /// The numbers of a frame of FLAC, kept for the next one.
    numbers: Vec<i32>,
}

impl FlacReader {
    /// Opens the recording called `name`.
    ///
    /// # Errors
    /// [`IoError::Malformed`] for what cannot be decoded, or the system's refusal.
    pub(super) fn open(file: File, name: &str) -> Result<Self, IoError> {
        let flac = claxon::FlacReader::new(file).map_err(|error| refused(name, 0, error))?;
        let info = flac.streaminfo();
        let bits = info.bits_per_sample;
        let format = if bits <= 24 { PcmFormat::S24Le } else { PcmFormat::S32Le };
        let real = StreamHeader::real(SampleLayout::packed(format), info.channels as usize);
        let word = Word { bits, is_unsigned: false };
        let real = StreamHeader { is_scaled: true, word: Some(word), rails: Some(word.rails()), ..real };
        let header = StreamHeader { promised: info.samples, ..real.at_whole_hertz(info.sample_rate) };
        Ok(Self { name: name.to_owned(), flac, header, frames: 0, numbers: Vec::new() })
    }

    /// Appends the samples of the next block of FLAC; false at the end.
    fn next_block(&mut self, into: &mut Block) -> Result<bool, IoError> {
        let scale = 2f64.powi(1 - self.flac.streaminfo().bits_per_sample as i32);
        let numbers = std::mem::take(&mut self.numbers);
        let block = self.flac.blocks().read_next_or_eof(numbers);
        let Some(block) = block.map_err(|error| refused(&self.name, self.frames, error))? else {
            return match self.header.promised.filter(|promised| *promised > self.frames) {
                Some(promised) => {
                    Err(damaged_after(&self.name, self.frames, format!("its header promises {promised}")))
                }
                None => Ok(false),
            };
        };
        if block.channels() as usize != self.header.channels {
            let problem = format!("from here on it has {} channels", block.channels());
            return Err(damaged_after(&self.name, self.frames, problem));
        }
        for frame in 0..block.duration() {
            into.extend((0..block.channels()).map(|channel| scale * f64::from(block.sample(channel, frame))));
        }
        self.frames += u64::from(block.duration());
        self.numbers = block.into_buffer();
        Ok(true)
    }
}

/// What is wrong after so many frames of the recording called `name`.
fn refused(name: &str, frames: u64, error: Error) -> IoError {
    match error {
        Error::IoError(error) if error.kind() != io::ErrorKind::UnexpectedEof => {
            IoError::system(name, "read it")(error)
        }
        error => damaged_after(name, frames, error.to_string()),
    }
}

fn damaged_after(name: &str, frames: u64, reason: String) -> IoError {
    IoError::malformed(name, "a FLAC recording")(format!(
        "damaged after {frames} frames ({reason}); copy it again, or convert what can be read with ffmpeg"
    ))
}

impl Capture for FlacReader {
    fn stream_header(&self) -> StreamHeader {
        self.header
    }

    fn read_block(&mut self, _: usize, block: &mut Block) -> io::Result<bool> {
        Ok(self.next_block(block)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{OfflineSamples, RecordedFrames};
    use crate::random::Random;
    use std::path::Path;

    /// ffmpeg's recording of the formula below (tools/flac_fixture.sh).
    fn fixture() -> Vec<u8> {
        std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/two.flac")).unwrap()
    }

    fn read(path: &Path, bytes: &[u8]) -> Result<(StreamHeader, Vec<f64>), String> {
        std::fs::write(path, bytes).unwrap();
        let reader = FlacReader::open(File::open(path).unwrap(), "x.flac");
        let mut reader = reader.map_err(|error| error.to_string())?;
        let mut block = Block::default();
        block.begin(&reader.stream_header());
        while reader.next_block(&mut block).map_err(|error| error.to_string())? {}
        let frames = block.view(0..block.frames(), 1);
        let one = [RecordedFrames { real: frames.real, imaginary: None }];
        let channels = OfflineSamples::of_frames(&one, usize::MAX).unwrap().channels;
        let samples = (0..block.frames()).flat_map(|k| channels.iter().map(move |channel| channel[k]));
        Ok((reader.stream_header(), samples.collect()))
    }

    #[test]
    fn recordings_keep_every_bit() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let sample = |n: usize, f: f64| {
            (16000.0 * (std::f64::consts::TAU * f * n as f64 / 24e3).sin()).round() / 32768.0
        };
        let want: Vec<f64> = (0..3000).flat_map(|n| [1000.0, 1700.0].map(|f| sample(n, f))).collect();
        let (header, samples) = read(path.path(), &fixture()).unwrap();
        assert_eq!((header.rate, header.channels, header.promised), (Some(24e3), 2, Some(3000)));
        assert!(samples == want);
    }

    #[test]
    fn what_cannot_be_decoded_is_refused() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let text = read(path.path(), b"no recording at all").unwrap_err();
        assert!(text.starts_with("x.flac: not a FLAC recording"), "{text}");
        let whole = fixture();
        let cut = read(path.path(), &whole[..whole.len() - 1000]).unwrap_err();
        assert!(cut.contains("damaged after"), "{cut}");
    }

    /// Damaged copies: an answer or a message, never a panic.
    #[test]
    fn damaged_recordings_are_answered() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let (whole, mut dice, mut seen) = (fixture(), Random(1), [0, 0]);
        for _ in 0..150 {
            let mut bytes = whole.clone();
            for _ in 0..=dice.below(4) {
                // Half of the faults are in the header.
                let most = if dice.below(2) == 0 { bytes.len().min(200) } else { bytes.len() };
                let place = dice.below(most.max(1)).min(bytes.len() - 1);
                match dice.below(4) {
                    0 => bytes.truncate(place.max(1)),
                    1 => bytes[place] ^= 1 << dice.below(8),
                    2 => bytes[place] = [0, 0xFF, 0x7F, 0x80][dice.below(4)],
                    _ => drop(bytes.drain(place..(place + 1 + dice.below(8)).min(bytes.len()).max(place))),
                }
                bytes.extend(bytes.is_empty().then_some(0));
            }
            let answer = read(path.path(), &bytes);
            seen[usize::from(answer.is_err())] += 1;
            assert!(
                answer.is_ok_and(|(header, samples)| samples.len() % header.channels == 0) || seen[1] > 0
            );
        }
        assert!(seen[0] > 5 && seen[1] > 50, "{seen:?}");
    }
}
