//! Bytes of messages: by their types, and by definitions that a file brings.
#![no_main]

use libfuzzer_sys::fuzz_target;
use record::{dynamic, schema::Schema};
use types::cdr::{Reader, Writer};
use types::message::describe;
use types::messages::*;
use types::{Message, Time};

// The first byte chooses a type. 255: the text up to a zero is a definition, and the rest a message of it.
fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    match which {
        0 => typed::<Twist>(bytes),
        1 => typed::<LaserScan>(bytes),
        2 => typed::<Image>(bytes),
        3 => typed::<Odometry>(bytes),
        4 => typed::<Transforms>(bytes),
        5 => typed::<Ranges>(bytes),
        6 => typed::<Echoes>(bytes),
        7 => typed::<Battery>(bytes),
        8 => typed::<Gyro>(bytes),
        9 => typed::<WheelTicks>(bytes),
        10 => typed::<Bumper>(bytes),
        11 => typed::<Head>(bytes),
        12 => typed::<Decision>(bytes),
        13 => typed::<Offer>(bytes),
        14 => typed::<Risk>(bytes),
        15 => typed::<Safety>(bytes),
        16 => typed::<Target>(bytes),
        17 => typed::<Landmarks>(bytes),
        255 => foreign(bytes),
        _ => {}
    }
});

fn decoded<T: Message>(bytes: &[u8]) -> Option<(T, Vec<T::Element>)> {
    let mut row = Vec::new();
    let message = T::decode(&mut Reader::new(bytes).ok()?, &mut row).ok()?;
    Some((message, row))
}

fn encoded<T: Message>((message, row): &(T, Vec<T::Element>)) -> Vec<u8> {
    let mut out = Writer::new();
    message.encode(row, Time::ZERO, &mut out);
    out.bytes().to_vec()
}

/// What can be read is the same when it is written and read again, by its type and by its definition.
fn typed<T: Message>(bytes: &[u8]) {
    let schema = Schema::from(&describe::<T>());
    let _ = dynamic::decode(&schema, bytes);
    let Some(message) = decoded::<T>(bytes) else { return };
    let written = encoded(&message);
    let again = decoded::<T>(&written).unwrap_or_else(|| panic!("{message:?} cannot be read again"));
    // Compared as bytes, since nan differs from itself.
    assert_eq!(encoded(&again), written, "{message:?}");
    let tree = dynamic::decode(&schema, &written).unwrap_or_else(|error| panic!("{error}: {message:?}"));
    let Ok(by_definition) = dynamic::encode(&schema, &tree.into()) else { return };
    // Compared as texts, since there are many numbers that are none.
    let again = decoded::<T>(&by_definition).map(|again| format!("{again:?}"));
    assert_eq!(again, decoded::<T>(&written).map(|first| format!("{first:?}")));
}

fn foreign(bytes: &[u8]) {
    let Some(end) = bytes.iter().position(|byte| *byte == 0) else { return };
    let text = String::from_utf8_lossy(&bytes[..end]);
    let Ok(schema) = Schema::parse("some_msgs/msg/Some", &text) else { return };
    if let Ok(value) = dynamic::decode(&schema, &bytes[end + 1..]) {
        let shown = value.to_string();
        if let Ok(written) = dynamic::encode(&schema, &value.into()) {
            let again = dynamic::decode(&schema, &written).unwrap_or_else(|error| panic!("{error}: {shown}"));
            assert_eq!(again.to_string(), shown);
        }
    }
}
