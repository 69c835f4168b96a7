//! The words of conditions: the signals that they can name, and those that they do.

use types::Name;
use types::messages::MOST_REASONS;
use types::value::{Mistake, Span};

use super::super::signal::{Kind, Known, MOST_TOLD, Values};
use super::super::situation::Situation;

/// The signals that the conditions of a table can name, and those that they have named so far.
#[derive(Clone, Debug)]
pub(crate) struct Words<'a> {
    /// The names that agents tell; nothing where any word may be one.
    declared: Option<&'a [String]>,
    told: Vec<Name>,
    used: Vec<usize>,
}

impl<'a> Words<'a> {
    /// None is named yet; the situations that are built in need some.
    pub(crate) fn new(declared: Option<&'a [String]>) -> Words<'a> {
        let used = Situation::SIGNALS.iter().map(|signal| *signal as usize).collect();
        Words { declared, told: Vec::new(), used }
    }

    /// The names that agents tell, of those that were named, and the places of all signals that are needed.
    pub(crate) fn into_used(self) -> (Vec<Name>, Vec<usize>) {
        (self.told, self.used)
    }

    /// The place of a signal and what it is. From now on it is needed.
    ///
    /// # Errors
    /// When there is no such signal, or no room for one more.
    pub(super) fn find(&mut self, word: &str, at: Span) -> Result<(usize, Kind), Mistake> {
        let (place, kind) = match Known::ALL.iter().find(|known| known.name() == word) {
            Some(known) => (*known as usize, known.kind()),
            None => (Values::place_of_told(self.told(word, at)?), Kind::Number),
        };
        if !self.used.contains(&place) {
            if self.used.len() == MOST_REASONS {
                return Err(self.no_room(word, at));
            }
            self.used.push(place);
        }
        Ok((place, kind))
    }

    /// Which of the names that agents tell it is.
    fn told(&mut self, word: &str, at: Span) -> Result<usize, Mistake> {
        if let Some(declared) = self.declared
            && !declared.iter().any(|name| name == word)
        {
            let known = Known::ALL.iter().map(|known| known.name());
            let all = known.chain(declared.iter().map(String::as_str));
            return Err(Mistake::unknown(at, "signal", word, all));
        }
        if let Some(known) = self.told.iter().position(|told| told.as_str() == word) {
            return Ok(known);
        }
        let name = Name::new(word);
        if name.as_str() != word {
            return Err(Mistake::new(at, format!("the name \"{word}\" is longer than 23 letters")));
        }
        if self.told.len() == MOST_TOLD {
            return Err(self.no_room(word, at));
        }
        self.told.push(name);
        Ok(self.told.len() - 1)
    }

    fn no_room(&self, word: &str, at: Span) -> Mistake {
        let room = MOST_REASONS - Situation::SIGNALS.len();
        Mistake::new(at, format!("\"{word}\" is one signal too many")).help(format!(
            "the conditions of a table can need {room} beside those of the built-in situations"
        ))
    }
}
