//! The last stage in front of a driver: latch, age limit, physical limits.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use motion::limits::{Cuts, Limits};
use types::messages::{Head, Twist};
use types::{Duration, Time};

use crate::description::RobotDescription;
use crate::driver::{Driver, DriverError, Listening, Polled, Sink};
use crate::guard::{Authority, Contact, Guard, Policy, Reason, Refusal, Verdict};
use crate::latch::{Cause, Latch};

/// A number that the gate's thread counts up and anybody reads.
#[derive(Debug, Default)]
pub struct Count(AtomicU64);

impl Count {
    /// How many.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    fn add(&self) {
        // There is one writer; a plain load and store is cheaper than an atomic addition.
        self.0.store(self.get() + 1, Ordering::Relaxed);
    }
}

/// The right to move a robot. Gates have it, and nobody else can make one.
#[derive(Debug)]
pub struct Permit(());

/// What happened at a gate. Nothing is lost in silence.
#[derive(Debug, Default)]
pub struct Counts {
    /// Cycles.
    pub cycles: Count,
    /// Commands that came.
    pub commands: Count,
    /// Commands that were not finite.
    pub not_finite: Count,
    /// Commands that came while the latch was set, or that were made before its reset.
    pub latched: Count,
    /// Commands that were too old when they came, and motions that ended because no new command came.
    pub stale: Count,
    /// Commands that came while one of a higher authority was followed.
    pub overruled: Count,
    /// Cycles in which something of a command was cut.
    pub clamped: Count,
    /// Cycles in which a command was followed more slowly, because it was faster than is safe.
    pub slowed: Count,
    /// Times that the bumper was pressed.
    pub bumps: Count,
    /// Times that the gate saw the latch set after it was clear.
    pub latch_sets: Count,
    /// Times that the hardware could not be reached.
    pub failures: Count,
    ended: AtomicBool,
}

impl Counts {
    /// Whether nothing will ever come from the driver again: the end of a recording.
    pub fn ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }
}

/// Something worth a note.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The latch was found set.
    LatchSet,
    /// The latch was found clear again.
    LatchCleared,
    /// A motion ended because no new command came.
    Stale,
    /// A command was cut for the first time since one passed whole.
    Clamped(Cuts),
    /// A command wanted to go forward faster than is safe, for the first time since one did not.
    Slowed,
}

/// So many commands that are no numbers, within so long, come from somebody who is broken: what else they command is as wrong, though
/// it looks right. One alone may be a division by zero at an odd moment, for which standing still is enough.
const NONSENSE: (u32, Duration) = (3, Duration::secs(1));

/// Counts nonsense.
#[derive(Clone, Copy, Debug, Default)]
struct Nonsense {
    count: u32,
    since: Option<Time>,
}

impl Nonsense {
    /// Counts one; whether it was one too many.
    fn count(&mut self, now: Time) -> bool {
        if self.since.is_none_or(|since| now - since > NONSENSE.1) {
            *self = Nonsense { count: 0, since: Some(now) };
        }
        self.count += 1;
        self.count >= NONSENSE.0
    }
}

/// Whoever commands for the robot hears how fast is safe and obeys within a few hundredths of a second. One who does not for so long does
/// not listen, or says the same again and again: what else it commands is as wrong, though it looks right.
const HEEDLESS: Duration = Duration::secs(1);

/// What one cycle did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// What went to the wheels, and why.
    pub verdict: Verdict,
    /// What is worth a note.
    pub event: Option<Event>,
}

/// A driver behind its gate. There is no other way to the driver.
///
/// Per cycle: [`poll`](Gate::poll), then [`command`](Gate::command) for what has come, then [`apply`](Gate::apply). Nothing in it
/// allocates, waits for a lock or reads a clock. A gate that is dropped first stops what moves.
pub struct Gate {
    driver: Box<dyn Driver>,
    guard: Option<Guard>,
    latch: Latch,
    counts: Arc<Counts>,
    pressed: u32,
    bumper_latches: bool,
    was_set: bool,
    /// How often the latch had been reset when it was last looked at.
    resets: u64,
    /// When the latch was last found set. Nothing that was commanded up to then moves the head.
    barrier: Option<Time>,
    was_cut: bool,
    /// Whose commands had to be slowed in each cycle, and since when.
    slowed: Option<(Authority, Time)>,
    nonsense: Nonsense,
    last_seen: Time,
}

