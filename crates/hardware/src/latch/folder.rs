//! The run folder: where running systems leave what other processes of the same user may find.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

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
    /// It belongs to somebody else, or others may write to it.
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

impl RunFolder {
    /// `$XDG_RUNTIME_DIR/sinew` where that is set, else `/dev/shm/sinew-UID`; made when it is missing.
    ///
    /// # Errors
    /// When it cannot be made, or is not this user's own.
    pub fn open() -> Result<RunFolder, FolderError> {
        RunFolder::at(&RunFolder::place(std::env::var_os("XDG_RUNTIME_DIR")))
    }

    /// Where [`open`](Self::open) looks for a value of `XDG_RUNTIME_DIR`.
    fn place(runtime: Option<OsString>) -> PathBuf {
        match runtime.filter(|folder| Path::new(folder).is_absolute()) {
            Some(folder) => Path::new(&folder).join("sinew"),
            None => PathBuf::from(format!("/dev/shm/sinew-{}", rustix::process::geteuid().as_raw())),
        }
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
}

/// A name as a part of a file name: whatever is not a letter, a digit, `_` or `-` is written as `%` and its number.
pub(super) fn file_word(name: &str) -> String {
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
    use crate::scratch::Scratch;

    #[test]
    fn it_lies_where_the_session_says_else_in_shared_memory() {
        assert_eq!(RunFolder::place(Some("/run/user/7".into())), PathBuf::from("/run/user/7/sinew"));
        let other = RunFolder::place(None);
        assert!(other.starts_with("/dev/shm"), "{other:?}");
        assert_eq!(RunFolder::place(Some("not/absolute".into())), other);
    }

    #[test]
    fn it_is_made_for_its_owner_alone_and_one_that_others_can_read_is_refused() {
        let scratch = Scratch::new("folder");
        let path = scratch.path().join("run");
        let folder = RunFolder::at(&path).unwrap();
        assert_eq!(fs::metadata(folder.path()).unwrap().mode() & 0o777, 0o700);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        assert!(matches!(RunFolder::at(&path), Err(FolderError::Unsafe { .. })));
        let link = scratch.path().join("link");
        std::os::unix::fs::symlink(scratch.path(), &link).unwrap();
        assert!(matches!(RunFolder::at(&link), Err(FolderError::Unsafe { .. })));
    }

    #[test]
    fn no_two_names_share_a_file_word() {
        assert_eq!(file_word("lab-1_a"), "lab-1_a");
        assert_eq!(file_word("../a.b"), "%2e%2e%2fa%2eb");
        assert_ne!(file_word("a%2eb"), file_word("a.b"));
    }
}
