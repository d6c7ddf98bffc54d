//! Maps of numbers as other programs write them: OpenEXR, TIFF with floats or wide integers, NumPy arrays.

use super::Image;
use super::source::Source;
use crate::files::InputError;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, read};
use hybank_core::npy::{self, NpyHeader};
use std::io::Cursor;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

type Decoded = Result<Image, InputError>;

/// Names of the channel with the depth among those of an OpenEXR file.
const DEPTHS: [&str; 5] = ["Z", "depth", "Depth", "depth.Z", "Depth.Z"];

pub(super) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(npy::MAGIC)
}

fn is_tiff(bytes: &[u8]) -> bool {
    bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*")
}

/// An OpenEXR file: the channel with the depth, the only channel, or red, green and blue.
pub(super) fn exr(file: &Source<'_>) -> Decoded {
    let wrong = |e: exr::error::Error| file.wrong(e.to_string());
    let head = MetaData::read_from_buffered(Cursor::new(file.bytes), false).map_err(wrong)?;
    let mut sizes = head.headers.iter().map(|header| header.layer_size);
    sizes.try_for_each(|size| file.check_size(size.0, size.1))?;
    let layers = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let layer = layers.all_attributes().from_buffered(Cursor::new(file.bytes)).map_err(wrong)?.layer_data;
    let all = &layer.channel_data.list;
    let named = |name: &str| all.iter().find(|channel| channel.name.eq(name));
    let depth = DEPTHS.iter().find_map(|name| named(name)).or(all.first().filter(|_| all.len() == 1));
    let chosen = match (depth, ["R", "G", "B"].map(named)) {
        (Some(depth), _) => vec![depth],
        (None, [Some(red), Some(green), Some(blue)]) => vec![red, green, blue],
        _ => {
            let names: Vec<String> = all.iter().map(|channel| channel.name.to_string()).collect();
            return Err(file.wrong(format!(
                "the channels are {}; one named Z, a single channel, or R, G and B are read",
                names.join(", ")
            )));
        }
    };
    let size = (layer.size.0, layer.size.1);
    let values: Vec<Vec<f32>> = chosen.iter().map(|c| c.sample_data.values_as_f32().collect()).collect();
    if values.iter().any(|values| values.len() != size.0 * size.1) {
        return Err(file.wrong("a channel has fewer samples than the layer has pixels".into()));
    }
    let data = (0..size.0 * size.1).flat_map(|p| values.iter().map(move |channel| channel[p])).collect();
    Ok(Image::from_values(size, chosen.len(), data))
}

