//! Controlling a running system from another process.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use runtime::{FolderError, Refusal, RunFolder};
use serde_json::Value as Json;
use types::value::nearest;

use crate::lines::{Lines, NoLine};
use crate::protocol::{LONGEST_LINE, Question, VERSION};
use crate::sockets::{socket_of, sockets_in};

/// Why a running system cannot be asked, or does not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// There is no run folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Nothing runs.
    #[error("no system is running; start one with \"sinew run FILE\"")]
    NothingRuns,
    /// Several systems run, and none was named.
    #[error("{} systems are running: {}; choose one with --system NAME", .0.len(), .0.join(", "))]
    Several(Vec<String>),
    /// None of this name runs.
    #[error("no system \"{name}\" is running; {help}")]
    Unknown {
        /// The name that was asked for.
        name: String,
        /// Which there are.
        help: String,
    },
    /// It speaks another version of the protocol.
    #[error(
        "the system speaks version {theirs} of the control protocol, this program version {VERSION}; use the program that started it"
    )]
    Version {
        /// Its version.
        theirs: Json,
    },
    /// It did not answer in time.
    #[error("the system did not answer within {} s; it may be held up by a step that does not return", .0.as_secs_f64())]
    TimedOut(Duration),
    /// It has ended, or it cut this client.
    #[error("the system has ended")]
    Ended,
    /// It said something that is not of the protocol.
    #[error("the system said something that is not understood: {0}")]
    NotUnderstood(String),
    /// The socket failed.
    #[error("the control socket failed: {0}")]
    Io(#[from] io::Error),
    /// It refused, and says why.
    #[error("{0}")]
    Refused(Refusal),
}

/// Something that a running system tells without being asked for it each time.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A message of an output that is listened to.
    Message {
        /// The output.
        port: String,
        /// What it carries besides its payload.
        header: Json,
        /// The message.
        message: Json,
    },
    /// Messages that were lost because this client did not read them in time.
    Lost {
        /// The output.
        port: String,
        /// How many.
        count: u64,
    },
}

/// How many events wait in the client while it waits for an answer; older ones are lost, and counted.
const EVENTS: usize = 4096;

/// A connection to a running system.
///
/// ```no_run
/// let mut client = control::Client::connect(None)?;
/// println!("{}", client.call(&["ls"])?);
/// client.call(&["tap", "sonar.filtered"])?;
/// while let Some(event) = client.next_event(None)? {
///     println!("{event:?}");
/// }
/// # Ok::<(), control::ClientError>(())
/// ```
pub struct Client {
    stream: UnixStream,
    lines: Lines<UnixStream>,
    system: String,
    process: u32,
    next: u64,
    time_out: Duration,
    events: VecDeque<Event>,
    lost: u64,
}

/// How long a client waits for an answer when nobody says: a system that is held up is told from one that is slow.
const TIME_OUT: Duration = Duration::from_secs(10);

impl Client {
    /// Connects to the system called `system`, or to the only one that runs.
    ///
    /// # Errors
    /// When none runs, when several run and none is named, or when the socket fails.
    pub fn connect(system: Option<&str>) -> Result<Client, ClientError> {
        Client::connect_in(&RunFolder::open()?, system)
    }

    /// The same in a given run folder.
    ///
    /// # Errors
    /// As [`connect`](Self::connect).
    pub fn connect_in(folder: &RunFolder, system: Option<&str>) -> Result<Client, ClientError> {
        if let Some(name) = system {
            return match Client::at(&socket_of(folder, name)) {
                Err(ClientError::Io(error)) if is_nobody(&error) => Err(unknown(name, &running(folder)?)),
                connected => connected,
            };
        }
        let mut clients = running(folder)?;
        match clients.len() {
            0 => Err(ClientError::NothingRuns),
            1 => Ok(clients.remove(0)),
            _ => Err(ClientError::Several(clients.into_iter().map(|client| client.system).collect())),
        }
    }

    /// Connects to the socket at `path`.
    ///
    /// # Errors
    /// When nobody listens there, or somebody who speaks another version.
    pub fn at(path: &Path) -> Result<Client, ClientError> {
        let stream = UnixStream::connect(path)?;
        stream.set_write_timeout(Some(TIME_OUT))?;
        let lines = Lines::new(stream.try_clone()?, LONGEST_LINE);
        let mut client = Client {
            stream,
            lines,
            system: String::new(),
            process: 0,
            next: 1,
            time_out: TIME_OUT,
            events: VecDeque::new(),
            lost: 0,
        };
        let hello = client.line(Some(TIME_OUT))?;
        let hello = &hello["hello"];
        if hello["sinew"] != VERSION {
            return Err(ClientError::Version { theirs: hello["sinew"].clone() });
        }
        client.system = hello["system"].as_str().unwrap_or_default().to_owned();
        client.process = hello["pid"].as_u64().and_then(|pid| u32::try_from(pid).ok()).unwrap_or(0);
        Ok(client)
    }

    /// The name of the system.
    pub fn system(&self) -> &str {
        &self.system
    }

    /// The number of its process.
    pub fn process(&self) -> u32 {
        self.process
    }

    /// Sets how long an answer may take; 10 s when nobody says.
    pub fn set_time_out(&mut self, time_out: Duration) {
        self.time_out = time_out;
    }

