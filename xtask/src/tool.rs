//! Running other programs.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::failure::Failure;

/// A program that is about to run. Its line is shown before it does.
pub(crate) struct Tool {
    command: Command,
    settings: String,
}

impl Tool {
    pub(crate) fn new(program: impl AsRef<OsStr>, folder: &Path) -> Tool {
        let mut command = Command::new(program);
        command.current_dir(folder).stdin(Stdio::null());
        Tool { command, settings: String::new() }
    }

    /// The same cargo that started this program.
    pub(crate) fn cargo(folder: &Path) -> Tool {
        Tool::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), folder)
    }

    pub(crate) fn args<S: AsRef<OsStr>>(mut self, args: impl IntoIterator<Item = S>) -> Tool {
        self.command.args(args);
        self
    }

    pub(crate) fn arg(self, arg: impl AsRef<OsStr>) -> Tool {
        self.args([arg])
    }

    pub(crate) fn env(mut self, key: &str, value: impl AsRef<OsStr>) -> Tool {
        self.settings.push_str(&format!("{key}={:?} ", value.as_ref()));
        self.command.env(key, value);
        self
    }

    /// Adds flags to those that the person already has in the environment.
    pub(crate) fn flags(self, key: &str, flags: &str) -> Tool {
        let all = match std::env::var(key) {
            Ok(before) if !before.is_empty() => format!("{before} {flags}"),
            _ => flags.to_owned(),
        };
        self.env(key, all)
    }

    /// Runs it with its output on the terminal; any code but 0 is a failure with this remedy.
    pub(crate) fn run(mut self, remedy: &str) -> Result<(), Failure> {
        let line = self.show();
        let status = self.command.status().map_err(|error| cannot_start(&line, &error))?;
        if status.success() { Ok(()) } else { Err(Failure::new(format!("{line}\n        {status}"), remedy)) }
    }

    /// Runs it and takes what it writes to standard output; standard error goes to the terminal.
    pub(crate) fn output(mut self) -> Result<(String, Output), Failure> {
        let line = self.show();
        let output =
            self.command.stderr(Stdio::inherit()).output().map_err(|error| cannot_start(&line, &error))?;
        Ok((line, output))
    }

    /// Runs it and takes what it writes to standard error; whether it ended well comes with it.
    pub(crate) fn told(mut self) -> Result<(bool, String), Failure> {
        let line = self.show();
        let output = self.command.output().map_err(|error| cannot_start(&line, &error))?;
        Ok((output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned()))
    }

    /// Runs it and takes what it writes; whether it ended well, standard output, and standard error.
    pub(crate) fn heard(mut self) -> Result<(bool, String, String), Failure> {
        let line = self.show();
        let output = self.command.output().map_err(|error| cannot_start(&line, &error))?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Ok((output.status.success(), text(&output.stdout), text(&output.stderr)))
    }

    /// Like `output`, but any code but 0 is a failure.
    pub(crate) fn text(self, remedy: &str) -> Result<String, Failure> {
        let (line, output) = self.output()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        if output.status.success() {
            return Ok(text);
        }
        Err(Failure::new(format!("{line}\n        {}\n{}", output.status, end_of(&text)), remedy))
    }

    /// Whether it can be started and ends well, without a word.
    pub(crate) fn works(mut self) -> bool {
        self.command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
    }

    fn show(&self) -> String {
        let program = Path::new(self.command.get_program());
        let name = program.file_name().unwrap_or(program.as_os_str());
        let args = self.command.get_args().map(OsStr::to_string_lossy);
        let words: Vec<_> = std::iter::once(name.to_string_lossy()).chain(args).collect();
        let line = format!("{}{}", self.settings, words.join(" "));
        println!("  $ {line}");
        line
    }
}

/// The last lines of a long text.
pub(crate) fn end_of(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(40)..].join("\n")
}

fn cannot_start(line: &str, error: &std::io::Error) -> Failure {
    Failure::new(format!("{line}: {error}"), "Is the program installed and on the path?")
}
