//! Colours as people name them.

/// Red, green and blue, 0 to 255 each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub [u8; 3]);

/// The colours that have a name.
pub const NAMES: [(&str, Colour); 18] = [
    ("white", Colour([235, 235, 230])),
    ("cream", Colour([222, 214, 190])),
    ("grey", Colour([135, 137, 140])),
    ("gray", Colour([135, 137, 140])),
    ("silver", Colour([180, 183, 186])),
    ("dark", Colour([62, 64, 70])),
    ("black", Colour([30, 30, 32])),
    ("red", Colour([205, 22, 30])),
    ("orange", Colour([226, 130, 30])),
    ("yellow", Colour([222, 200, 50])),
    ("green", Colour([50, 140, 70])),
    ("olive", Colour([118, 122, 72])),
    ("teal", Colour([40, 128, 132])),
    ("blue", Colour([45, 85, 165])),
    ("sky", Colour([140, 180, 210])),
    ("purple", Colour([105, 70, 140])),
    ("wood", Colour([164, 130, 86])),
    ("brown", Colour([112, 84, 58])),
];

impl Colour {
    /// Reads a name of [`NAMES`] or `#rrggbb`.
    pub fn read(text: &str) -> Option<Colour> {
        if let Some(hex) = text.strip_prefix('#') {
            if hex.len() != 6 || !hex.bytes().all(|byte| byte.is_ascii_hexdigit()) {
                return None;
            }
            let value = u32::from_str_radix(hex, 16).ok()?;
            return Some(Colour([(value >> 16) as u8, (value >> 8) as u8, value as u8]));
        }
        NAMES.iter().find(|(name, _)| *name == text).map(|&(_, colour)| colour)
    }

    /// The colour under light of this strength (1 leaves it).
    #[inline]
    pub(crate) fn lit(self, light: f32) -> [u8; 3] {
        // A float to integer cast saturates, so bright light ends at white.
        self.0.map(|channel| (f32::from(channel) * light) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_is_read_by_name_or_in_hexadecimal() {
        assert_eq!(Colour::read("#ff8001"), Some(Colour([255, 128, 1])));
        assert_eq!(Colour::read("red").map(|c| c.0[0] > 200 && c.0[1] < 60), Some(true));
        for wrong in ["#ff80", "#ggffff", "#+12345", "reddish", ""] {
            assert_eq!(Colour::read(wrong), None, "{wrong}");
        }
    }
}
