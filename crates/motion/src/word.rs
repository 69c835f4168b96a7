//! Commands in words: "turn right a little bit", "increase speed", "stop".
//!
//! ```text
//! command   = VERB [DIRECTION] [AMOUNT]     in any order, fillers such as "please" left out
//! VERB      = turn | go | speed | stop      and their synonyms: rotate, drive, increase, halt, …
//! DIRECTION = left | right | forward | back | up | down
//! AMOUNT    = a little bit | slightly | somewhat | more or less | [very] much | extremely
//!                                           and their synonyms: slowly, fast, a lot, …
//! ```
//!
//! "A little bit" is the next smaller term, not a hedge: it moves the centre of the set, which is what people mean.

use crate::fuzzy::{Claim, Hedge, Term};
use core::fmt;

pub use types::messages::{Amount, Direction, Verb, Word};

/// Stand still.
pub const STOP: Word = Word { verb: Verb::Stop, direction: Direction::None, amount: Amount::Plain };

/// Whether the verb can have the direction: turn left, right, up or down; go forward or back; speed up or down; stop without.
pub fn makes_sense(word: &Word) -> bool {
    fits(word.verb, word.direction)
}

fn fits(verb: Verb, direction: Direction) -> bool {
    use Direction as D;
    match verb {
        Verb::Turn => matches!(direction, D::Left | D::Right | D::Up | D::Down),
        Verb::Go => matches!(direction, D::Forward | D::Back),
        Verb::Speed => matches!(direction, D::Up | D::Down),
        Verb::Stop => direction == D::None,
    }
}

/// What an amount claims on the positive side: a term and its hedge.
///
/// Nothing said is the medium term, "a little bit" the small one, "very much" and "extremely" the big one with their hedges.
/// "Somewhat" loosens the medium term; "slightly" is the hedge on the small one.
pub fn claim(amount: Amount) -> Claim {
    let (term, hedge) = match amount {
        Amount::Plain => (Term::PositiveMedium, Hedge::Plain),
        Amount::LittleBit => (Term::PositiveSmall, Hedge::Plain),
        Amount::Slightly => (Term::PositiveSmall, Hedge::Slightly),
        Amount::Somewhat => (Term::PositiveMedium, Hedge::Somewhat),
        Amount::Very => (Term::PositiveBig, Hedge::Very),
        Amount::Extremely => (Term::PositiveBig, Hedge::Extremely),
    };
    Claim { term, hedge }
}

/// The spelling of a word that was not understood, cut after 24 bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Spelling {
    bytes: [u8; 24],
    length: u8,
}

impl Spelling {
    fn of(word: &str) -> Spelling {
        let mut spelling = Spelling { bytes: [0; 24], length: 0 };
        for c in word.chars() {
            let (at, next) = (usize::from(spelling.length), usize::from(spelling.length) + c.len_utf8());
            if next > spelling.bytes.len() {
                break;
            }
            c.encode_utf8(&mut spelling.bytes[at..next]);
            spelling.length = next as u8;
        }
        spelling
    }

    /// The word.
    pub fn as_str(&self) -> &str {
        // Whole characters were written, so this is always text.
        core::str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }
}

impl fmt::Debug for Spelling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

/// Why a text is no command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotAWord {
    /// No word says what to do. Begin with turn, go, speed or stop.
    NoVerb,
    /// The verb needs to know where to.
    NoDirection(Verb),
    /// A word that is not in the grammar, and the nearest one that is.
    Unknown {
        /// As it was written.
        word: Spelling,
        /// What may have been meant.
        nearest: &'static str,
    },
    /// A word that does not go with those before it, as in "turn left right" or "turn forward".
    Contradiction(Spelling),
}

impl fmt::Display for NotAWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotAWord::NoVerb => {
                f.write_str("the command says not what to do: begin with turn, go, speed or stop")
            }
            NotAWord::NoDirection(Verb::Turn) => f.write_str("turn where to? left, right, up or down"),
            NotAWord::NoDirection(verb) => write!(f, "{} where to? up or down", verb_text(*verb)),
            NotAWord::Unknown { word, nearest } => {
                write!(f, "\"{}\" is no word of a command; did you mean \"{nearest}\"?", word.as_str())
            }
            NotAWord::Contradiction(word) => {
                write!(f, "\"{}\" does not go with the words before it", word.as_str())
            }
        }
    }
}