    /// Asks in words, and waits for the answer.
    ///
    /// # Errors
    /// When the system refuses, does not answer in time, or has ended.
    pub fn call<W: AsRef<str>>(&mut self, words: &[W]) -> Result<Json, ClientError> {
        self.call_with(words, None)
    }

    /// The same with a message for `send` and `call`.
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn call_with<W: AsRef<str>>(
        &mut self,
        words: &[W],
        message: Option<Json>,
    ) -> Result<Json, ClientError> {
        let id = Json::from(self.next);
        self.next += 1;
        let words = words.iter().map(|word| word.as_ref().to_owned()).collect();
        let line = Question { id: id.clone(), words, message }.line();
        self.stream.write_all(line.as_bytes()).and_then(|()| self.stream.write_all(b"\n")).map_err(ended)?;
        #[expect(clippy::disallowed_methods, reason = "a person's patience runs on the host's clock")]
        let asked = Instant::now();
        loop {
            let left = self.time_out.saturating_sub(asked.elapsed());
            let mut json = self.line(Some(left))?;
            if json.get("event").is_some() {
                self.keep(read_event(json)?);
            } else if json.get("error").is_some() && (json["id"] == id || json["id"].is_null()) {
                return Err(ClientError::Refused(read_refusal(&json["error"])));
            } else if json.get("ok").is_some() && json["id"] == id {
                return Ok(json["ok"].take());
            }
            // Anything else answers a question that was given up.
        }
    }

    /// The next event, or nothing when none comes in time; without a time it waits until there is one.
    ///
    /// # Errors
    /// When the system has ended.
    pub fn next_event(&mut self, within: Option<Duration>) -> Result<Option<Event>, ClientError> {
        if let Some(event) = self.events.pop_front() {
            return Ok(Some(event));
        }
        #[expect(clippy::disallowed_methods, reason = "a person's patience runs on the host's clock")]
        let asked = Instant::now();
        loop {
            match self.line(within.map(|within| within.saturating_sub(asked.elapsed()))) {
                Ok(json) if json.get("event").is_some() => return read_event(json).map(Some),
                // It answers a question that was given up.
                Ok(_) => {}
                Err(ClientError::TimedOut(_)) => return Ok(None),
                Err(error) => return Err(error),
            }
        }
    }

    /// How many events were lost within the client because nobody asked for them.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    fn keep(&mut self, event: Event) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
            self.lost += 1;
        }
        self.events.push_back(event);
    }

    /// The next line of the system.
    fn line(&mut self, within: Option<Duration>) -> Result<Json, ClientError> {
        // No time at all would mean for ever.
        let within = within.map(|within| within.max(Duration::from_millis(1)));
        self.stream.set_read_timeout(within)?;
        let line = self.lines.next().map_err(|error| match error {
            NoLine::TooLong(_) => ClientError::NotUnderstood(error.to_string()),
            NoLine::Io(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                ClientError::TimedOut(self.time_out)
            }
            NoLine::Io(error) => ended(error),
        })?;
        let line = line.ok_or(ClientError::Ended)?;
        serde_json::from_slice(&line).map_err(|error| ClientError::NotUnderstood(error.to_string()))
    }
}

/// Connections to all systems that run, in the order of their names. Sockets of dead ones are passed over.
fn running(folder: &RunFolder) -> Result<Vec<Client>, ClientError> {
    let mut clients = Vec::new();
    for path in sockets_in(folder)? {
        match Client::at(&path) {
            Ok(client) => clients.push(client),
            Err(ClientError::Io(error)) if is_nobody(&error) => {}
            // It ended while it was asked.
            Err(ClientError::Ended) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(clients)
}

fn is_nobody(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused)
}

fn unknown(name: &str, running: &[Client]) -> ClientError {
    let names: Vec<&str> = running.iter().map(|client| client.system.as_str()).collect();
    let help = match nearest(name, names.iter().copied()) {
        Some(right) => format!("did you mean \"{right}\"?"),
        None if names.is_empty() => "none is; start one with \"sinew run FILE\"".to_owned(),
        None => format!("there are: {}", names.join(", ")),
    };
    ClientError::Unknown { name: name.to_owned(), help }
}

fn ended(error: io::Error) -> ClientError {
    match error.kind() {
        ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => ClientError::Ended,
        ErrorKind::WouldBlock | ErrorKind::TimedOut => ClientError::TimedOut(TIME_OUT),
        _ => ClientError::Io(error),
    }
}

fn read_refusal(json: &Json) -> Refusal {
    let text = |key: &str| json[key].as_str().map(str::to_owned);
    Refusal { what: text("what").unwrap_or_default(), help: text("help") }
}

fn read_event(mut json: Json) -> Result<Event, ClientError> {
    let port = json["port"].as_str().unwrap_or_default().to_owned();
    match json["event"].as_str() {
        Some("message") => {
            Ok(Event::Message { port, header: json["header"].take(), message: json["message"].take() })
        }
        Some("lost") => Ok(Event::Lost { port, count: json["count"].as_u64().unwrap_or(0) }),
        _ => Err(ClientError::NotUnderstood(json.to_string())),
    }
}
