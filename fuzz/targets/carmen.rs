//! CARMEN logs, plain or compressed.
#![no_main]

use std::fmt::Write as _;

use hardware::carmen;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let recording = carmen::read(bytes);
    let mut shown = String::new();
    let _ = write!(shown, "{}", recording.report);
    sinew_fuzz::play(recording, bytes);
});
