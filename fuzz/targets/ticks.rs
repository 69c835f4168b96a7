//! Recordings of wheel counts and scans.
#![no_main]

use hardware::ticks;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| sinew_fuzz::play(ticks::read(bytes), bytes));
