//! The socket of a running system, and the threads that serve it.
//!
//! ```text
//!   socket ── accept ──┬─ reader ─▶ commands ─▶ runtime::Control ─▶ the system
//!                      │               │
//!                      └─ writer ◀── outbox ◀── taps (one thread) ◀── what outputs send
//! ```
//!
//! All of it is ordinary threads with bounded queues. The real-time side is reached only through [`runtime::Control`].

use std::collections::HashMap;
use std::fs;
use std::io::{self, Write};
use std::net::Shutdown;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use runtime::{Control, Refusal, Request, RunFolder};
use serde_json::Value as Json;
use types::definition::Definition;

use crate::commands::{Asker, Commands};
use crate::lines::{Lines, NoLine};
use crate::outbox::Outbox;
use crate::protocol::{self, LONGEST_LINE, Question};
use crate::sockets;
use crate::taps::Taps;
use crate::words::Usage;

/// What the program that runs a system does for those who control it.
///
/// It is called from one thread for each client, several at once.
pub trait Hooks: Send + Sync + 'static {
    /// A request is on its way to the system, which may still refuse it.
    ///
    /// # Errors
    /// When it asks for what the system cannot know to be wrong; it does not reach it then.
    fn asks(&self, request: &Request) -> Result<(), Refusal> {
        let _ = request;
        Ok(())
    }

    /// Sets the emergency stop; `why` is what the person said, and may be empty.
    ///
    /// # Errors
    /// When the robots could not be stopped.
    fn stop(&self, why: &str) -> Result<(), Refusal>;

    /// Ends the emergency stop. Nothing moves by it.
    ///
    /// # Errors
    /// When it cannot be ended now.
    fn reset(&self) -> Result<(), Refusal>;

    /// The last `n` decisions with their reasons, the newest last.
    ///
    /// # Errors
    /// When nobody in the system decides.
    fn why(&self, n: usize) -> Result<Json, Refusal>;

    /// A message as JSON, from its CDR.
    ///
    /// # Errors
    /// When the bytes are no such message.
    fn decode(&self, definition: &Definition, cdr: &[u8]) -> Result<Json, String>;

    /// The CDR of a message that was given as JSON; fields that are not named are zero.
    ///
    /// # Errors
    /// What is wrong with it.
    fn encode(&self, definition: &Definition, message: &Json) -> Result<Vec<u8>, String>;

    /// Further commands that the program knows.
    fn more(&self) -> &[Usage] {
        &[]
    }

    /// Does one of the further commands.
    ///
    /// # Errors
    /// Why it is not done.
    fn command(&self, words: &[String]) -> Result<Json, Refusal> {
        Err(Refusal::new(format!("\"{}\" is not done here", words.join(" "))))
    }
}

/// How much a server gives to its clients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Clients at once. A person has a few windows and scripts; each costs two threads that sleep.
    pub clients: usize,
    /// Bytes that wait for one client; events take half at most. Four of the longest lines: enough for a burst of scans.
    pub waiting: usize,
    /// How long a client may take no byte of what waits for it before it is cut. A busy shell takes less than a second.
    pub patience: Duration,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits { clients: 32, waiting: 4 * LONGEST_LINE, patience: Duration::from_secs(5) }
    }
}

/// Why a server cannot start.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The socket cannot be made.
    #[error("the control socket {path} cannot be made: {cause}")]
    Socket {
        /// Where.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// There is no thread for it.
    #[error("no thread could be started for the control socket: {0}")]
    NoThread(io::Error),
}

/// The control interface of a running system. Dropping it lets clients have the answers that are under way, ends its threads and
/// removes the socket.
pub struct Server {
    shared: Arc<Shared>,
    name: String,
    path: PathBuf,
    inode: u64,
    listener: Arc<UnixListener>,
    threads: Vec<JoinHandle<()>>,
    /// Says something only when every thread of a client has ended.
    all_gone: Receiver<()>,
}

struct Shared {
    commands: Commands,
    taps: Arc<Taps>,
    limits: Limits,
    hello: String,
    clients: Mutex<HashMap<u64, UnixStream>>,
    ending: AtomicBool,
}

