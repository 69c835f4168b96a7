//! An agent's own end at the router: it sees what the system is made of, and asks for changes of its own wires.
//!
//! ```text
//!   step:  subscribe, connect … ──▶ a ring of requests ──────────▶ control side: decides them, as it decides anybody's
//!   step:  news, decision       ◀── what it was told between steps ◀── a change for the executor, as any other
//! ```
//!
//! Nothing here waits. What comes from the control side comes between two steps, and what it takes the place of goes back there to be freed.

#![allow(unsafe_code)]

use core::sync::atomic::{AtomicU64, Ordering};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::sync::{Arc, Mutex, PoisonError};

use types::{Filter, Message, Text};

use super::queue::{QueueEnd, QueueForm, Rest, Teller};
use super::{
    Direction, Input, InputEnd, Output, OutputEnd, Port, PortEnds, PortOptions, PortShape, Settled, WireId,
    count, output_core,
};
use crate::composition::{Composition, PortAt, PortSeen, QueueSeen};
use crate::context::current;
use crate::fetch::Depth;
use crate::message_type::MessageType;
use crate::ring::{self, Overload, Pushed};
use crate::service::{Client, Service, Ticket};

/// How many requests of one agent can be under way: asked and their decisions not taken yet.
pub const REQUESTS_UNDER_WAY: usize = 8;

/// The longest name of a port that can be asked for by name (bytes).
const LONGEST_NAME: usize = 95;
/// So much of the reason of a refusal is told to the agent (bytes); the log has all of it.
const LONGEST_REASON: usize = 120;

/// Where the other end of a wire shall be: a port that was seen, its number, or the name of a port or a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The port of this number.
    Port(PortAt),
    /// The port or queue of this name, as in `sonar.filtered`.
    Named(Text<LONGEST_NAME>),
    /// A name that is longer than can be asked for.
    TooLong,
}

impl From<PortSeen<'_>> for Place {
    fn from(port: PortSeen<'_>) -> Place {
        Place::Port(port.at())
    }
}

impl From<PortAt> for Place {
    fn from(at: PortAt) -> Place {
        Place::Port(at)
    }
}

impl From<QueueSeen<'_>> for Place {
    fn from(queue: QueueSeen<'_>) -> Place {
        Place::from(queue.name())
    }
}

impl From<&str> for Place {
    fn from(name: &str) -> Place {
        if name.len() > LONGEST_NAME { Place::TooLong } else { Place::Named(Text::new(name)) }
    }
}

/// How a wire shall be; its default is the usual wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wiring {
    /// How many messages wait at most; the usual depth when nothing is said.
    pub depth: Option<usize>,
    /// What happens when there is no room; the usual policy when nothing is said.
    pub overload: Option<Overload>,
    /// Which messages pass.
    pub filter: Filter,
    /// Out of a queue: who is served first, from 0 to 99.
    pub serving: Option<u8>,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Decision {
    /// It is done.
    #[default]
    Done,
    /// Nothing of it was done.
    Refused {
        /// Why, for the agent.
        why: Why,
        /// Why, for people; cut where it is long.
        what: Text<LONGEST_REASON>,
    },
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// There is no such port, or its agent is gone.
    Unknown,
    /// The two ends do not fit: other messages, or the wrong way round.
    Unfit,
    /// There is such a wire already.
    AlreadyWired,
    /// There is no such wire.
    NotWired,
    /// An executor that has to do its part does not answer. Later it may.
    Busy,
    /// For another reason, which the text says.
    Other,
}

/// Why a request was not even asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotAsked {
    /// As many as can be are under way: take their decisions first. It is counted.
    #[error("{REQUESTS_UNDER_WAY} requests are under way already")]
    TooMany,
    /// The end is not a port of this agent: it was never put in front of a mailbox or of routes.
    #[error("the end is no port of this agent")]
    NotMine,
    /// The name is too long to be asked for. A port that was seen has no such bound.
    #[error("a name that is asked for has at most {LONGEST_NAME} bytes")]
    NameTooLong,
    /// The agent does not run in any system.
    #[error("the agent runs in no system")]
    Nowhere,
}

/// Which end of an agent is meant. Only the runtime makes one.
#[derive(Clone, Copy, Debug)]
pub struct OwnAddress(pub(crate) Option<usize>);

/// A port in the hand of its agent.
pub trait OwnPort {
    /// Which end it is.
    #[doc(hidden)]
    fn address(&self) -> OwnAddress;
}

