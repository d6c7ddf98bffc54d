//! The frames of an array.

use super::array::MatArray;
use crate::io::PcmFormat;
use std::io::{self, Read};

/// Frames that are put in order at a time.
const BLOCK_FRAMES: u64 = 1024;

/// Reads the frames of an array: channels interleaved, numbers little-endian.
#[derive(Debug)]
pub struct MatReader {
    array: MatArray,
    /// The next frame.
    next: u64,
    bytes: Vec<u8>,
    given: usize,
}

impl MatReader {
    /// All frames of `array`, in the format of its header.
    pub fn new(array: MatArray) -> Self {
        Self { array, next: 0, bytes: Vec::new(), given: 0 }
    }

    fn refill(&mut self) {
        self.bytes.clear();
        self.given = 0;
        let MatArray { variable, order, format, parts, .. } = &self.array;
        let (channels, frames) = (variable.channels(), variable.frames());
        let to = (self.next + BLOCK_FRAMES).min(frames);
        // Columns follow each other.
        let (step, stride) = if variable.rows_are_channels() { (channels, 1) } else { (1, frames) };
        for frame in self.next..to {
            for channel in 0..channels {
                for numbers in parts {
                    let number = numbers.get((frame * step + channel * stride) as usize, *order);
                    put(*format, number.unwrap_or(f64::NAN), &mut self.bytes);
                }
            }
        }
        self.next = to;
    }
}

/// Appends a number of the class; one that was stored with fewer bytes is exact.
fn put(format: PcmFormat, number: f64, bytes: &mut Vec<u8>) {
    match format {
        PcmFormat::F64Le => bytes.extend(number.to_le_bytes()),
        PcmFormat::F32Le => bytes.extend((number as f32).to_le_bytes()),
        PcmFormat::S32Le => bytes.extend((number as i32).to_le_bytes()),
        PcmFormat::S16Le => bytes.extend((number as i16).to_le_bytes()),
        PcmFormat::U8 => bytes.push(number as u8),
        _ => bytes.extend((number as i8).to_le_bytes()),
    }
}

impl Read for MatReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.given == self.bytes.len() {
            self.refill();
        }
        let count = bytes.len().min(self.bytes.len() - self.given);
        bytes[..count].copy_from_slice(&self.bytes[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}
