//! What was measured on: without it no figure means anything.

use std::fs;

use serde_json::{Value as Json, json};

fn first_line(path: &str) -> Option<String> {
    Some(fs::read_to_string(path).ok()?.lines().next()?.trim().to_owned())
}

fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

const BUILD: &str = if cfg!(debug_assertions) { "dev" } else { "release" };

/// For programs.
pub(super) fn describe() -> Json {
    json!({
        "cores": cores(),
        "processor": processor(),
        "kernel": first_line("/proc/sys/kernel/osrelease"),
        "governor": first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        "load": first_line("/proc/loadavg").and_then(|line| line.split(' ').next()?.parse::<f64>().ok()),
        "build": BUILD,
    })
}

/// For people.
pub(super) fn line() -> String {
    let unknown = || "unknown".to_owned();
    let load = first_line("/proc/loadavg").and_then(|line| Some(line.split(' ').next()?.to_owned()));
    let mut text = format!(
        "{} cores ({}), kernel {}, load {}",
        cores(),
        processor().unwrap_or_else(unknown),
        first_line("/proc/sys/kernel/osrelease").unwrap_or_else(unknown),
        load.unwrap_or_else(unknown),
    );
    if BUILD == "dev" {
        text += ", a dev build: figures of a release build are several times better";
    }
    text
}
