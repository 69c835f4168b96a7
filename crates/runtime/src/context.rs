//! What belongs to the thread that runs agents: the time of the step, the wake-ups that it owes, its end of the log.

#![allow(unsafe_code)]

use core::sync::atomic::{AtomicU64, Ordering};
use std::cell::{Cell, UnsafeCell};
use std::ptr;
use std::sync::Arc;

use types::header::Quality;
use types::{AgentId, Time};

use crate::door::{Door, bit_of};
use crate::names::Directory;
use crate::trace;

/// How many doors one step can owe a wake-up before the first is rung early.
const DOORS: usize = 16;
/// How many agents of its own executor one step can wake by name; more, and all mailboxes there are looked at after it.
const WOKEN: usize = 128;

/// What is known of a panic: a fixed record, written without allocation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PanicRecord {
    text: [u8; 160],
    len: usize,
    line: u32,
    file: [u8; 64],
    file_len: usize,
}

impl PanicRecord {
    const EMPTY: PanicRecord = PanicRecord { text: [0; 160], len: 0, line: 0, file: [0; 64], file_len: 0 };

    fn fill(&mut self, info: &std::panic::PanicHookInfo<'_>) {
        let payload = info.payload();
        let said = payload
            .downcast_ref::<&'static str>()
            .copied()
            .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
            .unwrap_or("a value that is no text");
        self.len = copy_into(said, &mut self.text);
        if let Some(at) = info.location() {
            self.line = at.line();
            let file = at.file();
            let start = file.len().saturating_sub(self.file.len());
            self.file_len = copy_into(file.get(start..).unwrap_or(file), &mut self.file);
        }
    }

    /// What was said and where, as people read it.
    pub(crate) fn to_text(self) -> String {
        let said = String::from_utf8_lossy(&self.text[..self.len]);
        let file = String::from_utf8_lossy(&self.file[..self.file_len]);
        format!("{said} ({file}:{})", self.line)
    }
}

fn copy_into(text: &str, place: &mut [u8]) -> usize {
    let mut len = text.len().min(place.len());
    while !text.is_char_boundary(len) {
        len -= 1;
    }
    place[..len].copy_from_slice(&text.as_bytes()[..len]);
    len
}

/// The context of a thread that runs agents.
pub(crate) struct Context {
    now: Cell<Time>,
    agent: Cell<AgentId>,
    alarm: Cell<Time>,
    executor: Cell<u32>,
    /// Slots of this thread's own executor that have got a message. They belong to the thread: one that lost its executor within a step
    /// may still send, and reaches nothing that is another's by now.
    woken: [Cell<u32>; WOKEN],
    woken_len: Cell<usize>,
    owed: [Cell<(*const Door, u64)>; DOORS],
    owed_len: Cell<usize>,
    log: UnsafeCell<Option<trace::Writer>>,
    panic: Cell<PanicRecord>,
    in_step: Cell<bool>,
    /// How good what the step sends is.
    quality: Cell<Quality>,
    /// The number of the step, times two: no other step of the process has it. Zero is none.
    step: Cell<u64>,
    /// Of how many inputs the step has taken messages without seeing them empty since.
    open: Cell<u32>,
    directory: Arc<Directory>,
}

/// How many threads there have been, and room for the number of the steps of each.
static CONTEXTS: AtomicU64 = AtomicU64::new(1);
const STEPS: u32 = 44;

thread_local! {
    static CURRENT: Cell<*const Context> = const { Cell::new(ptr::null()) };
}

/// The context of the calling thread, if it runs agents.
#[inline]
pub(crate) fn current<'a>() -> Option<&'a Context> {
    // SAFETY: `Context::enter` set the pointer, and its guard takes it back before the context goes. Nobody keeps the reference for
    // longer than a call from a step.
    unsafe { CURRENT.with(Cell::get).as_ref() }
}

/// Takes the context back from its thread.
pub(crate) struct Entered(());

impl Drop for Entered {
    fn drop(&mut self) {
        CURRENT.with(|current| current.set(ptr::null()));
    }
}

impl Context {
    pub(crate) fn new(log: Option<trace::Writer>, directory: Arc<Directory>) -> Box<Context> {
        Box::new(Context {
            now: Cell::new(Time::ZERO),
            agent: Cell::new(AgentId::NONE),
            alarm: Cell::new(Time::NEVER),
            executor: Cell::new(u32::MAX),
            woken: [const { Cell::new(0) }; WOKEN],
            woken_len: Cell::new(0),
            owed: [const { Cell::new((ptr::null(), 0)) }; DOORS],
            owed_len: Cell::new(0),
            log: UnsafeCell::new(log),
            panic: Cell::new(PanicRecord::EMPTY),
            in_step: Cell::new(false),
            quality: Cell::new(Quality::FULL),
            step: Cell::new(CONTEXTS.fetch_add(1, Ordering::Relaxed) << STEPS),
            open: Cell::new(0),
            directory,
        })
    }

    /// Makes this the context of the calling thread until the guard goes.
    pub(crate) fn enter(&self) -> Entered {
        CURRENT.with(|current| current.set(self));
        Entered(())
    }

