//! Recursive banks as sections of second order.

use super::ExportError;
use crate::bank::{Bank, StateMatrices, SynthesisFilters};
use crate::runtime::{DelayLines, DelayedInput};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The part `z^-delay (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)` of a filter entry, z^-1 being one
/// slow period. The entry of a channel and a phase is the sum of its sections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Channel, from 0.
    pub channel: usize,
    /// Phase p of the output samples kM + p.
    pub phase: usize,
    /// Slow periods by which the section is late.
    pub delay: usize,
    /// b0, b1, b2.
    pub b: [f64; 3],
    /// a1, a2.
    pub a: [f64; 2],
}

impl Section {
    /// Whether it has no poles.
    fn is_fir(&self) -> bool {
        self.a == [0.0; 2]
    }
}

/// The sections of a bank: the delays of its FIR head with their taps, two at a time, and its poles.
///
/// With the states of a section s, x+ = A x + sum over d of `B_d u[k - d]`, its part of the output is
/// `c (zI - A)^-1 B_d = (c B_d z + c (A - tr A) B_d) / (z^2 - z tr A + det A)`. Nothing is factored, so the
/// coefficients have the accuracy of the bank's.
///
/// ```
/// use hybank::bank::{Bank, SynthesisFilters};
/// use hybank::interchange::{block_of_sections, sections};
/// let bank = Bank::from_json(include_str!("../../filters/thesis-iir.json"), "thesis-iir.json")?;
/// let list = sections(&bank)?;
/// // The product of two poles.
/// assert!(list.iter().all(|section| section.a[1].abs() < 1.0));
/// let block = block_of_sections(&list, bank.frame_samples(), bank.ratio);
/// assert_eq!((block.d.len(), block.d[0].len()), (2, 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ExportError::NoSections`] for FIR banks, and for poles that nearly coincide, whose states drive one
/// another.
pub fn sections(bank: &Bank) -> Result<Vec<Section>, ExportError> {
    let SynthesisFilters::StateSpace(block) = &bank.filters else {
        return Err(ExportError::NoSections("this bank has no poles; csv and mat hold its taps"));
    };
    let lines = DelayLines::new(block);
    let poles = pole_blocks(&lines).ok_or(ExportError::NoSections(
        "some of its poles nearly coincide, so that no sections side by side have its accuracy; mat holds its \
         matrices, and a design with order has fewer poles",
    ))?;
    let mut all = Vec::new();
    for channel in 0..bank.frame_samples() {
        for phase in 0..bank.ratio {
            all.extend(entry(&lines, &poles, channel, phase));
        }
    }
    Ok(all)
}

/// The sections from a channel to a phase.
fn entry(lines: &DelayLines, poles: &[Poles], channel: usize, phase: usize) -> Vec<Section> {
    let section = |delay, b, a| Section { channel, phase, delay, b, a };
    let of_channel = |terms: &BTreeMap<DelayedInput, Vec<f64>>| -> Vec<(usize, Vec<f64>)> {
        let own = terms.iter().filter(|((i, _), _)| *i == channel);
        own.map(|((_, delay), factors)| (*delay, factors.clone())).collect()
    };
    let (taps, drives) = (of_channel(&lines.taps), of_channel(&lines.b));
    let tap = |at: usize| taps.iter().find(|(delay, _)| *delay == at).map_or(0.0, |(_, taps)| taps[phase]);
    let last = taps.last().map_or(0, |(delay, _)| *delay);
    let head = (0..=last).step_by(2).map(|delay| section(delay, [tap(delay), tap(delay + 1), 0.0], [0.0; 2]));
    let parts = poles.iter().flat_map(|poles| {
        let part = |(delay, drive): &(usize, Vec<f64>)| {
            section(*delay, poles.numerator(lines, phase, drive), poles.denominator(lines))
        };
        drives.iter().map(part).collect::<Vec<_>>()
    });
    head.chain(parts).filter(|section| section.b.iter().any(|b| *b != 0.0)).collect()
}

/// The states of a pole or of two that drive one another: x+ = f x + (what drives it).
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Poles {
    state: usize,
    other: Option<usize>,
}

/// The states of poles, one or two each; `None` if more of them drive one another.
fn pole_blocks(lines: &DelayLines) -> Option<Vec<Poles>> {
    let of = |(state, other): (usize, Option<usize>)| match other {
        Some(j) if lines.a[state][j] == 0.0 && lines.a[j][state] == 0.0 => {
            vec![Poles { state, other: None }, Poles { state: j, other: None }]
        }
        _ => vec![Poles { state, other }],
    };
    let mut blocks: Vec<Poles> = lines.sections()?.into_iter().flat_map(of).collect();
    blocks.sort();
    Some(blocks)
}

impl Poles {
    /// -tr A and det A; of one state -A and 0.
    fn denominator(&self, lines: &DelayLines) -> [f64; 2] {
        let (a, i) = (&lines.a, self.state);
        match self.other {
            None => [-a[i][i], 0.0],
            Some(j) => [-(a[i][i] + a[j][j]), a[i][i] * a[j][j] - a[i][j] * a[j][i]],
        }
    }

