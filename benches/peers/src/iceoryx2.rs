//! iceoryx2: publish and subscribe over shared memory; within one thread, and between two of which the receiver polls.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{LogLevel, NodeBuilder, ServiceName, ipc, set_log_level};

use crate::document::{Document, Figure};
use crate::machine::{Granted, end, now, room, settle, sleep_until, start};
use crate::settings::Settings;

/// The other system.
pub(crate) const PEER: &str = "iceoryx2";

/// `hop_64`, `hop_230400`: in one thread, from before the sending of what stands in loaned memory until it is received, at a pace. The
/// others are one way between two threads, from before the loan until the message is received. A camera picture is 230 400 bytes:
/// `send_230400` begins when it stands in the loaned memory already, `filled_230400` before the loan, with the copying of the picture into it.
pub(crate) const FIGURES: &[&str] = &["hop_64", "hop_230400", "send_64", "send_230400", "filled_230400"];

/// Messages of each size where nobody says how many.
const ITERATIONS: u64 = 20_000;
/// Messages in one thread, those before anything is kept, and the time between them (ns) where nobody says.
const HOPS: u64 = 2_000;
const WARM_UP: u64 = 100;
const PERIOD: u64 = 100_000;
/// After so many looks the thread lets another run, which may be the one that it waits for.
const LOOKS: u64 = 10_000;

type Service = ipc::Service;
type Bytes = [u8];

/// Until where the receiver has come, and when (ns).
#[derive(Default)]
struct Received {
    count: AtomicU64,
    at: AtomicU64,
}

/// Measures, on processors 0 and 1 unless others are named.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let mut settings = settings.clone();
    if settings.cpus.is_empty() {
        settings.cpus = vec![0, 1];
    }
    // Its remark that nobody configured it is of no use here.
    set_log_level(LogLevel::Error);
    let hops = |size| {
        let wanted = settings.clone();
        end(start("peers-hops", move || hops(&wanted, size))?)?
    };
    let (small_hops, large_hops) = (hops(64)?, hops(230_400)?);
    let iterations = settings.iterations_or(ITERATIONS);
    let (mut granted, small) = way(&settings, 64, iterations)?;
    let (more, large) = way(&settings, 230_400, iterations.div_ceil(10))?;
    granted.extend(more);
    Ok(Document {
        peer: PEER,
        version: env!("VERSION_ICEORYX2").to_owned(),
        granted,
        figures: vec![
            Figure::times("hop_64", small_hops),
            Figure::times("hop_230400", large_hops),
            Figure::times("send_64", small.from_loan),
            Figure::times("send_230400", large.from_send),
            Figure::times("filled_230400", large.from_loan),
        ],
    })
}

/// Sends and receives in one thread, as agents of one executor do, at a pace; how long each took (ns). The bytes stay as they are: what
/// either side does with them is its own affair.
fn hops(settings: &Settings, size: usize) -> Result<Vec<u64>, String> {
    settle("hops", settings, 0);
    let name = format!("peers-{}-hop-{size}", std::process::id());
    let subscriber = connect(&name, |factory| {
        factory.subscriber_builder().create().map_err(|error| format!("no subscriber: {error}"))
    })?;
    let publisher = connect(&name, |factory| {
        let builder = factory.publisher_builder().initial_max_slice_len(size);
        builder.create().map_err(|error| format!("no publisher: {error}"))
    })?;
    let messages = settings.iterations_or(HOPS);
    let period = settings.period.unwrap_or(PERIOD);
    let mut spans = room(messages);
    let picture = vec![1u8; size];
    let begun = now();
    for round in 1..=WARM_UP + messages {
        let sample = publisher.1.loan_slice_uninit(size).map_err(|error| format!("loan: {error}"))?;
        let sample = sample.write_from_slice(&picture);
        sleep_until(begun + round * period);
        let before = now();
        sample.send().map_err(|error| format!("send: {error}"))?;
        let sample = subscriber.1.receive().map_err(|error| format!("receive: {error}"))?;
        let after = now();
        if sample.is_none_or(|sample| sample.payload().len() != size) {
            return Err(format!("message {round} did not come"));
        }
        if round > WARM_UP {
            spans.push(after - before);
        }
    }
    Ok(spans)
}

/// How long messages took (ns).
struct Spans {
    from_loan: Vec<u64>,
    from_send: Vec<u64>,
}

