//! The latch: once set, the robot stands until somebody resets it, and the reset moves nothing.
//!
//! ```text
//!            set(cause)                     reset
//!   clear ───────────────▶ set ─────────────────────────▶ clear, one reset more
//!                          │ ▲
//!                          └─┘ set(another cause): the causes add up
//! ```
//!
//! On hardware it is a word in a mapped file of the run folder, so any process of the user can set it and it outlives them all.
//! A simulated run has one of its own in private memory.

mod page;

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use runtime::{FolderError, RunFolder};
use types::Time;

use page::{Ordering, PAGE, Page};

/// What the first word of a page says: whose it is, and the form of what follows.
const MARK: u64 = u64::from_le_bytes(*b"sinewla1");
/// The words of a page.
const HEAD: usize = 0;
const STATE: usize = 1;
const SET_AT: usize = 2;
const RESET_AT: usize = 3;
/// The bits of the state in which the causes stand; above them the resets are counted.
const CAUSES: u64 = 0xffff;

/// Who set a latch, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Cause {
    /// The bumper was pressed.
    Bumper = 0,
    /// The safety monitor saw no other way.
    Safety = 1,
    /// A person asked for it.
    Person = 2,
    /// The referee of a match.
    Referee = 3,
    /// The process was told to end.
    Signal = 4,
    /// A step did not come back.
    Watchdog = 5,
    /// The supervisor gave up an agent without which the robot must not drive.
    Supervisor = 6,
    /// The hardware reported a fault.
    Hardware = 7,
    /// Commands again and again held what is no number: who makes them is broken.
    Nonsense = 8,
    /// Commands again and again were faster than is safe: who makes them does not listen.
    Heedless = 9,
}

impl Cause {
    /// All causes.
    pub const ALL: [Cause; 10] = [
        Cause::Bumper,
        Cause::Safety,
        Cause::Person,
        Cause::Referee,
        Cause::Signal,
        Cause::Watchdog,
        Cause::Supervisor,
        Cause::Hardware,
        Cause::Nonsense,
        Cause::Heedless,
    ];

    /// Its name on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            Cause::Bumper => "bumper",
            Cause::Safety => "safety",
            Cause::Person => "person",
            Cause::Referee => "referee",
            Cause::Signal => "signal",
            Cause::Watchdog => "watchdog",
            Cause::Supervisor => "supervisor",
            Cause::Hardware => "hardware",
            Cause::Nonsense => "nonsense",
            Cause::Heedless => "heedless",
        }
    }

    const fn bit(self) -> u64 {
        1 << self as u64
    }
}

/// A latch at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LatchState(u64);

impl LatchState {
    /// Whether it is set.
    pub const fn is_set(self) -> bool {
        self.0 & CAUSES != 0
    }

    /// How often it was reset since it was made. A change tells of a set and a reset that nobody saw.
    pub const fn resets(self) -> u64 {
        self.0 >> 16
    }

    /// Whether this is one of the causes.
    pub const fn has(self, cause: Cause) -> bool {
        self.0 & cause.bit() != 0
    }

    /// Why it is set; empty when it is not.
    pub fn causes(self) -> impl Iterator<Item = Cause> {
        Cause::ALL.into_iter().filter(move |cause| self.has(*cause))
    }
}

/// Why a latch cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LatchError {
    /// There is no run folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Its file cannot be opened or mapped.
    #[error("the latch {path} cannot be opened: {cause}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// Its file holds something else.
    #[error("{0} is not a latch, or one of another version; remove it when no robot uses it")]
    Foreign(PathBuf),
    /// Its page is written back to a disk, and a store to it can wait for that.
    #[error(
        "the latch {0} does not lie in memory (tmpfs), so setting it can wait for a disk: no real time with it. \
         Set XDG_RUNTIME_DIR to a folder on tmpfs, or unset it"
    )]
    OnDisk(PathBuf),
}

