//! Places for the texts of marks.

use super::legend::{LETTER, OVERSIZE};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// Height of the texts, before enlargement.
pub(super) const MARK_FONT: u32 = 12;
/// Of the circles, enlarged pixels.
pub(super) const RADIUS: i32 = 3 * OVERSIZE as i32;
/// Pixels between a circle and its text, enlarged.
const GAP: i32 = 2 * OVERSIZE as i32;

/// A pixel.
type Pixel = (i32, i32);

/// Where the text of an upright line is, relative to the foot of the line, which is so many pixels right of
/// the frame: at the left where there is room.
pub(super) fn beside_guide(from_left: i32, text: &str) -> (Pixel, Pos) {
    let at_left = from_left > width(text) + 2 * GAP;
    let (across, side) = if at_left { (-2 * GAP, HPos::Right) } else { (2 * GAP, HPos::Left) };
    ((across, -GAP), Pos::new(side, VPos::Bottom))
}

/// Of a text, enlarged pixels.
fn width(text: &str) -> i32 {
    (f64::from(MARK_FONT * OVERSIZE) * LETTER * text.chars().count() as f64).ceil() as i32
}

/// The pixels that are taken.
pub(super) struct Room {
    whole: Area,
    taken: Vec<Area>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Area {
    left: i32,
    top: i32,
    right: i32,
    bottom: i32,
}

impl Area {
    fn overlaps(self, other: Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn is_in(self, other: Self) -> bool {
        self.left >= other.left
            && self.right <= other.right
            && self.top >= other.top
            && self.bottom <= other.bottom
    }
}

impl Room {
    /// All of these columns and rows of pixels.
    pub(super) fn new(across: Range<i32>, down: Range<i32>) -> Self {
        let whole = Area { left: across.start, top: down.start, right: across.end, bottom: down.end };
        Self { whole, taken: Vec::new() }
    }

    pub(super) fn take_circle(&mut self, (x, y): Pixel) {
        let [left, top, right, bottom] = [x - RADIUS, y - RADIUS, x + RADIUS, y + RADIUS];
        self.taken.push(Area { left, top, right, bottom });
    }

    /// A free place for a text beside a circle, relative to its centre, which is taken then.
    pub(super) fn beside(&mut self, (x, y): Pixel, text: &str) -> Option<Pixel> {
        let height = (MARK_FONT * OVERSIZE) as i32;
        let width = width(text);
        let away = RADIUS + GAP;
        // Texts above and below leave the rows beside the circle free.
        let clear = away.max(height / 2);
        let above = (-width / 2, -clear - height);
        let places = [
            above,
            (away, -height / 2),
            (-away - width, -height / 2),
            (-width / 2, clear),
            (above.0, above.1 - height),
            (away, -clear - height),
            (-away - width, -clear - height),
        ];
        let area = |(right, down): Pixel| {
            let (left, top) = (x + right, y + down);
            Area { left, top, right: left + width, bottom: top + height }
        };
        let is_free = |place: &Pixel| {
            let area = area(*place);
            area.is_in(self.whole) && !self.taken.iter().any(|taken| taken.overlaps(area))
        };
        let place = places.into_iter().find(is_free)?;
        self.taken.push(area(place));
        Some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the points, no text covers another one, a circle, or the frame.
    #[test]
    fn texts_cover_nothing() {
        let mut dice = crate::random::Random(7);
        for count in 1..60 {
            let mut room = Room::new(100..3000, 50..1500);
            let points: Vec<Pixel> = (0..count)
                .map(|_| (100 + (dice.next() % 2900) as i32, 50 + (dice.next() % 1450) as i32))
                .collect();
            points.iter().for_each(|&point| room.take_circle(point));
            let placed = points.iter().filter(|&&point| room.beside(point, "3/4-f").is_some()).count();
            let texts = &room.taken[points.len()..];
            assert_eq!(texts.len(), placed);
            for (k, text) in texts.iter().enumerate() {
                assert!(text.is_in(room.whole));
                assert!(!room.taken[..points.len() + k].iter().any(|other| other.overlaps(*text)));
            }
            assert!(count > 10 || placed == count, "{placed} of {count}");
        }
    }

    #[test]
    fn texts_of_one_point_lie_around_it_until_there_is_no_room() {
        let mut room = Room::new(0..4000, 0..2000);
        room.take_circle((2000, 1000));
        let places: Vec<_> = (0..9).map(|_| room.beside((2000, 1000), "H2")).collect();
        assert!(places[..4].iter().all(Option::is_some) && places[8].is_none(), "{places:?}");
        assert!(places[0].unwrap().1 < 0 && places[1].unwrap().0 > 0, "{places:?}");
    }
}
