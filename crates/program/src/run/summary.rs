//! What a run comes to, for people and for programs.

use std::collections::BTreeMap;
use std::path::PathBuf;

use runtime::{AgentView, CannotRun, Figure, Incident, Noted, Report, SystemView};
use serde_json::{Value as Json, json};
use types::{Duration, Time};

use super::asked::{self, Asked};
use super::compare::Compared;
use super::judge;
use super::knowing;
use super::prepare::Ready;
use super::recorder::LogOutcome;
use super::tasks;
use super::useful::{Done, useful};
use crate::figures::TaskOutcome;
use crate::terminal::paint;

/// What became of a robot.
#[derive(Clone, Debug)]
pub(crate) struct RobotOutcome {
    pub(crate) name: String,
    /// What the judge knows; nothing for a robot that is not simulated.
    pub(crate) truth: Option<sim::Truth>,
    /// When it met the stages of its goal that are behind it.
    pub(crate) passed: Vec<Time>,
    pub(crate) commands: u64,
    pub(crate) stale: u64,
    pub(crate) clamped: u64,
    pub(crate) slowed: u64,
    /// Since when and why its latch is set; nothing where it is not.
    pub(crate) latch: Option<(Time, Vec<&'static str>)>,
    /// Whether its commands went nowhere, because it is a recording.
    pub(crate) shadow: bool,
    pub(crate) report: Option<hardware::Report>,
}

/// What became of a repeated run.
#[derive(Clone, Debug)]
pub(crate) struct Repeated {
    /// The log of the run before.
    pub(crate) log: PathBuf,
    /// How often something was asked in it.
    pub(crate) requests: usize,
    /// Where this run differs; nothing when the bytes are the same.
    pub(crate) differs: Option<String>,
}

/// What a run comes to.
#[derive(Clone, Debug)]
pub(crate) struct Summary {
    pub(crate) system: String,
    pub(crate) seed: u64,
    /// `sim` or `wall`.
    pub(crate) clock: &'static str,
    pub(crate) time: Duration,
    pub(crate) wall: f64,
    /// Whether the goal was met, nothing for a plan without one; and why.
    pub(crate) met: Option<bool>,
    pub(crate) why: String,
    pub(crate) ended: String,
    pub(crate) robots: Vec<RobotOutcome>,
    pub(crate) agents: Vec<AgentView>,
    pub(crate) sent: u64,
    pub(crate) dropped: u64,
    pub(crate) refused: u64,
    pub(crate) log_dropped: u64,
    /// Who took or freed memory in real time, and how often; nothing where nobody watched.
    pub(crate) allocations: Option<Vec<(String, u64)>>,
    pub(crate) incidents: Vec<Incident>,
    /// What became of the faults that were asked: when, and in words.
    pub(crate) effects: Vec<(Time, String)>,
    /// What the agents noted.
    pub(crate) noted: Vec<Noted>,
    /// When the run began on its own clock.
    pub(crate) begun: Time,
    pub(crate) log: Option<LogOutcome>,
    /// Pictures a second that were to be kept.
    pub(crate) images: f64,
    pub(crate) files: Vec<PathBuf>,
    /// What became of the tasks of the reactive layer, where there is a log.
    pub(crate) tasks: Vec<TaskOutcome>,
    pub(crate) repeat: Option<Repeated>,
    /// What the agents did whose plan says how important they are.
    pub(crate) done: Vec<Done>,
    /// The runs that this one is compared with.
    pub(crate) compared: Compared,
}

impl Summary {
    pub(crate) fn new(ready: &Ready, seed: u64, clock: &'static str, report: Report) -> Summary {
        let truth = ready.truth.as_ref();
        let robots: Vec<RobotOutcome> = ready
            .robots
            .iter()
            .map(|robot| RobotOutcome {
                name: robot.name.clone(),
                truth: truth.and_then(|truth| truth.robot(&robot.name)).map(|moment| moment.truth),
                passed: truth.map_or_else(Vec::new, |truth| truth.passed(&robot.name)),
                commands: robot.counts.commands.get(),
                stale: robot.counts.stale.get(),
                clamped: robot.counts.clamped.get(),
                slowed: robot.counts.slowed.get(),
                latch: robot.latch.is_set().then(|| {
                    let causes = robot.latch.state().causes().map(hardware::latch::Cause::name);
                    (robot.latch.set_at(), causes.collect())
                }),
                shadow: robot.description.clock == hardware::ClockKind::Recorded,
                report: robot.report.clone(),
            })
            .collect();
        let met = ready.goal.as_ref().and(truth).map(hardware::simulated::Truth::met);
        let why = match truth.filter(|_| met.is_some()) {
            Some(truth) => {
                let each = robots.iter().filter_map(|robot| {
                    let why = truth.why(&robot.name)?;
                    Some(if robots.len() > 1 { format!("{}: {why}", robot.name) } else { why })
                });
                each.collect::<Vec<_>>().join("; ")
            }
            None => report.ended.clone(),
        };
        let wires = &report.view.wires;
        Summary {
            system: report.view.name.clone(),
            seed,
            clock,
            time: report.time,
            wall: report.wall,
            met,
            why,
            ended: report.ended,
            robots,
            sent: wires.iter().map(|wire| wire.sent).sum(),
            dropped: wires.iter().map(|wire| wire.dropped + wire.expired).sum(),
            refused: wires.iter().map(|wire| wire.refused).sum(),
            log_dropped: report.log_dropped,
            allocations: allocations(&report.view),
            incidents: report.incidents,
            effects: Vec::new(),
            noted: report.noted,
            begun: Time(report.view.now.0 - report.time.0),
            agents: report.view.agents,
            log: None,
            images: 0.0,
            files: Vec::new(),
            tasks: Vec::new(),
            repeat: None,
            done: Vec::new(),
            compared: Compared::default(),
        }
    }