/// A latch. Clones are the same latch.
#[derive(Clone, Debug)]
pub struct Latch {
    page: Arc<Page>,
    path: Option<PathBuf>,
}

impl Latch {
    /// The latch of a robot in the run folder, made when it is missing. Every process that opens it has the same one.
    ///
    /// # Errors
    /// When the run folder or the file cannot be used.
    pub fn open(system: &str, robot: &str) -> Result<Latch, LatchError> {
        Latch::open_in(&RunFolder::open()?, system, robot)
    }

    /// The same in a folder of one's choice.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_in(folder: &RunFolder, system: &str, robot: &str) -> Result<Latch, LatchError> {
        let path = folder.file(&[system, robot], "latch");
        let page = map(&path).map_err(|cause| LatchError::Io { path: path.clone(), cause })?;
        let head = &page.words()[HEAD];
        // Whoever comes first marks the page. The rest of a new page is zero, and that is a clear latch.
        match head.compare_exchange(0, MARK, Ordering::AcqRel, Ordering::Acquire) {
            Err(found) if found != MARK => Err(LatchError::Foreign(path)),
            _ => Ok(Latch { page: Arc::new(page), path: Some(path) }),
        }
    }

    /// A latch that only this process sees: that of a simulated run. Nothing is left of it at the end.
    pub fn private() -> Latch {
        Latch { page: Arc::new(Page::private()), path: None }
    }

    /// Its file; nothing for a private one.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// Whether a real-time thread may set it.
    ///
    /// # Errors
    /// When its file is not on tmpfs.
    pub fn fit_for_real_time(&self) -> Result<(), LatchError> {
        /// The number by which the kernel knows tmpfs (`TMPFS_MAGIC` in `linux/magic.h`).
        const TMPFS: i64 = 0x0102_1994;
        let Some(path) = &self.path else { return Ok(()) };
        let found = rustix::fs::statfs(path)
            .map_err(|cause| LatchError::Io { path: path.clone(), cause: cause.into() })?;
        #[allow(clippy::unnecessary_cast)] // The type of the field differs between machines.
        let kind = found.f_type as i64;
        if kind == TMPFS { Ok(()) } else { Err(LatchError::OnDisk(path.clone())) }
    }

    /// Sets it: atomic instructions only, so any thread, process or signal handler may. `now` is noted for people.
    #[inline]
    pub fn set(&self, cause: Cause, now: Time) {
        let words = self.page.words();
        if words[STATE].load(Ordering::Relaxed) & CAUSES == 0 {
            words[SET_AT].store(now.0 as u64, Ordering::Relaxed);
        }
        // Release: what led to it is seen by who sees it set (`state`).
        words[STATE].fetch_or(cause.bit(), Ordering::AcqRel);
    }

    /// Clears it. Nothing moves by that: a gate waits for a command that is younger than the reset.
    ///
    /// Says what it was; resetting a clear latch changes nothing.
    pub fn reset(&self, now: Time) -> LatchState {
        let words = self.page.words();
        let cleared = words[STATE].fetch_update(Ordering::AcqRel, Ordering::Acquire, |state| {
            LatchState(state).is_set().then(|| (state & !CAUSES).wrapping_add(CAUSES + 1))
        });
        match cleared {
            Ok(before) => {
                words[RESET_AT].store(now.0 as u64, Ordering::Relaxed);
                LatchState(before)
            }
            Err(clear) => LatchState(clear),
        }
    }

    /// How it is now.
    #[inline]
    pub fn state(&self) -> LatchState {
        // Acquire: partner of the release in `set`.
        LatchState(self.page.words()[STATE].load(Ordering::Acquire))
    }

    /// Whether it is set.
    #[inline]
    pub fn is_set(&self) -> bool {
        self.state().is_set()
    }

    /// When it was last set, on the clock of who set it; [`Time::ZERO`] when it never was.
    pub fn set_at(&self) -> Time {
        Time(self.page.words()[SET_AT].load(Ordering::Relaxed) as i64)
    }

    /// When it was last reset, on the clock of who did it; [`Time::ZERO`] when it never was.
    pub fn reset_at(&self) -> Time {
        Time(self.page.words()[RESET_AT].load(Ordering::Relaxed) as i64)
    }
}

