//! Captures as tables that instruments and loggers wrote. As a user runs it.

use crate::support::{Desk, channel, frames, fused, interleaved, wav, words};

/// The two channels of a capture.
fn channels(count: usize) -> (Vec<f32>, Vec<f32>) {
    // Few digits, so that the text holds them all.
    let both: Vec<f32> = frames(count).iter().map(|x| (x * 64.0).round() / 1024.0).collect();
    (channel(&both, 0), channel(&both, 1))
}

/// A table with one line per frame.
fn table(head: &str, samples: &[f32], line: impl Fn(usize, f32) -> String) -> String {
    samples.iter().enumerate().fold(head.to_owned(), |table, (k, x)| table + &line(k, *x) + "\n")
}

#[test]
fn files_of_an_oscilloscope_are_fused() {
    let desk = Desk::new();
    let (a, b) = channels(300);
    let both =
        table("x-axis,1,2\nsecond,Volt,Volt\n", &a, |k, x| format!("{:.6e},{x},{}", k as f64 * 1e-6, b[k]));
    desk.write("scope.csv", both);
    let rigol = |samples: &[f32]| {
        let head = "X,CH1,Start,Increment,\nSequence,Volt,-2.0e-04,1.000000e-06\n";
        table(head, samples, |k, x| format!("{k},{x:e},"))
    };
    desk.write("a.csv", rigol(&a));
    desk.write("b.csv", rigol(&b));
    let german = table("Zeit;A;B\n(ms);(V);(V)\n\n", &a, |_, x| format!("0;{x};0"));
    desk.write("german.csv", german.replace('.', ","));
    for inputs in [&["scope.csv"][..], &["a.csv", "b.csv"]] {
        let fuse = words("fuse bank.json -o out.wav --keep-latency --force");
        let said = desk.good(&[&fuse[..], inputs].concat());
        assert!(wav::samples(&desk, "out.wav") == fused(&interleaved(&a, &b)), "{inputs:?}");
        assert!(said.contains("2 MS/s"), "{inputs:?}: {said}");
    }
    let named = words("fuse bank.json german.csv --columns A,B --time-column none -o named.wav");
    desk.good(&named);
}

#[test]
fn times_are_judged_to_the_last_line() {
    let desk = Desk::new();
    let (a, b) = channels(3000);
    let step = 1.0 / 24e3;
    let line = |k: usize, x: f32| format!("{:.6},{x},{}", k as f64 * step, b[k]);
    let whole = table("time,a,b\n", &a, line);
    let without = |lost: usize| -> String {
        let lines = whole.lines().enumerate().filter(|(k, _)| *k != lost);
        lines.fold(String::new(), |table, (_, line)| table + line + "\n")
    };
    desk.write("lost.csv", without(2901));
    desk.write("late.csv", whole.clone() + "0.125010,0,0\n");
    desk.write("back.csv", whole.clone() + "0.001000,0,0\n");
    let fuse = ["fuse", "bank.json", "-o", "out.wav", "--force"];
    let report = desk.report(&[&fuse[..4], &["lost.csv"]].concat());
    assert_eq!(report["samples"], 6000);
    assert!(report["warnings"].to_string().contains("its times leave out 1 line"), "{report}");
    let uneven = ["line 3002", "not evenly spaced", "hybank merge"];
    desk.refused(1, &[&fuse[..], &["late.csv"]].concat(), &uneven);
    desk.refused(1, &[&fuse[..], &["back.csv"]].concat(), &["line 3002", "before that of the line before"]);
    // Times without the digits that show their step.
    desk.write("coarse.csv", table("time,a\n", &a, |k, x| format!("{:.3},{x}", k as f64 * step)));
    desk.refused(1, &["measure", "coarse.csv"], &["last digit of its time is 1 ms", "41.6"]);
    // The signal has several lines, which measure names; of the times it says nothing.
    let report = desk.report(&["measure", "coarse.csv", "--rate", "24kHz"]);
    assert!(!report["warnings"].to_string().contains("time"), "{report}");
}