/// A port to which wires lead: an input, or a service.
pub trait Takes: OwnPort {}
/// A port from which wires lead: an output, or a client.
pub trait Gives: OwnPort {}

impl<T: Message> OwnPort for Input<T> {
    fn address(&self) -> OwnAddress {
        OwnAddress(self.core_address())
    }
}
impl<T: Message> Takes for Input<T> {}

impl<T: Message> OwnPort for Output<T> {
    fn address(&self) -> OwnAddress {
        OwnAddress(self.core_address())
    }
}
impl<T: Message> Gives for Output<T> {}

impl<Q: Message, A: Message> OwnPort for Service<Q, A> {
    fn address(&self) -> OwnAddress {
        OwnAddress(self.core_address())
    }
}
impl<Q: Message, A: Message> Takes for Service<Q, A> {}

impl<Q: Message, A: Message> OwnPort for Client<Q, A> {
    fn address(&self) -> OwnAddress {
        OwnAddress(self.core_address())
    }
}
impl<Q: Message, A: Message> Gives for Client<Q, A> {}

/// What an agent asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Deed {
    /// A wire from another's end to its own.
    #[default]
    Subscribe,
    Unsubscribe,
    /// A wire from its own end to another's.
    Connect,
    Disconnect,
}

/// A request on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask {
    pub ticket: u32,
    pub deed: Deed,
    /// The place of the agent's own port.
    pub own: u16,
    pub other: Place,
    pub wiring: Wiring,
}

impl Default for Ask {
    fn default() -> Ask {
        Ask { ticket: 0, deed: Deed::default(), own: 0, other: Place::TooLong, wiring: Wiring::default() }
    }
}

/// What an end at the router knows from the beginning.
pub(crate) struct Acquaintance {
    pub composition: Arc<Composition>,
    /// Counts what all agents ask.
    pub bell: Arc<AtomicU64>,
    /// The agent's ports, by the addresses of what stands behind them.
    pub own: Vec<(usize, PortAt)>,
    /// Whether the agent runs when there is news.
    pub runs_for_news: bool,
}

/// What the control side tells an agent between two steps. What it takes the place of comes back in it.
#[derive(Debug, Default)]
pub(crate) struct Told {
    pub composition: Option<Arc<Composition>>,
    /// Whether it is news even where nothing is different: to another instance.
    pub anew: bool,
    pub decision: Option<(u32, Decision)>,
}

struct Inner {
    asks: ring::Sender<Ask>,
    bell: Option<Arc<AtomicU64>>,
    /// The ports of the agent, by the addresses of what stands behind them. Those are compared, never followed.
    own: Vec<(usize, PortAt)>,
    composition: Arc<Composition>,
    /// How many looks at the composition are in use: meanwhile it stays.
    looks: u32,
    /// Whether the agent has not looked at the composition yet.
    is_new: bool,
    /// Whether it runs for that.
    runs_for_news: bool,
    /// The number of the next request. It goes on when another instance comes.
    next: u32,
    /// Requests whose decisions were not taken yet.
    open: usize,
    /// Decisions that wait, the oldest first, and how many.
    decisions: [(u32, Decision); REQUESTS_UNDER_WAY],
    waiting: usize,
    /// The step in which something was looked at or taken last, as [`Context::took`](crate::context::Context::took) keeps it.
    opened: u64,
}

impl Inner {
    fn take_decision(&mut self) -> Option<(u32, Decision)> {
        if self.waiting == 0 {
            return None;
        }
        let first = self.decisions[0];
        self.decisions.copy_within(1..self.waiting, 0);
        self.waiting -= 1;
        self.open = self.open.saturating_sub(1);
        self.note_taken();
        Some(first)
    }

    /// Passes over what was decided for an instance that is gone.
    fn pass_over(&mut self, first: u32) {
        while self.waiting > 0 && is_before(self.decisions[0].0, first) {
            self.take_decision();
        }
    }

    fn note_taken(&mut self) {
        if let Some(context) = current() {
            context.took(&mut self.opened);
        }
    }

    fn has_something(&self) -> bool {
        self.waiting > 0 || self.runs_for_news && self.is_new
    }
}

/// Numbers go round.
fn is_before(ticket: u32, first: u32) -> bool {
    (ticket.wrapping_sub(first) as i32) < 0
}

/// What stands behind an agent's end at the router. It belongs to the router and outlives the agent.
pub(crate) struct RouterEnd {
    inner: UnsafeCell<Inner>,
    /// The control side's end. Nobody else takes the lock.
    asked: Mutex<ring::Receiver<Ask>>,
    /// Requests that were asked.
    sent: AtomicU64,
    /// Those that were not, because too many were under way.
    turned_away: AtomicU64,
}

