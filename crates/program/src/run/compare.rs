//! Several runs of one scenario that differ in one entry, side by side: a table, and a figure of one band for each.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use record::figure::{BandRow, Bands, RateBand, Span};
use runtime::Plan;
use types::Duration;

use super::knowing::Knowing;
use super::prepare::Scenario;
use super::summary::{Summary, table};
use super::useful::useful;
use super::{One, Place, options};
use crate::cli::RunArgs;
use crate::error::Failure;
use crate::{figures, file, terminal};

/// The width of a bin in which steps are counted (s).
const BIN: f64 = 1.0;

/// Which entry takes which other values; nothing where the file compares nothing, or the command line has chosen.
pub(super) fn asked(args: &RunArgs, plan: &Plan) -> Option<(String, Vec<String>)> {
    if args.alone || args.repeat.is_some() || args.seeds.is_some() || args.no_log {
        return None;
    }
    let (key, values) = file::compared(plan)?;
    let chosen = args.set.iter().any(|set| set.split_once('=').is_some_and(|(set, _)| set.trim() == key));
    (!chosen).then_some((key, values))
}

/// Runs the other values after the first, which was run already, and draws all.
pub(super) fn run(
    whole: &One<'_>,
    first: &Summary,
    (key, values): &(String, Vec<String>),
) -> Result<Vec<String>, Failure> {
    let Some(place) = &whole.place else { return Ok(Vec::new()) };
    let mut lines = vec![row(&values[0], first)];
    let mut bands = Vec::new();
    bands.extend(place.log.as_deref().and_then(|log| band(log, &values[0], first, whole.scenario)));
    for value in &values[1..] {
        if whole.asked_to_end.load(Ordering::Relaxed) {
            break;
        }
        terminal::tell(&format!("the same with {key} = {value} …"));
        let mut args = whole.args.clone();
        args.set.push(format!("{key}={value}"));
        (args.out, args.log) = (Some(place.folder.join(value)), None);
        let scenario = options::scenario(&args, whole.scenario.registry.clone())?;
        let scenario = options::only(&args, scenario)?;
        let ready = scenario.prepare(whole.seed)?;
        let still = whole.knowing.map(Knowing::still);
        let own = Place::in_folder(place.folder.join(value), &args)?;
        let one = One {
            args: &args,
            scenario: &scenario,
            seed: whole.seed,
            clock: whole.clock,
            watched: false,
            place: Some(own.clone()),
            asked_to_end: Arc::clone(&whole.asked_to_end),
            serves: false,
            repeat: None,
            knowing: still.as_ref(),
        };
        let summary = one.run(ready)?;
        lines.push(row(value, &summary));
        bands.extend(own.log.as_deref().and_then(|log| band(log, value, &summary, &scenario)));
    }
    let picture = Bands { bands, spans: spans(&whole.scenario.file.plan), window: None }.draw();
    let files = figures::write(&picture, &place.folder, "bands")
        .unwrap_or_else(|error| {
            terminal::tell(&format!("warning: no figure of bands: {error}"));
            Vec::new()
        });
    let names = first.done.iter().map(|done| done.name.clone());
    let head: Vec<String> = [key.rsplit('.').next().unwrap_or(key).to_owned(), "useful".to_owned()]
        .into_iter()
        .chain(names)
        .collect();
    let mut all = vec![head];
    all.extend(lines);
    let mut said = vec![format!("  compared     useful work in all, and of each agent, with the deadlines that it missed\n{}", table(&all, 1))];
    said.extend(files.iter().map(|file| format!("               {file}")));
    Ok(said)
}

fn row(value: &str, summary: &Summary) -> Vec<String> {
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    let all = useful(&summary.done).map_or("-".to_owned(), percent);
    let each = summary.done.iter().map(|done| {
        let missed = if done.missed > 0 { format!(" ({} missed)", done.missed) } else { String::new() };
        format!("{:.0} %{missed}", done.share() * 100.0)
    });
    [value.to_owned(), all].into_iter().chain(each).collect()
}

/// What weighs on a run, as its plan says: burdens, and agents whose steps take longer.
fn spans(plan: &Plan) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    let mut heavy: Vec<(String, Duration)> = Vec::new();
    for request in &plan.requests {
        let words: Vec<&str> = request.words.iter().map(String::as_str).collect();
        match words[..] {
            ["fault", agent, "heavy"] => heavy.push((agent.to_owned(), request.at)),
            ["fault", agent, "ok"] => {
                if let Some(place) = heavy.iter().position(|(known, _)| known == agent) {
                    let (agent, from) = heavy.remove(place);
                    let (from, to) = (from.seconds(), request.at.seconds());
                    match spans.iter_mut().find(|span| span.from == from && span.to == to) {
                        Some(span) => span.label = format!("{}, {agent}", span.label),
                        None => spans.push(Span { from, to, label: format!("3 × as long: {agent}") }),
                    }
                }
            }
            _ => {}
        }
    }
    for burden in file::burdens(plan) {
        let label = format!("another process takes {:.0} % of a processor", burden.share * 100.0);
        spans.push(Span { from: burden.from.seconds(), to: burden.until.seconds(), label });
    }
    spans
}

/// A run as a band: how often the agents ran, of how often they did before anything weighed on them.
fn band(log: &Path, title: &str, summary: &Summary, scenario: &Scenario) -> Option<RateBand> {
    let rates = figures::rates(log).ok()?;
    let calm = spans(&scenario.file.plan).iter().map(|span| span.from).fold(f64::INFINITY, f64::min);
    let end = summary.time.seconds();
    let rows = summary.done.iter().map(|done| {
        let none = Vec::new();
        let times = rates.sent.get(&done.name).unwrap_or(&none);
        let bins = (end / BIN).floor() as usize;
        let mut counts = vec![0u32; bins.max(1)];
        for time in times {
            if let Some(count) = counts.get_mut((time / BIN) as usize) {
                *count += 1;
            }
        }
        // The first second is that of the start.
        let mut usual: Vec<u32> = counts.iter().copied().take((calm / BIN).min(1e6) as usize).skip(1).collect();
        usual.sort_unstable();
        let usual = usual.get(usual.len() / 2).copied().unwrap_or(1).max(1);
        let share = |count: &u32| (f64::from(*count) / f64::from(usual)).min(1.0);
        let rate = counts.iter().enumerate().map(|(bin, count)| (bin as f64 * BIN, share(count))).collect();
        let missed = if done.missed > 0 { format!(", {} missed", done.missed) } else { String::new() };
        BandRow {
            name: done.name.clone(),
            rate,
            misses: rates.misses.get(&done.name).cloned().unwrap_or_default(),
            suspended: rates.suspended_of(&done.name, end),
            said: format!("{:.0} %{missed}", done.share() * 100.0),
        }
    });
    let all = useful(&summary.done).map_or(String::new(), |share| format!(": {:.1} % useful", share * 100.0));
    Some(RateBand { title: format!("{title}{all}"), rows: rows.collect() })
}