    /// Says of the requests of a repeated log, and of those of schedules, that the plan did not ask for them.
    pub(crate) fn repeats(&mut self, asked: &Asked) {
        let timed = self.incidents.iter_mut().filter(|incident| incident.agent == asked::PLAN);
        for (number, incident) in timed.enumerate() {
            if let Some(whose) = asked.origin(number) {
                incident.agent = whose;
            }
        }
    }

    /// Takes in what was done to the robots, and tells what became of each fault.
    pub(crate) fn tells(&mut self, asked: &Asked) {
        self.incidents.extend(asked.deeds());
        self.incidents.sort_by_key(|incident| incident.time);
        let faults = self.incidents.iter().filter(|incident| asked::is_fault(incident));
        let effect = |fault: &Incident| {
            let way = self.distance()? - asked.way_before(fault)?;
            Some((fault.time, self.effect(fault.time, way, asked.last_moved())))
        };
        self.effects = faults.filter_map(effect).collect();
    }

    /// What became of a robot after a fault, since which it went so far (m).
    fn effect(&self, fault: Time, way: f64, moved: Option<Time>) -> String {
        let at = |time: Time| seconds((time - self.begun).seconds());
        let latch = self.robots.iter().filter_map(|robot| robot.latch.as_ref());
        let end = Time(self.begun.0 + self.time.0);
        let stands_since = moved.map_or(self.begun, |moved| moved.max(fault));
        let went = format!("it went on for {way:.1} m");
        if let Some((time, causes)) = latch.min_by_key(|(time, _)| *time).filter(|(time, _)| *time >= fault) {
            format!("{went}, until the latch was set at {} ({})", at(*time), causes.join(", "))
        } else if self.met == Some(true) {
            format!("{went} and met its goal")
        } else if end - stands_since > STANDS {
            format!("{went} and has stood since {}", at(stands_since))
        } else {
            went
        }
    }

    /// Whether the run did what it was to do: met its goal, or without one ran to its end; a repeated one gave the same bytes.
    pub(crate) fn is_success(&self) -> bool {
        let same = self.repeat.as_ref().is_none_or(|repeat| repeat.differs.is_none());
        self.met.unwrap_or(self.ended != judge::INTERRUPTED) && same
    }

    fn truths(&self) -> impl Iterator<Item = &sim::Truth> {
        self.robots.iter().filter_map(|robot| robot.truth.as_ref())
    }

    /// Collisions of all robots; nothing where nobody knows.
    pub(crate) fn collisions(&self) -> Option<u32> {
        self.truths().map(|truth| truth.collisions).reduce(|a, b| a + b)
    }

