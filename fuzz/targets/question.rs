//! Lines of the control socket, and requests in words.
#![no_main]

use control::protocol::Question;
use control::words::{join, parse, read_value, split, words_of, write_value};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match Question::read(bytes) {
        Ok(question) => {
            let line = question.line();
            assert_eq!(Question::read(line.as_bytes()).as_ref(), Ok(&question), "{line}");
            if let Some(message) = &question.message {
                let json = control::json::to_json(&control::json::from_json(message));
                let again = control::json::to_json(&control::json::from_json(&json));
                assert_eq!(json, again);
            }
            request(&question.words);
        }
        Err((_, refusal)) => assert!(!refusal.what.is_empty()),
    }
    let Ok(text) = core::str::from_utf8(bytes) else { return };
    if let Ok(words) = split(text) {
        assert_eq!(split(&join(&words)).as_ref(), Ok(&words), "{text}");
        request(&words);
    }
    if let Ok(value) = read_value(text) {
        let shown = write_value(&value);
        // Compared as texts, since nan differs from itself.
        let again = read_value(&shown).unwrap_or_else(|refusal| panic!("{refusal}: {shown}"));
        assert_eq!(write_value(&again), shown, "{text}");
    }
});

/// What is a request is the same request when it is written and read again.
fn request(words: &[String]) {
    if let Ok(request) = parse(words) {
        let written = words_of(&request);
        let again = parse(&written).unwrap_or_else(|refusal| panic!("{refusal}: {written:?}"));
        assert_eq!(format!("{again:?}"), format!("{request:?}"), "{written:?}");
    }
}
