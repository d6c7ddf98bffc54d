//! Any text is a spec or a message; a spec writes, reads back equal, and its filters are realised or
//! refused.
#![no_main]

use hybank::analog::StrictlyProper;
use hybank::spec::Spec;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let spec = match Spec::from_toml(text, "fuzz.toml") {
        Ok(spec) => spec,
        Err(error) => return assert!(error.to_string().starts_with("fuzz.toml:")),
    };
    let written = spec.to_toml().expect("a spec that was read can be written");
    assert_eq!(Spec::from_toml(&written, "written.toml").as_ref(), Ok(&spec));
    for filter in spec.channels.iter().map(|channel| &channel.filter).chain([&spec.target]) {
        match StrictlyProper::new(filter, spec.fast_period) {
            Ok(phi) => assert!(phi.order() > 0 && phi.a().iter().all(|x| x.is_finite())),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
});