    /// How often others ran into any robot; nothing where nobody knows.
    pub(crate) fn bumped(&self) -> Option<u32> {
        self.truths().map(|truth| truth.bumped).reduce(|a, b| a + b)
    }

    /// The smallest distance of any robot to anything (m).
    pub(crate) fn closest(&self) -> Option<f64> {
        self.truths().map(|truth| truth.closest).reduce(f64::min)
    }

    /// How far all robots went together (m).
    pub(crate) fn distance(&self) -> Option<f64> {
        self.truths().map(|truth| truth.distance).reduce(|a, b| a + b)
    }

    fn count(&self, of: impl Fn(&AgentView) -> u64) -> u64 {
        self.agents.iter().map(of).sum()
    }

    /// When the stages that the first robot with a goal has behind it were met (s of the run).
    fn stages(&self) -> Vec<f64> {
        let robot = self.robots.iter().find(|robot| !robot.passed.is_empty());
        robot.map_or_else(Vec::new, |robot| robot.passed.iter().map(|at| at.seconds()).collect())
    }

    /// The documented shape of a run.
    pub(crate) fn to_json(&self) -> Json {
        let agents: Vec<Json> = self.agents.iter().map(agent_json).collect();
        let robots: Vec<Json> = self.robots.iter().map(|robot| robot_json(robot, self.begun)).collect();
        let incidents = self.incidents.iter().map(|incident| {
            let mut told =
                json!({"time_s": self.since(incident.time), "agent": incident.agent, "what": incident.what});
            if let Some(effect) = self.effect_of(incident) {
                told["effect"] = effect.into();
            }
            told
        });
        let noted = self.noted.iter().map(|noted| {
            json!({
                "agent": noted.agent,
                "what": noted.what,
                "first_s": self.since(noted.first),
                "last_s": self.since(noted.last),
                "count": noted.count,
            })
        });
        json!({
            "system": self.system,
            "seed": self.seed,
            "clock": self.clock,
            "time_s": self.time.seconds(),
            "wall_s": self.wall,
            "ended": self.ended,
            "goal": {"met": self.met, "why": self.why, "stages_s": self.stages()},
            "collisions": self.collisions(),
            "bumped": self.bumped(),
            "closest_m": self.closest(),
            "distance_m": self.distance(),
            "deadlines": {
                "of": self.count(|agent| agent.counts.releases),
                "missed": self.count(|agent| agent.counts.missed),
                "stalled": self.count(|agent| agent.counts.stalled),
            },
            "useful": useful(&self.done).map(|share| json!({
                "share": share,
                "agents": self.done.iter().map(|done| json!({
                    "name": done.name, "share": done.share(), "importance": done.work.importance,
                    "nominal": done.work.nominal, "in_time": done.work.in_time, "quality": done.work.quality,
                })).collect::<Vec<_>>(),
            })),
            "tasks": tasks::document(&self.tasks),
            "compared": self.compared.document,
            "messages": {"sent": self.sent, "dropped": self.dropped, "refused": self.refused},
            "allocations": self.allocations.as_ref().map(|by| json!({
                "real_time": by.iter().map(|(_, count)| count).sum::<u64>(),
                "by": by.iter().cloned().collect::<BTreeMap<String, u64>>(),
            })),
            "agents": agents,
            "robots": robots,
            "incidents": incidents.collect::<Vec<_>>(),
            "notes": noted.collect::<Vec<_>>(),
            "log": self.log.as_ref().map(|log| json!({
                "messages": log.tally.safe,
                "lost": log.tally.lost + self.log_dropped,
                "images": log.images,
                "images_hz": self.images,
                "errors": log.errors,
            })),
            "files": self.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
            "repeat": self.repeat.as_ref().map(|repeat| json!({
                "log": repeat.log.display().to_string(),
                "requests": repeat.requests,
                "same": repeat.differs.is_none(),
                "differs": repeat.differs,
            })),
        })
    }

