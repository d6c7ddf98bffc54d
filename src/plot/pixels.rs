//! Pictures of pixels. They are drawn larger than they are written, so that slanted lines and letters get
//! grey edges.

/// Bytes of a pixel: red, green, blue.
const DEPTH: usize = 3;

/// Lines of pixels.
pub(super) struct Pixels {
    pub(super) width: usize,
    pub(super) bytes: Vec<u8>,
}

impl Pixels {
    pub(super) fn white(width: usize, height: usize) -> Self {
        Self { width, bytes: vec![u8::MAX; width * height * DEPTH] }
    }

    pub(super) fn height(&self) -> usize {
        self.bytes.len() / (self.width * DEPTH)
    }

    /// Puts a share of a colour in place of as much of what is there.
    pub(super) fn blend(&mut self, x: usize, y: usize, colour: [u8; DEPTH], share: f64) {
        let first = (y * self.width + x) * DEPTH;
        let mixed =
            |old: u8, new: u8| (f64::from(old) + share * (f64::from(new) - f64::from(old))).round() as u8;
        self.bytes[first..first + DEPTH]
            .iter_mut()
            .zip(colour)
            .for_each(|(old, new)| *old = mixed(*old, new));
    }

    /// The means of the squares of `factor` by `factor` pixels, of which there is a whole number.
    pub(super) fn reduced(&self, factor: usize) -> Self {
        let (width, line) = (self.width / factor, self.width * DEPTH);
        let mean = |lines: &[u8], column: usize, colour: usize| {
            let first = column * factor * DEPTH + colour;
            let square = (0..factor).flat_map(|y| (0..factor).map(move |x| first + y * line + x * DEPTH));
            let sum: usize = square.map(|at| usize::from(lines[at])).sum();
            ((sum + factor * factor / 2) / (factor * factor)) as u8
        };
        let all = |lines: &[u8]| -> Vec<u8> {
            (0..width * DEPTH).map(|k| mean(lines, k / DEPTH, k % DEPTH)).collect()
        };
        Self { width, bytes: self.bytes.chunks_exact(line * factor).flat_map(all).collect() }
    }

    /// The picture as a PNG file.
    pub(super) fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height() as u32);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.bytes)?;
        writer.finish()?;
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_become_their_means() {
        let bytes = vec![0, 10, 20, 4, 10, 21, 0, 10, 20, 4, 10, 21, 255, 255, 255, 255, 255, 255];
        let picture = Pixels { width: 2, bytes: [&bytes[..12], &bytes[..12]].concat() };
        let small = picture.reduced(2);
        assert_eq!((small.width, small.bytes), (1, [2, 10, 21].repeat(2)));
    }

    #[test]
    fn a_file_reads_back() {
        let picture = Pixels { width: 2, bytes: (0..18).collect() };
        let file = picture.png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut read).unwrap();
        assert_eq!((frame.width, frame.height, read), (2, 3, picture.bytes));
    }
}