impl core::error::Error for NotAWord {}

/// What a single word of a text can mean.
#[derive(Clone, Copy)]
enum Token {
    Verb(Verb),
    /// A verb that knows its direction: "accelerate".
    Both(Verb, Direction),
    Direction(Direction),
    Amount(Amount),
    /// "very": strengthens what follows, or stands for "very much".
    Very,
    Filler,
}

/// Every word that is understood. "slow" and "fast" are here as amounts; as first words they are verbs.
const LEXICON: &[(&str, Token)] = {
    use Direction as D;
    use Token as T;
    &[
        ("turn", T::Verb(Verb::Turn)),
        ("rotate", T::Verb(Verb::Turn)),
        ("steer", T::Verb(Verb::Turn)),
        ("look", T::Verb(Verb::Turn)),
        ("go", T::Verb(Verb::Go)),
        ("drive", T::Verb(Verb::Go)),
        ("move", T::Verb(Verb::Go)),
        ("speed", T::Verb(Verb::Speed)),
        ("stop", T::Verb(Verb::Stop)),
        ("halt", T::Verb(Verb::Stop)),
        ("increase", T::Both(Verb::Speed, D::Up)),
        ("accelerate", T::Both(Verb::Speed, D::Up)),
        ("faster", T::Both(Verb::Speed, D::Up)),
        ("decrease", T::Both(Verb::Speed, D::Down)),
        ("reduce", T::Both(Verb::Speed, D::Down)),
        ("brake", T::Both(Verb::Speed, D::Down)),
        ("slower", T::Both(Verb::Speed, D::Down)),
        ("left", T::Direction(D::Left)),
        ("right", T::Direction(D::Right)),
        ("forward", T::Direction(D::Forward)),
        ("forwards", T::Direction(D::Forward)),
        ("ahead", T::Direction(D::Forward)),
        ("straight", T::Direction(D::Forward)),
        ("back", T::Direction(D::Back)),
        ("backward", T::Direction(D::Back)),
        ("backwards", T::Direction(D::Back)),
        ("up", T::Direction(D::Up)),
        ("down", T::Direction(D::Down)),
        ("little", T::Amount(Amount::LittleBit)),
        ("bit", T::Amount(Amount::LittleBit)),
        ("slow", T::Amount(Amount::LittleBit)),
        ("slowly", T::Amount(Amount::LittleBit)),
        ("gently", T::Amount(Amount::LittleBit)),
        ("much", T::Amount(Amount::Very)),
        ("lot", T::Amount(Amount::Very)),
        ("fast", T::Amount(Amount::Very)),
        ("quickly", T::Amount(Amount::Very)),
        ("strongly", T::Amount(Amount::Very)),
        ("sharply", T::Amount(Amount::Very)),
        ("very", T::Very),
        ("extremely", T::Amount(Amount::Extremely)),
        ("somewhat", T::Amount(Amount::Somewhat)),
        ("more", T::Amount(Amount::Somewhat)),
        ("slightly", T::Amount(Amount::Slightly)),
        ("or", T::Filler),
        ("less", T::Filler),
        ("a", T::Filler),
        ("the", T::Filler),
        ("to", T::Filler),
        ("please", T::Filler),
        ("now", T::Filler),
    ]
};

/// What has been read so far.
#[derive(Default)]
struct Reading {
    verb: Option<Verb>,
    direction: Option<Direction>,
    amount: Option<Amount>,
    very: bool,
}

/// Reads a command as people write it; case and punctuation do not matter.
pub fn parse(text: &str) -> Result<Word, NotAWord> {
    let mut reading = Reading::default();
    let apart = |c: char| c.is_whitespace() || matches!(c, ',' | '.' | '!' | ';');
    for word in text.split(apart).filter(|word| !word.is_empty()) {
        let unknown = || NotAWord::Unknown { word: Spelling::of(word), nearest: nearest(word) };
        let token = meaning(word, reading.verb.is_none()).ok_or_else(unknown)?;
        if !reading.take(token) {
            return Err(NotAWord::Contradiction(Spelling::of(word)));
        }
    }
    reading.finish()
}

