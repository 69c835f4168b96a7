//! The watchdog: sees steps that do not return, and who does not return from its stop.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::Arc;

use types::Duration;

use super::{CALLED, Cell, MOST_HUNG, NOBODY};
use crate::handover::InStep;
use crate::os;
use crate::sync::Futex;

/// Next to the witness.
const PRIORITY: u8 = 94;
/// How often it looks.
const PERIOD: Duration = Duration::millis(5);

/// The watchdog: sees steps that last too long, gives their threads up, and hands what else they ran to the spare ones.
pub(super) fn watch(cells: &[Arc<Cell>], over: &AtomicBool, hung: &AtomicU32, can_take: bool) {
    os::exact_timers();
    // Without the right to a priority it watches all the same, later.
    let _ = os::set_fifo(PRIORITY);
    let word = Futex::new(0);
    let nanos_per_tick = os::nanos_per_tick();
    while !over.load(Ordering::Acquire) {
        word.wait(0, Some(os::monotonic() + PERIOD.0));
        for cell in cells {
            let running = cell.running();
            let Some(step) = running.in_step() else { continue };
            let lasts =
                os::ticks().saturating_sub(running.since.load(Ordering::Acquire)) as f64 * nanos_per_tick;
            if lasts <= running.limit.load(Ordering::Acquire) as f64 {
                continue;
            }
            if !can_take {
                hung.store(MOST_HUNG as u32 + 1, Ordering::Relaxed);
            } else if take_over(cell, step) {
                hung.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// Takes a core away from a thread that does not come back.
fn take_over(cell: &Cell, step: InStep) -> bool {
    let no_spare =
        cell.call.word.load(Ordering::Acquire) != NOBODY || cell.needs_spare.load(Ordering::Acquire);
    if no_spare || !cell.owner.take_from(cell.running(), step) {
        return false;
    }
    // A failure leaves the thread where it is, at its priority; there is nothing else to be done about it.
    let _ = os::set_idle(cell.thread.load(Ordering::Acquire));
    cell.given_up.store(step.slot(), Ordering::Release);
    cell.call.word.store(CALLED, Ordering::Release);
    cell.call.wake();
    true
}
