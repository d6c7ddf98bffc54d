//! Readers that die, time-interleaved converters, and bounds of what may be lost.

use super::super::block::Block;
use super::super::frames::Message;
use super::*;
use crate::io::table::TableOptions;
use crate::io::{Coding, InputFault, OfflineSamples, PcmFormat, SampleLayout, StatedScale, TimeInterleaving};
use crossbeam_channel::Sender;

fn raw(channels: usize) -> ReadOptions<'static> {
    ReadOptions { coding: Coding::Raw(PcmFormat::S8), channels, ..ReadOptions::files() }
}

/// A reader of one input whose thread does `send_all`.
fn reader(
    send_all: impl FnOnce(Sender<Result<Message, IoError>>, Receiver<Block>) + Send + 'static,
) -> MultiReader {
    let header = InputSource {
        path: "x".into(),
        coding: raw(1).coding,
        channels: 1,
        interleaving: None,
        per_frame: 1,
        only: None,
        is_iq: false,
        scale: StatedScale::default(),
        table: Default::default(),
        block: 4,
    }
    .raw_header();
    let input = Input::on_thread_of("dying".into(), header, 1, send_all).unwrap();
    let (stop, until) = (crossbeam_channel::never(), Until::Shortest);
    let inputs = vec![input];
    MultiReader { inputs, stop, until, max_lost: 0, origin: 0, ready: 0, consumed: 0 }
}

#[test]
fn options_of_tables_are_refused_without_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["x.raw", "x.csv"].map(|name| folder.path().join(name));
    paths.iter().for_each(|path| std::fs::write(path, "0.5\n0.5\n").unwrap());
    let table = TableOptions { skip_lines: 1, ..TableOptions::default() };
    let read = |paths: &[PathBuf]| {
        let options = ReadOptions { table: table.clone(), ..raw(1) };
        MultiReader::start(paths, options, &mut |_| {}).map(|reader| reader.channels())
    };
    let refused = read(&paths[..1]).unwrap_err().to_string();
    assert!(refused.contains("x.raw: it is no table"), "{refused}");
    assert_eq!(read(&paths).unwrap(), 2);
}

#[test]
fn a_reader_that_dies_is_an_error_and_not_the_end_of_its_input() {
    let mut reader = reader(|messages, _| {
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::S8), 1);
        messages.send(Ok(Message::Frames(Block::missing(&header, 3)))).unwrap();
        // As when it panics: the channel closes without an end.
    });
    assert_eq!(reader.wait(&mut |_| {}).unwrap(), Arrival::Frames(3));
    reader.consume(3);
    let error = reader.wait(&mut |_| {}).unwrap_err();
    assert!(error.to_string().starts_with("dying: its reader ended before it did;"), "{error}");
}

#[test]
fn a_panic_in_a_reader_is_an_error_too() {
    let mut reader = reader(|_messages, _| panic!("a reader that panics, for this test"));
    let error = reader.wait(&mut |_| {}).unwrap_err();
    assert!(error.to_string().contains("its reader ended before it did;"), "{error}");
}

#[test]
fn an_input_that_ends_is_no_error() {
    let mut reader =
        reader(|messages, _| messages.send(Ok(Message::End { faults: vec![], chunks: vec![] })).unwrap());
    assert_eq!(reader.wait(&mut |_| {}).unwrap(), Arrival::End);
}

#[test]
fn time_interleaved_converters_are_the_channels_of_one_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.raw");
    // Four frames of three converters, and two samples of a fifth.
    std::fs::write(&path, (0u8..14).collect::<Vec<_>>()).unwrap();
    let interleaving = TimeInterleaving::by_delay(&[0.0, 2.0, 1.0]);
    let options = ReadOptions { interleaving: Some(&interleaving), ..raw(1) };
    let mut reader = MultiReader::start(&[path], options, &mut |_| {}).unwrap();
    assert_eq!(reader.channels(), 3);
    let all = OfflineSamples::read(&mut reader, 10).unwrap().channels;
    let codes: Vec<Vec<f64>> =
        all.into_iter().map(|all| all.into_iter().map(|x| x * 128.0).collect()).collect();
    assert_eq!(codes, [[2.0, 5.0, 8.0, 11.0], [0.0, 3.0, 6.0, 9.0], [1.0, 4.0, 7.0, 10.0]]);
    let faults: Vec<_> = reader.warnings().into_iter().map(|warning| warning.fault).collect();
    assert_eq!(faults, [InputFault::CutFrame { bytes: 2 }]);
}

#[test]
fn more_lost_samples_than_allowed_are_refused_with_the_bound() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.raw");
    std::fs::write(&path, [0; 8]).unwrap();
    let lines = r#"{"sample_start": 0, "global_index": 0}
        {"sample_start": 1, "global_index": 41}
        {"sample_start": 2, "global_index": 82}"#;
    let lost = LostSamples::parse(lines, "lost").unwrap();
    let start = |max_lost| {
        let options = ReadOptions { lost: Some(&lost), max_lost, ..raw(1) };
        MultiReader::start(std::slice::from_ref(&path), options, &mut |_| {})
    };
    assert!(start(80).is_ok());
    let error = start(79).err().unwrap().to_string();
    assert!(error.contains("80 frames were lost in all, more than 79"), "{error}");
    assert!(error.contains("allow 80"), "{error}");
}
