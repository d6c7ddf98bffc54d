//! Headers as they are found in the wild, hound as the oracle for the tame ones.

use super::*;
use crate::io::capture::ByteSource;
use crate::io::{FrameFile, MultiReader, OfflineSamples, ReadOptions};
use crate::io::{InputFault, IoError, PcmFormat, SampleLayout};
use proptest::prelude::*;
use std::io::{self, Cursor, Read, Seek, SeekFrom, Write};

/// Header and samples as f64, as far as there are whole frames.
fn read(bytes: &[u8]) -> Result<(WavHeader, Vec<f64>, Vec<InputFault>), IoError> {
    let mut reader = WavReader::new(bytes, "test.wav")?;
    let header = reader.header().clone();
    let mut data = Vec::new();
    reader.read_to_end(&mut data).unwrap();
    let SampleLayout { format, container } = header.layout;
    let (whole, cut) = data.split_at(data.len() / header.frame_bytes() * header.frame_bytes());
    let samples = whole.chunks_exact(container).map(|b| format.decode(b)).collect();
    let truncated = Some(reader.missing_bytes()).filter(|&missing_bytes| missing_bytes > 0);
    let truncated = truncated.map(|missing_bytes| InputFault::Truncated { missing_bytes });
    let cut = (!cut.is_empty()).then_some(InputFault::CutFrame { bytes: cut.len() });
    Ok((header, samples, truncated.into_iter().chain(cut).collect()))
}

fn chunk(id: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = id.to_vec();
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(content);
    bytes.extend(vec![0; content.len() % 2]);
    bytes
}

fn fmt(tag: u16, channels: u16, container: u16, bits: u16) -> Vec<u8> {
    let mut bytes = tag.to_le_bytes().to_vec();
    bytes.extend(channels.to_le_bytes());
    bytes.extend(8000u32.to_le_bytes());
    bytes.extend((8000 * u32::from(container * channels)).to_le_bytes());
    bytes.extend((container * channels).to_le_bytes());
    bytes.extend(bits.to_le_bytes());
    bytes
}

fn extensible(tag: u16, channels: u16, container: u16, bits: u16, valid: u16) -> Vec<u8> {
    let mut bytes = fmt(0xFFFE, channels, container, bits);
    bytes.extend(22u16.to_le_bytes());
    bytes.extend(valid.to_le_bytes());
    bytes.extend(0u32.to_le_bytes());
    bytes.extend(tag.to_le_bytes());
    bytes.extend([0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71]);
    bytes
}

fn riff(chunks: &[Vec<u8>]) -> Vec<u8> {
    let body = chunks.concat();
    let mut bytes = b"RIFF".to_vec();
    bytes.extend((body.len() as u32 + 4).to_le_bytes());
    bytes.extend(b"WAVE");
    bytes.extend(body);
    bytes
}

/// 16-bit mono samples 1, 2, 3, ...
fn counting(count: i16) -> Vec<u8> {
    (1..=count).flat_map(i16::to_le_bytes).collect()
}

fn integers(samples: &[f64]) -> Vec<i32> {
    samples.iter().map(|x| (x * 32768.0) as i32).collect()
}

/// The samples must be 1, 2, .. count without a note.
fn counts(bytes: &[u8], count: i32) {
    let (_, samples, notes) = read(bytes).unwrap();
    assert_eq!(integers(&samples), (1..=count).collect::<Vec<_>>());
    assert_eq!(notes, []);
}

