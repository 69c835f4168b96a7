//! The packages and who depends on whom, from `cargo metadata`.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use serde_json::Value;

/// Where a package stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Layer {
    /// `layer = "-"`: what is run while compiling; below all.
    Below,
    /// `layer = N`.
    Number(i64),
}

/// A package of this workspace.
#[derive(Clone, Debug, Default)]
pub(crate) struct Member {
    /// Its folder, relative to the root.
    pub(crate) folder: String,
    /// Its layer, if it names one.
    pub(crate) layer: Option<Layer>,
    /// Every package that its `Cargo.toml` names: for use, for building, for tests, optional or not.
    pub(crate) named: Vec<String>,
}

/// Packages by name. Of a foreign package all versions are one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    /// The packages of this workspace.
    pub(crate) members: BTreeMap<String, Member>,
    /// What each package is built with; what only its tests use is left out.
    built_with: BTreeMap<String, Vec<String>>,
}

impl Graph {
    pub(crate) fn of(metadata: &Value, root: &Path) -> Graph {
        let root = format!("{}/", root.display());
        let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let mut graph = Graph::default();
        let mut names = BTreeMap::new();
        for package in list(&metadata["packages"]) {
            let name = text(&package["name"]);
            names.insert(text(&package["id"]), name.clone());
            if package["source"].is_null() {
                let manifest = text(&package["manifest_path"]);
                let folder = manifest.strip_prefix(&root).unwrap_or(&manifest);
                let member = Member {
                    folder: folder.trim_end_matches("/Cargo.toml").to_owned(),
                    layer: layer(&package["metadata"]["sinew"]["layer"]),
                    named: list(&package["dependencies"]).iter().map(|one| text(&one["name"])).collect(),
                };
                graph.members.insert(name, member);
            }
        }
        for node in list(&metadata["resolve"]["nodes"]) {
            let Some(name) = names.get(&text(&node["id"])) else { continue };
            let used = list(&node["deps"])
                .into_iter()
                .filter(|dep| list(&dep["dep_kinds"]).iter().any(|kind| kind["kind"] != "dev"));
            let used = used.filter_map(|dep| names.get(&text(&dep["pkg"])).cloned());
            graph.built_with.entry(name.clone()).or_default().extend(used);
        }
        graph
    }

    /// The shortest way from a package to another; it goes through nothing that `closed` names.
    pub(crate) fn way(&self, from: &str, to: &str, closed: &[&str]) -> Option<Vec<String>> {
        let mut before: BTreeMap<&str, &str> = BTreeMap::new();
        let mut waiting = VecDeque::from([from]);
        while let Some(here) = waiting.pop_front() {
            if here == to {
                let mut way = vec![here.to_owned()];
                let mut at = here;
                while let Some(previous) = before.get(at).filter(|_| at != from) {
                    way.push((*previous).to_owned());
                    at = previous;
                }
                way.reverse();
                return Some(way);
            }
            for next in self.built_with.get(here).into_iter().flatten() {
                let seen = next == from || before.contains_key(next.as_str());
                if !seen && !closed.contains(&next.as_str()) {
                    before.insert(next, here);
                    waiting.push_back(next);
                }
            }
        }
        None
    }

    /// The package whose folder has this name, as in `crates/runtime`.
    pub(crate) fn in_folder(&self, folder: &str) -> Option<&Member> {
        self.members.values().find(|member| member.folder == folder)
    }

    #[cfg(test)]
    pub(crate) fn put(mut self, name: &str, layer: Option<Layer>, uses: &[&str]) -> Graph {
        let uses: Vec<String> = uses.iter().map(|&one| one.to_owned()).collect();
        let folder = format!("crates/{}", name.trim_start_matches("sinew-"));
        self.members.insert(name.to_owned(), Member { folder, layer, named: uses.clone() });
        self.built_with.insert(name.to_owned(), uses);
        self
    }

    #[cfg(test)]
    pub(crate) fn put_foreign(mut self, name: &str, uses: &[&str]) -> Graph {
        self.built_with.insert(name.to_owned(), uses.iter().map(|&one| one.to_owned()).collect());
        self
    }
}

fn layer(value: &Value) -> Option<Layer> {
    match value {
        Value::String(text) if text == "-" => Some(Layer::Below),
        Value::Number(number) => number.as_i64().map(Layer::Number),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_become_members_and_what_they_are_built_with() {
        let metadata = serde_json::json!({
            "packages": [
                {"name": "sinew-a", "id": "a", "source": null, "manifest_path": "/clone/crates/a/Cargo.toml",
                 "metadata": {"sinew": {"layer": 1}}, "dependencies": [{"name": "b"}, {"name": "c"}]},
                {"name": "b", "id": "b", "source": "registry"},
                {"name": "c", "id": "c", "source": "registry"}
            ],
            "resolve": {"nodes": [{"id": "a", "deps": [
                {"pkg": "b", "dep_kinds": [{"kind": null}]},
                {"pkg": "c", "dep_kinds": [{"kind": "dev"}]}
            ]}]}
        });
        let graph = Graph::of(&metadata, Path::new("/clone"));
        let member = &graph.members["sinew-a"];
        assert_eq!((member.folder.as_str(), member.layer), ("crates/a", Some(Layer::Number(1))));
        assert_eq!(member.named, ["b", "c"]);
        assert!(graph.way("sinew-a", "b", &[]).is_some());
        assert_eq!(graph.way("sinew-a", "c", &[]), None, "only its tests use it");
    }

    #[test]
    fn a_way_is_the_shortest_and_does_not_go_through_what_is_closed() {
        let graph = Graph::default()
            .put_foreign("a", &["b", "c"])
            .put_foreign("b", &["d"])
            .put_foreign("c", &["e"])
            .put_foreign("e", &["d"]);
        assert_eq!(graph.way("a", "d", &[]).unwrap(), ["a", "b", "d"]);
        assert_eq!(graph.way("a", "d", &["b"]).unwrap(), ["a", "c", "e", "d"]);
        assert_eq!(graph.way("a", "d", &["b", "c"]), None);
    }
}
