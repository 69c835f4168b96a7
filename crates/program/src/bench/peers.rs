//! Other systems, measured beside ours: their program does one measurement in a process of its own.
//!
//! The program is built by `cargo xtask peers`. A process a round lets ours and theirs take turns on the machine.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value as Json;

use crate::error::Failure;
use crate::terminal;

/// The variable that names the program.
const VARIABLE: &str = "SINEW_PEERS";
/// Where it is otherwise, below the current folder.
const USUAL: &str = "benches/peers/target/release/peers";
/// How much of what a failing program wrote is shown (lines).
const LAST: usize = 10;

/// The program that measures other systems.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Peers {
    program: PathBuf,
}

/// What was measured with another system, unfiltered and in order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PeerFigure {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) values: Vec<f64>,
}

impl Peers {
    /// The program that the environment names, else the one in its usual place, if it is there.
    pub(super) fn find() -> Option<Peers> {
        Peers::among(std::env::var_os(VARIABLE), Path::new(USUAL))
    }

    /// What the environment names is taken at its word: that it cannot be started is told when it is.
    fn among(named: Option<OsString>, usual: &Path) -> Option<Peers> {
        match named.filter(|name| !name.is_empty()) {
            Some(name) => Some(Peers { program: name.into() }),
            None => usual.is_file().then(|| Peers { program: usual.to_owned() }),
        }
    }

    /// Does one measurement. What the machine refused the other system is told, since its figures are not its best then.
    pub(super) fn measure(&self, name: &str, args: &[impl AsRef<OsStr>]) -> Result<Vec<PeerFigure>, Failure> {
        let output = Command::new(&self.program).arg(name).args(args).stdin(Stdio::null()).output();
        let output = output.map_err(|error| self.failure(format!("cannot be started: {error}")))?;
        let document = self.document(name, &output)?;
        for thread in document["granted"].as_array().into_iter().flatten() {
            for refused in thread["refused"].as_array().into_iter().flatten().filter_map(Json::as_str) {
                terminal::tell(&format!("the machine refused the other system of {name} {refused}"));
            }
        }
        let figures = document["figures"].as_array().map(|rows| rows.iter().map(figure).collect());
        let figures: Option<Vec<PeerFigure>> = figures.and_then(|figures: Option<_>| figures);
        figures.ok_or_else(|| {
            self.failure(format!("{name}: its document has a figure without name, unit or values"))
        })
    }

    fn document(&self, name: &str, output: &Output) -> Result<Json, Failure> {
        let (text, errors) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        if !output.status.success() {
            let last = end_of(if errors.trim().is_empty() { &text } else { &errors });
            return Err(self.failure(format!("{name}: {}\n{last}", output.status)));
        }
        serde_json::from_str(&text)
            .map_err(|error| self.failure(format!("{name}: no JSON document ({error})\n{}", end_of(&text))))
    }

    fn failure(&self, what: String) -> Failure {
        let failure = Failure::new(format!("{}: {what}", self.program.display()));
        failure.help("`cargo xtask peers` builds it anew").code(1)
    }
}

/// A row `{"name","unit","values":[…]}`, or with `"counts":[[value, how often],…]` in place of the values.
fn figure(row: &Json) -> Option<PeerFigure> {
    let mut values = match (row["values"].as_array(), row["counts"].as_array()) {
        (Some(values), _) => values.iter().map(Json::as_f64).collect::<Option<Vec<f64>>>()?,
        (None, Some(counts)) => {
            let times = |pair: &Json| Some((pair[0].as_f64()?, pair[1].as_u64()?));
            let counts = counts.iter().map(times).collect::<Option<Vec<_>>>()?;
            counts.into_iter().flat_map(|(value, count)| std::iter::repeat_n(value, count as usize)).collect()
        }
        (None, None) => return None,
    };
    values.sort_by(f64::total_cmp);
    Some(PeerFigure {
        name: row["name"].as_str()?.to_owned(),
        unit: row["unit"].as_str()?.to_owned(),
        values,
    })
}

