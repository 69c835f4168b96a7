//! Heavy names stay in the leaves that own them.

use super::Finding;
use super::graph::Graph;

/// A package that is slow to build or needs what a plain machine lacks, and who alone may bring it in.
pub(crate) struct Owned {
    name: &'static str,
    owners: &'static [&'static str],
}

const fn owned(name: &'static str, owners: &'static [&'static str]) -> Owned {
    Owned { name, owners }
}

/// What is heavy, and whose it is. No owner: nobody's, since a plain machine cannot build it.
pub(crate) const OWNED: &[Owned] = &[
    // Other machines and processes: a program of its own.
    owned("zenoh", &["sinew-link"]),
    owned("iceoryx2", &["sinew-link"]),
    owned("rustdds", &["sinew-link"]),
    // The web page.
    owned("tokio", &["sinew-dashboard", "sinew-link"]),
    owned("axum", &["sinew-dashboard"]),
    owned("hyper", &["sinew-dashboard"]),
    // The store.
    owned("rusqlite", &["sinew-knowledge"]),
    owned("libsqlite3-sys", &["sinew-knowledge"]),
    // Other languages.
    owned("pyo3", &["sinew-python"]),
    // Logs and figures.
    owned("mcap", &["sinew-record"]),
    owned("lz4", &["sinew-record"]),
    owned("png", &["sinew-record"]),
    owned("tiny-skia", &["sinew-record"]),
    owned("ttf-parser", &["sinew-record"]),
    // Text formats are a matter of the border.
    owned("toml", &["sinew-program"]),
    owned("serde_json", &["sinew-program", "sinew-control"]),
    // These need libraries of the system, or compile for minutes.
    owned("image", &[]),
    owned("plotters", &[]),
    owned("openssl-sys", &[]),
    owned("zstd-sys", &[]),
    owned("bindgen", &["sinew-link"]),
    owned("cmake", &[]),
    owned("libudev-sys", &[]),
    owned("alsa-sys", &[]),
];

/// Every way from a layered crate to a heavy name goes through an owner.
pub(crate) fn check(graph: &Graph, owned: &[Owned]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, member) in graph.members.iter().filter(|(_, member)| member.layer.is_some()) {
        for heavy in owned.iter().filter(|heavy| !heavy.owners.contains(&name.as_str())) {
            let Some(way) = graph.way(name, heavy.name, heavy.owners) else { continue };
            // Whoever stands higher would only say the same again.
            if way[1..].iter().any(|step| graph.members.contains_key(step)) {
                continue;
            }
            let whose = if heavy.owners.is_empty() { "nobody".to_owned() } else { heavy.owners.join(" or ") };
            findings.push(Finding::new(
                format!("{}/Cargo.toml", member.folder),
                format!("{} belongs to {whose}: {}", heavy.name, way.join(" → ")),
            ));
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::super::graph::Layer;
    use super::*;

    const LIST: &[Owned] = &[owned("tokio", &["sinew-dashboard"]), owned("cmake", &[])];

    fn graph(of_runtime: &[&str]) -> Graph {
        Graph::default()
            .put_foreign("axum", &["tokio"])
            .put_foreign("quick", &["cmake"])
            .put("sinew-runtime", Some(Layer::Number(2)), of_runtime)
            .put("sinew-dashboard", Some(Layer::Number(6)), &["axum", "sinew-runtime"])
            .put("sinew", Some(Layer::Number(8)), &["sinew-dashboard"])
    }

    #[test]
    fn an_owner_and_who_stands_on_it_may() {
        assert_eq!(check(&graph(&[]), LIST), []);
    }

    #[test]
    fn a_heavy_name_below_its_leaf_is_found_once_with_its_way() {
        let found = check(&graph(&["axum", "quick"]), LIST);
        let found: Vec<&str> = found.iter().map(|finding| finding.what.as_str()).collect();
        assert_eq!(
            found,
            [
                "tokio belongs to sinew-dashboard: sinew-runtime → axum → tokio",
                "cmake belongs to nobody: sinew-runtime → quick → cmake",
            ]
        );
    }
}