#[test]
fn hound_writes_and_we_read_the_same() {
    use hound::SampleFormat::{Float, Int};
    for (bits, sample_format) in [(8, Int), (16, Int), (24, Int), (32, Int), (32, Float)] {
        for channels in 1..6 {
            let spec = hound::WavSpec { channels, sample_rate: 12_345, bits_per_sample: bits, sample_format };
            let mut file = Cursor::new(Vec::new());
            let mut writer = hound::WavWriter::new(&mut file, spec).unwrap();
            let values: Vec<i32> = (0..60).map(|i| (i - 30) * 4).collect();
            for &value in &values {
                match sample_format {
                    Int => writer.write_sample(value).unwrap(),
                    Float => writer.write_sample(value as f32).unwrap(),
                }
            }
            writer.finalize().unwrap();
            let (header, samples, notes) = read(file.get_ref()).unwrap();
            let full = if sample_format == Int { 2f64.powi(i32::from(bits) - 1) } else { 1.0 };
            assert_eq!(samples, values.iter().map(|&v| f64::from(v) / full).collect::<Vec<_>>());
            assert_eq!((header.channels, header.rate, notes), (usize::from(channels), 12_345, vec![]));
            // In this layout hound writes nothing after the data, so all bytes are accounted for.
            assert_eq!(header.data_offset + header.data_bytes.unwrap(), file.get_ref().len() as u64);
        }
    }
}

#[test]
fn we_write_and_hound_reads_the_same() {
    for format in [PcmFormat::U8, PcmFormat::S16Le, PcmFormat::S24Le, PcmFormat::S32Le, PcmFormat::F32Le] {
        for channels in [1, 2, 3, 8] {
            // An odd number of bytes for 8 and 24 bits and odd channel counts: a pad byte is due.
            let values: Vec<f64> = (0..5 * channels).map(|i| f64::from(i) / 64.0 - 0.25).collect();
            let mut data = vec![0; values.len() * format.bytes()];
            for (slot, &value) in data.chunks_exact_mut(format.bytes()).zip(&values) {
                format.encode(value, slot);
            }
            let mut file = WavFile::new(Cursor::new(Vec::new()), format, channels as u16, 44_100).unwrap();
            file.write_bytes(&data).unwrap();
            let bytes = file.finish(&[]).unwrap().into_inner();
            assert_eq!(bytes.len() % 2, 0);
            assert_eq!(read(&bytes).unwrap().1, values);
            let mut reader = hound::WavReader::new(&bytes[..]).unwrap();
            let spec = reader.spec();
            assert_eq!((i32::from(spec.channels), spec.sample_rate), (channels, 44_100));
            let got: Vec<f64> = match format {
                PcmFormat::F32Le => reader.samples::<f32>().map(|x| f64::from(x.unwrap())).collect(),
                _ => {
                    let full = 2f64.powi(8 * format.bytes() as i32 - 1);
                    reader.samples::<i32>().map(|x| f64::from(x.unwrap()) / full).collect()
                }
            };
            assert_eq!(got, values, "{format} x {channels}");
        }
    }
    assert!(WavFile::new(Cursor::new(Vec::new()), PcmFormat::S16Be, 1, 8000).is_err());
    // The frame size has 16 bits: it is refused and not cut.
    let wide = |channels| stream_header(PcmFormat::F64Le, channels, 8000).map_err(|error| error.to_string());
    assert!(wide(8191).is_ok());
    assert!(wide(8192).unwrap_err().contains("longer than a frame of WAV, 65535 bytes"));
}

#[test]
fn streamed_headers_mean_until_the_end() {
    for size in [0u32, 0x7FFF_F000, 0x7FFF_EFDC, 0x7FFF_FFFF, 0xFFFF_FFFF, 0xFFFF_FFFE, 0xFFFF_FFDB] {
        for riff_size in [0, 36, 0x7FFF_F024, 0xFFFF_FFFF] {
            let mut bytes = riff(&[chunk(b"fmt ", &fmt(1, 1, 2, 16)), chunk(b"data", &counting(50))]);
            bytes[4..8].copy_from_slice(&u32::to_le_bytes(riff_size));
            bytes[40..44].copy_from_slice(&size.to_le_bytes());
            counts(&bytes, 50);
        }
    }
    let mut streamed = stream_header(PcmFormat::S16Le, 1, 8000).unwrap();
    streamed.extend(counting(50));
    counts(&streamed, 50);
}

#[test]
fn an_empty_data_chunk_before_others_is_empty() {
    let bytes = riff(&[chunk(b"fmt ", &fmt(1, 1, 2, 16)), chunk(b"data", &[]), chunk(b"LIST", b"INFOabcd")]);
    counts(&bytes, 0);
}