/// Sends messages of a size, each when the one before was received.
fn way(settings: &Settings, size: usize, iterations: u64) -> Result<(Vec<Granted>, Spans), String> {
    let name = format!("peers-{}-{size}", std::process::id());
    let received = Arc::new(Received::default());
    let (theirs, wanted, service) = (received.clone(), settings.clone(), name.clone());
    // The receiver stands before the first message is sent.
    let (ready, standing) = std::sync::mpsc::sync_channel(1);
    let takes = start("peers-takes", move || {
        let granted = settle("takes", &wanted, 1);
        let subscriber = connect(&service, |factory| {
            factory.subscriber_builder().create().map_err(|error| format!("no subscriber: {error}"))
        })?;
        let _ = ready.send(());
        take(&subscriber.1, &theirs, size, iterations)?;
        Ok::<_, String>(granted)
    })?;
    let _ = standing.recv();
    let wanted = settings.clone();
    let sends = start("peers-sends", move || {
        let granted = settle("sends", &wanted, 0);
        let publisher = connect(&name, |factory| {
            let builder = factory.publisher_builder().initial_max_slice_len(size);
            builder.create().map_err(|error| format!("no publisher: {error}"))
        })?;
        let spans = send(&publisher.1, &received, size, iterations)?;
        Ok::<_, String>((granted, spans))
    })?;
    let sent = end(sends)?;
    let taken = end(takes)?;
    let ((sends, spans), takes) = (sent?, taken?);
    Ok((vec![sends, takes], spans))
}

type Factory = iceoryx2::service::port_factory::publish_subscribe::PortFactory<Service, Bytes, ()>;

/// One end of the service of this name; the first who comes makes it. What it stands on lives as long as it.
fn connect<T>(name: &str, make: impl FnOnce(&Factory) -> Result<T, String>) -> Result<(Factory, T), String> {
    let failed = |what: &str, error: &dyn std::fmt::Display| format!("{what}: {error}");
    let node = NodeBuilder::new().create::<Service>().map_err(|error| failed("no node", &error))?;
    let name: ServiceName = name.try_into().map_err(|error| failed("no name", &error))?;
    let factory = node.service_builder(&name).publish_subscribe::<Bytes>().open_or_create();
    let factory = factory.map_err(|error| failed("no service", &error))?;
    let port = make(&factory)?;
    Ok((factory, port))
}

fn take(
    subscriber: &Subscriber<Service, Bytes, ()>,
    received: &Received,
    size: usize,
    iterations: u64,
) -> Result<(), String> {
    for round in 1..=iterations {
        let mut looks = 0u64;
        let sample = loop {
            let sample = subscriber.receive().map_err(|error| format!("receive: {error}"))?;
            if let Some(sample) = sample {
                break sample;
            }
            looks += 1;
            if looks.is_multiple_of(LOOKS) {
                std::thread::yield_now();
            }
        };
        let at = now();
        let bytes = sample.payload();
        if bytes.len() != size || bytes[0] != round as u8 || bytes[size - 1] != round as u8 {
            return Err(format!("message {round} is not what was sent"));
        }
        drop(sample);
        received.at.store(at, Ordering::Relaxed);
        // Release: partner of the acquiring load of the sender, which then sees the time.
        received.count.store(round, Ordering::Release);
    }
    Ok(())
}

fn send(
    publisher: &Publisher<Service, Bytes, ()>,
    received: &Received,
    size: usize,
    iterations: u64,
) -> Result<Spans, String> {
    let mut spans = Spans { from_loan: room(iterations), from_send: room(iterations) };
    let mut picture = vec![0u8; size];
    for round in 1..=iterations {
        (picture[0], picture[size - 1]) = (round as u8, round as u8);
        let before = now();
        let sample = publisher.loan_slice_uninit(size).map_err(|error| format!("loan: {error}"))?;
        let sample = sample.write_from_slice(&picture);
        // A small message is not worth a second reading of the clock inside what is timed.
        let filled = if size > 64 { now() } else { before };
        sample.send().map_err(|error| format!("send: {error}"))?;
        let mut looks = 0u64;
        // Acquire: partner of the releasing store of the receiver.
        while received.count.load(Ordering::Acquire) != round {
            std::hint::spin_loop();
            looks += 1;
            if looks.is_multiple_of(LOOKS) {
                std::thread::yield_now();
            }
            if looks > LOOKS * 1_000_000 {
                return Err(format!("message {round} was never received"));
            }
        }
        let at = received.at.load(Ordering::Relaxed);
        spans.from_loan.push(at.saturating_sub(before));
        spans.from_send.push(at.saturating_sub(filled));
    }
    Ok(spans)
}
