//! Recordings that must be decoded: FLAC, MP3, AIFF, Ogg Vorbis.

use super::{IoError, PcmFormat, SampleLayout, StreamHeader};
use hybank_audio::{AudioError, AudioReader};
use std::io::{self, Read};
use std::path::Path;

/// The decoded frames of a recording, as `f64le`. An error of this reader holds an [`IoError`].
#[derive(Debug)]
pub(super) struct DecodedReader {
    audio: AudioReader,
    name: String,
    samples: Vec<f64>,
    bytes: Vec<u8>,
    given: usize,
}

impl DecodedReader {
    /// Opens the recording called `name`.
    ///
    /// # Errors
    /// [`IoError::Malformed`] for what cannot be decoded, or the system's refusal.
    pub(super) fn open(path: &Path, name: &str) -> Result<Self, IoError> {
        let audio = AudioReader::open(path).map_err(|error| refused(name, error))?;
        Ok(Self { audio, name: name.to_owned(), samples: Vec::new(), bytes: Vec::new(), given: 0 })
    }

    /// As the header of an input.
    pub(super) fn stream_header(&self) -> StreamHeader {
        let real = StreamHeader::real(SampleLayout::packed(PcmFormat::F64Le), self.audio.channels());
        StreamHeader { rate: Some(f64::from(self.audio.rate())), promised: self.audio.promised(), ..real }
    }
}

fn refused(name: &str, error: AudioError) -> IoError {
    match error {
        AudioError::System(source) => IoError::system(name, "read it")(source),
        error => {
            IoError::Malformed { file: name.to_owned(), kind: "a recording", problem: error.to_string() }
        }
    }
}

impl Read for DecodedReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.given == self.bytes.len() {
            let more = self.audio.next_block(&mut self.samples);
            more.map_err(|error| io::Error::other(refused(&self.name, error)))?;
            self.bytes.clear();
            self.bytes.extend(self.samples.iter().flat_map(|x| x.to_le_bytes()));
            self.given = 0;
        }
        let count = bytes.len().min(self.bytes.len() - self.given);
        bytes[..count].copy_from_slice(&self.bytes[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}