    /// What people read at the end of a run.
    pub(crate) fn to_text(&self, coloured: bool) -> String {
        let mut out = String::new();
        let mut line = |text: String| {
            out.push_str(&text);
            out.push('\n');
        };
        let verdict = match self.met {
            Some(true) => paint(coloured, "1;32", "goal met"),
            Some(false) => paint(coloured, "1;31", "goal not met"),
            None => paint(coloured, "1", "ended"),
        };
        line(format!("{} (seed {}): {verdict}: {}", self.system, self.seed, self.why));
        if self.met == Some(false) && self.ended != judge::DECIDED {
            line(format!("  ended        {}", self.ended));
        }
        line(format!("  time         {}", self.times()));
        let stages = self.stages();
        if !stages.is_empty() {
            let at: Vec<String> = stages.iter().map(|at| format!("{at:.0} s")).collect();
            line(format!("  stages       met after {}", at.join(", ")));
        }
        for robot in &self.robots {
            robot_lines(robot, self.robots.len() > 1, self.begun).into_iter().for_each(&mut line);
        }
        if self.robots.iter().any(|robot| robot.shadow) {
            line(format!("               {}", self.wishes()));
        }
        line(format!("  deadlines    {}", self.deadlines()));
        if let Some(useful) = useful(&self.done) {
            let each = self.done.iter().map(|done| format!("{} {:.0} %", done.name, done.share() * 100.0));
            let each: Vec<String> = each.collect();
            line(format!("  useful work  {:.1} %: {}", useful * 100.0, each.join(", ")));
        }
        line(format!("  messages     {}", self.messages()));
        if let Some(text) = self.memory() {
            line(format!("  memory       {text}"));
        }
        for text in self.told() {
            line(format!("  happened     {text}"));
        }
        for text in self.since_then() {
            line(format!("  then         {text}"));
        }
        if let Some(text) = self.granted() {
            line(format!("  real time    {text}"));
        }
        line(String::new());
        line(agent_table(&self.agents));
        if let Some(log) = &self.log {
            line(format!("  log          {}", self.log_line(log)));
            log.errors
                .iter()
                .for_each(|error| line(format!("  log          {}", paint(coloured, "1;31", error))));
        }
        if let Some(repeat) = &self.repeat {
            let (asked, log) = (repeat.requests, repeat.log.display());
            line(match &repeat.differs {
                None => format!("  repeated     {log}, with {asked} requests: the same bytes"),
                Some(how) => {
                    let how = paint(coloured, "1;31", &format!("it differs: {how}"));
                    format!("  repeated     {log}, with {asked} requests: {how}")
                }
            });
        }
        tasks::text(&self.tasks).into_iter().for_each(&mut line);
        self.compared.text.iter().for_each(|text| line(text.clone()));
        for (i, file) in self.files.iter().enumerate() {
            line(format!("  {:<12} {}", if i == 0 { "files" } else { "" }, file.display()));
        }
        out
    }

    /// Who wished to drive how often.
    fn wishes(&self) -> String {
        let wishes = |agent: &AgentView| {
            let port = agent.ports.iter().find(|port| port.name == "drive" && port.message == "Offer")?;
            Some(format!("{} wished {} times", agent.name, port.sent))
        };
        self.agents.iter().filter_map(wishes).collect::<Vec<_>>().join(", ")
    }

    fn times(&self) -> String {
        match self.clock {
            "sim" => format!(
                "{} simulated in {:.2} s ({:.0} × real time)",
                seconds(self.time.seconds()),
                self.wall,
                self.time.seconds() / self.wall.max(1e-9)
            ),
            _ => format!("{} on the wall clock", seconds(self.time.seconds())),
        }
    }

    fn deadlines(&self) -> String {
        let (of, missed) =
            (self.count(|agent| agent.counts.releases), self.count(|agent| agent.counts.missed));
        let stalled = self.count(|agent| agent.counts.stalled);
        let mut text = format!("{missed} of {of} missed");
        if stalled > 0 {
            text += &format!(", {stalled} of them while the machine stood still for everybody");
        }
        text
    }

    fn messages(&self) -> String {
        let mut text = format!("{} sent, {} dropped", self.sent, self.dropped);
        if self.refused > 0 {
            text += &format!(", {} given back to their senders", self.refused);
        }
        text
    }

    /// Who took memory where there is no time for it.
    fn memory(&self) -> Option<String> {
        let by = self.allocations.as_ref()?;
        if by.is_empty() {
            return Some("no real-time step took or freed any".into());
        }
        let each: Vec<String> = by.iter().map(|(name, count)| format!("{name} {count} times")).collect();
        Some(format!("taken or freed in real time: {}", each.join(", ")))
    }

