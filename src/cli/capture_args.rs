//! How captures are read whose header does not say it.

use super::Failure;
use crate::io::{Coding, ReadOptions};

/// Options of the commands that read captures.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct CaptureArgs {
    /// Sample format of captures: wav, or a raw format as in ffmpeg (s16le, f32le, ..; with c before it for
    /// complex samples: cf32, cs16). SigMF recordings, .csv, .npy, .mat (x.mat:name for one variable of
    /// several) and .flac state their own
    #[arg(long, value_name = "FORMAT", default_value = "wav", value_parser = coding)]
    format: Coding,
    /// Interleaved channels of each raw capture [default: 1 each, or all in a single capture]
    #[arg(long, value_name = "C", value_parser = clap::value_parser!(u16).range(1..))]
    channels: Option<u16>,
    /// Use only this channel of each capture, from 1
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    channel: Option<u16>,
}

/// Reads the name of a coding.
pub(super) fn coding(name: &str) -> Result<Coding, String> {
    name.parse()
        .map_err(|error| format!("{error}, wav, or one of these with c before it for complex samples"))
}

impl CaptureArgs {
    /// Refuses impossible combinations; `takes_turns` with --interleaved.
    pub(super) fn check(self, takes_turns: bool) -> Result<(), Failure> {
        let message = match self {
            Self { channel: Some(_), .. } if takes_turns => {
                "--channel and --interleaved: converters that take turns share one channel; extract it first"
            }
            Self { channels: Some(_), format: Coding::Wav, .. } => {
                "--channels: captures with headers state their channels; give the --format of raw captures"
            }
            _ => return Ok(()),
        };
        Err(Failure::Usage(message.into()))
    }

    /// For `inputs` captures of `wanted` channels in all.
    pub(super) fn options(self, inputs: usize, wanted: usize) -> ReadOptions<'static> {
        let single = if inputs == 1 && self.channel.is_none() { wanted } else { 1 };
        let channels = self.channels.map_or(single, usize::from);
        let only = self.channel.map(|channel| usize::from(channel) - 1);
        ReadOptions { coding: self.format, channels, only, ..ReadOptions::files() }
    }
}
