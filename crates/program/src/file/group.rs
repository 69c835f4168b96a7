//! `[agent.arm] use = "arm.toml"`: the agents of another file under a prefix, with some of their ports as ports of the whole.

use std::path::{Path, PathBuf};

use types::value::{Mistake, Row, Span, Table, TableReader, Value};

use super::library::Shelf;
use super::read::{Reader, unknown};
use super::tree;

/// The sections of a file that is used as a group.
const SECTIONS: [&str; 6] = ["name", "executor", "agent", "queue", "wires", "ports"];
/// Groups within groups within groups.
const DEEPEST: usize = 8;

/// The groups, and the ports that they have as a whole.
#[derive(Debug, Default)]
pub(super) struct Names {
    groups: Vec<String>,
    /// The port of a group, as in `arm.pose`, and the one it stands for, as in `arm.elbow.pose`.
    ports: Vec<(String, String)>,
}

impl Names {
    /// The port of an agent that a name stands for.
    pub(super) fn resolve<'a>(&'a self, name: &'a str) -> &'a str {
        match self.ports.iter().find(|(known, _)| known == name) {
            // The port that it stands for is one level deeper, so this ends.
            Some((_, deeper)) => self.resolve(deeper),
            None => name,
        }
    }

    /// Whether a group has this name.
    pub(super) fn is_group(&self, name: &str) -> bool {
        self.groups.iter().any(|group| group == name)
    }

    /// The names of the groups.
    pub(super) fn groups(&self) -> impl Iterator<Item = &str> {
        self.groups.iter().map(String::as_str)
    }

    /// The names of the ports of a group.
    pub(super) fn ports_of(&self, group: &str) -> impl Iterator<Item = &str> {
        self.ports.iter().filter_map(move |(port, _)| port.strip_prefix(group)?.strip_prefix('.'))
    }
}

impl Reader<'_> {
    /// Reads the file of a group. Tables in `table` change entries of its agents; `robot` says whose ports they are wired to.
    pub(super) fn group(
        &mut self,
        name: &str,
        at: Span,
        table: &Table,
        folder: &Path,
        robot: Option<&str>,
        chain: &mut Vec<String>,
    ) {
        self.names.groups.push(name.to_owned());
        let mut r = TableReader::new(table, at, format!("group \"{name}\""));
        let file = r.text("use").map(|file| (file.to_owned(), r.place("use")));
        let own_robot = r.text("robot").map(|robot| (robot.to_owned(), r.place("robot")));
        table.rows().iter().for_each(|row| r.allow(&row.key));
        r.finish(&mut self.mistakes);
        if let Some((robot, at)) = &own_robot
            && self.robots.get(robot).is_none()
        {
            let known = self.robots.rows().iter().map(|row| row.key.as_str());
            let mistake = Mistake::unknown(*at, "robot", robot, known);
            self.mistakes.push(mistake);
        }
        let Some((file, file_at)) = file else { return };
        let Some((mut tree, shown, inside)) = self.part(&file, file_at, folder, chain) else { return };
        self.sections(&tree, &SECTIONS, "a file that is used as a group");
        self.change(&mut tree, table, name);
        let prefix = format!("{name}.");
        let robot = own_robot.as_ref().map(|(robot, _)| robot.as_str()).or(robot);
        chain.push(shown);
        self.executors(&tree);
        self.agents(&tree, &prefix, &inside, robot, chain);
        self.queues(&tree, &prefix);
        self.collect_wires(&tree, &prefix);
        self.ports(&tree, &prefix);
        chain.pop();
    }

    /// The tree of a used file, what it is called, and the folder it lies in.
    fn part(
        &mut self,
        file: &str,
        at: Span,
        folder: &Path,
        chain: &[String],
    ) -> Option<(Table, String, PathBuf)> {
        let found = Shelf::Scenarios.find(file, folder);
        let found = found.map_err(|mistake| self.mistakes.push(Mistake { at, ..mistake })).ok()?;
        if chain.contains(&found.name) || chain.len() >= DEEPEST {
            self.say(at, format!("{} would use itself, by way of {}", found.name, chain.join(", ")));
            return None;
        }
        let base = self.sources.add(found.name.clone(), found.text);
        let tree = tree::read(&self.sources, base, &mut self.mistakes)?;
        Some((tree, found.name, found.folder.unwrap_or_default()))
    }

    /// Lays the tables of the group's own section over those of its agents.
    fn change(&mut self, tree: &mut Table, table: &Table, group: &str) {
        for row in table.rows().iter().filter(|row| row.key != "use" && row.key != "robot") {
            let agents = tree.get_mut("agent").map(|entry| &mut entry.value);
            let Some(Value::Table(agents)) = agents else { continue };
            match (agents.get_mut(&row.key).map(|entry| &mut entry.value), &row.entry.value) {
                (Some(Value::Table(agent)), Value::Table(changes)) => overlay(agent, changes),
                _ => {
                    let known: Vec<&str> =
                        agents.rows().iter().map(|row| row.key.as_str()).chain(["use", "robot"]).collect();
                    let what = format!("group \"{group}\" has no agent \"{}\"", row.key);
                    self.mistakes.push(unknown(row.key_at, what, &row.key, known));
                }
            }
        }
    }

    fn ports(&mut self, tree: &Table, prefix: &str) {
        let Some(entry) = tree.get("ports") else { return };
        let Some(ports) = entry.value.as_table() else {
            self.say(entry.at, format!("\"ports\" is {}, not a section", entry.value.kind()));
            return;
        };
        for row in ports.rows() {
            // With a dot it could be the port of an agent in the group, and so stand for itself.
            if row.key.contains('.') {
                let what = format!("\"{}\" cannot be the name of a port of the whole", row.key);
                let help = format!("a name without a dot, as in pose = {}", row.entry.value);
                self.mistakes.push(Mistake::new(row.key_at, what).help(help));
                continue;
            }
            match row.entry.value.as_text().filter(|target| target.contains('.')) {
                Some(target) => {
                    let target = format!("{prefix}{target}");
                    self.names.ports.push((format!("{prefix}{}", row.key), target.clone()));
                    // Judged as it stands here, so that the mistake is shown in the file of the group.
                    let _ = self.end(&target, row.entry.at);
                }
                None => {
                    let what = format!("\"{}\" must be a port, not {}", row.key, row.entry.value);
                    self.mistakes.push(
                        Mistake::new(row.entry.at, what)
                            .help("as in pose = \"elbow.pose\", with the name of an agent"),
                    );
                }
            }
        }
    }
}

/// Puts the entries of `changes` into `table`; tables in tables are laid over one another.
fn overlay(table: &mut Table, changes: &Table) {
    for row in changes.rows() {
        match (table.get_mut(&row.key), &row.entry.value) {
            (Some(old), Value::Table(new)) if old.value.as_table().is_some() => {
                if let Value::Table(old) = &mut old.value {
                    overlay(old, new);
                }
            }
            (Some(old), _) => *old = row.entry.clone(),
            (None, _) => table.push(Row { ..row.clone() }),
        }
    }
}
