//! Reads recordings in FLAC, MP3, AIFF and Ogg Vorbis as interleaved samples.
//!
//! The decoders are those of symphonia, which are safe Rust. A recording is read to its end or refused: a
//! packet that cannot be decoded is an error and never an unreported gap. Integers have the full scale
//! 1.0 and keep all their bits.
//!
//! ```no_run
//! let mut reader = hybank_audio::AudioReader::open("ch1.flac".as_ref())?;
//! println!("{} channels at {} Hz", reader.channels(), reader.rate());
//! let mut samples = Vec::new();
//! while reader.next_block(&mut samples)? {
//!     assert_eq!(samples.len() % reader.channels(), 0);
//! }
//! # Ok::<(), hybank_audio::AudioError>(())
//! ```

use std::fs::File;
use std::io;
use std::path::Path;
use symphonia::core::audio::GenericAudioBufferRef;
use symphonia::core::codecs::audio::{AudioCodecParameters, AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::{MediaSourceStream, MediaSourceStreamOptions};
use symphonia::core::meta::MetadataOptions;

/// Extensions of the names of recordings that are read, in lower case.
pub const EXTENSIONS: [&str; 7] = ["flac", "mp3", "aif", "aiff", "aifc", "ogg", "oga"];

/// A recording that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum AudioError {
    /// The operating system refused.
    #[error("cannot read it: {0}")]
    System(#[from] io::Error),
    /// The file is of no known kind, or of a kind that is not decoded.
    #[error("no FLAC, MP3, AIFF or Ogg Vorbis recording that can be decoded ({reason})")]
    Unknown {
        /// What the decoder says.
        reason: String,
    },
    /// There is no track of sound, or one without rate or channels.
    #[error("no track with a sample rate and channels")]
    NoTrack,
    /// Damage, or an end before the end.
    #[error(
        "damaged after {frames} frames ({reason}); copy it again, or convert what can be read with ffmpeg"
    )]
    Damaged {
        /// Frames before it.
        frames: u64,
        /// What the decoder says.
        reason: String,
    },
    /// Rate or channels change on the way.
    #[error(
        "after {frames} frames it has {channels} channels at {rate} Hz, other than before; cut it into two files there"
    )]
    Changes {
        /// Frames before the change.
        frames: u64,
        /// Channels after it.
        channels: usize,
        /// Hertz after it.
        rate: u32,
    },
}

/// An open recording.
pub struct AudioReader {
    format: Box<dyn FormatReader>,
    decoder: Box<dyn AudioDecoder>,
    track: u32,
    rate: u32,
    channels: usize,
    promised: Option<u64>,
    frames: u64,
}

impl std::fmt::Debug for AudioReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { rate, channels, promised, frames, .. } = self;
        write!(f, "AudioReader {{ {channels} channels, {rate} Hz, {frames} of {promised:?} frames }}")
    }
}

impl AudioReader {
    /// Opens a recording; its kind is found by its content, and its name is a hint.
    ///
    /// # Errors
    /// [`AudioError`]: the system, a kind of file that is not decoded, or no track of sound.
    pub fn open(path: &Path) -> Result<Self, AudioError> {
        let source = MediaSourceStream::new(Box::new(File::open(path)?), MediaSourceStreamOptions::default());
        let mut hint = Hint::new();
        path.extension().and_then(|extension| extension.to_str()).map(|name| hint.with_extension(name));
        let (options, meta) = (FormatOptions::default(), MetadataOptions::default());
        let format = symphonia::default::get_probe().probe(&hint, source, options, meta).map_err(unknown)?;
        let track = format.default_track(TrackType::Audio).ok_or(AudioError::NoTrack)?;
        let codec = track.codec_params.as_ref().and_then(|codec| codec.audio()).ok_or(AudioError::NoTrack)?;
        let channels = codec.channels.as_ref().map_or(0, |channels| channels.count());
        let rate = codec.sample_rate.filter(|rate| *rate > 0).ok_or(AudioError::NoTrack)?;
        if channels == 0 {
            return Err(AudioError::NoTrack);
        }
        let promised = track.num_frames.filter(|_| is_lossless(codec));
        let decoder = symphonia::default::get_codecs();
        let decoder = decoder.make_audio_decoder(codec, &AudioDecoderOptions::default()).map_err(unknown)?;
        let track = track.id;
        Ok(Self { format, decoder, track, rate, channels, promised, frames: 0 })
    }

    /// Frames per second.
    pub fn rate(&self) -> u32 {
        self.rate
    }

    /// Interleaved channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Frames of the whole recording, where the file states them exactly.
    pub fn promised(&self) -> Option<u64> {
        self.promised
    }

    /// Puts the samples of the next packet into `samples`, whole frames; `false` and none at the end.
    ///
    /// # Errors
    /// [`AudioError::Damaged`] for packets that cannot be decoded and for ends before the end,
    /// [`AudioError::Changes`], and the system's refusal.
    pub fn next_block(&mut self, samples: &mut Vec<f64>) -> Result<bool, AudioError> {
        samples.clear();
        while samples.is_empty() {
            let frames = self.frames;
            let Some(packet) = self.format.next_packet().map_err(|error| damaged(error, frames))? else {
                return self.check_end();
            };
            if packet.track_id != self.track {
                continue;
            }
            let block = self.decoder.decode(&packet).map_err(|error| damaged(error, frames))?;
            if block.frames() > 0 {
                check(&block, self.channels, self.rate, frames)?;
                block.copy_to_vec_interleaved(samples);
                self.frames += block.frames() as u64;
            }
        }
        Ok(true)
    }

    fn check_end(&self) -> Result<bool, AudioError> {
        match self.promised {
            Some(promised) if promised > self.frames => Err(AudioError::Damaged {
                frames: self.frames,
                reason: format!("its header promises {promised}"),
            }),
            _ => Ok(false),
        }
    }
}

/// Whether the number of frames in the file is exact. Lossy codecs have no bits per sample, and their number
/// is often an estimate.
fn is_lossless(codec: &AudioCodecParameters) -> bool {
    codec.bits_per_sample.is_some()
}

fn check(
    block: &GenericAudioBufferRef<'_>,
    channels: usize,
    rate: u32,
    frames: u64,
) -> Result<(), AudioError> {
    let (its_channels, its_rate) = (block.num_planes(), block.spec().rate());
    if (its_channels, its_rate) == (channels, rate) {
        return Ok(());
    }
    Err(AudioError::Changes { frames, channels: its_channels, rate: its_rate })
}

fn unknown(error: Error) -> AudioError {
    match error {
        Error::IoError(error) if error.kind() != io::ErrorKind::UnexpectedEof => AudioError::System(error),
        error => AudioError::Unknown { reason: error.to_string() },
    }
}

fn damaged(error: Error, frames: u64) -> AudioError {
    match error {
        Error::IoError(error) if error.kind() != io::ErrorKind::UnexpectedEof => AudioError::System(error),
        error => AudioError::Damaged { frames, reason: error.to_string() },
    }
}