impl Shared {
    fn clients(&self) -> MutexGuard<'_, HashMap<u64, UnixStream>> {
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How long the end waits for clients to take their answers, and then for their threads.
const FAREWELL: Duration = Duration::from_millis(500);

impl Server {
    /// Opens `NAME.sock` in the run folder and serves it. Where a living system has that name, this one is called `NAME-2`, and
    /// so on; the socket of a dead one is cleared away.
    ///
    /// # Errors
    /// When the socket or a thread cannot be made.
    pub fn start(
        folder: &RunFolder,
        name: &str,
        control: Control,
        hooks: Arc<dyn Hooks>,
    ) -> Result<Server, ServerError> {
        Server::start_with(folder, name, control, hooks, Limits::default())
    }

    /// The same with other limits.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn start_with(
        folder: &RunFolder,
        name: &str,
        control: Control,
        hooks: Arc<dyn Hooks>,
        limits: Limits,
    ) -> Result<Server, ServerError> {
        let (name, path, listener) = bind(folder, name)?;
        let inode = fs::metadata(&path).map_or(0, |found| found.ino());
        let listener = Arc::new(listener);
        let taps = Arc::new(Taps::new(control.clone(), hooks.clone()));
        let shared = Arc::new(Shared {
            commands: Commands::new(control, hooks, taps.clone()),
            taps: taps.clone(),
            limits,
            hello: protocol::hello(&name),
            clients: Mutex::default(),
            ending: AtomicBool::new(false),
        });
        let (here, all_gone) = sync_channel(0);
        let mut server = Server {
            shared: shared.clone(),
            name,
            path,
            inode,
            listener: listener.clone(),
            threads: Vec::new(),
            all_gone,
        };
        let pump = Builder::new().name("control-taps".into()).spawn(move || taps.pump());
        server.threads.push(pump.map_err(ServerError::NoThread)?);
        let accept = Builder::new().name("control".into()).spawn(move || accept(&listener, &shared, here));
        server.threads.push(accept.map_err(ServerError::NoThread)?);
        Ok(server)
    }

    /// The name under which clients find it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where its socket is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        // Removed while it still listens: nobody else takes the name before that. One that took it after somebody removed ours stays.
        if fs::metadata(&self.path).is_ok_and(|found| found.ino() == self.inode) {
            // It may be gone by now, which is as good.
            let _ = fs::remove_file(&self.path);
        }
        // Wakes the thread that accepts. Clients may ask nothing more; what they asked is answered.
        let _ = rustix::net::shutdown(&self.listener, rustix::net::Shutdown::Both);
        self.shut(Shutdown::Read);
        if self.all_gone.recv_timeout(FAREWELL) == Err(RecvTimeoutError::Timeout) {
            self.shut(Shutdown::Both);
        }
        self.shared.taps.end();
        for thread in self.threads.drain(..) {
            // One that panicked has said so.
            let _ = thread.join();
        }
        // A client's thread that still waits for the system ends with it.
        let _ = self.all_gone.recv_timeout(FAREWELL);
    }
}

impl Server {
    fn shut(&self, how: Shutdown) {
        for stream in self.shared.clients().values() {
            // One that has gone is shut already.
            let _ = stream.shutdown(how);
        }
    }
}

/// The name, path and socket of a system that would like to be called `name`.
fn bind(folder: &RunFolder, name: &str) -> Result<(String, PathBuf, UnixListener), ServerError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |cause| ServerError::Socket { path, cause }
    };
    let _lock = sockets::lock(folder).map_err(failed(folder.path()))?;
    let mut number = 1;
    loop {
        let name = if number == 1 { name.to_owned() } else { format!("{name}-{number}") };
        let path = sockets::socket_of(folder, &name);
        match UnixStream::connect(&path) {
            Ok(_) => {
                number += 1;
                continue;
            }
            // Its process is dead, or it never was a socket of a system.
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {
                fs::remove_file(&path).map_err(failed(&path))?;
            }
            Err(_) => {}
        }
        let listener = UnixListener::bind(&path).map_err(failed(&path))?;
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).map_err(failed(&path))?;
        return Ok((name, path, listener));
    }
}

fn accept(listener: &UnixListener, shared: &Arc<Shared>, here: SyncSender<()>) {
    let mut number = 0;
    loop {
        let accepted = listener.accept();
        if shared.ending.load(Ordering::Acquire) {
            return;
        }
        let Ok((stream, _)) = accepted else {
            // Too many open files, or a client that went at once: both pass.
            std::thread::park_timeout(Duration::from_millis(50));
            continue;
        };
        number += 1;
        // A client that cannot be served finds its connection closed.
        let _ = welcome(number, stream, shared, &here);
    }
}