    /// A time of the run (s since its start).
    fn since(&self, time: Time) -> f64 {
        (time - self.begun).seconds()
    }

    /// What became of a fault; nothing of what is none, or where nobody knows.
    fn effect_of(&self, incident: &Incident) -> Option<&str> {
        let of = self.effects.iter().find(|(time, _)| *time == incident.time);
        of.filter(|_| asked::is_fault(incident)).map(|(_, effect)| effect.as_str())
    }

    /// What agents noted for the first time after the first incident: mostly what they did about it.
    fn since_then(&self) -> Vec<String> {
        let Some(first) = self.incidents.first() else { return Vec::new() };
        let new = self.noted.iter().filter(|noted| noted.first >= first.time);
        let told = |noted: &Noted| {
            let Noted { agent, what, count, .. } = noted;
            let often = if *count > 1 { format!(", {count} times") } else { String::new() };
            format!("{agent}: {what} (at {}{often})", seconds(self.since(noted.first)))
        };
        new.map(told).collect()
    }

    /// What the supervisor did, in sentences; a death and the start after it are one.
    fn told(&self) -> Vec<String> {
        let mut told = Vec::new();
        let mut done = vec![false; self.incidents.len()];
        for (i, incident) in self.incidents.iter().enumerate() {
            if done[i] {
                continue;
            }
            let at = (incident.time - self.begun).seconds();
            let mut text = happened(incident, &seconds(at));
            let again =
                (i + 1..self.incidents.len()).find(|later| self.incidents[*later].agent == incident.agent);
            if let Some(later) = again.filter(|later| self.incidents[*later].what == STARTED_AGAIN) {
                let after = (self.incidents[later].time - incident.time).seconds();
                text += &format!(", started again {after:.1} s later");
                done[later] = true;
            }
            if let Some(effect) = self.effect_of(incident) {
                text += &format!("; {effect}");
            }
            let more = self.asked_again(i);
            if let Some(last) = more.last() {
                let last = seconds(self.since(self.incidents[*last].time));
                text += &format!(", and {} more times until {last}", more.len());
                more.iter().for_each(|later| done[*later] = true);
            }
            told.push(text);
        }
        told
    }

    /// When a schedule asked for the same later, and the same became of it.
    fn asked_again(&self, first: usize) -> Vec<usize> {
        let Incident { agent, what, .. } = &self.incidents[first];
        if !knowing::is_schedule(agent) {
            return Vec::new();
        }
        let same = |later: &Incident| later.agent == *agent && later.what == *what;
        (first + 1..self.incidents.len()).filter(|later| same(&self.incidents[*later])).collect()
    }

    /// Asking for real time and not getting it is said aloud.
    fn granted(&self) -> Option<String> {
        if self.clock != "wall" {
            return None;
        }
        let refused: Vec<&AgentView> =
            self.agents.iter().filter(|agent| agent.asked != agent.granted).collect();
        let first = refused.first()?;
        Some(format!(
            "{} of {} agents did not get what they asked for ({}: asked {}, granted {}); \"sinew doctor\" says why",
            refused.len(),
            self.agents.len(),
            first.name,
            first.asked,
            first.granted
        ))
    }

