//! Where the files of a run go: a folder that belongs to one run at a time.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::RunArgs;
use crate::error::Failure;

/// Where the files of a run go.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// The folder.
    pub(super) folder: PathBuf,
    /// The log; nothing when there shall be none.
    pub(super) log: Option<PathBuf>,
    /// Held as long as the run writes.
    _lock: Option<Arc<File>>,
}

/// What a run leaves beside its log: none of it may stay of a run before, or it would be taken for what this one measured.
const RESULTS: [&str; 1] = ["timing.json"];
/// So many runs of one scenario and seed find a folder of their own at once.
const MOST: usize = 1000;

impl Place {
    pub(super) fn of(args: &RunArgs, name: &str, seed: u64) -> Result<Option<Place>, Failure> {
        if args.no_log && args.out.is_none() {
            return Ok(None);
        }
        let again = if args.repeat.is_some() { "-repeated" } else { "" };
        let place = match &args.out {
            Some(out) => Place::in_folder(out.clone(), args)?,
            None => {
                Place::in_usual_folder(&Path::new("out").join(format!("{name}-seed{seed}{again}")), args)?
            }
        };
        if let (Some(before), Some(log)) = (&args.repeat, &place.log)
            && before.canonicalize().is_ok_and(|before| log.canonicalize().is_ok_and(|log| log == before))
        {
            return Err(Failure::new(format!(
                "{} would be written over while it is repeated",
                log.display()
            ))
            .help("--out names another folder, --log another file"));
        }
        Ok(Some(place))
    }

    /// In a folder that somebody named.
    pub(super) fn in_folder(folder: PathBuf, args: &RunArgs) -> Result<Place, Failure> {
        match Place::claim(&folder, args)? {
            Some(place) => Ok(place),
            None => Err(Failure::new(format!("another run writes into {}", folder.display()))
                .help("--out names another folder; sinew ls shows what runs")),
        }
    }

    /// In the folder that is usual for a run; while another one writes there, in one beside it.
    fn in_usual_folder(usual: &Path, args: &RunArgs) -> Result<Place, Failure> {
        for number in 1..MOST {
            let folder = if number == 1 {
                usual.to_owned()
            } else {
                PathBuf::from(format!("{}-{number}", usual.display()))
            };
            if let Some(place) = Place::claim(&folder, args)? {
                return Ok(place);
            }
        }
        Place::in_folder(usual.to_owned(), args)
    }

    /// Makes a folder this run's own; nothing when another run has it.
    fn claim(folder: &Path, args: &RunArgs) -> Result<Option<Place>, Failure> {
        let cannot = |what: &str, error: std::io::Error| {
            Failure::new(format!("{what} cannot be made: {error}"))
                .help("--out names another folder, --no-log writes nothing")
        };
        std::fs::create_dir_all(folder)
            .map_err(|error| cannot(&format!("the folder {}", folder.display()), error))?;
        let path = folder.join(".lock");
        let file = File::create(&path).map_err(|error| cannot(&path.display().to_string(), error))?;
        let lock = match file.try_lock() {
            Ok(()) => Some(Arc::new(file)),
            Err(TryLockError::WouldBlock) => return Ok(None),
            // A file system without locks: nobody can be told of, as before.
            Err(TryLockError::Error(_)) => None,
        };
        for result in RESULTS {
            // What is not there need not go; what cannot go will be told when it is written.
            let _ = std::fs::remove_file(folder.join(result));
        }
        let log = (!args.no_log).then(|| args.log.clone().unwrap_or_else(|| folder.join("run.mcap")));
        Ok(Some(Place { folder: folder.to_owned(), log, _lock: lock }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_runs_at_once_never_write_into_one_folder_and_nothing_old_is_taken_for_new() {
        let root = std::env::temp_dir().join(format!("sinew-place-{}", std::process::id()));
        let usual = root.join("home-seed1");
        let args = crate::cli::run_args(&["run", "home"]);
        std::fs::create_dir_all(&usual).unwrap();
        std::fs::write(usual.join("timing.json"), "{}").unwrap();
        let first = Place::in_usual_folder(&usual, &args).unwrap();
        assert_eq!(first.folder, usual);
        assert!(!usual.join("timing.json").exists(), "of a run before");
        let second = Place::in_usual_folder(&usual, &args).unwrap();
        assert_eq!(second.folder, root.join("home-seed1-2"));
        assert_eq!(second.log, Some(root.join("home-seed1-2/run.mcap")));
        let refused = Place::in_folder(usual.clone(), &args).unwrap_err();
        assert!(refused.problems[0].what.starts_with("another run writes into "), "{refused:?}");
        drop(first);
        assert_eq!(Place::in_usual_folder(&usual, &args).unwrap().folder, usual);
        std::fs::remove_dir_all(&root).unwrap();
    }
}
