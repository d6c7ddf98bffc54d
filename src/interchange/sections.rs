//! Recursive banks as sections of second order.

use super::ExportError;
use crate::bank::{Bank, StateSpace, SynthesisFilters};
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

/// The states that a section takes in the bank: x+ = f x + (what drives it).
struct Block {
    states: Vec<usize>,
}

/// The sections of a bank: the delays of its FIR head with their taps, two at a time, and its poles.
///
/// With the states of a section s, x+ = A x + sum over d of `B_d u[k - d]`, its part of the output is
/// `c (zI - A)^-1 B_d = (c B_d z + c (A - tr A) B_d) / (z^2 - z tr A + det A)`. Nothing is factored, so the
/// coefficients have the accuracy of the bank's.
///
/// # Errors
/// [`ExportError::NoSections`] for FIR banks, and for poles that nearly coincide, whose states drive one
/// another.
pub fn sections(bank: &Bank) -> Result<Vec<Section>, ExportError> {
    let SynthesisFilters::StateSpace(block) = &bank.filters else {
        return Err(ExportError::NoSections("this bank has no poles; csv and npz hold its taps"));
    };
    let structure = Structure::of(block)?;
    let mut all = Vec::new();
    for channel in 0..bank.frame_samples() {
        for phase in 0..bank.ratio {
            all.extend(structure.entry(block, channel, phase));
        }
    }
    Ok(all)
}

/// Which state is a delayed input, and which belong to poles.
struct Structure {
    /// Of each state.
    delayed: Vec<Option<DelayedInput>>,
    poles: Vec<Block>,
}

/// The input of a channel `delay` >= 1 slow periods ago.
#[derive(Clone, Copy)]
struct DelayedInput {
    channel: usize,
    delay: usize,
}

impl Structure {
    fn of(block: &StateSpace) -> Result<Self, ExportError> {
        let delayed: Vec<_> = (0..block.a.len()).map(|state| delayed_input(block, state)).collect();
        let poles = pole_blocks(block, &delayed).ok_or(ExportError::NoSections(
            "some of its poles nearly coincide, so that no sections side by side have its accuracy; npz and mat \
             hold its matrices, and a design with order has fewer poles",
        ))?;
        Ok(Self { delayed, poles })
    }

    fn entry(&self, block: &StateSpace, channel: usize, phase: usize) -> Vec<Section> {
        let section = |delay, b, a| Section { channel, phase, delay, b, a };
        let head = self.head(block, channel, phase);
        let pairs = head
            .chunks(2)
            .enumerate()
            .map(|(k, taps)| section(2 * k, [taps[0], taps.get(1).copied().unwrap_or(0.0), 0.0], [0.0; 2]));
        let poles = self.poles.iter().flat_map(|poles| {
            let a = poles.denominator(block);
            let part = move |(delay, drive): (usize, Vec<f64>)| {
                section(delay, poles.numerator(block, phase, &drive), a)
            };
            poles.drives(block, &self.delayed, channel).into_iter().map(part).collect::<Vec<_>>()
        });
        pairs.chain(poles).filter(|section| section.b.iter().any(|b| *b != 0.0)).collect()
    }

    /// The taps of the delayed inputs, without delay first.
    fn head(&self, block: &StateSpace, channel: usize, phase: usize) -> Vec<f64> {
        let mut taps = vec![block.d[phase][channel]];
        for (state, place) in self.delayed.iter().enumerate() {
            if let Some(DelayedInput { delay, .. }) = place.filter(|input| input.channel == channel) {
                taps.resize(taps.len().max(delay + 1), 0.0);
                taps[delay] += block.c[phase][state];
            }
        }
        taps
    }
}

