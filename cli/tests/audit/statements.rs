//! A spec as a user gives it to the program, the bank that comes out, and whether what the program says of
//! it is true.

use super::bounds::{causal, noncausal};
use super::judge::Judge;
use super::optimum::optimum;
use super::plant::{Errors, Library, Plant};
use crate::support::Desk;
use crate::support::sweep::each;
use serde_json::Value;

/// Rounding of the judge: its last step is an eigenvalue in doubles.
const ROUNDING: f64 = 1e-12;
/// What the bank format promises of `norm`, with ten times as much for the rounding that it leaves open.
const NORM_ACCURACY: f64 = 1e-8;
/// Where nothing is proven, gammas are computed in doubles from front ends of about unit size.
const UNPROVEN: f64 = 1e-12;
/// Taps of all channels up to which the judge looks for the best taps itself.
const MOST_TAPS: usize = 40;
/// Widths and excesses above this are listed.
const NOTEWORTHY: f64 = 1e-4;
/// Slow periods of an input that leaves all samples zero, and the gain over half of them at which its error
/// has settled.
const PERIODS: i64 = 24;
const SETTLED: f64 = 1e-6;

/// Designs `spec`: the bank as its file says, and the report of the design; a tally with the program's
/// reason where there is none.
pub(crate) fn designed(desk: &Desk, name: &str, spec: &Value) -> Result<(Value, Value), Tally> {
    desk.write("spec.toml", toml::to_string(spec).expect("a spec"));
    let output = desk.run(&["design", "--prove", "spec.toml", "-o", "bank.json", "--json", "--force"], &[]);
    if !output.status.success() {
        return Err(Tally::refused(name, &String::from_utf8_lossy(&output.stderr)));
    }
    let report = serde_json::from_slice(&output.stdout).expect("a report");
    Ok((desk.read_json("bank.json"), report))
}

/// As [`designed`], with what the judge finds of the bank and of what `verify` says of it.
pub(crate) fn examined(desk: &Desk, name: &str, spec: &Value) -> Result<(Value, Value, Tally), Tally> {
    let (bank, report) = designed(desk, name, spec)?;
    let proven = verified(desk);
    let mut tally = judged(name, &bank, proven.as_ref());
    if proven.is_none() {
        tally.unproven.push(format!("{name}: {}", report["unproven"]));
    }
    Ok((bank, report, tally))
}

/// What `verify` says of `bank.json` in the folder; `None` if it refuses the file.
pub(crate) fn verified(desk: &Desk) -> Option<Value> {
    let output = desk.run(&["verify", "bank.json", "--json"], &[]);
    output.status.success().then(|| serde_json::from_slice(&output.stdout).expect("a report"))
}

/// The number at a key, if there is one.
pub(crate) fn at(value: &Value, pointer: &str) -> Option<f64> {
    value.pointer(pointer).and_then(Value::as_f64)
}

/// Findings of one campaign.
#[derive(Default)]
pub(crate) struct Tally {
    pub(crate) cases: usize,
    pub(crate) refused: Vec<String>,
    pub(crate) unproven: Vec<String>,
    pub(crate) refuted: Vec<String>,
    /// True, and worth a look.
    pub(crate) notes: Vec<String>,
    /// Upper over lower end, less one, of every proven interval that is to be narrow.
    pub(crate) widths: Vec<f64>,
    /// By how much more than the best that the judge knows, relative.
    pub(crate) excesses: Vec<f64>,
}

impl Tally {
    /// A case without a bank.
    pub(crate) fn refused(name: &str, reason: &str) -> Self {
        Self { cases: 1, refused: vec![format!("{name}: {reason}")], ..Self::default() }
    }

    /// Without what is no news of banks of this kind.
    pub(crate) fn without_figures(self) -> Self {
        Self { notes: Vec::new(), widths: Vec::new(), excesses: Vec::new(), ..self }
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.cases += other.cases;
        self.refused.extend(other.refused);
        self.unproven.extend(other.unproven);
        self.refuted.extend(other.refuted);
        self.notes.extend(other.notes);
        self.widths.extend(other.widths);
        self.excesses.extend(other.excesses);
    }

    /// The findings of one case, with the details.
    fn tell(&self, campaign: &str, seed: u64) {
        let Self { cases, refused, unproven, refuted, notes, widths, excesses } = self;
        let lists = [refused, unproven, refuted, notes];
        let [refusals, proofs, falsehoods, _] = lists.map(Vec::len);
        println!("{campaign} {seed}: {cases} {refusals} {proofs} {falsehoods} {widths:?} {excesses:?}");
        for (list, kind) in lists.into_iter().zip(["refused", "not proven", "REFUTED", "note"]) {
            list.iter().for_each(|line| println!("{campaign}: {kind}: {}", line.trim_end()));
        }
    }

