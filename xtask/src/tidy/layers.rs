//! Who may depend on whom: strictly downwards, and a few crates less than that.

use super::Finding;
use super::graph::{Graph, Layer, Member};

/// The folders whose packages stand in layers; tools stand beside them.
const LAYERED: [&str; 3] = ["crates/", "apps/", "bindings/"];

/// All that the runtime may know of this workspace: it must not find out what a wall is.
const RUNTIME_KNOWS: [&str; 3] = ["sinew-macros", "sinew-types", "sinew-schedule"];

/// What the agents must not reach by any way: nobody reads the simulator's truth.
const HIDDEN_FROM_AGENTS: [&str; 2] = ["sinew-hardware", "sinew-sim"];

pub(crate) fn check(graph: &Graph) -> Vec<Finding> {
    let layered = |member: &Member| LAYERED.iter().any(|folder| member.folder.starts_with(folder));
    let mut findings = Vec::new();
    for (name, member) in graph.members.iter().filter(|(_, member)| layered(member)) {
        let place = format!("{}/Cargo.toml", member.folder);
        let Some(layer) = member.layer else {
            findings.push(Finding::new(place, "names no layer in [package.metadata.sinew]"));
            continue;
        };
        for used in &member.named {
            match graph.members.get(used).map(|other| other.layer) {
                Some(Some(below)) if below < layer => {}
                Some(Some(other)) => findings.push(Finding::new(
                    &place,
                    format!(
                        "{name} ({}) depends on {used} ({}): only lower layers may be named",
                        show(layer),
                        show(other)
                    ),
                )),
                Some(None) => findings.push(Finding::new(
                    &place,
                    format!("{name} depends on {used}, which stands in no layer"),
                )),
                None => {}
            }
        }
    }
    if let Some(runtime) = graph.members.get("sinew-runtime") {
        let known = runtime.named.iter().filter(|used| graph.members.contains_key(*used));
        findings.extend(known.filter(|used| !RUNTIME_KNOWS.contains(&used.as_str())).map(|used| {
            Finding::new("crates/runtime/Cargo.toml", format!("the runtime may not know {used}"))
        }));
    }
    findings.extend(seen_by_agents(graph));
    findings
}

fn seen_by_agents(graph: &Graph) -> Vec<Finding> {
    let Some(agents) = graph.members.get("sinew-agents") else { return Vec::new() };
    let mut findings = Vec::new();
    for hidden in HIDDEN_FROM_AGENTS {
        let direct = agents.named.iter().any(|used| used == hidden);
        let way = if direct {
            Some(vec!["sinew-agents".to_owned(), hidden.to_owned()])
        } else {
            graph.way("sinew-agents", hidden, &[])
        };
        if let Some(way) = way {
            findings.push(Finding::new(
                "crates/agents/Cargo.toml",
                format!("agents must not reach {hidden}: {}", way.join(" → ")),
            ));
        }
    }
    findings
}

fn show(layer: Layer) -> String {
    match layer {
        Layer::Below => "below all".to_owned(),
        Layer::Number(number) => format!("layer {number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(layer: i64) -> Option<Layer> {
        Some(Layer::Number(layer))
    }

    fn found(graph: Graph) -> Vec<String> {
        check(&graph).into_iter().map(|finding| finding.what).collect()
    }

    fn good() -> Graph {
        Graph::default()
            .put("sinew-macros", Some(Layer::Below), &["syn"])
            .put("sinew-types", at(0), &["sinew-macros", "libm"])
            .put("sinew-sim", at(2), &["sinew-types"])
            .put("sinew-runtime", at(2), &["sinew-types", "sinew-macros"])
            .put("sinew-hardware", at(4), &["sinew-runtime", "sinew-sim"])
            .put("sinew-agents", at(5), &["sinew-runtime"])
    }

    #[test]
    fn downwards_is_fine() {
        assert_eq!(found(good()), [""; 0]);
    }

    #[test]
    fn siblings_and_what_is_above_are_found() {
        let siblings = found(good().put("sinew-sim", at(2), &["sinew-runtime"]));
        assert_eq!(siblings.len(), 1);
        assert!(
            siblings[0].contains("sinew-sim (layer 2) depends on sinew-runtime (layer 2)"),
            "{siblings:?}"
        );
        let upwards = found(good().put("sinew-macros", Some(Layer::Below), &["sinew-types"]));
        assert!(upwards[0].contains("(below all) depends on sinew-types (layer 0)"), "{upwards:?}");
    }

    #[test]
    fn a_crate_without_a_layer_is_found() {
        assert_eq!(found(good().put("sinew-acl", None, &[])), ["names no layer in [package.metadata.sinew]"]);
    }

    #[test]
    fn the_runtime_may_not_know_what_a_wall_is() {
        let graph = good().put("sinew-motion", at(1), &[]).put(
            "sinew-runtime",
            at(2),
            &["sinew-types", "sinew-motion"],
        );
        assert_eq!(found(graph), ["the runtime may not know sinew-motion"]);
    }

    #[test]
    fn agents_reach_the_truth_by_no_way() {
        let graph =
            good().put("sinew-record", at(3), &["sinew-sim"]).put("sinew-agents", at(5), &["sinew-record"]);
        assert_eq!(
            found(graph),
            ["agents must not reach sinew-sim: sinew-agents → sinew-record → sinew-sim"]
        );
        let direct = found(good().put("sinew-agents", at(5), &["sinew-hardware"]));
        assert!(direct.iter().any(|what| what.ends_with("sinew-agents → sinew-hardware")), "{direct:?}");
    }
}
