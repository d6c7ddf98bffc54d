//! The same bits however a stream is cut.

use crate::support::random::Random;
use crate::support::{Desk, bytes, frames};
use std::io::{Read, Write};

/// Lengths that add up to `total`, short and long ones, with zeros among them.
fn pieces(random: &mut Random, total: usize) -> Vec<usize> {
    let mut pieces = Vec::new();
    let mut left = total;
    while left > 0 {
        let longest = random.of(&[1, 3, 40, total]);
        let piece = random.count(0, longest).min(left);
        pieces.push(piece);
        left -= piece;
    }
    pieces
}

#[test]
fn pipes_that_drip_give_the_same_bytes() {
    let desk = Desk::new();
    let input = bytes(&frames(700));
    let whole = desk.run(&["stream", "bank.json"], &input).stdout;
    let mut cuts = Random(3);
    for turn in 0..30 {
        let mut child = desk.spawn(&["stream", "bank.json"]);
        let mut stdin = child.stdin.take().unwrap();
        let (pieces, input) = (pieces(&mut cuts, input.len()), input.clone());
        let feeder = std::thread::spawn(move || {
            let mut rest = &input[..];
            for piece in pieces {
                let (now, after) = rest.split_at(piece);
                stdin.write_all(now).unwrap();
                rest = after;
            }
        });
        let mut out = Vec::new();
        child.stdout.take().unwrap().read_to_end(&mut out).unwrap();
        feeder.join().unwrap();
        assert!(child.wait().unwrap().success());
        assert!(out == whole, "turn {turn}");
    }
}
