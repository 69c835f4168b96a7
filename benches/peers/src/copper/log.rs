//! The folder of a log, and what is found in a log that was written.

use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use cu29::bincode::config::standard;
use cu29::bincode::{Decode, decode_from_std_read};
use cu29::prelude::{CopperList, CopperListTuple, UnifiedLogType};
use cu29::prelude::{UnifiedLogger, UnifiedLoggerBuilder, UnifiedLoggerIOReader};

/// The unit in which the system counts blocks of a disk (bytes).
const BLOCK: u64 = 512;

/// A folder for a log that is gone, with all in it, when this is dropped.
pub(super) struct LogFolder {
    folder: PathBuf,
}

impl LogFolder {
    pub(super) fn make() -> Result<LogFolder, String> {
        let folder = std::env::temp_dir().join(format!("peers-copper-{}", std::process::id()));
        std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        Ok(LogFolder { folder })
    }

    /// The name under which copper makes its files.
    pub(super) fn base(&self) -> PathBuf {
        self.folder.join("peer.copper")
    }

    /// How much of the disk it takes (bytes); the files are longer, since copper reserves room ahead.
    pub(super) fn size(&self) -> u64 {
        let Ok(entries) = std::fs::read_dir(&self.folder) else { return 0 };
        entries.flatten().filter_map(|entry| Some(entry.metadata().ok()?.blocks() * BLOCK)).sum()
    }
}

impl Drop for LogFolder {
    fn drop(&mut self) {
        // What cannot be removed is left to whoever cleans the temporary folder.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// How many iterations stand in a log, each next to the one before.
pub(super) fn iterations_in<P: CopperListTuple + Decode<()>>(base: &Path) -> Result<u64, String> {
    let log = UnifiedLoggerBuilder::new().file_base_name(base).build();
    let UnifiedLogger::Read(log) = log.map_err(|error| format!("the log cannot be read again: {error}"))?
    else {
        return Err("the log was opened for writing".to_owned());
    };
    let mut reader = UnifiedLoggerIOReader::new(log, UnifiedLogType::CopperList);
    let mut count = 0;
    while let Ok(list) = decode_from_std_read::<CopperList<P>, _, _>(&mut reader, standard()) {
        if list.id != count {
            return Err(format!("the log has iteration {} where {count} was expected", list.id));
        }
        count += 1;
    }
    Ok(count)
}