/// Opens or makes the file, as long as a page, and maps it.
fn map(path: &Path) -> io::Result<Page> {
    let no_link = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
    let file: File = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags(no_link)
        .open(path)?;
    // Growing only: another process may have it mapped.
    if file.metadata()?.len() < PAGE as u64 {
        file.set_len(PAGE as u64)?;
    }
    Page::map(&file)
}

/// Setters and who resets at once, in every order.
#[cfg(all(test, loom))]
mod model {
    use super::*;

    /// Two set it, each after something that led to it, while a third resets it; says what the reset found, and the end.
    fn play(check: impl Fn(LatchState, LatchState) + Sync + Send + 'static) {
        // Three threads at will are two minutes; a mistake that takes more than two changes of who runs is one that nobody made yet.
        let mut model = loom::model::Builder::new();
        model.preemption_bound = Some(2);
        model.check(move || {
            let latch = Latch::private();
            let setter = |cause: Cause, at: i64| {
                let latch = latch.clone();
                loom::thread::spawn(move || latch.set(cause, Time(at)))
            };
            let (bumper, person) = (setter(Cause::Bumper, 5), setter(Cause::Person, 7));
            let before = latch.reset(Time(9));
            bumper.join().unwrap();
            person.join().unwrap();
            let after = latch.state();
            check(before, after);
            if after.is_set() {
                assert!([5, 7].contains(&latch.set_at().0), "set at {:?}", latch.set_at());
            }
        });
    }

    #[test]
    fn each_set_is_either_reset_by_who_saw_it_or_stands() {
        play(|before, after| {
            for cause in [Cause::Bumper, Cause::Person] {
                assert!(before.has(cause) != after.has(cause), "{cause:?}: {before:?}, {after:?}");
            }
            assert_eq!(
                after.resets(),
                u64::from(before.is_set()),
                "each reset of a set latch is counted once"
            );
        });
    }

    #[test]
    fn two_resets_clear_one_set_once() {
        loom::model(|| {
            let latch = Latch::private();
            latch.set(Cause::Safety, Time(3));
            let other = latch.clone();
            let there = loom::thread::spawn(move || other.reset(Time(5)).is_set());
            let here = latch.reset(Time(6)).is_set();
            assert!(here != there.join().unwrap(), "one of them cleared it");
            assert_eq!((latch.is_set(), latch.state().resets()), (false, 1));
        });
    }

