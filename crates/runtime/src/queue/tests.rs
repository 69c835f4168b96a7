//! A queue against a plain one, and every order in which two senders and two receivers can meet at it.

use super::*;
use types::{AgentId, Time};

fn key(priority: Priority, stamp: i64, sender: u32) -> Key {
    Key::new(priority, Time(stamp), AgentId(sender))
}

#[cfg(not(loom))]
mod plain {
    use super::*;
    use std::collections::VecDeque;

    const SENDERS: usize = 3;
    const RECEIVERS: usize = 3;
    const PRIORITIES: [Priority; 2] = [Priority::Urgent, Priority::Normal];

    type Item = (Key, u32);

    /// What can be done with a queue.
    #[derive(Clone, Debug)]
    enum Act {
        Send {
            sender: usize,
            urgent: bool,
            stamp: i64,
        },
        Take(usize),
        Wait(usize),
        Withdraw(usize),
        /// A sender goes, and another one comes in its place.
        Change(usize),
        /// The same for a receiver.
        Succeed(usize),
    }

    fn act() -> impl proptest::strategy::Strategy<Value = Act> {
        use proptest::prelude::*;
        prop_oneof![
            6 => (0..SENDERS, any::<bool>(), 0i64..4)
                .prop_map(|(sender, urgent, stamp)| Act::Send { sender, urgent, stamp }),
            5 => (0..RECEIVERS).prop_map(Act::Take),
            2 => (0..RECEIVERS).prop_map(Act::Wait),
            1 => (0..RECEIVERS).prop_map(Act::Withdraw),
            1 => (0..SENDERS).prop_map(Act::Change),
            1 => (0..RECEIVERS).prop_map(Act::Succeed),
        ]
    }

    /// A queue with one thread: each sender and priority in order, the fronts compared, the receivers that wait by number.
    #[derive(Default)]
    struct Plain {
        lanes: [[VecDeque<Item>; 2]; SENDERS],
        /// What senders left that are gone.
        left: Vec<VecDeque<Item>>,
        waits: [bool; RECEIVERS],
    }

    impl Plain {
        fn all(&mut self) -> impl Iterator<Item = &mut VecDeque<Item>> {
            let lanes = self.lanes.iter_mut().flatten().chain(&mut self.left);
            lanes.filter(|lane| !lane.is_empty())
        }

        /// What decides which message is next.
        fn next(&mut self) -> Option<Key> {
            self.all().map(|lane| lane[0].0).min()
        }

        /// Takes the message with this number, if it is one of those that are next.
        fn take(&mut self, number: u32) -> bool {
            let next = self.next();
            let lane = self.all().find(|lane| Some(lane[0].0) == next && lane[0].1 == number);
            lane.is_some_and(|lane| lane.pop_front().is_some())
        }

        fn call(&mut self) -> Option<u32> {
            let first = (0..RECEIVERS).find(|receiver| self.waits[*receiver])?;
            self.waits[first] = false;
            Some(first as u32)
        }
    }

    fn doors() -> Vec<Arc<Door>> {
        vec![Arc::new(Door::new())]
    }

