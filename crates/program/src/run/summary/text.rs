//! What people read of a run.

use runtime::{AgentView, Incident, Noted};
use types::Time;

use super::{RobotOutcome, Summary, seconds, span, table};
use crate::run::recorder::LogOutcome;
use crate::run::useful::useful;
use crate::run::{asked, judge, knowing, tasks};
use crate::terminal::paint;

/// The supervisor's words for a restart.
const STARTED_AGAIN: &str = "started again";

impl Summary {
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
        if self.replaced > 0 {
            text += &format!(", {} replaced by newer ones", self.replaced);
        }
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

/// One line an agent: what it asked for and got, and how it did.
fn agent_table(agents: &[AgentView]) -> String {
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