/// A recorder that lost its power wrote the size of the file, and none of the data.
#[test]
fn samples_after_a_size_of_zero_are_read() {
    counts(&riff(&[chunk(b"fmt ", &fmt(1, 1, 2, 16)), chunk(b"data", &[]), counting(300)]), 300);
}

#[test]
fn chunks_before_and_after_the_samples_are_passed_over() {
    let odd = chunk(b"LIST", b"INFOx");
    let unpadded = odd[..odd.len() - 1].to_vec();
    for before in [vec![], odd, unpadded.clone(), [unpadded, chunk(b"JUNK", &[7; 1000])].concat()] {
        let chunks = [
            before.clone(),
            chunk(b"fmt ", &fmt(1, 1, 2, 16)),
            before,
            chunk(b"data", &counting(9)),
            chunk(b"LIST", b"INFOnot samples"),
        ];
        counts(&riff(&chunks), 9);
    }
}

/// In a time that grows with their number, and in bounded memory.
#[test]
fn of_very_many_chunks_the_first_are_kept() {
    let mut chunks = vec![chunk(b"LIST", b"INFO"); 400_000];
    chunks.extend([chunk(b"fmt ", &fmt(1, 1, 2, 16)), chunk(b"data", &counting(3))]);
    let (header, samples, faults) = read(&riff(&chunks)).unwrap();
    assert_eq!((header.chunks.len(), samples.len(), faults.len()), (64, 3, 0));
}

#[test]
fn format_chunks_of_all_sizes_are_read() {
    let plain = fmt(1, 1, 2, 16);
    let eighteen = [&plain[..], &[0, 0]].concat();
    // A longer one, and one that leaves the frame size to the reader.
    let long = [&extensible(1, 1, 2, 16, 99)[..], &[1, 2, 3, 4]].concat();
    let mut no_frame_size = plain.clone();
    no_frame_size[12..14].fill(0);
    let [stated, open] = [16, 0].map(|valid| extensible(1, 1, 2, 16, valid));
    for fmt in [plain, eighteen, stated, open, long, no_frame_size] {
        counts(&riff(&[chunk(b"fmt ", &fmt), chunk(b"data", &counting(20))]), 20);
    }
}

#[test]
fn fewer_bits_than_bytes_lie_high() {
    // 12 bits in 2 bytes: the number 0x123 is stored as 0x1230.
    let bytes = riff(&[chunk(b"fmt ", &fmt(1, 1, 2, 12)), chunk(b"data", &0x1230u16.to_le_bytes())]);
    assert_eq!(read(&bytes).unwrap().1, [f64::from(0x123) / 2048.0]);
    let twenty = riff(&[chunk(b"fmt ", &extensible(1, 1, 3, 24, 20)), chunk(b"data", &[0xF0, 0xFF, 0xFF])]);
    assert_eq!(read(&twenty).unwrap().1, [-1.0 / 524288.0]);
}

#[test]
fn fewer_bits_than_bytes_are_found_high_or_low() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.wav");
    for (bytes, valid) in [(4, 24), (4, 20), (4, 16), (3, 20), (2, 12), (2, 14)] {
        let full = 1i32 << (valid - 1);
        let values = [0x123, -0x123, 1, -1, full - 1, -full];
        let want: Vec<f64> = values.iter().map(|&v| f64::from(v) / f64::from(full)).collect();
        let plain = (u32::from(valid).div_ceil(8) <= bytes).then(|| fmt(1, 1, bytes as u16, valid));
        let fmts = [Some(extensible(1, 1, bytes as u16, 8 * bytes as u16, valid)), plain];
        for fmt in fmts.into_iter().flatten() {
            for shift in [0, 8 * bytes - u32::from(valid)] {
                let word = |v: &i32| (v << shift).to_le_bytes()[..bytes as usize].to_vec();
                let data: Vec<u8> = values.iter().flat_map(word).collect();
                std::fs::write(&path, riff(&[chunk(b"fmt ", &fmt), chunk(b"data", &data)])).unwrap();
                let mut reader =
                    MultiReader::start(std::slice::from_ref(&path), ReadOptions::files(), &mut |_| {})
                        .unwrap();
                let samples = OfflineSamples::read(&mut reader, 10).unwrap().channels;
                let case = format!("{valid} of {bytes} bytes, shifted by {shift}");
                assert_eq!(samples, std::slice::from_ref(&want), "{case}");
                let spans = FrameFile::open(&path).unwrap().read::<f64>(1, 9).unwrap();
                assert_eq!(spans, want[1..], "{case}");
            }
        }
    }
}