fn meaning(word: &str, first: bool) -> Option<Token> {
    if first && word.eq_ignore_ascii_case("slow") {
        return Some(Token::Both(Verb::Speed, Direction::Down));
    }
    LEXICON.iter().find(|(known, _)| known.eq_ignore_ascii_case(word)).map(|(_, token)| *token)
}

impl Reading {
    /// Adds a word; false when it contradicts those before.
    fn take(&mut self, token: Token) -> bool {
        match token {
            Token::Filler => true,
            // "Go faster" is about the speed.
            Token::Both(verb, direction) => {
                if self.verb == Some(Verb::Go) && self.direction.is_none() {
                    self.verb = None;
                }
                agree(&mut self.verb, verb) && agree(&mut self.direction, direction) && self.consistent()
            }
            Token::Verb(verb) => agree(&mut self.verb, verb) && self.consistent(),
            Token::Direction(direction) => {
                // "Go left" is a turn.
                if self.verb == Some(Verb::Go) && matches!(direction, Direction::Left | Direction::Right) {
                    self.verb = Some(Verb::Turn);
                }
                agree(&mut self.direction, direction) && self.consistent()
            }
            Token::Very => {
                self.very = true;
                true
            }
            Token::Amount(amount) => {
                // "Very slowly" is less than "slowly", and "extremely fast" is one amount.
                let amount = if self.very && amount == Amount::LittleBit { Amount::Slightly } else { amount };
                if self.amount == Some(Amount::Extremely) && amount == Amount::Very {
                    return true;
                }
                agree(&mut self.amount, amount)
            }
        }
    }

    fn consistent(&self) -> bool {
        match (self.verb, self.direction) {
            (Some(verb), Some(direction)) => fits(verb, direction),
            _ => true,
        }
    }

    fn finish(self) -> Result<Word, NotAWord> {
        let verb = self.verb.ok_or(NotAWord::NoVerb)?;
        let direction = match (verb, self.direction) {
            (_, Some(direction)) => direction,
            (Verb::Go, None) => Direction::Forward,
            (Verb::Stop, None) => Direction::None,
            (verb, None) => return Err(NotAWord::NoDirection(verb)),
        };
        let unsaid = if self.very { Amount::Very } else { Amount::Plain };
        Ok(Word { verb, direction, amount: self.amount.unwrap_or(unsaid) })
    }
}

/// Keeps a first value and accepts its repetition.
fn agree<T: PartialEq + Copy>(slot: &mut Option<T>, value: T) -> bool {
    *slot.get_or_insert(value) == value
}

fn nearest(word: &str) -> &'static str {
    let mut best = ("stop", usize::MAX);
    for (known, _) in LEXICON {
        let distance = edits(word, known);
        if distance < best.1 {
            best = (known, distance);
        }
    }
    best.0
}

/// Levenshtein's distance to a known word, which is shorter than 16 letters; case does not count.
fn edits(word: &str, known: &str) -> usize {
    let known = known.as_bytes();
    let mut row = [0usize; 16];
    for (j, cell) in row.iter_mut().enumerate() {
        *cell = j;
    }
    for (i, c) in word.chars().take(64).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..known.len() {
            let change = diagonal + usize::from(!c.eq_ignore_ascii_case(&char::from(known[j])));
            diagonal = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[known.len()]
}

fn verb_text(verb: Verb) -> &'static str {
    match verb {
        Verb::Turn => "turn",
        Verb::Go => "go",
        Verb::Speed => "speed",
        Verb::Stop => "stop",
    }
}

