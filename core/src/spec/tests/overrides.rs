//! The `[design]` table with overrides.

use super::*;

#[test]
fn the_command_line_overrides_the_design() {
    let with = |text: &str, overrides| {
        Spec::from_toml_and_files(text, "spec.toml", overrides, &no_models).map(|spec| spec.design)
    };
    let method = |method| DesignOverrides { method: Some(method), ..Default::default() };
    let no_taps = thesis_with("taps = 22", "");
    let taps = DesignOverrides { taps: Some(7), ..Default::default() };
    assert_eq!(with(&no_taps, taps.clone()).unwrap().taps, Some(7));
    assert_eq!(with(THESIS, taps).unwrap().taps, Some(7));
    // The file's taps go with its method, not with another that has none.
    assert_eq!(with(THESIS, method(Method::H2)), Ok(DesignSpec::new(Method::H2, None)));
    assert_eq!(with(THESIS, method(Method::Sinc)).unwrap().taps, Some(22));
    let mean_square = THESIS.replace("\"fir\"", "\"h2\"");
    assert_eq!(with(&mean_square, method(Method::H2)).unwrap().taps, Some(22));
    let snr = DesignOverrides { target_snr_db: Some(60.0), ..Default::default() };
    let sized = with(THESIS, snr).unwrap();
    assert_eq!((sized.taps, sized.target_snr_db), (None, Some(60.0)));
    let both = DesignOverrides { method: Some(Method::Iir), taps: Some(5), ..Default::default() };
    assert!(matches!(
        with(THESIS, both).unwrap_err().problem(),
        SpecProblem::NeedlessKey { key: "taps", .. }
    ));

    let wanted = DesignOverrides { reduction_loss_db: Some(0.5), ..Default::default() };
    let iir = thesis_with("method = \"fir\"", "method = \"iir\"\norder = 7").replace("taps = 22", "");
    assert_eq!(with(&iir, DesignOverrides::default()).unwrap().reduction(), Some(Reduction::Order(7)));
    assert_eq!(with(&iir, wanted.clone()).unwrap().reduction(), Some(Reduction::Loss(0.5)));
    assert_eq!(with(&iir, method(Method::H2)).unwrap().reduction(), Some(Reduction::Order(7)));
    assert_eq!(with(&iir, method(Method::Separation)).unwrap().reduction(), None);
    assert!(matches!(
        with(THESIS, wanted).unwrap_err().problem(),
        SpecProblem::NeedlessKey { key: "reduction_loss_db", .. }
    ));
}