#[test]
fn rf64_and_bw64_tell_their_size_in_ds64() {
    for id in [b"RF64", b"BW64"] {
        let mut ds64 = 0u64.to_le_bytes().to_vec();
        ds64.extend(20u64.to_le_bytes());
        ds64.extend([0; 12]);
        let mut bytes = riff(&[
            chunk(b"ds64", &ds64),
            chunk(b"fmt ", &fmt(1, 1, 2, 16)),
            chunk(b"data", &counting(10)),
            chunk(b"LIST", b"after"),
        ]);
        bytes[..4].copy_from_slice(id);
        bytes[4..8].fill(0xFF);
        bytes[12 + 36 + 24 + 4..][..4].fill(0xFF);
        counts(&bytes, 10);
    }
}

#[test]
fn doubles_are_read() {
    let data: Vec<u8> = [1.0f64, -1e-300, 0.1].iter().flat_map(|x| x.to_le_bytes()).collect();
    let bytes = riff(&[chunk(b"fmt ", &fmt(3, 1, 8, 64)), chunk(b"data", &data)]);
    assert_eq!(read(&bytes).unwrap().1, [1.0, -1e-300, 0.1]);
}

#[test]
fn what_is_not_pcm_is_refused_by_name() {
    let refusal = |fmt: Vec<u8>| read(&riff(&[chunk(b"fmt ", &fmt), chunk(b"data", &[0; 64])])).unwrap_err();
    for (tag, container, bits) in
        [(6, 1, 8), (2, 1, 4), (0x55, 1, 0), (3, 2, 16), (1, 8, 64), (1, 2, 17), (1, 2, 0)]
    {
        let error = refusal(fmt(tag, 1, container, bits));
        assert!(error.to_string().starts_with("test.wav: "), "{error}");
        assert!(error.to_string().contains("samples are coded as format tag"), "{error}");
    }
    let says = |error: IoError, part: &str| assert!(error.to_string().contains(part), "{error}");
    says(refusal(fmt(1, 0, 2, 16)), "the channel count at byte 22 is 0");
    let mut no_rate = fmt(1, 1, 2, 16);
    no_rate[4..8].fill(0);
    says(refusal(no_rate), "the sample rate at byte 24 is 0");
    let mut uneven = fmt(1, 3, 2, 16);
    uneven[12] = 7;
    says(refusal(uneven), "the frame size at byte 32 is 7");
    let no_fmt = read(&riff(&[chunk(b"data", &[0; 8])])).unwrap_err();
    assert!(no_fmt.to_string().contains("fmt chunk must come before"), "{no_fmt}");
    assert!(matches!(read(b"OggS1234"), Err(IoError::NotWav { .. })));
    assert!(matches!(read(b"RIFF1234AVI "), Err(IoError::NotWav { .. })));
    says(read(&riff(&[chunk(b"fmt ", &fmt(1, 1, 2, 16))])).unwrap_err(), "no data chunk after 36 bytes");
}