fn welcome(
    number: u64,
    mut stream: UnixStream,
    shared: &Arc<Shared>,
    here: &SyncSender<()>,
) -> io::Result<()> {
    stream.set_write_timeout(Some(shared.limits.patience))?;
    // The first line always fits into the socket's own buffer.
    writeln!(stream, "{}", shared.hello)?;
    if shared.clients().len() >= shared.limits.clients {
        let refusal = Refusal::new(format!("the system has {} clients already", shared.limits.clients))
            .help("end one of them and try again");
        return writeln!(stream, "{}", protocol::answer(&Json::Null, &Err(refusal)));
    }
    shared.clients().insert(number, stream.try_clone()?);
    let (mine, here) = (shared.clone(), here.clone());
    let spawned = Builder::new().name(format!("control-{number}")).spawn(move || {
        let _present = Present { client: number, shared: &mine, _here: here };
        serve(number, stream, &mine);
    });
    if spawned.is_err() {
        shared.clients().remove(&number);
    }
    spawned.map(drop)
}

/// A client that has a place: it is given back when the client's thread ends, however it does.
struct Present<'a> {
    client: u64,
    shared: &'a Shared,
    _here: SyncSender<()>,
}

impl Drop for Present<'_> {
    fn drop(&mut self) {
        self.shared.clients().remove(&self.client);
    }
}

/// Serves one client to its end.
fn serve(client: u64, stream: UnixStream, shared: &Arc<Shared>) {
    let outbox = Outbox::new(shared.limits.waiting);
    let asker = Asker { client, outbox: outbox.clone() };
    let writer = stream.try_clone().and_then(|stream| {
        let outbox = outbox.clone();
        Builder::new().name(format!("control-{client}-out")).spawn(move || write(stream, &outbox))
    });
    if shared.ending.load(Ordering::Acquire) {
        // It came too late to be told that nothing more is answered.
        let _ = stream.shutdown(Shutdown::Read);
    }
    let leaving = Leaving { client, outbox, shared };
    if let Ok(writer) = writer {
        read(stream, &asker, shared);
        drop(leaving);
        // It ends when all is written, or nobody reads.
        let _ = writer.join();
    }
}

/// Takes a client out of everything that knows it, also when a hook panicked.
struct Leaving<'a> {
    client: u64,
    outbox: Arc<Outbox>,
    shared: &'a Shared,
}

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        self.shared.taps.forget(self.client);
        self.outbox.close();
    }
}

/// Answers questions until there are no more, or nobody takes the answers.
fn read(stream: UnixStream, asker: &Asker, shared: &Shared) {
    let mut lines = Lines::new(stream, LONGEST_LINE);
    loop {
        let (answer, goes_on) = match lines.next() {
            Ok(Some(line)) if line.trim_ascii().is_empty() => continue,
            Ok(Some(line)) => (answer(&line, asker, shared), true),
            Err(NoLine::TooLong(most)) => {
                let refusal = Refusal::new(format!("the line is longer than {most} bytes"));
                (protocol::answer(&Json::Null, &Err(refusal)), false)
            }
            Ok(None) | Err(NoLine::Io(_)) => return,
        };
        if !asker.outbox.put(answer.into()) || !goes_on {
            return;
        }
    }
}

fn answer(line: &[u8], asker: &Asker, shared: &Shared) -> String {
    let (id, result) = match Question::read(line) {
        Ok(question) => {
            let result = shared.commands.answer(asker, &question);
            (question.id, result)
        }
        Err((id, refusal)) => (id, Err(refusal)),
    };
    let line = protocol::answer(&id, &result);
    if line.len() <= LONGEST_LINE {
        return line;
    }
    let refusal = Refusal::new(format!("the answer is longer than the {LONGEST_LINE} bytes of a line"));
    protocol::answer(&id, &Err(refusal))
}

/// Writes what waits until the box is closed, or the client takes nothing for too long.
fn write(mut stream: UnixStream, outbox: &Outbox) {
    while let Some(line) = outbox.next() {
        if stream.write_all(line.as_bytes()).and_then(|()| stream.write_all(b"\n")).is_err() {
            outbox.abandon();
            break;
        }
    }
    // Wakes the reader, and tells the client that this is the end.
    let _ = stream.shutdown(Shutdown::Both);
}