/// The last lines of a text.
fn end_of(text: &str) -> String {
    let lines: Vec<&str> = text.trim_end().lines().collect();
    lines[lines.len().saturating_sub(LAST)..].join("\n")
}

/// Takes the values of the figure of this name out of what was measured. In another unit they could not be compared.
pub(super) fn take(figures: &mut Vec<PeerFigure>, name: &str, unit: &str) -> Result<Vec<f64>, Failure> {
    let wanted =
        |figure: &PeerFigure| figure.name == name && figure.unit == unit && !figure.values.is_empty();
    let at = figures.iter().position(wanted);
    let missing = || Failure::new(format!("the other system measured no \"{name}\" in {unit}")).code(1);
    at.map(|at| figures.swap_remove(at).values).ok_or_else(missing)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// What a program of a few lines of shell is understood to have measured; its first argument is the script itself.
    fn measured(test: &str, lines: &str, args: &[&str]) -> Result<Vec<PeerFigure>, Failure> {
        let script = std::env::temp_dir().join(format!("sinew-peers-{test}-{}", std::process::id()));
        fs::write(&script, lines).unwrap();
        let shell = Peers { program: "/bin/sh".into() };
        let figures = shell.measure(script.to_str().unwrap(), args);
        fs::remove_file(script).unwrap();
        figures
    }

    fn what(failure: &Failure) -> &str {
        &failure.problems[0].what
    }

    #[test]
    fn values_and_counts_become_figures_in_order() {
        let document = r#"{"granted":[{"refused":[]}],"figures":[
            {"name":"a","unit":"ns","values":[3.5,1]},{"name":"b","unit":"1/s","counts":[[7,2],[9,1]]}]}"#;
        let lines = format!("[ \"$1 $2\" = \"--fifo 80\" ] && echo '{document}'");
        let mut figures = measured("good", &lines, &["--fifo", "80"]).unwrap();
        let first = PeerFigure { name: "a".into(), unit: "ns".into(), values: vec![1.0, 3.5] };
        assert_eq!(figures[0], first);
        assert!(what(&take(&mut figures, "b", "ns").unwrap_err()).contains("\"b\" in ns"));
        assert_eq!(take(&mut figures, "b", "1/s").unwrap(), [7.0, 7.0, 9.0]);
        assert!(take(&mut figures, "b", "1/s").is_err());
    }

    #[test]
    fn a_program_that_prints_something_else_is_told_with_its_last_lines() {
        for (name, lines, expected) in [
            ("garbage", "seq 1 30; echo so it goes", "no JSON document"),
            ("garbage", "seq 1 30; echo so it goes", "so it goes"),
            ("empty", "true", "no JSON document"),
            ("other", "echo '{\"figures\":[{\"name\":\"a\"}]}'", "figure without name"),
            ("none", "echo '{}'", "figure without name"),
            ("fails", "echo '{}'; echo no log folder >&2; exit 3", "exit status: 3\nno log folder"),
        ] {
            let failure = measured(name, lines, &[]).unwrap_err();
            assert!(what(&failure).contains(expected), "{name}: {failure:?}");
            assert!(what(&failure).lines().count() <= LAST + 1, "{failure:?}");
            assert_eq!(failure.code, 1);
        }
    }

    #[test]
    fn what_the_environment_names_comes_first_and_is_told_when_it_is_not_there() {
        let nowhere = Path::new("no/such/folder/peers");
        assert_eq!(Peers::among(None, nowhere), None);
        assert_eq!(Peers::among(Some("".into()), nowhere), None);
        let shell = Path::new("/bin/sh");
        assert_eq!(Peers::among(None, shell), Some(Peers { program: shell.to_owned() }));
        let peers = Peers::among(Some(nowhere.into()), shell).unwrap();
        let failure = peers.measure("hop", &[""; 0]).unwrap_err();
        assert!(what(&failure).contains("cannot be started"), "{failure:?}");
    }
}
