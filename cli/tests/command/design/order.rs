//! Order reduction, by `order`, `reduction_loss_db` and their flags.

use crate::support::{Desk, THESIS, number};

#[test]
fn the_order_is_reduced_reported_and_proven() {
    let desk = Desk::with_spec(THESIS);
    let iir = THESIS
        .replace("latency = 10", "latency = 4")
        .replace("method = \"fir\"\ntaps = 22", "method = \"iir\"");
    desk.write("iir.toml", &iir);
    let report = desk.json(&["design", "--prove", "iir.toml", "-o", "two.json", "--order", "2", "--json"]);
    assert_eq!((&report["states"], &report["reduction"]["reduced"]["order"]), (&2.into(), &2.into()));
    let (full, order) =
        (number(&report, "/reduction/full/order"), number(&report, "/reduction/reduced/order"));
    assert_eq!(report["reduction"]["orders"].as_array().unwrap().len() as f64, full + 1.0);
    let ratio = number(&report, "/gamma/upper") / number(&report, "/reduction/full/gamma");
    let loss = number(&report, "/reduction/reduced/loss_db");
    assert!(order < full && (20.0 * ratio.log10() - loss).abs() < 1e-6, "{report}");
    assert!(number(&report, "/proven/upper") >= number(&report, "/gamma/upper"), "{report}");
    let proof = desk.json(&["verify", "two.json", "--json"]);
    assert!((number(&proof, "/upper") / number(&report, "/gamma/upper") - 1.0).abs() < 1e-5, "{proof}");
    let bank = desk.read_json("two.json");
    assert_eq!(bank["spec"]["design"]["order"], 2);

    // In the file, the loss; on the command line, something else in its place.
    desk.write("loss.toml", format!("{iir}reduction_loss_db = 6\n"));
    let text = desk.good(&["design", "loss.toml", "-o", "loss.json", "--verbose"]);
    assert!(text.contains("dB of gamma lost") && text.contains("states          gamma"), "{text}");
    let report = desk.json(&["design", "loss.toml", "-o", "one.json", "--order", "1", "--json"]);
    assert_eq!(report["states"], 1);
    // A method without states drops it with the method that it belongs to.
    desk.good(&["design", "loss.toml", "-o", "fir.json", "--method", "fir", "--taps", "8"]);
}
