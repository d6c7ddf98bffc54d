//! Files that SciPy wrote (`tools/mat_fixtures.py`), and what is wrong with others.

use super::*;
use crate::io::StreamHeader;

fn bytes(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/mat");
    std::fs::read(folder.join(name).with_extension("mat")).unwrap()
}

fn read(bytes: &[u8], wanted: Option<&str>) -> Result<(StreamHeader, Vec<f64>), String> {
    let mut reader = open_mat(&mut Cursor::new(bytes), wanted, "x.mat").map_err(|error| error.to_string())?;
    let header = reader.header();
    let mut frames = Vec::new();
    reader.read_to_end(&mut frames).unwrap();
    assert_eq!(frames.len() as u64, header.frame_bytes() as u64 * header.promised.unwrap());
    let format = header.layout.format;
    Ok((header, frames.chunks_exact(format.bytes()).map(|number| format.decode(number)).collect()))
}

/// Sample k of channel c.
fn formula(k: usize, c: usize) -> f64 {
    ((7 * k + 3 * c) % 11) as f64 / 8.0 - 0.625
}

#[test]
fn arrays_of_every_class_are_interleaved_frames() {
    let both: Vec<f64> = (0..40).flat_map(|k| [formula(k, 0), formula(k, 1)]).collect();
    let scaled = |bits: i32| both.iter().map(|x| x * 8.0 / f64::powi(2.0, bits - 1)).collect::<Vec<_>>();
    let first: Vec<f64> = (0..40).map(|k| formula(k, 0)).collect();
    for (name, format, channels, rate, want) in [
        ("double", PcmFormat::F64Le, 2, None, both.clone()),
        ("compressed", PcmFormat::F64Le, 2, Some(24e3), both.clone()),
        ("single", PcmFormat::F32Le, 1, None, first.clone()),
        ("int16", PcmFormat::S16Le, 2, None, scaled(16)),
        ("int8", PcmFormat::S8, 2, None, scaled(8)),
        ("stored", PcmFormat::F64Le, 2, None, both.iter().map(|x| 8.0 * x).collect()),
    ] {
        let (header, samples) = read(&bytes(name), None).unwrap();
        assert_eq!((header.layout.format, header.channels, header.rate), (format, channels, rate), "{name}");
        assert!(!header.is_complex && samples == want, "{name}: {samples:?}");
    }
    // Both parts of complex samples.
    let (header, samples) = read(&bytes("complex"), Some("z")).unwrap();
    assert!(header.is_complex && header.channels == 1 && samples == both);
}

#[test]
fn a_variable_is_chosen_by_its_name() {
    let right: Vec<f64> = (0..40).map(|k| formula(k, 1)).collect();
    assert_eq!(read(&bytes("several"), Some("right")).unwrap().1, right);
    let refused = |wanted| read(&bytes("several"), wanted).unwrap_err();
    let several = refused(None);
    assert!(several.contains("left (1 x 40, double), right (1 x 40, double)"), "{several}");
    assert!(several.contains("choose one, as x.mat:left"), "{several}");
    for (wanted, part) in [
        ("lost", "no variable lost; it holds left"),
        ("note", "variable note: it is text; save double"),
        ("cells", "variable cells: it is a cell array"),
        ("u", "variable u: it is uint64"),
    ] {
        let message = refused(Some(wanted));
        assert!(message.starts_with("x.mat: not a MATLAB file") && message.contains(part), "{message}");
    }
    let sparse = read(&bytes("sparse"), None).unwrap_err();
    let parts = ["s (2 x 40, a sparse matrix)", "save one as double"];
    assert!(parts.iter().all(|part| sparse.contains(part)), "{sparse}");
}

#[test]
fn names_hold_file_and_variable() {
    let named = |text: &'static str| mat_variable(Path::new(text));
    assert_eq!(named("a/x.mat"), Some(("a/x.mat".into(), None)));
    assert_eq!(named("C:/x.MAT:left"), Some(("C:/x.MAT".into(), Some("left"))));
    for other in ["x.wav", "x.wav:mat", "mat", "x.mat.wav", "-"] {
        assert_eq!(named(other), None, "{other}");
    }
}

#[test]
fn other_files_are_named_for_what_they_are() {
    let refused = |bytes: &[u8]| read(bytes, None).unwrap_err();
    let mut newer = bytes("double");
    newer[..10].copy_from_slice(b"MATLAB 7.3");
    let mut swapped = bytes("double");
    swapped[124..128].copy_from_slice(b"\x01\x00MI");
    let version = "its header is not that of versions 5 to 7.2";
    for (bytes, part) in [
        (swapped, version),
        (newer, "(7.3 is HDF5); save it in MATLAB with save("),
        (b"RIFF".to_vec(), version),
        (vec![b'x'; 200], version),
        (bytes("double")[..200].to_vec(), "copy it again"),
        (bytes("compressed")[..180].to_vec(), "copy it again"),
    ] {
        let message = refused(&bytes);
        assert!(message.starts_with("x.mat: not a MATLAB file") && message.contains(part), "{message}");
    }
    // A shape that the numbers do not fill.
    let mut forged = bytes("double");
    let place = forged.windows(8).position(|w| w == [2, 0, 0, 0, 40, 0, 0, 0]).unwrap();
    forged[place + 6] = 0x7F;
    let message = refused(&forged);
    assert!(message.contains("its shape needs 16646224 numbers, but there are 80"), "{message}");
}
