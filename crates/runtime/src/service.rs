//! Calls and answers. A call never blocks: its answer, or the news that none came in time, arrives like a message.

use std::sync::Arc;

use types::cdr::NoElement;
use types::{AgentId, Category, Duration, Header, Message, Time};

use crate::context::{Context, current};
use crate::fetch::Depth;
use crate::message_type::MessageType;
use crate::port::{
    Direction, Envelope, Input, InputCore, Output, OutputCore, Port, PortEnds, PortOptions, PortShape,
    downcast_input, downcast_output, input_core, output_core,
};

/// How many calls of one client can be under way.
pub const CALLS_UNDER_WAY: usize = 8;

/// An end that answers calls: questions of type `Q` with answers of type `A`.
pub struct Service<Q: Message, A: Message> {
    calls: Input<Q>,
    answers: Output<A>,
}

impl<Q: Message, A: Message> Default for Service<Q, A> {
    fn default() -> Self {
        Service { calls: Input::default(), answers: Output::default() }
    }
}

impl<Q: Message<Element = NoElement>, A: Message<Element = NoElement>> Service<Q, A> {
    /// Answers every call that waits and whose time is not yet over. Says how many.
    pub fn serve(&mut self, mut answer: impl FnMut(&Q) -> A) -> usize {
        let mut served = 0;
        while let Some((question, call)) = self.take() {
            let answer = answer(&question);
            self.answer(&call, answer);
            served += 1;
        }
        served
    }

    /// Takes the next call, to be answered now or in a later step. Calls whose time is over are passed over: nobody waits.
    pub fn take(&mut self) -> Option<(Q, Call)> {
        let now = current().map_or(Time::ZERO, Context::now);
        loop {
            let received = self.calls.take()?;
            if received.header().deadline >= now {
                return Some((*received, Call { header: *received.header() }));
            }
        }
    }

    /// Answers a call.
    pub fn answer(&mut self, call: &Call, answer: A) {
        let Header { sender, marker, priority, .. } = call.header;
        let envelope = Envelope {
            recipient: sender,
            marker,
            priority,
            category: Category::Answer,
            ..Envelope::default()
        };
        self.answers.send_as(envelope, answer);
    }

    /// Whether a call waits.
    pub fn has_call(&self) -> bool {
        self.calls.has_message()
    }
}

/// A call that was taken and wants an answer.
#[derive(Clone, Copy, Debug)]
pub struct Call {
    header: Header,
}

impl Call {
    /// What the call carried besides the question.
    pub fn header(&self) -> &Header {
        &self.header
    }
}

/// The number of a call, or of a request to the router, that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket(pub(crate) u32);

/// What became of a call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply<A> {
    /// The answer.
    Answer(A),
    /// None came in time.
    TimeOut,
}

/// An end that calls a service.
pub struct Client<Q: Message, A: Message> {
    calls: Output<Q>,
    answers: Input<A>,
    under_way: [Option<(u32, Time)>; CALLS_UNDER_WAY],
    next: u32,
}

impl<Q: Message, A: Message> Default for Client<Q, A> {
    fn default() -> Self {
        Client {
            calls: Output::default(),
            answers: Input::default(),
            under_way: [None; CALLS_UNDER_WAY],
            next: 1,
        }
    }
}

impl<Q: Message<Element = NoElement>, A: Message<Element = NoElement>> Client<Q, A> {
    /// Calls. The agent gets a step when the answer comes, or when the time is over. Gives the question back when nobody is
    /// wired to answer, or when too many calls are under way.
    pub fn call(&mut self, question: Q, time_out: Duration) -> Result<Ticket, Q> {
        let Some(place) = self.under_way.iter_mut().find(|place| place.is_none()) else {
            return Err(question);
        };
        let deadline = current().map_or(Time::ZERO, Context::now).saturating_add(time_out);
        let marker = self.next;
        let envelope = Envelope { marker, deadline, category: Category::Call, ..Envelope::default() };
        if self.calls.send_as(envelope, question).taken == 0 {
            return Err(question);
        }
        self.next = self.next.wrapping_add(1).max(1);
        *place = Some((marker, deadline));
        if let Some(context) = current() {
            context.wake_at(deadline);
        }
        Ok(Ticket(marker))
    }

