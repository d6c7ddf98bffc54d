//! The choice of views on the command line.

use super::*;

/// Six views of the synthetic scene at uneven distances with their disparities, and the scene of some of
/// them; the virtual view is `middle.png`.
fn row_of_views(dir: &Path, which: &[usize], target: &str) -> String {
    let positions = [-1.6, -0.9, 0.1, 0.35, 1.3, 2.4];
    let view = |k: &usize| {
        let position = positions[*k];
        let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
        let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
        save(&image, &dir.join(format!("v{k}.png"))).unwrap();
        write_map(&rig_disparity(&depth, SIZE.0), &dir.join(format!("v{k}.pfm")));
        format!(
            "[[view]]\nname = \"v{k}\"\nimage = \"v{k}.png\"\nposition = {position:?}\ndisparity = \"v{k}.pfm\"\n"
        )
    };
    which.iter().map(view).collect::<String>() + target
}

fn number(figures: &serde_json::Value, path: &str) -> f64 {
    figures.pointer(path).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("{path}: {figures}"))
}

/// Two of six views: each of the 15 pairs is rendered and compared with the photograph.
#[test]
fn the_choice_is_among_the_best_of_all_pairs() {
    let dir = rig();
    let target = "[virtual]\nposition = 0.5\n";
    std::fs::write(dir.path().join("six.toml"), row_of_views(dir.path(), &[0, 1, 2, 3, 4, 5], target))
        .unwrap();
    let asked = ["place", "six.toml", "--choose", "2", "--truth", "middle.png", "--json"];
    let figures = json(&run(dir.path(), &asked));
    let mut errors = Vec::new();
    for pair in (0..6).flat_map(|a| (a + 1..6).map(move |b| [a, b])) {
        std::fs::write(dir.path().join("pair.toml"), row_of_views(dir.path(), &pair, target)).unwrap();
        let asked = ["render", "pair.toml", "-o", "pair.png", "--truth", "middle.png", "--json", "--force"];
        errors.push((number(&json(&run(dir.path(), &asked)), "/mae"), pair));
    }
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let chosen = [0, 1].map(|k| figures["chosen"]["views"][k].as_u64().unwrap() as usize);
    let rank = errors.iter().position(|(_, pair)| *pair == chosen).unwrap();
    assert!(rank < 2, "{rank} {errors:.3?} {figures}");
    let even = errors.iter().find(|(_, pair)| *pair == [0, 5]).unwrap().0;
    for (set, error) in [("chosen", errors[rank].0), ("even", even)] {
        assert!((number(&figures, &format!("/{set}/measured")) - error).abs() < 1e-9, "{set} {figures}");
    }
    let estimate = |set: &str| number(&figures, &format!("/{set}/estimate"));
    assert!(estimate("chosen") < estimate("even") && errors[rank].0 < 0.7 * even, "{errors:.3?} {figures}");
    assert_eq!(
        (figures["even"]["names"][1].as_str(), figures["all"]["views"][5].as_u64()),
        (Some("v5"), Some(5))
    );
    assert_eq!((figures["tried"].as_u64(), figures["exhaustive"].as_bool()), (Some(15), Some(true)));
    assert_eq!(figures["calibrated_on"], 4);
}

/// The estimate of all views is that of `bound`, and of a path the mean over its views.
#[test]
fn the_errors_are_the_estimates_of_bound() {
    let dir = rig();
    let target = "[virtual]\nposition = 0.2\nto_position = 0.8\nframes = 3\n";
    std::fs::write(dir.path().join("path.toml"), row_of_views(dir.path(), &[1, 2, 4], target)).unwrap();
    let figures = json(&run(dir.path(), &["place", "path.toml", "--choose", "3", "--json"]));
    let bound = json(&run(dir.path(), &["bound", "path.toml", "--json"]));
    let mean = (0..3).map(|k| number(&bound, &format!("/frames/{k}/totals/estimate"))).sum::<f64>() / 3.0;
    for set in ["chosen", "even", "all"] {
        assert!(
            (number(&figures, &format!("/{set}/estimate")) / mean - 1.0).abs() < 1e-5,
            "{mean} {figures}"
        );
        assert!(figures[set]["measured"].is_null());
    }
    let text = String::from_utf8(good(dir.path(), &["place", "path.toml", "--choose", "1"]).stdout).unwrap();
    for line in [
        "chosen    ",
        ", from v2\n",
        "all       ",
        "from 3 views",
        "searched  all 3 sets of 1 view\n",
        "inputs    ",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
}
