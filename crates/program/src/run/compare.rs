//! Several runs of one scenario that differ in one entry, side by side: a table, and a figure of one band for each.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use record::figure::{BandRow, Bands, RateBand, Span};
use runtime::Plan;
use serde_json::{Value as Json, json};
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
) -> Result<Compared, Failure> {
    let Some(place) = &whole.place else { return Ok(Compared::default()) };
    let mut lines = vec![row(&values[0], first)];
    let mut documents = vec![document(&values[0], first)];
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
            facts: None,
        };
        let summary = one.run(ready)?;
        lines.push(row(value, &summary));
        documents.push(document(value, &summary));
        bands.extend(own.log.as_deref().and_then(|log| band(log, value, &summary, &scenario)));
    }
    let picture = Bands { bands, spans: spans(&whole.scenario.file.plan), window: None }.draw();
    let files = figures::write(&picture, &place.folder, "bands").unwrap_or_else(|error| {
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
    let mut said = vec![format!(
        "  compared     useful work in all, and of each agent, with the deadlines that it missed\n{}",
        table(&all, 1)
    )];
    said.extend(files.iter().map(|file| format!("               {file}")));
    Ok(Compared { text: said, document: json!({"entry": key, "runs": documents, "files": files}) })
}

/// What came out, for people and for programs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Compared {
    pub(crate) text: Vec<String>,
    pub(crate) document: Json,
}

fn document(value: &str, summary: &Summary) -> Json {
    let agents = summary.done.iter();
    let agents = agents.map(|done| json!({"name": done.name, "share": done.share(), "missed": done.missed}));
    json!({"value": value, "useful": useful(&summary.done), "agents": agents.collect::<Vec<_>>()})
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
        let mut usual: Vec<u32> =
            counts.iter().copied().take((calm / BIN).min(1e6) as usize).skip(1).collect();
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

#[cfg(test)]
mod tests {
    use runtime::{Options, Report, Simulation};

    use super::*;
    use crate::run::useful::{Done, done};
    use crate::run::with_robots;

    /// The overload experiment by one policy, on two virtual processors.
    fn overload(policy: &str) -> (Report, Vec<Done>) {
        let registry = with_robots(agents::registry());
        let sets = [format!("agent.manager.policy={policy}")];
        let file = file::load("overload", &sets, &registry).unwrap();
        let ready = Scenario { file, registry }.prepare(1).unwrap();
        let processors = file::processors(&ready.plan).unwrap();
        let options = Options {
            limit: Some(Duration::secs(60)),
            admission: Some(ready.admission(processors, Duration::ZERO, false)),
            processors: Some(processors),
            burdens: file::burdens(&ready.plan),
            parse: control::words::parse,
            ..Options::default()
        };
        let report = Simulation::new(&ready.plan, &ready.registry, options).unwrap().run().unwrap();
        let done = done(&ready, &report.view.agents, report.time);
        (report, done)
    }

    fn missed(done: &[Done], names: &[&str]) -> u64 {
        done.iter().filter(|done| names.contains(&done.name.as_str())).map(|done| done.missed).sum()
    }

    const CARE: [&str; 3] = ["safety", "drive", "sonar"];
    const PICTURES: [&str; 3] = ["camera", "track", "finder"];

    #[test]
    fn who_matters_misses_nothing_and_more_useful_work_is_done_than_by_nobody_or_by_halving_rates() {
        let ((managed, by_manager), (_, by_nobody), (_, by_ladder)) =
            (overload("elastic"), overload("none"), overload("ladder"));
        assert_eq!(missed(&by_manager, &CARE), 0);
        assert!(
            missed(&by_nobody, &PICTURES) > 100 && missed(&by_nobody, &["planner"]) > 10,
            "{by_nobody:?}"
        );
        assert!(
            missed(&by_manager, &PICTURES) < 20 && missed(&by_manager, &["planner"]) < 5,
            "{by_manager:?}"
        );
        let [manager, nobody, ladder] = [by_manager, by_nobody, by_ladder].map(|done| useful(&done).unwrap());
        assert!(manager > nobody && manager > ladder, "{manager} {nobody} {ladder}");
        // At the end, 10 s after the load fell, all is as it was asked for.
        let agent = |name: &str| managed.view.agents.iter().find(|agent| agent.name == name).unwrap();
        assert_eq!(agent("planner").period, Some(Duration::millis(200)));
        assert_eq!(agent("planner").budget, Some(Duration::millis(80)));
        assert_eq!([agent("track").method, agent("finder").method], [Some("exact"); 2]);
        assert!(managed.view.agents.iter().all(|agent| !agent.is_suspended));
    }

    #[test]
    fn the_same_overload_twice_gives_the_same_settings_at_the_same_time() {
        let told = |(report, _): (Report, Vec<Done>)| {
            let all = report.view.agents.into_iter();
            all.map(|agent| (agent.name, agent.counts.releases, agent.counts.missed)).collect::<Vec<_>>()
        };
        assert_eq!(told(overload("elastic")), told(overload("elastic")));
    }

    #[test]
    fn what_weighs_at_the_same_time_is_one_span() {
        let registry = with_robots(agents::registry());
        let plan = file::load("overload", &[], &registry).unwrap().plan;
        let told: Vec<_> = spans(&plan).into_iter().map(|span| (span.from, span.to, span.label)).collect();
        let expected = [
            (20.0, 40.0, "3 × as long: camera, track, finder".to_owned()),
            (25.0, 40.0, "another process takes 90 % of a processor".to_owned()),
        ];
        assert_eq!(told, expected);
    }
}