/// The input that a state holds, if all it does is to repeat it: each state on the way has one coefficient,
/// which is 1.
fn delayed_input(block: &StateSpace, state: usize) -> Option<DelayedInput> {
    let n = block.a.len();
    let mut at = state;
    for delay in 1..=n {
        let mut row = block.a[at].iter().chain(&block.b[at]).enumerate().filter(|(_, x)| **x != 0.0);
        let (column, value) = row.next()?;
        if *value != 1.0 || row.next().is_some() {
            return None;
        }
        match column.checked_sub(n) {
            Some(channel) => return Some(DelayedInput { channel, delay }),
            None => at = column,
        }
    }
    None
}

/// The states of poles, one or two each; `None` if more of them drive one another.
fn pole_blocks(block: &StateSpace, delayed: &[Option<DelayedInput>]) -> Option<Vec<Block>> {
    let own: Vec<usize> = (0..delayed.len()).filter(|&state| delayed[state].is_none()).collect();
    let drives = |i: usize, j: usize| i != j && (block.a[i][j] != 0.0 || block.a[j][i] != 0.0);
    let mut blocks = Vec::new();
    for &state in &own {
        let partners: Vec<usize> = own.iter().copied().filter(|&other| drives(state, other)).collect();
        match partners[..] {
            [] => blocks.push(Block { states: vec![state] }),
            [other] if own.iter().filter(|&&third| drives(other, third)).count() == 1 => {
                if state < other {
                    blocks.push(Block { states: vec![state, other] });
                }
            }
            _ => return None,
        }
    }
    Some(blocks)
}

impl Block {
    fn a(&self, block: &StateSpace, row: usize, column: usize) -> f64 {
        block.a[self.states[row]][self.states[column]]
    }

    /// -tr A and det A; of one state -A and 0.
    fn denominator(&self, block: &StateSpace) -> [f64; 2] {
        let a = |i, j| self.a(block, i, j);
        match self.states.len() {
            1 => [-a(0, 0), 0.0],
            _ => [-(a(0, 0) + a(1, 1)), a(0, 0) * a(1, 1) - a(0, 1) * a(1, 0)],
        }
    }

    /// 0, c B and c (A - tr A) B; of one state 0, c B and 0.
    fn numerator(&self, block: &StateSpace, phase: usize, drive: &[f64]) -> [f64; 3] {
        let c = |i: usize| block.c[phase][self.states[i]];
        let a = |i, j| self.a(block, i, j);
        match drive {
            [single] => [0.0, c(0) * single, 0.0],
            _ => {
                let swapped =
                    [a(0, 1) * drive[1] - a(1, 1) * drive[0], a(1, 0) * drive[0] - a(0, 0) * drive[1]];
                [0.0, c(0) * drive[0] + c(1) * drive[1], c(0) * swapped[0] + c(1) * swapped[1]]
            }
        }
    }

    /// The coefficients B_d of a channel's input d periods ago, with d.
    fn drives(
        &self,
        block: &StateSpace,
        delayed: &[Option<DelayedInput>],
        channel: usize,
    ) -> Vec<(usize, Vec<f64>)> {
        let direct = self.states.iter().map(|&state| block.b[state][channel]).collect();
        let mut drives = vec![(0, direct)];
        for (of, place) in delayed.iter().enumerate() {
            if let Some(DelayedInput { delay, .. }) = place.filter(|input| input.channel == channel) {
                drives.push((delay, self.states.iter().map(|&state| block.a[state][of]).collect()));
            }
        }
        drives.retain(|(_, drive): &(usize, Vec<f64>)| drive.iter().any(|x| *x != 0.0));
        drives
    }
}

/// The state-space filters of sections: delay lines of the inputs, and for each pair of poles and each phase
/// two states in observer form, which all channels drive.
pub fn block_of_sections(sections: &[Section], channels: usize, ratio: usize) -> StateSpace {
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
    fn undriven(&self, ratio: usize) -> StateSpace {
        let (n, channels) = (self.pair(self.poles.len()), self.lines.len());
        let zeros = |rows: usize, columns: usize| vec![vec![0.0; columns]; rows];
        let mut block = StateSpace {
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
    fn add_taps(&self, block: &mut StateSpace, section: &Section) {
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
    fn drive_poles(&self, block: &mut StateSpace, section: &Section) {
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