    #[test]
    fn who_sees_it_set_sees_what_led_to_it() {
        loom::model(|| {
            let latch = Latch::private();
            let led = std::sync::Arc::new(page::AtomicU64::new(0));
            let (mine, reason) = (latch.clone(), led.clone());
            let setter = loom::thread::spawn(move || {
                reason.store(1, Ordering::Relaxed);
                mine.set(Cause::Hardware, Time(4));
            });
            if latch.is_set() {
                assert_eq!((led.load(Ordering::Relaxed), latch.set_at()), (1, Time(4)));
            }
            setter.join().unwrap();
        });
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::scratch::Scratch;

    #[test]
    fn causes_add_up_and_a_reset_counts_and_clears() {
        let latch = Latch::private();
        assert!(!latch.is_set());
        latch.set(Cause::Bumper, Time(5));
        latch.set(Cause::Person, Time(9));
        assert_eq!(latch.state().causes().collect::<Vec<_>>(), [Cause::Bumper, Cause::Person]);
        assert_eq!(latch.set_at(), Time(5), "the first who set it");
        let before = latch.reset(Time(12));
        assert!(before.has(Cause::Person) && !latch.is_set());
        assert_eq!((latch.state().resets(), latch.reset_at()), (1, Time(12)));
        latch.reset(Time(20));
        assert_eq!((latch.state().resets(), latch.reset_at()), (1, Time(12)), "a clear latch is not reset");
    }

    const FOLDER: &str = "HARDWARE_TEST_LATCH_FOLDER";
    const ACT: &str = "HARDWARE_TEST_LATCH_ACT";

    /// What the other process does; without its variables this is an empty test.
    #[test]
    fn other_process() {
        let Some(folder) = std::env::var_os(FOLDER) else { return };
        let latch = Latch::open_in(&RunFolder::at(Path::new(&folder)).unwrap(), "lab", "h1").unwrap();
        match std::env::var(ACT).as_deref() {
            Ok("set") => latch.set(Cause::Person, Time(77)),
            Ok("see") => assert!(latch.state().has(Cause::Bumper) && !latch.state().has(Cause::Person)),
            other => panic!("{other:?}"),
        }
    }

    fn in_another_process(folder: &RunFolder, act: &str) -> bool {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "latch::tests::other_process"]).env(FOLDER, folder.path()).env(ACT, act);
        let done = command.output().unwrap();
        assert!(
            String::from_utf8_lossy(&done.stdout).contains("1 passed") || !done.status.success(),
            "the test was not found"
        );
        done.status.success()
    }

    #[test]
    fn another_process_sets_it_and_sees_it() {
        let scratch = Scratch::new("latch");
        let folder = RunFolder::at(&scratch.path().join("run")).unwrap();
        let latch = Latch::open_in(&folder, "lab", "h1").unwrap();
        let other = Latch::open_in(&folder, "lab", "h2").unwrap();
        assert!(in_another_process(&folder, "set"));
        assert!(latch.state().has(Cause::Person) && !other.is_set());
        assert_eq!(latch.set_at(), Time(77));
        assert!(!in_another_process(&folder, "see"));
        latch.reset(Time(80));
        latch.set(Cause::Bumper, Time(81));
        assert!(in_another_process(&folder, "see"));
    }

    #[test]
    fn it_outlives_who_set_it() {
        let scratch = Scratch::new("outlive");
        let folder = RunFolder::at(&scratch.path().join("run")).unwrap();
        Latch::open_in(&folder, "lab", "h1").unwrap().set(Cause::Signal, Time(3));
        assert!(Latch::open_in(&folder, "lab", "h1").unwrap().state().has(Cause::Signal));
    }

    #[test]
    fn a_file_of_somebody_else_is_refused() {
        let scratch = Scratch::new("foreign");
        let folder = RunFolder::at(&scratch.path().join("run")).unwrap();
        std::fs::write(folder.path().join("lab.h1.latch"), [7u8; PAGE]).unwrap();
        assert!(matches!(Latch::open_in(&folder, "lab", "h1"), Err(LatchError::Foreign(_))));
    }

    #[test]
    fn only_a_page_in_memory_is_fit_for_real_time() {
        Latch::private().fit_for_real_time().unwrap();
        let shared = Path::new("/dev/shm");
        if !shared.is_dir() {
            println!("skipped: there is no /dev/shm");
            return;
        }
        let scratch = Scratch::within(shared, "tmpfs");
        let folder = RunFolder::at(&scratch.path().join("run")).unwrap();
        Latch::open_in(&folder, "lab", "h1").unwrap().fit_for_real_time().unwrap();
        let disk = Scratch::within(&std::env::temp_dir(), "disk");
        let folder = RunFolder::at(&disk.path().join("run")).unwrap();
        let on_disk = Latch::open_in(&folder, "lab", "h1").unwrap().fit_for_real_time();
        let disk_is_memory =
            rustix::fs::statfs(disk.path()).unwrap().f_type == rustix::fs::statfs(shared).unwrap().f_type;
        assert_eq!(matches!(on_disk, Err(LatchError::OnDisk(_))), !disk_is_memory);
    }
}