// SAFETY: `inner` is touched only by the thread that runs the executor of its agent, in a step or between two; before the agent has its
// seat, by the control side alone.
unsafe impl Sync for RouterEnd {}

impl RouterEnd {
    fn new() -> RouterEnd {
        let (asks, asked) = ring::ring(REQUESTS_UNDER_WAY, false);
        let inner = Inner {
            asks,
            bell: None,
            own: Vec::new(),
            composition: Arc::default(),
            looks: 0,
            is_new: true,
            runs_for_news: false,
            next: 1,
            open: 0,
            decisions: [(0, Decision::Done); REQUESTS_UNDER_WAY],
            waiting: 0,
            opened: 0,
        };
        RouterEnd {
            inner: UnsafeCell::new(inner),
            asked: Mutex::new(asked),
            sent: AtomicU64::new(0),
            turned_away: AtomicU64::new(0),
        }
    }

    #[allow(clippy::mut_from_ref)]
    fn inner(&self) -> &mut Inner {
        // SAFETY: see `Sync`; no reference outlives the call of a handle or of the executor.
        unsafe { &mut *self.inner.get() }
    }

    /// Says what there is and where to ring, while nobody else has this end yet. Its numbers go on from those of the one before it.
    pub(crate) fn acquaint(&self, known: Acquaintance, before: Option<&RouterEnd>) {
        let Acquaintance { composition, bell, own, runs_for_news } = known;
        let inner = self.inner();
        (inner.composition, inner.bell) = (composition, Some(bell));
        (inner.own, inner.runs_for_news) = (own, runs_for_news);
        if let Some(before) = before {
            // The one before may still be in use in a step that does not return: of it only what is counted for all is read.
            let sent = before.sent();
            inner.next = (sent as u32).wrapping_add(1);
            self.sent.store(sent, Ordering::Relaxed);
            self.turned_away.store(before.turned_away(), Ordering::Relaxed);
        }
    }

    /// The next request, for the control side.
    pub(crate) fn take_ask(&self) -> Option<Ask> {
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.advance().then(|| *asked.current())
    }

    /// Requests that were asked.
    pub(crate) fn sent(&self) -> u64 {
        self.sent.load(Ordering::Relaxed)
    }

    /// Requests that were not asked, because too many were under way.
    pub(crate) fn turned_away(&self) -> u64 {
        self.turned_away.load(Ordering::Relaxed)
    }

    /// Between two steps: takes over what the control side says, and gives back what it had.
    pub(crate) fn tell(&self, told: &mut Told) {
        let inner = self.inner();
        if inner.looks == 0
            && let Some(composition) = &mut told.composition
        {
            inner.is_new |= told.anew || composition.version() != inner.composition.version();
            core::mem::swap(&mut inner.composition, composition);
        }
        if let Some(decision) = told.decision
            && let Some(place) = inner.decisions.get_mut(inner.waiting)
        {
            *place = decision;
            inner.waiting += 1;
        }
    }
}

/// No message goes through an end at the router.
#[derive(Clone, Copy, Debug, Default, types::Message)]
struct Nothing {}

impl InputEnd for RouterEnd {
    fn join(&self, _: &mut (dyn Any + Send)) {}

    fn is_drained(&self, _: WireId) -> bool {
        true
    }

    fn leave(&self, _: WireId, _: &mut (dyn Any + Send)) {}

    fn leaving_box(&self) -> Box<dyn Any + Send> {
        Box::new(())
    }

    fn has_message(&self) -> bool {
        self.inner().has_something()
    }

    fn settle(&self, step: u64) -> Settled {
        let inner = self.inner();
        Settled { took: inner.opened & !1 == step, left: inner.has_something() }
    }

    fn begin_step(&self) {}

    fn serves(&self) -> bool {
        false
    }

    fn rest(&self, why: Rest, _: &mut Teller<'_>) -> bool {
        matches!(why, Rest::Stepped(true) | Rest::Ready) && self.inner().has_something()
    }

    fn queue(&self, _: QueueForm) -> Option<Arc<dyn QueueEnd>> {
        None
    }

    fn message_type(&self) -> &'static MessageType {
        MessageType::of::<Nothing>()
    }

    fn facing(&self) -> Arc<dyn OutputEnd> {
        output_core::<Nothing>(&PortOptions::DEFAULT, 1)
    }

    fn take_cdr(&self) -> Option<Vec<u8>> {
        None
    }
}