/// Writes a command so that [`parse`] reads the same one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text(pub Word);

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(verb_text(self.0.verb))?;
        f.write_str(match self.0.direction {
            Direction::None => "",
            Direction::Left => " left",
            Direction::Right => " right",
            Direction::Forward => " forward",
            Direction::Back => " back",
            Direction::Up => " up",
            Direction::Down => " down",
        })?;
        f.write_str(match self.0.amount {
            Amount::Plain => "",
            Amount::LittleBit => " a little bit",
            Amount::Slightly => " slightly",
            Amount::Somewhat => " somewhat",
            Amount::Very => " very much",
            Amount::Extremely => " extremely",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Amount::*;
    use Direction::{Back, Down, Forward, Left, None, Right, Up};
    use proptest::prelude::*;
    use std::string::ToString;

    fn word(verb: Verb, direction: Direction, amount: Amount) -> Word {
        Word { verb, direction, amount }
    }

    #[test]
    fn commands_are_read_as_people_say_them() {
        for (text, want) in [
            ("turn right a little bit", word(Verb::Turn, Right, LittleBit)),
            ("increase speed", word(Verb::Speed, Up, Plain)),
            ("Stop!", STOP),
            ("go forward slowly", word(Verb::Go, Forward, LittleBit)),
            ("speed up very much", word(Verb::Speed, Up, Very)),
            ("slow down a bit, please", word(Verb::Speed, Down, LittleBit)),
            ("go faster", word(Verb::Speed, Up, Plain)),
            ("go left", word(Verb::Turn, Left, Plain)),
            ("drive back", word(Verb::Go, Back, Plain)),
            ("turn left more or less", word(Verb::Turn, Left, Somewhat)),
            ("turn LEFT slightly", word(Verb::Turn, Left, Slightly)),
            ("go forward very slowly", word(Verb::Go, Forward, Slightly)),
            ("go extremely fast", word(Verb::Go, Forward, Extremely)),
            ("look up", word(Verb::Turn, Up, Plain)),
            ("go", word(Verb::Go, Forward, Plain)),
            ("move slow", word(Verb::Go, Forward, LittleBit)),
        ] {
            assert_eq!(parse(text), Ok(want), "{text}");
        }
    }

    #[test]
    fn errors_name_the_word_and_the_nearest_right_one() {
        for (text, want) in [
            ("turn rihgt", "\"rihgt\" is no word of a command; did you mean \"right\"?"),
            ("incraese speed", "\"incraese\" is no word of a command; did you mean \"increase\"?"),
            ("trun left", "\"trun\" is no word of a command; did you mean \"turn\"?"),
            ("turn left right", "\"right\" does not go with the words before it"),
            ("turn forward", "\"forward\" does not go with the words before it"),
            ("turn", "turn where to? left, right, up or down"),
            ("speed", "speed where to? up or down"),
            ("a little", "the command says not what to do: begin with turn, go, speed or stop"),
            ("", "the command says not what to do: begin with turn, go, speed or stop"),
        ] {
            assert_eq!(parse(text).unwrap_err().to_string(), want, "{text}");
        }
    }

    #[test]
    fn the_longest_nonsense_is_cut_between_characters() {
        let error = parse("ääääääääääääääääääää").unwrap_err();
        assert!(
            matches!(error, NotAWord::Unknown { word, .. } if word.as_str() == "ä".repeat(12)),
            "{error}"
        );
    }

    #[test]
    fn edit_distances_are_those_of_the_textbook() {
        assert_eq!((edits("kitten", "sitting"), edits("", "stop"), edits("STOP", "stop")), (3, 4, 0));
    }

    fn any_word() -> impl Strategy<Value = Word> {
        let ways = [
            (Verb::Stop, None),
            (Verb::Turn, Left),
            (Verb::Turn, Right),
            (Verb::Turn, Up),
            (Verb::Turn, Down),
            (Verb::Go, Forward),
            (Verb::Go, Back),
            (Verb::Speed, Up),
            (Verb::Speed, Down),
        ];
        let amounts = [Plain, LittleBit, Slightly, Somewhat, Very, Extremely];
        (prop::sample::select(ways.to_vec()), prop::sample::select(amounts.to_vec()))
            .prop_map(|((verb, direction), amount)| word(verb, direction, amount))
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(word in any_word()) {
            prop_assert!(makes_sense(&word));
            prop_assert_eq!(parse(&Text(word).to_string()), Ok(word));
        }

        #[test]
        fn no_text_breaks_it(text in ".{0,60}") {
            let _ = parse(&text).map_err(|error| error.to_string());
        }
    }
}