/// A TIFF file with numbers that no other image has: floats, or integers of 32 bits. `None` of another
/// file.
pub(super) fn tiff(file: &Source<'_>) -> Result<Option<Image>, InputError> {
    if !is_tiff(file.bytes) {
        return Ok(None);
    }
    let wrong = |e: tiff::TiffError| file.wrong(e.to_string());
    let mut decoder = Decoder::new(Cursor::new(file.bytes)).map_err(wrong)?;
    let (width, height) = decoder.dimensions().map_err(wrong)?;
    let size = (width as usize, height as usize);
    let channels = match decoder.colortype().map_err(wrong)? {
        ColorType::Gray(16..) => 1,
        ColorType::RGB(16..) => 3,
        _ => return Ok(None),
    };
    file.check_size(size.0, size.1)?;
    // As many bytes as so many pixels take at most.
    let mut limits = Limits::default();
    limits.decoding_buffer_size = size.0 * size.1 * channels * 8;
    limits.intermediate_buffer_size = limits.intermediate_buffer_size.max(limits.decoding_buffer_size);
    let mut decoder = decoder.with_limits(limits);
    let data: Vec<f32> = match decoder.read_image().map_err(wrong)? {
        DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::U32(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I32(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I16(values) => values.into_iter().map(f32::from).collect(),
        _ => return Ok(None),
    };
    match data.len() == size.0 * size.1 * channels {
        true => Ok(Some(Image::from_values(size, channels, data))),
        false => Err(file.wrong(format!("it has {} values for {width} x {height} pixels", data.len()))),
    }
}

/// A NumPy array of rows and columns, of any real numbers; dimensions of one are left out.
pub(super) fn npy(file: &Source<'_>) -> Decoded {
    let header = NpyHeader::read(&mut { file.bytes }).map_err(|error| file.wrong(error.to_string()))?;
    let (width, height) = columns_and_rows(&header.shape).ok_or_else(|| {
        file.wrong(format!("the array has the shape {:?}; a map has rows and columns", header.shape))
    })?;
    file.check_size(width, height)?;
    let numbers = numbers(&header.descr, &file.bytes[header.offset as usize..])
        .ok_or_else(|| file.wrong(format!("numbers of the type {} are not read", header.descr)))?;
    if numbers.is_empty() || numbers.len() != width * height {
        return Err(file.wrong(format!("it has {} values for {width} x {height} pixels", numbers.len())));
    }
    let place = |p: usize| if header.is_column_major { p % width * height + p / width } else { p };
    Ok(Image::from_values((width, height), 1, (0..numbers.len()).map(|p| numbers[place(p)]).collect()))
}

/// Of two axes, or of the two that are longer than one.
fn columns_and_rows(shape: &[u64]) -> Option<(usize, usize)> {
    let sides: Vec<u64> = shape.iter().copied().filter(|side| *side != 1).collect();
    let [height, width] = *<&[u64; 2]>::try_from(&sides[..]).or_else(|_| shape.try_into()).ok()?;
    Some((usize::try_from(width).ok()?, usize::try_from(height).ok()?))
}

/// The numbers of the type `descr`, of NumPy.
fn numbers(descr: &str, bytes: &[u8]) -> Option<Vec<f32>> {
    let kind = descr.trim_start_matches(['<', '>', '|']);
    let size = kind.get(1..)?.parse().ok().filter(|size| (1..=8).contains(size))?;
    let little_endian = |number: &[u8]| match descr.starts_with('>') {
        true => number.iter().rev().copied().collect(),
        false => number.to_vec(),
    };
    bytes.chunks_exact(size).map(|bytes| number(kind, &little_endian(bytes))).collect()
}

fn number(kind: &str, bytes: &[u8]) -> Option<f32> {
    Some(match kind {
        "f4" => f32::from_le_bytes(bytes.try_into().ok()?),
        "f8" => f64::from_le_bytes(bytes.try_into().ok()?) as f32,
        "u1" => f32::from(*bytes.first()?),
        "u2" => f32::from(u16::from_le_bytes(bytes.try_into().ok()?)),
        "i2" => f32::from(i16::from_le_bytes(bytes.try_into().ok()?)),
        "u4" => u32::from_le_bytes(bytes.try_into().ok()?) as f32,
        "i4" => i32::from_le_bytes(bytes.try_into().ok()?) as f32,
        "i8" => i64::from_le_bytes(bytes.try_into().ok()?) as f32,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use crate::image::{MOST_PIXELS, read_image, read_map};
    use exr::prelude::{WritableImage, *};
    use std::path::Path;

    const VALUES: [f32; 6] = [1.5, -2.0, 0.25, 1e6, f32::INFINITY, 7.0];

    fn write_exr(path: &Path, names: &[&str]) {
        let channel = |name: &&str| {
            let sign = if *name == "Z" || *name == "Y" { 1.0 } else { -1.0 };
            let values = VALUES.map(|v| sign * v).to_vec();
            AnyChannel::new(*name, FlatSamples::F32(values))
        };
        let channels = AnyChannels::sort(names.iter().map(channel).collect());
        let layer = Layer::new((3, 2), LayerAttributes::named("l"), Encoding::FAST_LOSSLESS, channels);
        Image::from_layer(layer).write().to_file(path).unwrap();
    }

    /// An array as NumPy writes it.
    fn write_npy(path: &Path, shape: &str, fortran_order: &str, descr: &str, numbers: &[u8]) {
        let header =
            format!("{{'descr': '{descr}', 'fortran_order': {fortran_order}, 'shape': {shape}, }}\n");
        let length = u16::try_from(header.len()).unwrap().to_le_bytes();
        std::fs::write(path, [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), numbers].concat())
            .unwrap();
    }

    fn floats(values: [f32; 6]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    #[test]
    fn every_format_gives_the_same_map() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let is_read = |name: &str| {
            assert_eq!(read_map(&at(name), MOST_PIXELS).unwrap(), (3, 2, VALUES.to_vec()), "{name}");
        };
        for names in [&["Z", "R", "G"][..], &["Y"]] {
            write_exr(&at("a.exr"), names);
            is_read("a.exr");
        }
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
        encoder.write_image::<tiff::encoder::colortype::Gray32Float>(3, 2, &VALUES).unwrap();
        std::fs::write(at("a.tiff"), bytes.into_inner()).unwrap();
        is_read("a.tiff");
        write_npy(&at("a.npy"), "(2, 3)", "False", "<f4", &floats(VALUES));
        is_read("a.npy");
        write_npy(&at("a.npy"), "(1, 2, 3, 1)", "False", "<f4", &floats(VALUES));
        is_read("a.npy");
        let [a, b, c, d, e, f] = VALUES;
        write_npy(&at("a.npy"), "(2, 3)", "True", "<f4", &floats([a, d, b, e, c, f]));
        is_read("a.npy");
    }

    /// The bytes of -2 or 254, and of 258, as each type of NumPy stores them.
    #[test]
    fn every_type_of_numbers_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let [doubles, big] =
            [[-2.0_f64, 258.0].map(f64::to_le_bytes), [-2.0_f64, 258.0].map(f64::to_be_bytes)];
        for (descr, bytes, want) in [
            ("<f8", doubles.concat(), [-2.0, 258.0]),
            (">f8", big.concat(), [-2.0, 258.0]),
            ("|u1", vec![254, 2], [254.0, 2.0]),
            ("<u2", vec![254, 255, 2, 1], [65534.0, 258.0]),
            (">i2", vec![255, 254, 1, 2], [-2.0, 258.0]),
            ("<u4", vec![254, 0, 0, 0, 2, 1, 0, 0], [254.0, 258.0]),
            (">i4", vec![255, 255, 255, 254, 0, 0, 1, 2], [-2.0, 258.0]),
            ("<i8", [-2_i64, 258].map(i64::to_le_bytes).concat(), [-2.0, 258.0]),
        ] {
            write_npy(&path, "(1, 2)", "False", descr, &bytes);
            assert_eq!(read_map(&path, MOST_PIXELS).unwrap(), (2, 1, want.to_vec()), "{descr}");
        }
        for descr in ["<c8", "|S3", "<f99", "<é"] {
            write_npy(&path, "(1, 2)", "False", descr, &[0; 16]);
            let message = read_map(&path, MOST_PIXELS).unwrap_err().to_string();
            assert!(message.contains("are not read"), "{message}");
        }
    }

    #[test]
    fn colours_of_floats_are_photographs() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_exr(&path, &["R", "G", "B"]);
        let image = read_image(&path, MOST_PIXELS).unwrap();
        assert_eq!((image.channels(), image.data()[3]), (3, 2.0 * 255.0));
    }

    #[test]
    fn what_is_no_map_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let message = |name: &str| read_map(&at(name), MOST_PIXELS).unwrap_err().to_string();
        write_exr(&at("a.exr"), &["U", "V"]);
        assert!(message("a.exr").contains("the channels are U, V"), "{}", message("a.exr"));
        write_npy(&at("a.npy"), "(6,)", "False", "<f4", &floats(VALUES));
        assert!(message("a.npy").contains("shape [6]"), "{}", message("a.npy"));
        for (name, start) in
            [("b.exr", &[0x76, 0x2f, 0x31, 0x01][..]), ("b.npy", b"\x93NUMPY\x01"), ("b.tif", b"II*\0")]
        {
            std::fs::write(at(name), start).unwrap();
            assert!(message(name).contains(name), "{}", message(name));
        }
    }
}