/// The end at the router, where this is one.
pub(crate) fn router_end(ends: &PortEnds) -> Option<Arc<RouterEnd>> {
    let any: Arc<dyn Any + Send + Sync> = ends.input.clone()?;
    any.downcast().ok()
}

/// An agent's own end at the router: through it a step sees what the system is made of, and asks for changes of the agent's own wires.
///
/// It is declared like a port. An agent with one also runs when something was decided for it; with `on = "router"` in its plan it runs, too,
/// when somebody came or went, died, was wired or cut off, and when it begins.
///
/// Nothing waits: a request is decided later, whole or not at all, as if a person had asked for it, and its [`Decision`] comes to a later
/// step. On the wall clock that takes up to some ten milliseconds, longer while an executor that has to do its part does not answer. In
/// simulated time a request is decided when the steps of its instant are done; one that follows a decision of the same instant is
/// decided at the next instant, a millisecond later at most.
///
/// ```
/// use runtime::{Agent, Decision, Fault, Input, Router, Step, Why};
/// use types::messages::Ranges;
///
/// /// Hears whoever measures ranges, whoever comes.
/// #[derive(Agent)]
/// struct Listener {
///     /// What was measured.
///     ranges: Input<Ranges>,
///     /// Who measures.
///     router: Router,
/// }
///
/// impl Agent for Listener {
///     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
///         if let (Some(system), Some(own)) = (self.router.news(), self.router.own(&self.ranges)) {
///             for output in system.outputs::<Ranges>().filter(|output| !system.is_wired(output.at(), own)) {
///                 // Of too many at once the rest is asked for at the next news.
///                 let _ = self.router.subscribe(&self.ranges, output);
///             }
///         }
///         while let Some((_, decision)) = self.router.decision() {
///             // News may come before a decision: what was asked for twice is there already.
///             if let Decision::Refused { why, .. } = decision && why != Why::AlreadyWired {
///                 runtime::note!("was not wired: reason {}", why as u8);
///             }
///         }
///         while let Some(_ranges) = self.ranges.take() {}
///         Ok(())
///     }
/// }
/// ```
///
/// An agent has one at most:
///
/// ```compile_fail
/// use runtime::{Agent, Fault, Router, Step};
///
/// /// Asks twice.
/// #[derive(Agent)]
/// struct Twice {
///     /// Who there is.
///     router: Router,
///     /// Who there is, again.
///     again: Router,
/// }
///
/// impl Agent for Twice {
///     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
///         Ok(())
///     }
/// }
/// ```
#[derive(Default)]
pub struct Router {
    end: Option<Arc<RouterEnd>>,
    /// The number of the first request of this instance; what was decided before is not its own.
    first: Cell<Option<u32>>,
    /// The version of which it was told last.
    version: Cell<u64>,
}

/// What the system is made of, while it is looked at.
pub struct Look<'a> {
    composition: &'a Composition,
    end: Option<&'a RouterEnd>,
}

impl core::ops::Deref for Look<'_> {
    type Target = Composition;
    fn deref(&self) -> &Composition {
        self.composition
    }
}

impl Drop for Look<'_> {
    fn drop(&mut self) {
        if let Some(end) = self.end {
            end.inner().looks -= 1;
        }
    }
}

static NOBODY: Composition = Composition::EMPTY;

