//! The library by its results: golden numbers, brute force, identities, random and nasty problems.

#[path = "../support/mod.rs"]
mod support;

mod adc_tools;
mod bands;
mod causal_optima;
mod equivalence;
mod examples;
mod extremes;
mod filters;
mod gains;
mod golden;
mod hard_designs;
mod latency;
mod near_instants;
mod rates;
mod reduction;
mod repeated_channels;
mod sections;
mod soundness;
mod steep_front_ends;
mod tiny_gammas;
mod written_filters;