impl Gate {
    /// Takes the driver for good.
    pub fn new(driver: impl Driver + 'static, latch: Latch) -> Gate {
        Gate::of(Box::new(driver), latch)
    }

    /// The same for a driver whose type is not known.
    pub fn of(driver: Box<dyn Driver>, latch: Latch) -> Gate {
        let guard = driver.describe().limits.map(|limits: Limits| Guard::new(limits, Policy::default()));
        let resets = latch.state().resets();
        Gate {
            driver,
            guard,
            latch,
            counts: Arc::default(),
            pressed: 0,
            bumper_latches: true,
            was_set: false,
            resets,
            barrier: None,
            was_cut: false,
            slowed: None,
            nonsense: Nonsense::default(),
            last_seen: Time::ZERO,
        }
    }

    /// What the robot is.
    pub fn description(&self) -> &RobotDescription {
        self.driver.describe()
    }

    /// Its latch.
    pub fn latch(&self) -> &Latch {
        &self.latch
    }

    /// Its counts, to be kept and read from any thread.
    pub fn counts(&self) -> Arc<Counts> {
        self.counts.clone()
    }

    /// Changes what can be set: limits, and whether a press of the bumper sets the latch.
    pub fn set_policy(&mut self, policy: Policy, bumper_latches: bool) {
        self.bumper_latches = bumper_latches;
        if let Some(guard) = &mut self.guard {
            guard.set_policy(policy);
        }
    }

    /// Delivers the readings that are due. The driver has stopped by itself if the bumper was pressed; here the latch is set.
    ///
    /// # Errors
    /// When the hardware cannot be reached; the latch is set then.
    pub fn poll(
        &mut self,
        now: Time,
        wanted: &Listening,
        sink: &mut dyn Sink,
    ) -> Result<Polled, DriverError> {
        self.last_seen = now;
        match self.driver.poll(now, wanted, sink) {
            Ok(polled) => {
                self.pressed = polled.pressed;
                if polled.newly_pressed != 0 {
                    self.counts.bumps.add();
                    if self.bumper_latches {
                        self.latch.set(Cause::Bumper, now);
                    }
                }
                if polled.ended {
                    self.counts.ended.store(true, Ordering::Relaxed);
                }
                Ok(polled)
            }
            Err(error) => {
                self.counts.failures.add();
                self.latch.set(Cause::Hardware, now);
                Err(error)
            }
        }
    }

    /// Takes a command that was made at `stamp`. What does not pass is counted; the third within a second that is no number sets the latch.
    pub fn command(&mut self, now: Time, authority: Authority, stamp: Time, twist: Twist) {
        let counts = &self.counts;
        counts.commands.add();
        let Some(guard) = &mut self.guard else { return };
        match guard.offer(now, self.latch.state(), authority, stamp, twist) {
            Ok(()) if guard.is_overruled(authority) => counts.overruled.add(),
            Ok(()) => {}
            Err(Refusal::NotFinite) => {
                counts.not_finite.add();
                if self.nonsense.count(now) {
                    self.latch.set(Cause::Nonsense, now);
                }
            }
            Err(Refusal::Latched | Refusal::BeforeReset) => counts.latched.add(),
            Err(Refusal::Stale) => counts.stale.add(),
        }
    }

    /// Takes the word of somebody who is not the one who commands: how fast it was safe to go forward at `stamp` (m/s).
    pub fn allow(&mut self, now: Time, stamp: Time, linear_max: f64) {
        if let Some(guard) = &mut self.guard {
            guard.allow(now, stamp, linear_max);
        }
    }

    /// Turns the head by a command that was made at `stamp`, unless the latch is set or was set after that, there is none, or the
    /// command is not finite.
    ///
    /// # Errors
    /// When the hardware cannot be reached.
    pub fn command_head(&mut self, now: Time, stamp: Time, head: Head) -> Result<(), DriverError> {
        self.counts.commands.add();
        let latch = self.latch.state();
        let was_reset = latch.resets() != self.resets;
        if latch.is_set() || was_reset || self.barrier.is_some_and(|barrier| stamp.min(now) <= barrier) {
            self.counts.latched.add();
            return Ok(());
        }
        if !(head.pan.is_finite() && head.tilt.is_finite()) {
            self.counts.not_finite.add();
            return Ok(());
        }
        let Some(limits) = self.driver.describe().head else { return Ok(()) };
        let within = Head {
            pan: head.pan.clamp(-limits.pan_max, limits.pan_max),
            tilt: head.tilt.clamp(-limits.tilt_max, limits.tilt_max),
        };
        if within != head {
            self.counts.clamped.add();
        }
        self.driver.turn_head(&Permit(()), now, within)
    }