    proptest::proptest! {
        /// Nothing is lost, doubled or out of order, and of those who wait the first is called; whoever comes and goes.
        #[test]
        fn it_does_what_a_plain_queue_does(
            depth in 1usize..5, displaces: bool, acts in proptest::collection::vec(act(), 0..300),
        ) {
            let shared = Shared::<u32>::new(depth, displaces, doors());
            let mut senders: Vec<_> = (0..SENDERS).map(|_| shared.sender(&PRIORITIES)).collect();
            let mut receivers: Vec<_> = (0..RECEIVERS).map(|slot| shared.receiver(0, slot as u32)).collect();
            let mut model = Plain::default();
            for (number, act) in acts.into_iter().enumerate() {
                let number = number as u32;
                match act {
                    Act::Send { sender, urgent, stamp } => {
                        let priority = PRIORITIES[usize::from(!urgent)];
                        let key = key(priority, stamp, sender as u32);
                        let mut called = None;
                        let end = senders[sender].as_mut().unwrap();
                        let lane = &mut model.lanes[sender][usize::from(!urgent)];
                        let room = lane.len() < depth;
                        let all = room && model.lanes[sender].iter().all(|lane| lane.len() < depth);
                        proptest::prop_assert_eq!(end.has_room(), all);
                        let pushed = end.push(priority, key, |place| *place = number, |who| called = Some(who.slot));
                        let expected = match (room, displaces) {
                            (true, _) => Pushed::Stored,
                            (false, true) => Pushed::Displaced,
                            (false, false) => Pushed::Full,
                        };
                        proptest::prop_assert_eq!(pushed, expected);
                        let lane = &mut model.lanes[sender][usize::from(!urgent)];
                        if pushed == Pushed::Displaced {
                            lane.pop_front();
                        }
                        let mut expected = None;
                        if pushed != Pushed::Full {
                            lane.push_back((key, number));
                            expected = model.call();
                        }
                        proptest::prop_assert_eq!(called, expected);
                    }
                    Act::Take(receiver) => {
                        let end = receivers[receiver].as_mut().unwrap();
                        let next = model.next();
                        proptest::prop_assert_eq!(end.has_message(), next.is_some());
                        proptest::prop_assert_eq!(end.peek().map(|seen| seen.key()), next);
                        let taken = end.advance().then(|| *end.current());
                        proptest::prop_assert_eq!(taken.is_some(), next.is_some());
                        proptest::prop_assert!(taken.is_none_or(|number| model.take(number)));
                    }
                    Act::Wait(receiver) => {
                        let empty = model.next().is_none();
                        proptest::prop_assert_eq!(receivers[receiver].as_ref().unwrap().wait(|_| ()), empty);
                        model.waits[receiver] |= empty;
                    }
                    Act::Withdraw(receiver) => {
                        model.waits[receiver] = false;
                        let any = model.next().is_some();
                        let expected = any.then(|| model.call()).flatten();
                        let called = receivers[receiver].as_ref().unwrap().withdraw();
                        proptest::prop_assert_eq!(called.map(|called| called.slot), expected);
                    }
                    Act::Change(sender) => {
                        senders[sender] = None;
                        model.left.extend(core::mem::take(&mut model.lanes[sender]));
                        senders[sender] = shared.sender(&PRIORITIES);
                        proptest::prop_assert!(senders[sender].is_some());
                    }
                    Act::Succeed(receiver) => {
                        model.waits[receiver] = false;
                        receivers[receiver] = None;
                        receivers[receiver] = shared.receiver(0, receiver as u32);
                        proptest::prop_assert_eq!(receivers[receiver].as_ref().unwrap().number(), receiver as u32);
                    }
                }
                let waiting = model.all().map(|lane| lane.len()).sum::<usize>();
                proptest::prop_assert_eq!(shared.waiting(), waiting);
            }
        }
    }

    #[test]
    fn the_first_by_rank_is_called_whatever_its_place() {
        let shared = Shared::<u32>::new(4, false, doors());
        let mut sender = shared.sender(&[Priority::Normal]).unwrap();
        let receivers: Vec<_> = (0..3).map(|slot| shared.receiver(0, slot).unwrap()).collect();
        for (receiver, rank) in receivers.iter().zip([2, 0, 1]) {
            shared.set_rank(receiver.number(), rank);
            assert!(receiver.wait(|_| ()));
        }
        let mut called = Vec::new();
        for _ in 0..4 {
            sender.push(Priority::Normal, key(Priority::Normal, 0, 0), |_| (), |who| called.push(who.slot));
        }
        assert_eq!(called, [1, 2, 0], "and the last message calls nobody");
    }

    #[test]
    fn who_leaves_messages_to_others_is_called_when_nobody_else_waits() {
        let shared = Shared::<u32>::new(4, false, doors());
        let mut sender = shared.sender(&[Priority::Normal]).unwrap();
        let mut send = |expected: Option<u32>| {
            let mut called = None;
            sender.push(Priority::Normal, key(Priority::Normal, 0, 0), |_| (), |who| called = Some(who.slot));
            assert_eq!(called, expected);
        };
        let (lazy, keen) = (shared.receiver(0, 0).unwrap(), shared.receiver(0, 1).unwrap());
        assert!(lazy.wait(|_| ()) && keen.wait(|_| ()));
        send(Some(0));
        assert_eq!(lazy.leave_to_others().map(|called| called.slot), Some(1));
        // The other one is at work now.
        send(Some(0));
        assert!(lazy.leave_to_others().is_none());
        lazy.withdraw();
        send(None);
    }

    #[test]
    fn who_is_closed_neither_takes_nor_puts() {
        let shared = Shared::<u32>::new(4, false, doors());
        let mut sender = shared.sender(&[Priority::Normal]).unwrap();
        let (mut stuck, mut other) = (shared.receiver(0, 0).unwrap(), shared.receiver(0, 1).unwrap());
        let key = key(Priority::Normal, 0, 0);
        let push = |sender: &mut Sender<u32>, number| {
            sender.push(Priority::Normal, key, |place| *place = number, |_| ())
        };
        assert_eq!(push(&mut sender, 7), Pushed::Stored);
        shared.close_receiver(stuck.number());
        shared.close_rings(&sender.rings());
        assert_eq!(push(&mut sender, 8), Pushed::Full);
        assert!(!stuck.advance() && !stuck.has_message() && stuck.wait(|_| ()));
        // Its place is not given to another until it is dropped.
        assert_eq!(shared.receiver(0, 2).unwrap().number(), 2);
        assert!(other.advance() && *other.current() == 7);
        drop(stuck);
        assert_eq!(shared.receiver(0, 3).unwrap().number(), 0);
        // Neither are its rings; and whoever gets them is open.
        let mut second = shared.sender(&[Priority::Normal]).unwrap();
        assert_ne!(second.rings(), sender.rings());
        drop(sender);
        let mut third = shared.sender(&[Priority::Normal]).unwrap();
        assert_eq!((push(&mut second, 1), push(&mut third, 2)), (Pushed::Stored, Pushed::Stored));
    }

