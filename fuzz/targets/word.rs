//! Words that people type: spans of time, commands, drivers.
#![no_main]

use libfuzzer_sys::fuzz_target;
use types::Duration;

fuzz_target!(|text: &str| {
    if let Ok(span) = text.parse::<Duration>() {
        assert_eq!(span.to_string().parse(), Ok(span), "{text}");
    }
    match motion::word::parse(text) {
        Ok(word) => assert!(motion::word::makes_sense(&word), "{text} is {word:?}"),
        Err(why) => assert!(!why.to_string().is_empty()),
    }
    if let Err(why) = hardware::Spec::parse(text) {
        assert!(!why.to_string().is_empty());
    }
});
