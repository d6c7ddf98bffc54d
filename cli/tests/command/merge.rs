//! Recordings of one event become one.

use crate::support::Desk;

/// One even recording as a table of stamped lines, with a few lines missing.
fn logger() -> String {
    let value = |k: u32| (0.37 * f64::from(k)).sin() + 0.5 * (0.11 * f64::from(k)).cos();
    let line = |k: u32| format!("{:.6},{:.9}\n", f64::from(k) / 1000.0, value(k));
    let lines = (0..4000).filter(|k| !(1700..1720).contains(k)).map(line);
    "time (s),x\n".to_owned() + &lines.collect::<String>()
}

#[test]
fn a_table_with_missing_lines_becomes_even() {
    let desk = Desk::empty();
    desk.write("logger.csv", logger());
    let report = desk.json(&["merge", "logger.csv", "-o", "even.csv", "--rate", "1kHz", "--json"]);
    assert_eq!((report["samples"].as_u64(), report["rate"].as_f64()), (Some(4000), Some(1000.0)));
    let text = String::from_utf8(desk.read("even.csv")).unwrap();
    let rows: Vec<[f64; 2]> = text
        .lines()
        .skip(1)
        .map(|line| {
            let (time, value) = line.split_once(',').unwrap();
            [time.parse().unwrap(), value.parse().unwrap()]
        })
        .collect();
    for &[time, value] in rows[100..1650].iter().chain(&rows[1800..3900]) {
        let k = 1000.0 * time;
        let truth = (0.37 * k).sin() + 0.5 * (0.11 * k).cos();
        assert!((value - truth).abs() < 1e-3, "{time}: {value} {truth}");
    }
    desk.refused(1, &["merge", "logger.csv", "-o", "even.csv"], &["even.csv", "--force"]);
}

#[test]
fn what_cannot_be_merged_is_refused() {
    let desk = Desk::empty();
    desk.write("logger.csv", logger());
    desk.write("back.csv", "t,x\n0,1\n1,2\n0.5,3\n");
    desk.write("plain.csv", "0.1\n0.2\n0.3\n");
    desk.refused(1, &["merge", "back.csv", "-o", "x.wav"], &["line 4", "sort the lines"]);
    let parts = ["plain.csv", "states no rate", "column of time"];
    desk.refused(1, &["merge", "plain.csv", "-o", "x.wav"], &parts);
    desk.refused(1, &["merge", "logger.csv", "-o", "x.wav", "--rate", "1GHz"], &["at most"]);
    desk.refused(2, &["merge", "logger.csv", "-o", "-", "--json"], &["--json"]);
    desk.refused(2, &["merge", "-o", "x.wav"], &["RECORDINGS"]);
}