    /// The steps that follow are those of agents of this executor.
    #[inline]
    pub(crate) fn enter_executor(&self, executor: u32) {
        self.executor.set(executor);
    }

    /// Begins a step.
    #[inline]
    pub(crate) fn begin(&self, agent: AgentId, now: Time) {
        self.now.set(now);
        self.agent.set(agent);
        self.in_step.set(true);
        self.quality.set(Quality::FULL);
        self.step.set(self.step.get() + 2);
        self.open.set(0);
    }

    /// A message was taken from an input that keeps `opened` for this: the step in which that happened last, odd while it was not seen
    /// empty since.
    #[inline(always)]
    pub(crate) fn took(&self, opened: &mut u64) {
        let open = self.step.get() | 1;
        if *opened != open {
            *opened = open;
            self.open.set(self.open.get() + 1);
        }
    }

    /// The same input has no message left. What comes later says so itself.
    #[inline(always)]
    pub(crate) fn drained(&self, opened: &mut u64) {
        if *opened == self.step.get() | 1 {
            *opened = self.step.get();
            self.open.set(self.open.get() - 1);
        }
    }

    /// The number of the step, and whether it has taken messages from an input where some may be left.
    #[inline]
    pub(crate) fn left_open(&self) -> (u64, bool) {
        (self.step.get(), self.open.get() > 0)
    }

    /// Ends a step: makes the wake-ups that it owes, each door once. Gives the time for which the agent asked to be woken.
    #[inline]
    pub(crate) fn end(&self) -> Option<Time> {
        self.in_step.set(false);
        if self.owed_len.get() > 0 {
            self.ring_doors();
        }
        if self.alarm.get() == Time::NEVER {
            return None;
        }
        Some(self.alarm.replace(Time::NEVER))
    }

    /// Whether an agent's own code is being run.
    pub(crate) fn is_in_step(&self) -> bool {
        self.in_step.get()
    }

    fn ring_doors(&self) {
        for owed in &self.owed[..self.owed_len.take()] {
            let (door, bits) = owed.get();
            // SAFETY: a door is owed only through a route that holds it, and routes change only between steps.
            unsafe { (*door).ring(bits) };
        }
    }

    /// The slots of this thread's own executor that have got a message since the last time, perhaps more than once; nothing when they
    /// were too many to tell.
    #[inline]
    pub(crate) fn take_woken(&self) -> Option<&[Cell<u32>]> {
        self.woken.get(..self.woken_len.take())
    }

    #[inline]
    pub(crate) fn now(&self) -> Time {
        self.now.get()
    }

    #[inline]
    pub(crate) fn agent(&self) -> AgentId {
        self.agent.get()
    }

    #[inline]
    pub(crate) fn quality(&self) -> Quality {
        self.quality.get()
    }

    pub(crate) fn set_quality(&self, quality: Quality) {
        self.quality.set(quality);
    }

    /// Asks for a step at `time`, or sooner if it was asked for sooner.
    pub(crate) fn wake_at(&self, time: Time) {
        self.alarm.set(self.alarm.get().min(time));
    }

    /// Makes the agent in `slot` of `executor` ready: at once where it is this thread's, else after the step.
    #[inline]
    pub(crate) fn wake(&self, executor: u32, slot: u32, door: &Arc<Door>) {
        if executor == self.executor.get() {
            let len = self.woken_len.get();
            if let Some(place) = self.woken.get(len) {
                place.set(slot);
            }
            self.woken_len.set(len + 1);
            return;
        }
        self.owe(slot, door);
    }

    fn owe(&self, slot: u32, door: &Arc<Door>) {
        let (door, bit) = (Arc::as_ptr(door), bit_of(slot));
        let len = self.owed_len.get();
        for owed in &self.owed[..len] {
            let (known, bits) = owed.get();
            if known == door {
                owed.set((known, bits | bit));
                return;
            }
        }
        if len < DOORS {
            self.owed[len].set((door, bit));
            self.owed_len.set(len + 1);
        } else {
            // SAFETY: as in `end`.
            unsafe { (*door).ring(bit) };
        }
    }

    /// The thread's end of the log.
    #[inline]
    pub(crate) fn log<R>(&self, write: impl FnOnce(&mut trace::Writer) -> R) -> Option<R> {
        // SAFETY: only the thread itself comes here, and `write` does not come back.
        unsafe { (*self.log.get()).as_mut().map(write) }
    }

    /// The names of all agents.
    pub(crate) fn directory(&self) -> &Directory {
        &self.directory
    }

    /// What the last panic said.
    pub(crate) fn panic_record(&self) -> PanicRecord {
        self.panic.get()
    }
}

/// Once in a process: a panic inside a step is written into its thread's record, and nothing is printed. Others are
/// printed as before.
pub(crate) fn install_panic_hook() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let recorded = current().map(|context| {
                if context.in_step.get() {
                    let mut record = PanicRecord::EMPTY;
                    record.fill(info);
                    context.panic.set(record);
                }
                context.in_step.get()
            });
            if recorded != Some(true) {
                before(info);
            }
        }));
    });
}
