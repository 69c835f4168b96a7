//! The run folder: where running systems leave what other processes of the same user may find, as sockets and latches.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use crate::os;

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
    /// It belongs to somebody else, or others have rights to it.
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
        match runtime.map(PathBuf::from).filter(|folder| folder.is_absolute()) {
            Some(folder) => folder.join("sinew"),
            None => PathBuf::from(format!("/dev/shm/sinew-{}", os::user())),
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
        if found.uid() != os::user() {
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

    /// The path of the file of what is called `names`, say a system and its robot. Whatever the names are made of, the file lies
    /// in this folder, and other names have another file.
    pub fn file(&self, names: &[&str], ending: &str) -> PathBuf {
        let mut file = String::new();
        for name in names {
            push_word(&mut file, name);
            file.push('.');
        }
        self.path.join(file + ending)
    }
}

/// Adds a name as a part of a file name: whatever is not a letter, a digit, `_` or `-` is written as `%` and its number.
fn push_word(file: &mut String, name: &str) {
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-' {
            file.push(char::from(byte));
        } else {
            file.push_str(&format!("%{byte:02x}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn it_lies_where_the_session_says_else_in_shared_memory() {
        assert_eq!(RunFolder::place(Some("/run/user/7".into())), PathBuf::from("/run/user/7/sinew"));
        let other = RunFolder::place(None);
        assert_eq!(other, PathBuf::from(format!("/dev/shm/sinew-{}", os::user())));
        assert_eq!(RunFolder::place(Some("not/absolute".into())), other);
    }

    #[test]
    fn it_is_made_for_its_owner_alone_and_others_are_refused() {
        let scratch = std::env::temp_dir().join(format!("sinew-folder-{}", std::process::id()));
        fs::create_dir_all(&scratch).unwrap();
        let path = scratch.join("sinew");
        let folder = RunFolder::at(&path).unwrap();
        let found = fs::metadata(folder.path()).unwrap();
        assert_eq!((found.mode() & 0o777, found.uid()), (0o700, os::user()));
        assert_eq!(RunFolder::at(&path).unwrap(), folder, "the second time it is there already");

        fs::set_permissions(&path, fs::Permissions::from_mode(0o750)).unwrap();
        assert!(matches!(RunFolder::at(&path), Err(FolderError::Unsafe { .. })));
        let link = scratch.join("link");
        std::os::unix::fs::symlink(&scratch, &link).unwrap();
        assert!(matches!(RunFolder::at(&link), Err(FolderError::Unsafe { .. })));
        fs::write(scratch.join("file"), "").unwrap();
        assert!(matches!(RunFolder::at(&scratch.join("file")), Err(FolderError::Unsafe { .. })));
        assert!(matches!(RunFolder::at(&scratch.join("no/where")), Err(FolderError::Io { .. })));
        fs::remove_dir_all(&scratch).unwrap();
    }

    #[test]
    fn no_two_names_share_a_file_and_none_leaves_the_folder() {
        let folder = RunFolder { path: PathBuf::from("/run") };
        assert_eq!(folder.file(&["lab-1_a"], "sock"), Path::new("/run/lab-1_a.sock"));
        assert_eq!(folder.file(&["../a b"], "sock"), Path::new("/run/%2e%2e%2fa%20b.sock"));
        assert_eq!(folder.file(&["lab", "h1"], "latch"), Path::new("/run/lab.h1.latch"));
        assert_ne!(folder.file(&["lab.h1"], "latch"), folder.file(&["lab", "h1"], "latch"));
        assert_ne!(folder.file(&["a%2eb"], "sock"), folder.file(&["a.b"], "sock"));
    }
}