#[test]
fn a_file_cut_at_any_byte_gives_what_is_whole_or_says_why_not() {
    let whole = [
        riff(&[
            chunk(b"LIST", b"INFOabc"),
            chunk(b"fmt ", &extensible(1, 3, 2, 16, 16)),
            chunk(b"data", &counting(30)),
        ]),
        riff(&[chunk(b"fmt ", &fmt(3, 1, 8, 64)), chunk(b"data", &[0; 80])]),
    ];
    for bytes in whole {
        let (header, all, _) = read(&bytes).unwrap();
        let data = header.data_offset as usize;
        for cut in 0..bytes.len() {
            match read(&bytes[..cut]) {
                Ok((_, samples, notes)) => {
                    let there = cut - data;
                    let frame = header.frame_bytes();
                    let promised = header.data_bytes.unwrap() as usize;
                    assert_eq!(samples, all[..there.min(promised) / frame * header.channels]);
                    let missing_bytes = promised.saturating_sub(there) as u64;
                    let bytes = there.min(promised) % frame;
                    let truncated = (missing_bytes > 0).then_some(InputFault::Truncated { missing_bytes });
                    let cut_frame = (bytes > 0).then_some(InputFault::CutFrame { bytes });
                    assert_eq!(notes, truncated.into_iter().chain(cut_frame).collect::<Vec<_>>());
                }
                Err(error) => {
                    let said = error.to_string();
                    let parts = ["the header ends at byte ", "no data chunk after "];
                    let offset = parts.iter().find_map(|part| Some(said.split_once(part)?.1));
                    let offset = offset.unwrap_or_else(|| panic!("cut at {cut}: {said}"));
                    let digits = offset.split(|c: char| !c.is_ascii_digit()).next().unwrap();
                    assert!(cut <= data && digits.parse::<usize>().unwrap() <= cut, "{said}");
                }
            }
        }
    }
}

/// Keeps the first 4 KiB and forgets the rest.
#[derive(Default)]
struct Head {
    bytes: Vec<u8>,
    place: u64,
}

impl Write for Head {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for (i, &byte) in bytes.iter().enumerate().take(4096usize.saturating_sub(self.place as usize)) {
            let at = self.place as usize + i;
            self.bytes.resize(self.bytes.len().max(at + 1), 0);
            self.bytes[at] = byte;
        }
        self.place += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Head {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Start(place) => self.place = place,
            _ => return Err(io::ErrorKind::Unsupported.into()),
        }
        Ok(self.place)
    }
}

/// Past four gibibytes, and of sizes with which other programs say that they know none: what follows the
/// samples would become samples.
#[test]
fn a_size_that_a_header_cannot_state_is_written_as_rf64() {
    let block = vec![1; 1 << 20];
    for (bytes, id) in [
        (1 << 20, b"RIFF"),
        (4095 << 20, b"RIFF"),
        (4096 << 20, b"RF64"),
        (5000 << 20, b"RF64"),
        (0x7FFF_0000_u64, b"RIFF"),
        (0x7FFF_EFF8, b"RF64"),
        (0x7FFF_FF00, b"RF64"),
    ] {
        let mut file = WavFile::new(Head::default(), PcmFormat::F32Le, 2, 8000).unwrap();
        (0..bytes >> 20).for_each(|_| file.write_bytes(&block).unwrap());
        file.write_bytes(&block[..(bytes % (1 << 20)) as usize]).unwrap();
        let head = file.finish(&[]).unwrap().bytes;
        assert_eq!(&head[..4], id);
        let reader = WavReader::new(&head[..], "head").unwrap();
        let header = reader.header();
        assert_eq!((header.data_bytes, header.channels, header.rate), (Some(bytes), 2, 8000));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn no_bytes_make_the_reader_panic(
        mut bytes in prop::collection::vec(any::<u8>(), 0..300), kind in 0usize..3,
        flips in prop::collection::vec((0usize..80, any::<u8>()), 0..4),
    ) {
        let start = match kind {
            0 => vec![],
            1 => riff(&[chunk(b"fmt ", &fmt(1, 2, 2, 16)), chunk(b"data", &counting(10))]),
            _ => riff(&[chunk(b"ds64", &[9; 28]), chunk(b"fmt ", &extensible(1, 2, 4, 32, 24)), chunk(b"data", &counting(10))]),
        };
        let length = start.len().min(bytes.len());
        bytes[..length].copy_from_slice(&start[..length]);
        for (place, value) in flips {
            if let Some(byte) = bytes.get_mut(place) {
                *byte = value;
            }
        }
        let _ = read(&bytes);
    }
}
