//! The sockets of running systems in the run folder.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;

use runtime::RunFolder;
use rustix::fs::FlockOperation;

/// What the names of sockets end with.
const SOCKET: &str = "sock";
/// Who starts or looks for dead sockets holds a lock on this file, so that no two do it at once.
const LOCK: &str = "sockets.lock";

/// The path of the socket of the system called `name`.
pub fn socket_of(folder: &RunFolder, name: &str) -> PathBuf {
    folder.file(&[name], SOCKET)
}

/// All sockets that lie in the folder, those of dead systems too, in the order of their names.
///
/// # Errors
/// When the folder cannot be read.
pub fn sockets_in(folder: &RunFolder) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder.path())? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == SOCKET) {
            found.push(path);
        }
    }
    // By name: the end of a file name would put "lab-2" before "lab".
    found.sort_by(|a, b| a.file_stem().cmp(&b.file_stem()));
    Ok(found)
}

/// Keeps others from making or clearing away sockets until the file is dropped.
pub(crate) fn lock(folder: &RunFolder) -> io::Result<File> {
    let file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .mode(0o600)
        .open(folder.path().join(LOCK))?;
    rustix::fs::flock(&file, FlockOperation::LockExclusive)?;
    Ok(file)
}
