//! A spec as a document: the same keys in TOML and in the `spec` of a bank file.

use serde::{Serialize, Serializer};

use super::{ChannelSpec, DesignSpec, FilterSpec, Fitting, SignalSpec, Spec, UncertaintySpec};
use crate::quantity::FullScale;
use crate::units::Seconds;

/// The written form of a [`Spec`], with all times in seconds and all defaults filled in.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    name: &'a str,
    fast_period: Seconds,
    #[serde(skip_serializing_if = "Option::is_none")]
    ratio: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    latency: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    full_scale: Option<FullScale>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    fit: &'a [Fitting],
    target: Target<'a>,
    channel: &'a [ChannelSpec],
    #[serde(skip_serializing_if = "Option::is_none")]
    signal: Option<&'a SignalSpec>,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<&'a UncertaintySpec>,
    design: &'a DesignSpec,
}

#[derive(Serialize)]
struct Target<'a> {
    filter: &'a FilterSpec,
}

impl Serialize for Spec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Document {
            name: &self.name,
            fast_period: self.fast_period,
            // The rates say it.
            ratio: self.layout().is_plain().then_some(self.ratio),
            latency: self.latency,
            full_scale: self.full_scale,
            fit: &self.fit,
            target: Target { filter: &self.target },
            channel: &self.channels,
            signal: self.signal.as_ref(),
            uncertainty: self.uncertainty.as_ref(),
            design: &self.design,
        }
        .serialize(serializer)
    }
}