    /// Decides and writes to the wheels.
    ///
    /// # Errors
    /// When the hardware cannot be reached; the latch is set then, and the robot's own watchdog has to stop it.
    pub fn apply(&mut self, now: Time) -> Result<Cycle, DriverError> {
        self.last_seen = now;
        self.counts.cycles.add();
        let latch = self.latch.state();
        if latch.is_set() || latch.resets() != self.resets {
            self.hold(now, latch.resets())?;
        }
        let event = self.look_at_latch(latch.is_set());
        let Some(guard) = &mut self.guard else {
            let verdict = Verdict {
                twist: Twist::ZERO,
                reason: if latch.is_set() { Reason::Latched } else { Reason::Idle },
            };
            return Ok(Cycle { verdict, event });
        };
        let contact = Contact::of(self.pressed, self.driver.describe().bumper_sectors);
        let verdict = guard.decide(now, latch, contact);
        let event = event.or_else(|| self.look_at(now, verdict.reason));
        self.driver.drive(&Permit(()), now, verdict.twist).inspect_err(|_| {
            self.counts.failures.add();
            self.latch.set(Cause::Hardware, now);
        })?;
        Ok(Cycle { verdict, event })
    }

    /// What moves besides the wheels stands, too: once when the latch is found set, or to have been.
    fn hold(&mut self, now: Time, resets: u64) -> Result<(), DriverError> {
        let is_new = !self.was_set || resets != self.resets;
        (self.barrier, self.resets) = (Some(now), resets);
        if !is_new || self.driver.describe().head.is_none() {
            return Ok(());
        }
        self.driver.hold_head(&Permit(()), now).inspect_err(|_| {
            self.counts.failures.add();
            self.latch.set(Cause::Hardware, now);
        })
    }

    fn look_at_latch(&mut self, is_set: bool) -> Option<Event> {
        if is_set == self.was_set {
            return None;
        }
        self.was_set = is_set;
        if is_set {
            self.counts.latch_sets.add();
        }
        Some(if is_set { Event::LatchSet } else { Event::LatchCleared })
    }

    fn look_at(&mut self, now: Time, reason: Reason) -> Option<Event> {
        let before = self.slowed.take();
        match reason {
            Reason::Slowed(authority) => {
                self.counts.slowed.add();
                let of_the_same = before.filter(|(before, _)| *before == authority);
                let (_, since) = *self.slowed.insert(of_the_same.unwrap_or((authority, now)));
                // A person may push on against it for as long as he likes.
                if authority == Authority::Robot && now - since > HEEDLESS {
                    self.latch.set(Cause::Heedless, now);
                }
                before.is_none().then_some(Event::Slowed)
            }
            Reason::Stale => {
                self.counts.stale.add();
                Some(Event::Stale)
            }
            Reason::Followed(_, cuts) => {
                let is_cut = !cuts.none();
                let begins = is_cut && !self.was_cut;
                self.was_cut = is_cut;
                if is_cut {
                    self.counts.clamped.add();
                }
                begins.then_some(Event::Clamped(cuts))
            }
            Reason::Idle | Reason::Latched => None,
        }
    }
}

impl Drop for Gate {
    fn drop(&mut self) {
        // Should this fail too, the robot's own watchdog is what is left.
        let _ = self.driver.drive(&Permit(()), self.last_seen, Twist::ZERO);
        let _ = self.driver.hold_head(&Permit(()), self.last_seen);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_now_and_then_is_borne_and_again_and_again_it_is_not() {
        let ms = |ms: i64| Time(ms * 1_000_000);
        let mut nonsense = Nonsense::default();
        assert!((0..20).all(|i| !nonsense.count(ms(600 * i))));
        let mut nonsense = Nonsense::default();
        assert_eq!([0, 400, 1000].map(|at| nonsense.count(ms(at))), [false, false, true]);
    }
}
