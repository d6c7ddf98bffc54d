//! Memory does not grow with the recording: sparse files through fuse and stream, into a pipe.
//!
//! The ordinary suite takes 72 MiB. With HYBANK_SLOW=1 it is 10 GiB, which takes a minute and no
//! disk.

use crate::support::Desk;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::process::Child;

/// More than this at any time is a failure, KiB.
const MOST_RESIDENT: u64 = 64 << 10;

fn recording_bytes() -> u64 {
    if trials::is_slow("recordings of 10 GiB") { 10 << 30 } else { 72 << 20 }
}

/// A file of `bytes` zeros after `header`, which takes no room on the disk.
fn sparse(desk: &Desk, name: &str, header: &[u8], bytes: u64) {
    let mut file = File::create(desk.path(name)).unwrap();
    file.write_all(header).unwrap();
    file.set_len(header.len() as u64 + bytes).unwrap();
}

/// RF64 with two channels of 16 bits.
fn rf64_header(data: u64) -> Vec<u8> {
    let mut header = b"RF64\xFF\xFF\xFF\xFFWAVEds64\x1C\0\0\0".to_vec();
    [data + 72, data, data / 4].iter().for_each(|size| header.extend(size.to_le_bytes()));
    header.extend([0; 4]);
    header.extend(b"fmt \x10\0\0\0\x01\0\x02\0");
    [24_000u32, 96_000].iter().for_each(|rate| header.extend(rate.to_le_bytes()));
    header.extend(b"\x04\0\x10\0data\xFF\xFF\xFF\xFF");
    header
}

/// Reads the output to its end; gives its length and the most memory that the process had, in KiB.
fn drain(child: &mut Child, expected: u64) -> (u64, u64) {
    let mut stdout = child.stdout.take().unwrap();
    let mut block = vec![0; 1 << 20];
    let (mut total, mut resident) = (0, 0);
    loop {
        let count = stdout.read(&mut block).unwrap();
        if count == 0 {
            return (total, resident);
        }
        assert!(block[..count].iter().all(|&byte| byte == 0) || total < 4096);
        total += count as u64;
        // The last look is when all but the last pipeful is out, so that the process is still there.
        if total * 16 / expected > (total - count as u64) * 16 / expected || resident == 0 {
            resident = peak_resident(child.id()).unwrap_or(resident);
        }
    }
}

fn peak_resident(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse().ok()
}

fn runs_in_bounded_memory(desk: &Desk, args: &[&str], expected: u64) {
    let mut child = desk.spawn(args);
    drop(child.stdin.take());
    let (total, resident) = drain(&mut child, expected);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    println!("{args:?}: {total} bytes out, {resident} KiB resident at most");
    // A WAV header may come on top.
    assert!((expected..expected + 100).contains(&total), "{total} of {expected} bytes");
    assert!(resident > 0 && resident < MOST_RESIDENT, "{resident} KiB");
}

#[test]
fn long_recordings_run_in_bounded_memory() {
    let desk = Desk::with_model();
    let bytes = recording_bytes();
    sparse(&desk, "long.wav", &rf64_header(bytes), bytes);
    sparse(&desk, "long.raw", &[], bytes);
    sparse(&desk, "half.raw", &[], bytes / 2);
    runs_in_bounded_memory(&desk, &["fuse", "bank.json", "long.wav", "-o", "-", "--bits", "16"], bytes);
    let stream = ["stream", "bank.json", "--format", "s16le"];
    runs_in_bounded_memory(&desk, &[&stream[..], &["--input", "long.raw"]].concat(), bytes);
    let apart = ["--input", "half.raw", "--input", "half.raw", "--gaps"];
    runs_in_bounded_memory(&desk, &[&stream[..], &apart].concat(), bytes);
    let float = ["stream", "bank.json", "--input", "long.raw", "--gaps"];
    runs_in_bounded_memory(&desk, &float, bytes);
}
