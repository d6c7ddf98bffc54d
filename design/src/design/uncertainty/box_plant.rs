//! One plant for all errors of a box.
//!
//! The rows of H for a converter depend on its errors alone. So one lifted plant whose measurements are the
//! samples of every converter with several errors, its nodes, holds the rows of all combinations of nodes,
//! with one input for all. Errors of gains are factors of rows. No other plant is lifted while the worst
//! combination is searched.

use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use hybank_core::spec::{ConverterErrors, ErrorBox, ErrorPoint};
use hybank_core::units::FastPeriods;
use hybank_linalg::{CMat, Complex};
use std::ops::Range;

/// Errors of a channel as shares of the half-width, beside none: of the delay and of the cut-off. The
/// remainder of a row between two nodes falls with the square of their distance.
const OFFSETS: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];
/// The same for boxes with many channels.
const ENDS: [f64; 2] = [-1.0, 1.0];
/// Most nodes of all channels with [`OFFSETS`].
const MAX_NODES: usize = 64;
/// Most corners that are looked at.
const MAX_CORNERS: usize = 64;
/// Errors this close, relative to the half-width, are one node.
const SAME_ERROR: f64 = 1e-9;

/// For each channel the index of one of its [`ChannelError`]s; zeros for no errors.
pub(in crate::design) type Combination = Vec<usize>;

/// All front ends of a box.
#[derive(Debug)]
pub(in crate::design) struct BoxPlant {
    pub(in crate::design) problem: Problem,
    pub(in crate::design) errors: ErrorBox,
    /// Its measurements are the samples of the nodes.
    pub(super) plant: LiftedPlant,
    nodes: Vec<UncertainConverter>,
    /// The samples of each converter in a frame.
    converters: Vec<Range<usize>>,
    /// For each converter.
    pub(super) options: Vec<Vec<ChannelError>>,
}

/// A converter with errors of its delay and cut-off, which all its samples share.
#[derive(Debug, Clone, Copy, PartialEq)]
struct UncertainConverter {
    channel: usize,
    delay: FastPeriods,
    cutoff: f64,
}

/// A node with an error of the gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ChannelError {
    /// Index of the row.
    pub(super) node: usize,
    /// Relative to the channel's own gain.
    pub(super) gain: f64,
}

/// The responses of all nodes and of the references at one frequency.
pub(in crate::design) struct BoxResponse {
    pub(super) nodes: CMat,
    pub(in crate::design) references: CMat,
}

impl BoxPlant {
    /// The front ends of `problem` over `errors`: without errors, at the ends of each side, and between
    /// them.
    ///
    /// # Errors
    /// As [`Problem::check_size`].
    pub(in crate::design) fn new(problem: &Problem, errors: &ErrorBox) -> Result<Self, DesignError> {
        let channels = errors.delays.len();
        let centre = ErrorPoint::none(channels);
        for sign in [-1.0, 1.0] {
            let delays = errors.delays.iter().map(|&half| half * sign).collect();
            problem.perturbed(&ErrorPoint { delays, ..ErrorPoint::none(channels) }).check_size()?;
        }
        let nodes = nodes(errors, &centre, &OFFSETS);
        let nodes = if nodes.len() > MAX_NODES { self::nodes(errors, &centre, &ENDS) } else { nodes };
        Ok(Self::with_nodes(problem, errors, &centre, nodes))
    }

    /// The same front ends near one point: there, and `share` of the half-widths beside it.
    pub(super) fn near(&self, point: &ErrorPoint, share: f64) -> Self {
        let nodes = nodes(&self.errors, point, &[-share, share]);
        Self::with_nodes(&self.problem, &self.errors, point, nodes)
    }

