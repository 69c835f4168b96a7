//! By how much one channel of a colour exceeds the others: what passes over most of a picture in a split by colour.
//!
//! In plain words: in every red that is coloured and bright enough, red exceeds green and blue by some bytes at least. Where no pixel
//! of a group shows that, nothing else needs to be known of them. It is a first look: what shows it may still be another colour.
//!
//! Channel c of hue H (red 0, green 1, blue 2) lies above the mean of the three by x, up to a factor, and the factor follows from
//! the least saturation and sum Σ = R+G+B, where s is the least step of saturation, rounded:
//!
//! ```text
//! x(c) = cos(H − c·120°)          −3 min x = Σ − 3 min(R,G,B) = S Σ,    S ≥ (2s − 1)/510
//! ```
//!
//! It is that of Gonzalez and Woods, *Digital Image Processing*, 3rd ed., eq. 6.2-2 to 6.2-4, with the hue as an angle in the plane of
//! colours of one sum. With S Σ fixed, a difference of two channels is linear in a channel between hues at which the least channel
//! changes (0°, 120°, 240°), so it is least at those or at the ends of the range.

use crate::colour::Steps;
use libm::{ceil, cos, fmax, fmin};
use types::geometry::TAU;

/// Pixels that are looked at or passed over together.
pub(crate) const GROUP: usize = 16;
/// Their bytes.
const BYTES: usize = 3 * GROUP;

/// What all colours of a range have in common: one channel leads.
#[derive(Clone, Debug)]
pub(crate) struct Lead {
    /// The channel that leads, and the two others.
    channels: [usize; 3],
    /// For the first byte of each pixel one less than the lead over each of the others, and for the other bytes so much that they
    /// never tell anything.
    less: [[u8; BYTES]; 2],
}

impl Lead {
    /// There is none of a range in which no channel leads everywhere: one of many hues, or one that takes greys.
    pub(crate) fn of(steps: Steps) -> Option<Lead> {
        [[0, 1, 2], [1, 2, 0], [2, 0, 1]].into_iter().find_map(|channels| {
            let [lead, one, other] = channels;
            let less = [least_lead(steps, lead, one)? - 1, least_lead(steps, lead, other)? - 1];
            let pattern = |less| core::array::from_fn(|i| if i % 3 == 0 { less } else { u8::MAX });
            Some(Lead { channels, less: less.map(pattern) })
        })
    }

    /// Whether no pixel of a group of the picture can be of the range. The last group of a picture has no bytes behind it, and is
    /// not told.
    #[inline(always)]
    pub(crate) fn is_missing(&self, rgb: &[u8], group: usize) -> bool {
        let Some(bytes) = rgb.get(BYTES * group..).and_then(|rest| rest.first_chunk::<{ BYTES + 2 }>())
        else {
            return false;
        };
        // The channels stand one byte apart, so the same place of three rows of bytes has the three channels of a pixel.
        let [lead, one, other] = self.channels.map(|channel| &bytes[channel % 3..channel % 3 + BYTES]);
        let mut shown = [0u8; GROUP];
        for start in (0..BYTES).step_by(GROUP) {
            for (place, shown) in shown.iter_mut().enumerate() {
                let at = start + place;
                let exceeds = |row: &[u8], less: &[u8; BYTES]| {
                    lead[at].saturating_sub(less[at]).saturating_sub(row[at])
                };
                *shown |= exceeds(one, &self.less[0]).min(exceeds(other, &self.less[1]));
            }
        }
        u128::from_le_bytes(shown) == 0
    }
}

