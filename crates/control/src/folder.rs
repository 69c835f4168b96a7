//! The run folder: where running systems leave what other processes of the same user may find.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::FlockOperation;

/// Why there is no run folder.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// It cannot be made or looked at.
    #[error("the run folder {path} cannot be used: {cause}")]
    Io {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// It belongs to somebody else, or others may look into it.
    #[error(
        "the run folder {path} is not safe: {why}; remove it, or set XDG_RUNTIME_DIR to a folder of your own"
    )]
    Unsafe {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        why: &'static str,
    },
}

/// A folder of this user alone (mode 0700), as a rule in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

/// What the names of sockets end with.
const SOCKET: &str = "sock";
/// Who starts or looks for dead sockets holds a lock on this file, so that no two do it at once.
const LOCK: &str = "sockets.lock";

impl RunFolder {
    /// `$XDG_RUNTIME_DIR/sinew` where that is set, else `/dev/shm/sinew-UID`; made when it is missing.
    ///
    /// # Errors
    /// When it cannot be made, or is not this user's own.
    pub fn open() -> Result<RunFolder, FolderError> {
        RunFolder::open_for(std::env::var_os("XDG_RUNTIME_DIR"))
    }

    /// The same for a given value of `XDG_RUNTIME_DIR`.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_for(runtime: Option<OsString>) -> Result<RunFolder, FolderError> {
        RunFolder::at(&match runtime.map(PathBuf::from).filter(|folder| folder.is_absolute()) {
            Some(folder) => folder.join("sinew"),
            None => PathBuf::from(format!("/dev/shm/sinew-{}", rustix::process::geteuid().as_raw())),
        })
    }

    /// The folder `path`; its last part is made when it is missing.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn at(path: &Path) -> Result<RunFolder, FolderError> {
        let io = |cause| FolderError::Io { path: path.to_owned(), cause };
        match fs::DirBuilder::new().mode(0o700).create(path) {
            Err(cause) if cause.kind() != io::ErrorKind::AlreadyExists => return Err(io(cause)),
            _ => {}
        }
        // Of the link itself: a link to another folder is not what was made here.
        let found = fs::symlink_metadata(path).map_err(io)?;
        let bad = |why| Err(FolderError::Unsafe { path: path.to_owned(), why });
        if !found.is_dir() {
            return bad("it is no folder");
        }
        if found.uid() != rustix::process::geteuid().as_raw() {
            return bad("it belongs to another user");
        }
        if found.mode() & 0o077 != 0 {
            return bad("others have rights to it (its mode must be 0700)");
        }
        Ok(RunFolder { path: path.to_owned() })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of the socket of the system called `name`.
    pub fn socket(&self, name: &str) -> PathBuf {
        self.path.join(format!("{}.{SOCKET}", file_word(name)))
    }

    /// All sockets that lie there, those of dead systems too, in the order of their names.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn sockets(&self) -> io::Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.path)? {
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
    pub(crate) fn lock(&self) -> io::Result<File> {
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .mode(0o600)
            .open(self.path.join(LOCK))?;
        rustix::fs::flock(&file, FlockOperation::LockExclusive)?;
        Ok(file)
    }
}

/// A name as a part of a file name: whatever is not a letter, a digit, `_` or `-` is written as `%` and its number.
fn file_word(name: &str) -> String {
    let mut word = String::with_capacity(name.len());
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-' {
            word.push(char::from(byte));
        } else {
            word.push_str(&format!("%{byte:02x}"));
        }
    }
    word
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn it_is_made_for_its_owner_alone_and_others_are_refused() {
        let scratch = std::env::temp_dir().join(format!("sinew-folder-{}", std::process::id()));
        fs::create_dir_all(&scratch).unwrap();
        let folder = RunFolder::open_for(Some(scratch.clone().into())).unwrap();
        assert_eq!(folder.path(), scratch.join("sinew"));
        assert_eq!(fs::metadata(folder.path()).unwrap().mode() & 0o777, 0o700);
        assert_eq!(folder.socket("../a b"), scratch.join("sinew/%2e%2e%2fa%20b.sock"));

        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o750)).unwrap();
        assert!(matches!(RunFolder::at(folder.path()), Err(FolderError::Unsafe { .. })));
        let link = scratch.join("link");
        std::os::unix::fs::symlink(&scratch, &link).unwrap();
        assert!(matches!(RunFolder::at(&link), Err(FolderError::Unsafe { .. })));
        assert!(matches!(RunFolder::at(&scratch.join("no/where")), Err(FolderError::Io { .. })));
        fs::remove_dir_all(&scratch).unwrap();
    }
}
