//! Reads whole frames from a byte stream that may be split anywhere.

use std::io::{self, Read};

/// Returns whole frames of `frame` bytes and keeps the rest of an incomplete one for the next call.
#[derive(Debug)]
pub struct FrameReader<R> {
    inner: R,
    frame: usize,
    /// Bytes that may still be taken; `None` until the end.
    left: Option<u64>,
    /// The beginning of a frame that was cut.
    carry: Vec<u8>,
    ended: bool,
}

impl<R: Read> FrameReader<R> {
    /// Reads frames of `frame` bytes (at least 1), at most `limit` bytes in all if given.
    pub fn new(inner: R, frame: usize, limit: Option<u64>) -> Self {
        let frame = frame.max(1);
        Self { inner, frame, left: limit, carry: Vec::with_capacity(frame), ended: false }
    }

    /// Fills `bytes` with as many whole frames as it holds or the stream still has; returns the
    /// bytes filled, a multiple of the frame, short only at the end.
    ///
    /// # Errors
    /// The errors of the underlying reader.
    pub fn fill(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let capacity = bytes.len() / self.frame * self.frame;
        let mut filled = 0;
        while filled < capacity && !self.ended {
            filled += self.read_whole(&mut bytes[filled..capacity])?;
        }
        Ok(filled)
    }

    /// Waits for at least one whole frame and returns the bytes of one read; 0 only at the end.
    ///
    /// # Errors
    /// The errors of the underlying reader.
    pub fn take_ready(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let capacity = bytes.len() / self.frame * self.frame;
        let mut filled = 0;
        while filled == 0 && capacity > 0 && !self.ended {
            filled = self.read_whole(&mut bytes[..capacity])?;
        }
        Ok(filled)
    }

    /// Makes `count` >= 1 frames in a row one, before anything is read.
    pub fn group(&mut self, count: usize) {
        self.frame *= count;
    }

    /// What the bytes come from.
    pub(super) fn inner_mut(&mut self) -> &mut R {
        &mut self.inner
    }

    /// Bytes a frame.
    pub fn frame_bytes(&self) -> usize {
        self.frame
    }

    /// Bytes of a last frame that was cut, known at the end.
    pub fn cut_bytes(&self) -> usize {
        if self.ended { self.carry.len() } else { 0 }
    }

    /// Bytes that were promised but did not come, known at the end.
    pub fn missing_bytes(&self) -> u64 {
        if self.ended { self.left.unwrap_or(0) } else { 0 }
    }

    /// True once the stream, or its promised length, is used up.
    pub fn ended(&self) -> bool {
        self.ended
    }

    /// One read, which may give no whole frame; whole frames into `bytes` (a multiple of the frame), the
    /// rest into the carry.
    pub(super) fn read_whole(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let carried = self.carry.len();
        bytes[..carried].copy_from_slice(&self.carry);
        let room = bytes.len() - carried;
        let want = self.left.map_or(room, |left| room.min(usize::try_from(left).unwrap_or(room)));
        let got = read_once(&mut self.inner, &mut bytes[carried..carried + want])?;
        if let Some(left) = &mut self.left {
            *left -= got as u64;
        }
        self.ended = got == 0;
        let whole = (carried + got) / self.frame * self.frame;
        self.carry.clear();
        self.carry.extend_from_slice(&bytes[whole..carried + got]);
        Ok(whole)
    }
}

fn read_once(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<usize> {
    loop {
        match reader.read(bytes) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives `step` bytes at a time.
    struct Dripping<'a>(&'a [u8], usize);

    impl Read for Dripping<'_> {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            let n = self.1.min(self.0.len()).min(bytes.len());
            bytes[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }

    #[test]
    fn any_drip_and_any_buffer_give_the_same_frames() {
        let data: Vec<u8> = (0..100).collect();
        for frame in [1, 3, 8] {
            for step in 1..20 {
                for buffer in [frame, 2 * frame + 1, 64] {
                    let mut reader = FrameReader::new(Dripping(&data, step), frame, None);
                    let mut all = Vec::new();
                    let mut bytes = vec![0; buffer];
                    loop {
                        let n = reader.take_ready(&mut bytes).unwrap();
                        assert_eq!(n % frame, 0);
                        if n == 0 {
                            break;
                        }
                        all.extend_from_slice(&bytes[..n]);
                    }
                    assert_eq!(all, data[..100 / frame * frame]);
                    assert_eq!(reader.cut_bytes(), 100 % frame);
                }
            }
        }
    }

    #[test]
    fn fill_is_short_only_at_the_end_and_limits_hold() {
        let data = [7u8; 50];
        let mut reader = FrameReader::new(Dripping(&data, 7), 4, Some(30));
        let mut bytes = [0; 16];
        assert_eq!(reader.fill(&mut bytes).unwrap(), 16);
        assert_eq!(reader.fill(&mut bytes).unwrap(), 12);
        assert_eq!((reader.cut_bytes(), reader.missing_bytes()), (2, 0));
        let mut short = FrameReader::new(Dripping(&data, 7), 4, Some(60));
        assert_eq!(short.fill(&mut [0; 100]).unwrap(), 48);
        assert_eq!((short.cut_bytes(), short.missing_bytes()), (2, 10));
    }
}