    /// The next answer, or the next call whose time is over.
    pub fn reply(&mut self) -> Option<(Ticket, Reply<A>)> {
        while let Some(received) = self.answers.take() {
            let marker = received.header().marker;
            let place =
                self.under_way.iter_mut().find(|place| place.is_some_and(|(known, _)| known == marker));
            // An answer that comes after its time has no place any more, and is passed over.
            if let Some(place) = place {
                *place = None;
                return Some((Ticket(marker), Reply::Answer(*received)));
            }
        }
        let now = current().map_or(Time::ZERO, Context::now);
        let late = self.under_way.iter_mut().find(|place| place.is_some_and(|(_, deadline)| deadline <= now));
        if let Some((marker, _)) = late.and_then(Option::take) {
            return Some((Ticket(marker), Reply::TimeOut));
        }
        // Steps that were asked for are forgotten when another comes first.
        if let Some(next) = self.under_way.iter().flatten().map(|(_, deadline)| *deadline).min()
            && let Some(context) = current()
        {
            context.wake_at(next);
        }
        None
    }
}

impl<Q: Message, A: Message> Service<Q, A> {
    pub(crate) fn core_address(&self) -> Option<usize> {
        self.calls.core_address()
    }
}

impl<Q: Message, A: Message> Client<Q, A> {
    pub(crate) fn core_address(&self) -> Option<usize> {
        self.calls.core_address()
    }
}

impl<Q: Message, A: Message> Port for Service<Q, A> {
    fn shape(&self) -> PortShape {
        let (input, output) = (Some(MessageType::of::<Q>()), Some(MessageType::of::<A>()));
        PortShape { direction: Direction::Service, input, output }
    }

    fn create(&self, options: &PortOptions, seats: usize) -> PortEnds {
        let (input, output) = (input_core::<Q>(), output_core::<A>(options, seats));
        PortEnds { input: Some(input), output: Some(output), ..PortEnds::default() }
    }

    fn bind(&mut self, ends: &PortEnds) {
        bind_both(&mut self.calls, &mut self.answers, ends);
    }

    fn fetch(&self, depth: Depth) {
        self.calls.fetch(depth);
        self.answers.fetch(depth);
    }
}

impl<Q: Message, A: Message> Port for Client<Q, A> {
    fn shape(&self) -> PortShape {
        let (input, output) = (Some(MessageType::of::<A>()), Some(MessageType::of::<Q>()));
        PortShape { direction: Direction::Client, input, output }
    }

    fn create(&self, options: &PortOptions, seats: usize) -> PortEnds {
        let (input, output) = (input_core::<A>(), output_core::<Q>(options, seats));
        PortEnds { input: Some(input), output: Some(output), ..PortEnds::default() }
    }

    fn bind(&mut self, ends: &PortEnds) {
        bind_both(&mut self.answers, &mut self.calls, ends);
    }

    fn fetch(&self, depth: Depth) {
        self.calls.fetch(depth);
        self.answers.fetch(depth);
    }
}

fn bind_both<I: Message, O: Message>(input: &mut Input<I>, output: &mut Output<O>, ends: &PortEnds) {
    let input_end: Option<Arc<InputCore<I>>> = ends.input.as_ref().and_then(downcast_input);
    let output_end: Option<Arc<OutputCore<O>>> = ends.output.as_ref().and_then(downcast_output);
    input.set_core(input_end);
    output.set_core(output_end);
}

/// The agent to which an answer goes.
pub(crate) fn answers_for(client: AgentId) -> types::Filter {
    types::Filter { recipient: Some(client), ..types::Filter::ALL }
}