    #[test]
    fn there_are_so_many_places_and_no_more() {
        let shared = Shared::<u32>::new(1, false, doors());
        let receivers: Vec<_> = (0..SEATS as u32).map(|slot| shared.receiver(0, slot).unwrap()).collect();
        assert!(shared.receiver(0, 0).is_none());
        let senders: Vec<_> = (0..RINGS / 2).map(|_| shared.sender(&PRIORITIES).unwrap()).collect();
        assert!(shared.sender(&[Priority::Normal]).is_none());
        drop((receivers, senders));
        assert!(shared.receiver(0, 0).is_some() && shared.sender(&PRIORITIES).is_some());
    }
}

#[cfg(loom)]
mod model {
    use super::*;
    use crate::sync::weaken;
    use loom::thread;

    /// Both halves of a message are written apart: a torn read would show them apart.
    #[derive(Default)]
    struct Pair(u32, u32);

    const PRIORITY: Priority = Priority::Normal;

    fn send(sender: &mut Sender<Pair>, number: u32) -> Pushed {
        let fill = |pair: &mut Pair| *pair = Pair(number, number);
        sender.push(PRIORITY, key(PRIORITY, number.into(), 0), fill, |called| called.ring())
    }

    /// Takes what is next and checks that it is whole, and what its key said.
    fn take(receiver: &mut Receiver<Pair>) -> Option<u32> {
        let seen = receiver.peek()?;
        if !receiver.take(&seen) {
            return None;
        }
        let pair = receiver.current();
        assert_eq!(pair.0, pair.1, "torn");
        assert_eq!(seen.key(), key(PRIORITY, pair.0.into(), 0), "the key of another message");
        Some(pair.0)
    }

    fn rest(receiver: &mut Receiver<Pair>) -> Vec<u32> {
        std::iter::from_fn(|| take(receiver)).collect()
    }

    fn grows(numbers: &[u32]) -> bool {
        numbers.windows(2).all(|pair| pair[0] < pair[1])
    }

    /// A ring that was full before and from which one has taken, so that slots go around within few messages: its sender sends two, and
    /// two receivers take one each.
    fn exchange(depth: u32, displaces: bool) {
        let shared = Shared::<Pair>::new(depth as usize, displaces, Vec::new());
        let mut sender = shared.sender(&[PRIORITY]).unwrap();
        let [mut one, mut other] = [0, 1].map(|slot| shared.receiver(0, slot).unwrap());
        (1..=depth).for_each(|number| assert_eq!(send(&mut sender, number), Pushed::Stored));
        assert_eq!(take(&mut one), Some(1));
        let last = depth + 1;
        assert_eq!(send(&mut sender, last), Pushed::Stored);
        let sending = thread::spawn(move || {
            let became = (last + 1..=last + 2).map(|number| send(&mut sender, number));
            became.filter(|pushed| *pushed != Pushed::Full).count() as u32
        });
        let taking = thread::spawn(move || {
            let taken = take(&mut other);
            (other, taken)
        });
        // What was taken is there until the next is.
        let before = one.current();
        assert_eq!((before.0, before.1), (1, 1));
        let first = take(&mut one);
        let accepted = last + sending.join().unwrap();
        let (mut other, second) = taking.join().unwrap();
        // Who was away finds what is left.
        let left = rest(&mut other);
        assert!(rest(&mut one).is_empty() && grows(&left), "{left:?}");
        let mut all: Vec<u32> = first.into_iter().chain(second).chain(left).collect();
        all.sort_unstable();
        assert!(grows(&all), "taken twice: {all:?}");
        if displaces {
            assert_eq!(all.last(), Some(&(last + 2)), "the newest is never lost");
        } else {
            assert_eq!(all.len() as u32 + 1, accepted, "what was accepted is taken: {all:?}");
        }
    }

    /// What only one who waits for a message needs.
    const WAITING: [&str; 3] = ["queue: wait", "queue: call", "queue: withdraw"];

    #[test]
    fn refuse_past_the_wrap() {
        weaken::check(&WAITING, || exchange(1, false));
    }

    #[test]
    fn newest_wins_past_the_wrap() {
        weaken::check(&WAITING, || exchange(1, true));
    }