    /// The first option of each channel has the errors of `centre`.
    fn with_nodes(
        problem: &Problem,
        errors: &ErrorBox,
        centre: &ErrorPoint,
        nodes: Vec<UncertainConverter>,
    ) -> Self {
        let converters = problem.converters();
        let options = (0..converters.len())
            .map(|i| {
                let of_channel = (0..nodes.len()).filter(|&node| nodes[node].channel == i);
                let half = errors.gains[i];
                let gains = if half > 0.0 { vec![-half, half] } else { vec![0.0] };
                let all =
                    of_channel.flat_map(|node| gains.iter().map(move |&gain| ChannelError { node, gain }));
                let all: Vec<ChannelError> = all.collect();
                let first = ChannelError { gain: centre.gains[i], ..all[0] };
                let others = all.into_iter().filter(|other| *other != first);
                std::iter::once(first).chain(others).collect()
            })
            .collect();
        let plant = lifted(problem, &nodes);
        Self { problem: problem.clone(), errors: errors.clone(), plant, nodes, converters, options }
    }

    /// Makes the errors of `point` a combination. All other combinations stay what they are.
    pub(in crate::design) fn include(&mut self, point: &ErrorPoint) -> Combination {
        let mut combination = Combination::new();
        let lifted = self.nodes.len();
        for channel in 0..self.options.len() {
            let ConverterErrors { delay, cutoff, gain } = point.of(channel);
            let node = self.node_at(UncertainConverter { channel, delay, cutoff });
            let options = &mut self.options[channel];
            let known = options.iter().position(|option| option.node == node && option.gain == gain);
            if known.is_none() {
                options.push(ChannelError { node, gain });
            }
            combination.push(known.unwrap_or(options.len() - 1));
        }
        if self.nodes.len() > lifted {
            self.plant = self::lifted(&self.problem, &self.nodes);
        }
        combination
    }

    /// The index of a node, which is added unless there is one like it.
    fn node_at(&mut self, node: UncertainConverter) -> usize {
        let (delay, cutoff) = (self.errors.delays[node.channel].0, self.errors.cutoffs[node.channel]);
        let is_same = |other: &UncertainConverter| {
            other.channel == node.channel
                && (other.delay - node.delay).0.abs() <= SAME_ERROR * delay
                && (other.cutoff - node.cutoff).abs() <= SAME_ERROR * cutoff
        };
        self.nodes.iter().position(is_same).unwrap_or_else(|| {
            self.nodes.push(node);
            self.nodes.len() - 1
        })
    }

    /// Corners of the box: all, or [`MAX_CORNERS`] that differ from each other in half of the sides.
    pub(super) fn corners(&self) -> Vec<Combination> {
        let ends: Vec<Vec<usize>> = (0..self.options.len()).map(|i| self.ends(i)).collect();
        let sides: u32 = ends.iter().map(|ends| ends.len().ilog2()).sum();
        let are_few = sides <= MAX_CORNERS.ilog2();
        let corners = if are_few { 1 << sides } else { MAX_CORNERS };
        let upper = |corner: usize, side: usize| {
            if are_few {
                corner >> side & 1 == 1
            } else {
                // Rows of a Hadamard matrix and their opposites.
                ((corner / 2) & side).count_ones().is_multiple_of(2) == corner.is_multiple_of(2)
            }
        };
        let of_corner = |corner: usize| {
            let mut side = 0;
            let end = |ends: &Vec<usize>| {
                let own = 0..ends.len().ilog2() as usize;
                let index =
                    own.clone().map(|bit| usize::from(upper(corner, side + bit)) << bit).sum::<usize>();
                side += own.end;
                ends[index]
            };
            ends.iter().map(end).collect()
        };
        (0..corners).map(of_corner).collect()
    }

    /// The options of a channel at the ends of all its sides: a power of two.
    fn ends(&self, channel: usize) -> Vec<usize> {
        let at_end = |value: f64, half: f64| half - value.abs() <= SAME_ERROR * half;
        let is_end = |option: &ChannelError| {
            let node = self.nodes[option.node];
            at_end(node.delay.0, self.errors.delays[channel].0)
                && at_end(node.cutoff, self.errors.cutoffs[channel])
                && at_end(option.gain, self.errors.gains[channel])
        };
        let options = &self.options[channel];
        (0..options.len()).filter(|&choice| is_end(&options[choice])).collect()
    }