    /// 0, c B and c (A - tr A) B; of one state 0, c B and 0.
    fn numerator(&self, lines: &DelayLines, phase: usize, drive: &[f64]) -> [f64; 3] {
        let (a, c, i) = (&lines.a, |state: usize| lines.c[state][phase], self.state);
        match self.other {
            None => [0.0, c(i) * drive[i], 0.0],
            Some(j) => {
                let swapped =
                    [a[i][j] * drive[j] - a[j][j] * drive[i], a[j][i] * drive[i] - a[i][i] * drive[j]];
                [0.0, c(i) * drive[i] + c(j) * drive[j], c(i) * swapped[0] + c(j) * swapped[1]]
            }
        }
    }
}

/// The state-space filters of sections: delay lines of the inputs, and for each pair of poles and each phase
/// two states in observer form, which all channels drive.
pub fn block_of_sections(sections: &[Section], channels: usize, ratio: usize) -> StateMatrices {
    let states = SectionStates::of(sections, channels);
    let mut block = states.undriven(ratio);
    for section in sections {
        if section.is_fir() {
            states.add_taps(&mut block, section);
        } else {
            states.drive_poles(&mut block, section);
        }
    }
    block
}

/// Where the states of sections stand: the delay lines, then two for each pair of poles.
struct SectionStates {
    /// States of the delay line of each channel.
    lines: Vec<usize>,
    /// The phase and the denominator of each pair.
    poles: Vec<(usize, [f64; 2])>,
}

impl SectionStates {
    fn of(sections: &[Section], channels: usize) -> Self {
        let longest = |channel: usize| {
            let own = sections.iter().filter(|section| section.channel == channel);
            own.map(|section| section.delay + if section.is_fir() { 2 } else { 0 }).max().unwrap_or(0)
        };
        let mut poles: Vec<(usize, [f64; 2])> =
            sections.iter().filter(|section| !section.is_fir()).map(|s| (s.phase, s.a)).collect();
        poles.sort_by(|x, y| x.0.cmp(&y.0).then(x.1[0].total_cmp(&y.1[0])).then(x.1[1].total_cmp(&y.1[1])));
        poles.dedup();
        Self { lines: (0..channels).map(longest).collect(), poles }
    }

    /// The state that holds the input of a channel one slow period ago.
    fn line(&self, channel: usize) -> usize {
        self.lines[..channel].iter().sum()
    }

    /// The first state of a pair.
    fn pair(&self, pair: usize) -> usize {
        self.line(self.lines.len()) + 2 * pair
    }

    /// Delay lines with their inputs, and poles that nothing drives yet.
    fn undriven(&self, ratio: usize) -> StateMatrices {
        let (n, channels) = (self.pair(self.poles.len()), self.lines.len());
        let zeros = |rows: usize, columns: usize| vec![vec![0.0; columns]; rows];
        let mut block = StateMatrices {
            a: zeros(n, n),
            b: zeros(n, channels),
            c: zeros(ratio, n),
            d: zeros(ratio, channels),
        };
        for (channel, &length) in self.lines.iter().enumerate().filter(|(_, length)| **length > 0) {
            let first = self.line(channel);
            block.b[first][channel] = 1.0;
            (first + 1..first + length).for_each(|state| block.a[state][state - 1] = 1.0);
        }
        for (k, (phase, [a1, a2])) in self.poles.iter().enumerate() {
            let state = self.pair(k);
            (block.a[state][state], block.a[state][state + 1], block.a[state + 1][state]) = (-a1, 1.0, -a2);
            block.c[*phase][state] = 1.0;
        }
        block
    }

    /// Taps to the outputs of the delay line.
    fn add_taps(&self, block: &mut StateMatrices, section: &Section) {
        for (delay, b) in (section.delay..).zip(section.b) {
            match delay.checked_sub(1) {
                None => block.d[section.phase][section.channel] += b,
                Some(d) if d < self.lines[section.channel] => {
                    block.c[section.phase][self.line(section.channel) + d] += b;
                }
                Some(_) => {}
            }
        }
    }

    /// The numerator to the inputs of the pair. b0 is zero: the poles follow a delay.
    fn drive_poles(&self, block: &mut StateMatrices, section: &Section) {
        let own = |pole: &(usize, [f64; 2])| *pole == (section.phase, section.a);
        let Some(pair) = self.poles.iter().position(own) else { return };
        for (state, b) in (self.pair(pair)..).zip(&section.b[1..]) {
            match section.delay.checked_sub(1) {
                None => block.b[state][section.channel] += b,
                Some(d) => block.a[state][self.line(section.channel) + d] += b,
            }
        }
    }
}

/// One section a line, channels from 1, with a line of headings.
pub(super) fn table(sections: &[Section]) -> String {
    let mut text = "channel,phase,delay,b0,b1,b2,a0,a1,a2\n".to_owned();
    for Section { channel, phase, delay, b: [b0, b1, b2], a: [a1, a2] } in sections {
        let _ = writeln!(text, "{},{phase},{delay},{b0:e},{b1:e},{b2:e},1,{a1:e},{a2:e}", channel + 1);
    }
    text
}
