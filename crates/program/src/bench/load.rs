//! Load of a machine: processors, disk and memory, at ordinary priority, in a process of its own that ends when its standard
//! input does, and so surely with whoever started it.

use std::fs::File;
use std::hint::black_box;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::parcel::thread;
use crate::error::Failure;

/// The name by which `sinew bench` makes load.
pub(super) const NAME: &str = "load";
pub(super) const WHAT: &str =
    "no measurement: loads processors, disk and memory until its standard input ends";

/// What is written before the disk is waited for and the file begins anew (bytes), and in which pieces.
const FILE: usize = 32 << 20;
const PIECE: usize = 1 << 20;
/// What is taken from memory, touched and given back (bytes).
const MEMORY: usize = 64 << 20;
const PAGE: usize = 4096;

/// A process that makes load. It ends when this is dropped.
pub(super) struct Load(Child);

impl Load {
    /// Starts it. `program` is this one.
    pub(super) fn start(program: &Path) -> Result<Load, Failure> {
        let mut command = Command::new(program);
        command.args(["bench", NAME]).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        let failed = |error| Failure::new(format!("no load could be made: {error}")).code(1);
        command.spawn().map(Load).map_err(failed)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        drop(self.0.stdin.take());
        let _ = self.0.wait();
    }
}

/// Makes load until standard input ends.
pub(super) fn make() -> Result<(), Failure> {
    for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
        thread("load-processor", processor)?;
    }
    let path = std::env::temp_dir().join(format!("sinew-load-{}", std::process::id()));
    let file = File::create(&path);
    // The open file lives on without its name until the process ends.
    let _ = std::fs::remove_file(&path);
    let file = file.map_err(|error| Failure::new(format!("{}: {error}", path.display())).code(1))?;
    thread("load-disk", move || disk(file))?;
    thread("load-memory", memory)?;
    // An error is an end, too.
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
    Ok(())
}

fn processor() {
    let mut x = 1u64;
    loop {
        x = black_box(x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
    }
}

/// Writes and waits for the disk until that fails.
fn disk(mut file: File) {
    let piece = vec![0x5a; PIECE];
    loop {
        for _ in 0..FILE / PIECE {
            if file.write_all(&piece).is_err() {
                return;
            }
        }
        if file.sync_data().is_err() || file.rewind().is_err() {
            return;
        }
    }
}

fn memory() {
    loop {
        let mut taken = vec![0u8; MEMORY];
        taken.iter_mut().step_by(PAGE).for_each(|byte| *byte = 1);
        drop(black_box(taken));
    }
}