    /// The errors of a combination.
    pub(in crate::design) fn point(&self, combination: &[usize]) -> ErrorPoint {
        let mut point = ErrorPoint::none(self.options.len());
        for (i, &choice) in combination.iter().enumerate() {
            let ChannelError { node, gain } = self.options[i][choice];
            let UncertainConverter { delay, cutoff, .. } = self.nodes[node];
            (point.delays[i], point.gains[i], point.cutoffs[i]) = (delay, gain, cutoff);
        }
        point
    }

    /// The plant with the errors of `point`.
    pub(in crate::design) fn moved(&self, point: &ErrorPoint) -> LiftedPlant {
        LiftedPlant::new(&self.problem.perturbed(point))
    }

    /// All responses at a frequency in radians per slow period.
    pub(in crate::design) fn response(&self, omega: f64) -> BoxResponse {
        let all = self.plant.at_frequency(omega);
        let count = self.plant.channels();
        BoxResponse {
            nodes: all.rows(0, count).into_owned(),
            references: all.rows(count, self.plant.ratio()).into_owned(),
        }
    }

    /// H of a combination.
    pub(in crate::design) fn measurements(&self, response: &BoxResponse, combination: &[usize]) -> CMat {
        let chosen = combination.iter().enumerate().map(|(i, &choice)| self.options[i][choice]);
        let rows: Vec<(usize, f64)> = chosen
            .flat_map(|choice| self.rows(choice.node).map(move |row| (row, 1.0 + choice.gain)))
            .collect();
        CMat::from_fn(rows.len(), response.nodes.ncols(), |i, column| {
            response.nodes[(rows[i].0, column)] * Complex::from(rows[i].1)
        })
    }

    /// K of a combination.
    pub(super) fn error(&self, response: &BoxResponse, filters: &CMat, combination: &[usize]) -> CMat {
        &response.references - filters * self.measurements(response, combination)
    }

    /// The rows of a node's samples.
    pub(super) fn rows(&self, node: usize) -> Range<usize> {
        let count = |node: &UncertainConverter| self.converters[node.channel].len();
        let first = self.nodes[..node].iter().map(count).sum();
        first..first + count(&self.nodes[node])
    }

    /// The columns of the filters of a converter.
    pub(super) fn columns(&self, converter: usize) -> Range<usize> {
        self.converters[converter].clone()
    }
}

/// The plant whose measurements are the samples of the nodes.
fn lifted(problem: &Problem, nodes: &[UncertainConverter]) -> LiftedPlant {
    let (mut all, converters) = (problem.clone(), problem.converters());
    let mut channels = Vec::new();
    for &UncertainConverter { channel, delay, cutoff } in nodes {
        let errors = ConverterErrors { delay, cutoff, gain: 0.0 };
        let own = &problem.channels[converters[channel].clone()];
        channels.extend(own.iter().map(|sample| all.perturb(*sample, errors)));
    }
    all.noise = vec![0.0; channels.len()];
    LiftedPlant::new(&Problem { channels, ..all })
}

/// The nodes of all channels: at `centre`, and `offsets` of the half-widths beside it. The first node of
/// each channel is that at the centre.
fn nodes(errors: &ErrorBox, centre: &ErrorPoint, offsets: &[f64]) -> Vec<UncertainConverter> {
    let of_channel = |channel: usize| {
        let delays = side(centre.delays[channel].0, errors.delays[channel].0, offsets);
        let cutoffs = side(centre.cutoffs[channel], errors.cutoffs[channel], offsets);
        let node =
            |delay: f64, cutoff: f64| UncertainConverter { channel, delay: FastPeriods(delay), cutoff };
        let all = |delay| cutoffs.iter().map(move |&cutoff| node(delay, cutoff));
        delays.into_iter().flat_map(all).collect::<Vec<UncertainConverter>>()
    };
    (0..errors.delays.len()).flat_map(of_channel).collect()
}

/// Values of one error, different and within the box.
fn side(centre: f64, half: f64, offsets: &[f64]) -> Vec<f64> {
    let mut values = vec![centre];
    for offset in offsets {
        let value = (centre + offset * half).clamp(-half, half);
        if values.iter().all(|known| (known - value).abs() > SAME_ERROR * half) {
            values.push(value);
        }
    }
    values
}