    /// A row of the printed table. Fails if a statement was refuted.
    pub(crate) fn report(&self, campaign: &str) {
        let ends = |list: &[f64]| {
            let mut list = list.to_vec();
            list.sort_by(f64::total_cmp);
            let middle = list.get(list.len() / 2).copied().unwrap_or(f64::NAN);
            format!("{middle:.0e}, {:.1e}", list.last().copied().unwrap_or(f64::NAN))
        };
        println!(
            "| {campaign} | {} | {} | {} | {} | {} | {} |",
            self.cases,
            self.refused.len(),
            self.unproven.len(),
            self.refuted.len(),
            ends(&self.widths),
            ends(&self.excesses),
        );
        assert!(self.refuted.is_empty(), "{campaign}: {} false statements", self.refuted.len());
    }
}

/// All cases of a campaign, `usual` ones unless the environment asks for others; a task ends early where
/// there is no bank.
pub(crate) fn campaign(usual: usize, name: &str, task: impl Fn(u64) -> Result<Tally, Tally> + Sync) {
    let mut whole = Tally::default();
    // Each case as it ends, so that what an interrupted campaign found is not lost.
    let told = |seed: u64| {
        let tally = task(seed).unwrap_or_else(|refused| refused);
        tally.tell(name, seed);
        tally
    };
    each(trials::trials(trials::rounds(usual) as u64), told).into_iter().for_each(|tally| whole.add(tally));
    whole.report(name);
}

/// The frequency of a witness in the proof of a bank file, radians per slow period.
pub(crate) fn witness(bank: &Value, pointer: &str) -> Option<f64> {
    let half = bank.pointer(pointer)?;
    Some(2.0 * half[1].as_f64()?.atan2(half[0].as_f64()?))
}

/// Compares every gamma of a bank file and of the report of `verify` with the judge's.
pub(crate) fn judged(name: &str, bank: &Value, proven: Option<&Value>) -> Tally {
    let mut tally = Tally { cases: 1, ..Tally::default() };
    let judge = Judge::of(bank);
    let peak: Vec<f64> = witness(bank, "/proof/upper/peak/half").into_iter().collect();
    let norm = judge.norm(&peak).gain;
    let any = noncausal(&judge.plant).gain;
    let mut claim = |is_true: bool, what: &str, stated: f64, truth: f64| {
        if !is_true {
            tally.refuted.push(format!("{name}: {what} {stated:.12e}, true {truth:.12e}"));
        }
    };
    let upwards = 1.0 + ROUNDING;
    for (source, value) in [("file", &bank["gamma"]), ("verify", proven.unwrap_or(&Value::Null))] {
        let number = |key: &str| at(value, &format!("/{key}")).map(|x| (format!("{source}: {key}"), x));
        if let Some((what, upper)) = number("upper") {
            let rounding = if proven.is_some() { 0.0 } else { UNPROVEN };
            claim(norm <= upper * upwards + rounding, &what, upper, norm);
        }
        if let Some((what, attained)) = number("attained") {
            claim(attained <= norm * upwards, &what, attained, norm);
        }
        if let Some((what, stated)) = number("norm") {
            let accuracy = if norm < 1e-9 { 0.1 } else { NORM_ACCURACY };
            claim((stated - norm).abs() <= accuracy * norm + 1e-13, &what, stated, norm);
        }
        if let Some((what, noncausal)) = number("noncausal") {
            claim(noncausal <= any.max(1e-13) * upwards.max(1.0 + 1e-9), &what, noncausal, any);
        }
    }
    let Some(proven) = proven else { return tally };
    let [attained, upper] = ["/attained", "/upper"].map(|key| at(proven, key).unwrap_or(f64::NAN));
    let best = reachable(bank, &judge, any);
    if let (Some(best), Some(lower)) = (best, at(bank, "/gamma/lower")) {
        claim(lower <= best * (1.0 + SETTLED), "file: lower", lower, best);
        tally.excesses.push(norm / best - 1.0);
    }
    tally.widths.push(upper / attained - 1.0);
    let far = |list: &[f64]| list.iter().any(|x| *x > NOTEWORTHY);
    if far(&tally.widths) || far(&tally.excesses) {
        let Tally { widths, excesses, .. } = &tally;
        tally
            .notes
            .push(format!("{name}: width {widths:?}, excess {excesses:?}, norm {norm:e}, best {best:?}"));
    }
    tally
}

/// The least norm of the banks of this method and size, up to [`SETTLED`] or above it; `None` where the
/// judge does not find it.
fn reachable(bank: &Value, judge: &Judge, any: f64) -> Option<f64> {
    let plant = &judge.plant;
    match bank["method"].as_str()? {
        "fir" => {
            let count = bank["channels"][0]["taps"].as_array()?.len();
            let latency = bank["latency"].as_u64()? as usize;
            let own =
                || Plant::new(&bank["spec"], latency, &Errors::none(plant.channels), &mut Library::default());
            (count * plant.channels <= MOST_TAPS)
                .then(|| optimum(vec![own()], count))
                .flatten()
                .map(|best| best.norm)
        }
        "iir" => {
            let [half, whole] = [PERIODS / 2, PERIODS].map(|periods| causal(plant, periods).max(any));
            // Front ends that remember for longer leave it open.
            (whole <= half * (1.0 + SETTLED)).then_some(whole)
        }
        _ => Some(any),
    }
}