    fn log_line(&self, log: &LogOutcome) -> String {
        let mut text = format!("{} messages", log.tally.safe);
        if self.images > 0.0 && log.images > 0 {
            text += &format!(", images at {} Hz, compressed ({} of them)", self.images, log.images);
        } else if self.images <= 0.0 {
            text += ", no images";
        }
        let lost = log.tally.lost + self.log_dropped;
        if lost > 0 {
            text += &format!(", {lost} messages lost");
        }
        text
    }
}

/// The agents and executors that took or freed memory in real time, and how often.
fn allocations(view: &SystemView) -> Option<Vec<(String, u64)>> {
    let real_time = |name: &str| view.executors.iter().any(|known| known.name == name && known.real_time);
    let agents = view.agents.iter().filter(|agent| real_time(&agent.executor));
    let agents = agents.map(|agent| (agent.name.clone(), agent.counts.allocations));
    let executors = view.executors.iter().filter(|executor| executor.real_time);
    let executors = executors.map(|known| (format!("executor {}", known.name), known.allocations));
    view.allocations_watched.then(|| agents.chain(executors).filter(|(_, count)| *count > 0).collect())
}

/// An incident in a sentence.
fn happened(incident: &Incident, at: &str) -> String {
    let Incident { agent, what, .. } = incident;
    let who = match agent.as_str() {
        asked::PLAN => Some("the plan"),
        asked::LOG => Some("the log"),
        asked::OUTSIDE => Some("somebody"),
        schedule => knowing::is_schedule(schedule).then_some(schedule),
    };
    if let Some(who) = who.filter(|_| what.starts_with("asked: ")) {
        return format!(
            "{who} {} at {at}",
            what.replacen("asked: ", "asked for \"", 1).replacen("; refused", "\"; refused", 1)
                + if what.contains("; refused") { "" } else { "\"" }
        );
    }
    match what.strip_prefix("panic: ") {
        Some(why) => format!("{agent} panicked at {at} ({})", why.split(" (").next().unwrap_or(why)),
        None => format!("{agent} {what} at {at}"),
    }
}

/// Who has not moved for so long at the end has given up.
const STANDS: Duration = Duration::secs(5);
/// The supervisor's words for a restart.
const STARTED_AGAIN: &str = "started again";

fn robot_lines(robot: &RobotOutcome, several: bool, begun: Time) -> Vec<String> {
    let mut lines = Vec::new();
    let who = if several { format!("{}: ", robot.name) } else { String::new() };
    if let Some(truth) = &robot.truth {
        let collisions = match truth.collisions {
            0 => "no collisions".to_owned(),
            1 => "1 collision".to_owned(),
            n => format!("{n} collisions"),
        };
        let closest = if truth.closest >= sim::CLEARANCE_LIMIT {
            "nothing was ever near".to_owned()
        } else {
            format!("closest {:.2} m", truth.closest)
        };
        let bumped = match truth.bumped {
            0 => String::new(),
            1 => ", others ran into it once".to_owned(),
            n => format!(", others ran into it {n} times"),
        };
        lines.push(format!("  safety       {who}{collisions}{bumped}, {closest}"));
        lines.push(format!("  way          {who}{:.1} m", truth.distance));
    }
    if robot.shadow {
        lines.push(format!(
            "  shadow       {who}{} commands that a robot would have followed; the recording moves as it did",
            robot.commands
        ));
    }
    if let Some(report) = &robot.report {
        lines.push(format!("  recording    {who}{report}"));
        for bad in &report.told {
            lines.push(format!("               line {}: {}", bad.line, bad.why));
        }
    }
    if robot.stale > 0 && !robot.shadow {
        lines.push(format!(
            "  gate         {who}stood {} times because no new command came in time",
            robot.stale
        ));
    }
    if robot.slowed > 0 {
        lines.push(format!(
            "  gate         {who}slowed {} times what was commanded faster than is safe",
            robot.slowed
        ));
    }
    if let Some((time, causes)) = &robot.latch {
        let (at, causes) = (seconds((*time - begun).seconds()), causes.join(", "));
        lines.push(format!("  latch        {who}set at {at} ({causes}): the robot stands until it is reset"));
    }
    lines
}

fn agent_json(agent: &AgentView) -> Json {
    json!({
        "name": agent.name,
        "kind": agent.kind,
        "executor": agent.executor,
        "asked": agent.asked,
        "granted": agent.granted,
        "state": agent.state.name(),
        "releases": agent.counts.releases,
        "missed": agent.counts.missed,
        "stalled": agent.counts.stalled,
        "skipped": agent.counts.skipped,
        "restarts": agent.counts.restarts,
        "left_out": agent.counts.left_out,
        "allocations": agent.counts.allocations,
        "checked": agent.counts.checked,
        "disagreed": agent.counts.disagreed,
        "exec": figure_json("exec", &agent.exec),
        "jitter": figure_json("jitter", &agent.jitter),
        "response": figure_json("response", &agent.response),
    })
}

/// The documented shape of a figure of spans of time.
pub(crate) fn figure_json(name: &str, figure: &Figure) -> Json {
    json!({
        "name": name,
        "unit": "ns",
        "n": figure.n,
        "min": figure.min,
        "p50": figure.p50,
        "p99": figure.p99,
        "p999": figure.p999,
        "max": figure.max,
    })
}

fn robot_json(robot: &RobotOutcome, begun: Time) -> Json {
    json!({
        "name": robot.name,
        "collisions": robot.truth.map(|truth| truth.collisions),
        "bumped": robot.truth.map(|truth| truth.bumped),
        "closest_m": robot.truth.map(|truth| truth.closest),
        "distance_m": robot.truth.map(|truth| truth.distance),
        "commands": robot.commands,
        "stale": robot.stale,
        "clamped": robot.clamped,
        "slowed": robot.slowed,
        "latched": robot.latch.is_some(),
        "latch": robot.latch.as_ref().map(|(time, causes)| json!({
            "set_s": (*time - begun).seconds(),
            "causes": causes,
        })),
        "shadow": robot.shadow,
        "recording": robot.report.as_ref().map(|report| json!({
            "lines": report.lines,
            "scans": report.scans,
            "odometry": report.odometry,
            "bad": report.bad,
            "bad_lines": report.told.iter().map(|told| json!({"line": told.line, "why": told.why})).collect::<Vec<_>>(),
        })),
    })
}

/// One line an agent: what it asked for and got, and how it did.
pub(crate) fn agent_table(agents: &[AgentView]) -> String {
    let mut rows = vec![
        ["agent", "asked", "granted", "releases", "missed", "restarts", "exec p50", "exec max"]
            .map(str::to_owned),
    ];
    for agent in agents {
        rows.push([
            agent.name.clone(),
            agent.asked.clone(),
            agent.granted.clone(),
            agent.counts.releases.to_string(),
            agent.counts.missed.to_string(),
            agent.counts.restarts.to_string(),
            span(agent.exec.p50),
            span(agent.exec.max),
        ]);
    }
    table(&rows, 3)
}

/// Rows in columns; the first `left` columns are words, the others numbers.
pub(crate) fn table<R: AsRef<[String]>>(rows: &[R], left: usize) -> String {
    let mut widths = Vec::new();
    for row in rows.iter().map(AsRef::as_ref) {
        widths.resize(row.len().max(widths.len()), 0);
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = (*width).max(cell.chars().count());
        }
    }
    let mut out = String::new();
    for row in rows.iter().map(AsRef::as_ref) {
        let mut line = String::from("  ");
        for (i, (cell, width)) in row.iter().zip(widths.iter().copied()).enumerate() {
            line += &if i < left { format!("{cell:<width$}  ") } else { format!("{cell:>width$}  ") };
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

/// A span of time in nanoseconds, as people read it.
pub(crate) fn span(nanos: f64) -> String {
    match nanos {
        n if n <= 0.0 => "0".to_owned(),
        n if n < 1e3 => format!("{n:.0} ns"),
        n if n < 1e5 => format!("{:.1} µs", n * 1e-3),
        n if n < 1e6 => format!("{:.0} µs", n * 1e-3),
        n if n < 1e9 => format!("{:.1} ms", n * 1e-6),
        n => format!("{:.2} s", n * 1e-9),
    }
}

/// A time in seconds, as people read it.
pub(crate) fn seconds(seconds: f64) -> String {
    let text = format!("{seconds:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{text} s")
}

/// Why a plan did not run, as a failure with its places.
pub(crate) fn failure(error: CannotRun, sources: &crate::file::Sources) -> crate::Failure {
    match error {
        CannotRun::Mistakes(list) => crate::file::Mistakes { sources: sources.clone(), list }.into(),
        CannotRun::Refused(refusal) => refusal.into(),
        // These are no matter of the file but of an agent or of the machine.
        other @ (CannotRun::NoThread(_) | CannotRun::Stuck { .. } | CannotRun::Endless { .. }) => {
            crate::Failure::new(other.to_string()).code(1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_read_with_their_unit() {
        assert_eq!(
            [0.0, 999.0, 1500.0, 250_000.0, 2.5e6, 3e9].map(span),
            ["0", "999 ns", "1.5 µs", "250 µs", "2.5 ms", "3.00 s"].map(str::to_owned)
        );
        assert_eq!([30.0, 30.1, 0.25].map(seconds), ["30 s", "30.1 s", "0.25 s"].map(str::to_owned));
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [["a", "n"], ["long", "10"]].map(|row| row.map(str::to_owned));
        assert_eq!(table(&rows, 1), "  a      n\n  long  10\n");
    }
}