impl Router {
    /// What the system is made of. It stays the same until the step ends.
    pub fn system(&self) -> Look<'_> {
        let Some(end) = self.end.as_deref() else { return Look { composition: &NOBODY, end: None } };
        let inner = end.inner();
        if core::mem::take(&mut inner.is_new) {
            inner.note_taken();
        }
        inner.looks += 1;
        // SAFETY: while it is looked at, nobody puts another in its place; and its last owner, whoever that is, frees it on the control side.
        let composition = unsafe { &*Arc::as_ptr(&inner.composition) };
        self.version.set(composition.version());
        Look { composition, end: Some(end) }
    }

    /// The same where it has changed since this agent looked last. To an agent that has just begun all is new.
    pub fn news(&self) -> Option<Look<'_>> {
        let seen = self.version.get();
        let system = self.system();
        (system.version() != seen).then_some(system)
    }

    /// The number of a port of this agent; nothing for what is none of its ports.
    pub fn own(&self, port: &impl OwnPort) -> Option<PortAt> {
        let address = port.address().0?;
        let own = &self.end.as_deref()?.inner().own;
        own.iter().find(|(known, _)| *known == address).map(|(_, at)| *at)
    }

    /// The version of what the system was made of when the agent looked last: for [`Composition::joined_since`] and
    /// [`Composition::left_since`], asked for before the next look.
    pub fn version(&self) -> u64 {
        self.version.get()
    }

    /// Asks for a wire from an output, or from a queue, to an input of this agent; or from a client to a service of it.
    pub fn subscribe(&self, own: &impl Takes, from: impl Into<Place>) -> Result<Ticket, NotAsked> {
        self.subscribe_with(own, from, Wiring::default())
    }

    /// The same, for a wire that is not the usual one.
    pub fn subscribe_with(
        &self,
        own: &impl Takes,
        from: impl Into<Place>,
        wiring: Wiring,
    ) -> Result<Ticket, NotAsked> {
        self.ask(Deed::Subscribe, own, from.into(), wiring)
    }

    /// Asks for a cut of the wire from an output, or from a queue, to an input of this agent. What is on it arrives.
    pub fn unsubscribe(&self, own: &impl Takes, from: impl Into<Place>) -> Result<Ticket, NotAsked> {
        self.ask(Deed::Unsubscribe, own, from.into(), Wiring::default())
    }

    /// Asks for a wire from an output of this agent to an input, or to a queue; or from a client of it to a service.
    pub fn connect(&self, own: &impl Gives, to: impl Into<Place>) -> Result<Ticket, NotAsked> {
        self.connect_with(own, to, Wiring::default())
    }

    /// The same, for a wire that is not the usual one.
    pub fn connect_with(
        &self,
        own: &impl Gives,
        to: impl Into<Place>,
        wiring: Wiring,
    ) -> Result<Ticket, NotAsked> {
        self.ask(Deed::Connect, own, to.into(), wiring)
    }

    /// Asks for a cut of the wire from an output of this agent to an input, or to a queue. What is on it arrives.
    pub fn disconnect(&self, own: &impl Gives, to: impl Into<Place>) -> Result<Ticket, NotAsked> {
        self.ask(Deed::Disconnect, own, to.into(), Wiring::default())
    }

    /// The next decision. What was decided for an instance of this agent that is gone is passed over.
    pub fn decision(&self) -> Option<(Ticket, Decision)> {
        let end = self.end.as_deref()?;
        let inner = end.inner();
        inner.pass_over(self.first(inner));
        inner.take_decision().map(|(ticket, decision)| (Ticket(ticket), decision))
    }

    /// How many requests are under way: asked, and their decisions not taken yet.
    pub fn under_way(&self) -> usize {
        self.end.as_deref().map_or(0, |end| end.inner().open)
    }

    fn first(&self, inner: &Inner) -> u32 {
        let first = self.first.get().unwrap_or(inner.next);
        self.first.set(Some(first));
        first
    }

    fn ask(&self, deed: Deed, own: &impl OwnPort, other: Place, wiring: Wiring) -> Result<Ticket, NotAsked> {
        let end = self.end.as_deref().ok_or(NotAsked::Nowhere)?;
        let own = self.own(own).ok_or(NotAsked::NotMine)?.port;
        if other == Place::TooLong {
            return Err(NotAsked::NameTooLong);
        }
        let inner = end.inner();
        inner.pass_over(self.first(inner));
        let ticket = inner.next;
        let ask = Ask { ticket, deed, own, other, wiring };
        if inner.open >= REQUESTS_UNDER_WAY || inner.asks.push(|place| *place = ask) == Pushed::Full {
            count(&end.turned_away);
            return Err(NotAsked::TooMany);
        }
        inner.next = ticket.wrapping_add(1);
        inner.open += 1;
        count(&end.sent);
        if let Some(bell) = &inner.bell {
            // Pairs with the acquire where the control side looks: who sees the number finds the request.
            bell.fetch_add(1, Ordering::Release);
        }
        Ok(Ticket(ticket))
    }
}

impl Port for Router {
    fn shape(&self) -> PortShape {
        PortShape { direction: Direction::Router, input: None, output: None }
    }

    fn create(&self, _: &PortOptions, _: usize) -> PortEnds {
        PortEnds { input: Some(Arc::new(RouterEnd::new())), ..PortEnds::default() }
    }

    fn bind(&mut self, ends: &PortEnds) {
        self.end = router_end(ends);
    }

    /// It is used too seldom.
    fn fetch(&self, _: Depth) {}
}