    /// Here a thread is interrupted twice at most: there are very many orders.
    #[test]
    fn two_places_past_the_wrap() {
        for displaces in [false, true] {
            weaken::run(2, move || exchange(2, displaces));
        }
    }

    /// The rings pass on what was sent by themselves, which is shown above; and the door, which is shown with it.
    const RING: [&str; 5] =
        ["queue: look", "queue: refuse, look", "queue: refuse, put", "queue: give back", "door: ring"];

    /// A queue, and two doors that say who was told.
    fn queue() -> (Arc<Shared<Pair>>, Vec<Arc<Door>>) {
        let doors: Vec<Arc<Door>> = (0..2).map(|_| Arc::new(Door::new())).collect();
        (Shared::new(1, false, doors.clone()), doors)
    }

    fn sender(shared: &Arc<Shared<Pair>>) -> Sender<Pair> {
        shared.sender(&[PRIORITY]).unwrap()
    }

    fn sends(mut sender: Sender<Pair>, number: u32) -> thread::JoinHandle<Sender<Pair>> {
        thread::spawn(move || {
            assert_eq!(send(&mut sender, number), Pushed::Stored);
            sender
        })
    }

    /// Takes what there is, or waits. Says whether it waits.
    fn works(mut receiver: Receiver<Pair>) -> (Receiver<Pair>, bool) {
        receiver.begin_step();
        let waits = take(&mut receiver).is_none() && receiver.wait(|called| called.ring());
        (receiver, waits)
    }

    /// Senders with a message each and receivers that come to work. For each message that is left
    /// somebody was told, or looks once more.
    fn meet(senders: u32, receivers: u32) {
        let (shared, doors) = queue();
        let senders: Vec<_> = (1..=senders).map(|number| (sender(&shared), number)).collect();
        let mut receivers: Vec<_> =
            (0..receivers).map(|executor| shared.receiver(executor, 0).unwrap()).collect();
        let last = receivers.pop().unwrap();
        let sending: Vec<_> = senders.into_iter().map(|(sender, number)| sends(sender, number)).collect();
        let working: Vec<_> =
            receivers.into_iter().map(|receiver| thread::spawn(move || works(receiver))).collect();
        let last = works(last);
        let mut all: Vec<_> = working.into_iter().map(|worker| worker.join().unwrap()).collect();
        all.push(last);
        let _senders: Vec<_> = sending.into_iter().map(|sender| sender.join().unwrap()).collect();
        let looks = all.iter().zip(&doors).filter(|((_, waits), door)| !waits || door.is_rung()).count();
        assert!(looks >= shared.waiting().min(all.len()), "one waits and so does a message");
    }

    #[test]
    fn nobody_waits_while_a_message_does() {
        weaken::check(&[&RING[..], &["queue: withdraw"]].concat(), || meet(1, 2));
    }

    #[test]
    fn nobody_waits_while_one_of_two_messages_does() {
        weaken::check(&[&RING[..], &["queue: withdraw"]].concat(), || meet(2, 1));
    }

    /// Here a thread is interrupted once at most: there are very many orders.
    #[test]
    fn two_senders_meet_two_receivers() {
        weaken::run(1, || {
            meet(2, 2);
        });
    }

    /// A receiver waits and dies, as another one comes to wait. Whichever was called, the other one is told of the message.
    #[test]
    fn a_call_for_the_dead_is_passed_on() {
        weaken::check(&RING, || {
            let (shared, doors) = queue();
            let [dies, lives] = [0, 1].map(|executor| shared.receiver(executor, 0).unwrap());
            let sender = sender(&shared);
            let dying = thread::spawn(move || {
                dies.wait(|called| called.ring());
                if let Some(called) = dies.withdraw() {
                    called.ring();
                }
                dies
            });
            let sending = sends(sender, 1);
            let waits = lives.wait(|called| called.ring());
            let _ends = (dying.join().unwrap(), sending.join().unwrap());
            assert!(!waits || doors[1].is_rung(), "only the dead was told");
        });
    }

    /// A receiver is closed as it comes to wait. Whether it was called or not, the other one is told of the message.
    #[test]
    fn a_call_for_who_is_closed_is_passed_on() {
        weaken::check(&RING, || {
            let (shared, doors) = queue();
            let [closed, lives] = [0, 1].map(|executor| shared.receiver(executor, 0).unwrap());
            assert!(lives.wait(|_| ()));
            let sender = sender(&shared);
            let waiting = thread::spawn(move || {
                closed.wait(|called| called.ring());
                closed
            });
            let sending = sends(sender, 1);
            shared.close_receiver(0);
            shared.call_again();
            let _ends = (waiting.join().unwrap(), sending.join().unwrap(), lives);
            assert!(doors[1].is_rung(), "only who is closed was told");
        });
    }
}
