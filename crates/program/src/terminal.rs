//! Where text goes: the one place that prints, besides failures, and that knows whether people are watching.

use std::io::{self, IsTerminal as _, Write as _};
use std::time::{Instant, SystemTime};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value as Json;
use types::Time;

/// What a command has to say on standard output. Nobody is left to be told when the stream is closed.
pub(crate) fn say(text: &str) {
    let mut out = io::stdout().lock();
    let _ = out.write_all(text.as_bytes());
    if !text.ends_with('\n') {
        let _ = out.write_all(b"\n");
    }
    let _ = out.flush();
}

/// One JSON document on standard output.
pub(crate) fn say_json(document: &Json) {
    say(&document.to_string());
}

/// What people shall know besides, on standard error: a program that reads the output does not see it.
pub(crate) fn tell(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Whether somebody watches standard output.
pub(crate) fn watched() -> bool {
    io::stdout().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Whether text on standard output may be coloured.
pub(crate) fn coloured() -> bool {
    watched() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Text in one of the terminal's colours, where `on`.
pub(crate) fn paint(on: bool, code: &str, text: &str) -> String {
    if on { format!("\u{1b}[{code}m{text}\u{1b}[0m") } else { text.to_owned() }
}

/// The clock of the host, to measure work and to pace what people look at; never a clock of a run.
#[allow(clippy::disallowed_methods)] // The program may look at the clock here, and nowhere else.
pub(crate) fn host_now() -> Instant {
    Instant::now()
}

/// The host's date, for what is written down; never a clock of a run.
#[allow(clippy::disallowed_methods)] // The program may look at the clock here, and nowhere else.
pub(crate) fn host_date() -> Time {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Time(i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX))
}

/// Waits on the host's clock. For threads that look now and then, never for one that runs agents.
pub(crate) fn pause(span: std::time::Duration) {
    let end = host_now() + span;
    loop {
        let left = end.saturating_duration_since(host_now());
        if left.is_zero() {
            return;
        }
        std::thread::park_timeout(left);
    }
}

/// Progress over so many steps, on standard error when it is a terminal and else nowhere.
pub(crate) fn progress(steps: u64, what: &'static str) -> ProgressBar {
    if !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:30} {pos} of {len}, {eta} left") {
        bar.set_style(style);
    }
    bar
}