/// By how many bytes the channel `lead` exceeds `other` at least in all colours of a range; nothing where that is not one.
fn least_lead(steps: Steps, lead: usize, other: usize) -> Option<u8> {
    /// More than rounding changes.
    const HAIR: f64 = 1e-9;
    const THIRD: f64 = 256.0 / 3.0;
    let [hue, saturation, intensity] = steps.first.map(f64::from);
    let share = |step: f64| {
        let height = |channel: usize| cos((step - channel as f64 * THIRD) * TAU / 256.0);
        (height(lead) - height(other)) / (-3.0 * fmin(fmin(height(0), height(1)), height(2)))
    };
    // A hue is rounded to the nearest step.
    let (from, to) = (hue - 0.51, hue + f64::from(steps.more[0]) + 0.51);
    let corners = (0..=6).map(|k| f64::from(k) * THIRD).filter(|corner| (from..to).contains(corner));
    let least_share = corners.chain([from, to]).map(share).fold(f64::INFINITY, fmin);
    // Where greys are taken, nothing exceeds anything.
    let excess = fmax(2.0 * saturation - 1.0, 0.0) / 510.0 * fmax(3.0 * intensity - 1.0, 1.0);
    let least = ceil(least_share * excess - HAIR);
    (least >= 1.0).then_some(least as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::{ColourRange, Converter, SET, in_range};

    /// All colours of three bytes below 100 that lie in a range.
    fn colours_in(range: &ColourRange) -> Vec<[u8; 3]> {
        let values = || 0..100u8;
        let cube: Vec<[u8; 3]> =
            values().flat_map(|r| values().flat_map(move |g| values().map(move |b| [r, g, b]))).collect();
        let (mut hsi, mut mask) = (vec![0; 3 * cube.len()], vec![0; cube.len()]);
        Converter::new().convert(cube.as_flattened(), &mut hsi).unwrap();
        in_range(&hsi, range, &mut mask).unwrap();
        cube.into_iter().zip(mask).filter(|(_, mask)| *mask == SET).map(|(colour, _)| colour).collect()
    }

    /// A group of one colour, with another pixel behind it.
    fn is_missing(lead: &Lead, colour: [u8; 3]) -> bool {
        lead.is_missing([colour; GROUP + 1].as_flattened(), 0)
    }

    #[test]
    fn no_colour_of_a_range_is_missing_and_the_least_lead_is_that_of_one_of_them() {
        let of = |from: f64, to: f64, saturation_min: f64| ColourRange {
            hue_from: from.to_radians(),
            hue_to: to.to_radians(),
            saturation_min,
            ..ColourRange::default()
        };
        let ranges = [
            (ColourRange::default(), 0),
            (of(100.0, 150.0, 0.35), 1),
            (of(200.0, 235.0, 0.2), 2),
            (of(5.0, 40.0, 0.6), 0),
        ];
        for (range, channel) in ranges {
            let lead = Lead::of(Steps::of(&range)).unwrap();
            assert_eq!(lead.channels[0], channel);
            let colours = colours_in(&range);
            for (which, less) in lead.less.iter().enumerate() {
                let leads = colours.iter().map(|colour| colour[channel] - colour[lead.channels[1 + which]]);
                let spare = leads.min().unwrap() - less[0] - 1;
                assert!(spare <= 2, "{range:?}: {spare}");
            }
            assert!(colours.iter().all(|colour| !is_missing(&lead, *colour)), "{range:?}");
        }
    }

    #[test]
    fn greys_and_other_hues_are_missing_wherever_bytes_end() {
        let lead = Lead::of(Steps::of(&ColourRange::default())).unwrap();
        for colour in
            [[0; 3], [128; 3], [255; 3], [255, 250, 240], [30, 90, 40], [255, 255, 0], [40, 60, 255]]
        {
            assert!(is_missing(&lead, colour), "{colour:?}");
        }
        assert!(!is_missing(&lead, [255, 0, 0]));
    }

    #[test]
    fn one_pixel_of_a_group_is_enough_and_the_last_group_is_not_told() {
        let lead = Lead::of(Steps::of(&ColourRange::default())).unwrap();
        for place in 0..GROUP {
            let mut group = [[90; 3]; GROUP + 1];
            assert!(lead.is_missing(group.as_flattened(), 0));
            assert!(!lead.is_missing(group[..GROUP].as_flattened(), 0));
            group[place] = [200, 30, 30];
            assert!(!lead.is_missing(group.as_flattened(), 0), "{place}");
        }
    }

    #[test]
    fn many_hues_and_greys_have_no_lead() {
        let wide = ColourRange { hue_from: 0.0, hue_to: 2.5, ..ColourRange::default() };
        let all = ColourRange { hue_from: 0.0, hue_to: TAU, ..ColourRange::default() };
        let grey_too = ColourRange { saturation_min: 0.0, ..all };
        for range in [wide, all, grey_too] {
            assert!(Lead::of(Steps::of(&range)).is_none(), "{range:?}");
        }
    }
}
