//! How long a campaign of random trials is.

/// `short` trials, which every run makes, or HYBANK_CAMPAIGN times as many.
pub(crate) fn rounds(short: usize) -> usize {
    let Ok(text) = std::env::var("HYBANK_CAMPAIGN") else { return short };
    let factor: usize = text.parse().unwrap_or_else(|_| panic!("HYBANK_CAMPAIGN={text}: not a number"));
    short * factor
}
