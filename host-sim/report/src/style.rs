//! What a line stands for, and how that role looks.
//!
//! Colours are those of Okabe and Ito (2008), "Color Universal Design", chosen to be told apart by all common forms of colour
//! blindness. Dash, width and marker differ as well, so that the roles survive a black and white printer.

use plotters::style::RGBColor;

/// The role of a series or mark in a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Style {
    /// What the sensors recorded: wide, solid, grey, meant to lie below the predictions.
    Measured,
    /// What the model said before a change: thin, dashed, vermillion.
    PredictedBefore,
    /// What the model says after the change: thin, solid, blue.
    PredictedAfter,
    /// A set-point, analytic solution or other truth: dash-dotted green.
    Reference,
    /// A specification limit: dotted purple.
    Limit,
    /// A cloud of raw points behind a summary: pale grey.
    Muted,
    /// One of several equals, such as the four motors, counted from 0; repeats after seven.
    Category(usize),
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Marker {
    Disc,
    Triangle,
    Cross,
}

/// How a role is drawn. Lengths are tenths of a pixel, the drawing unit of `draw`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    pub(crate) colour: RGBColor,
    /// Unique together with the colour: `draw` finds the lines to dash by this pair.
    pub(crate) width: u32,
    /// Lengths of dash and gap in turn; empty for a solid line.
    pub(crate) dash: &'static [u32],
    pub(crate) marker: Marker,
}

const BLACK: RGBColor = RGBColor(0, 0, 0);
const ORANGE: RGBColor = RGBColor(0xE6, 0x9F, 0x00);
const SKY_BLUE: RGBColor = RGBColor(0x56, 0xB4, 0xE9);
const GREEN: RGBColor = RGBColor(0x00, 0x9E, 0x73);
const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xB2);
const VERMILLION: RGBColor = RGBColor(0xD5, 0x5E, 0x00);
const PURPLE: RGBColor = RGBColor(0xCC, 0x79, 0xA7);
const GREY: RGBColor = RGBColor(0x85, 0x85, 0x85);
const PALE: RGBColor = RGBColor(0xBC, 0xBC, 0xBC);

const fn look(colour: RGBColor, width: u32, dash: &'static [u32], marker: Marker) -> Look {
    Look { colour, width, dash, marker }
}

const CATEGORIES: [Look; 7] = [
    look(BLUE, 17, &[], Marker::Disc),
    look(ORANGE, 19, &[80, 30], Marker::Triangle),
    look(GREEN, 16, &[35, 25], Marker::Cross),
    look(PURPLE, 18, &[100, 30, 20, 30], Marker::Disc),
    look(SKY_BLUE, 26, &[], Marker::Triangle),
    look(VERMILLION, 17, &[16, 20], Marker::Cross),
    look(BLACK, 12, &[140, 40], Marker::Disc),
];

impl Style {
    pub(crate) fn look(self) -> Look {
        match self {
            Self::Measured => look(GREY, 26, &[], Marker::Disc),
            Self::PredictedBefore => look(VERMILLION, 15, &[60, 30], Marker::Triangle),
            Self::PredictedAfter => look(BLUE, 15, &[], Marker::Cross),
            Self::Reference => look(GREEN, 19, &[100, 30, 20, 30], Marker::Disc),
            Self::Limit => look(PURPLE, 21, &[22, 26], Marker::Triangle),
            Self::Muted => look(PALE, 10, &[], Marker::Disc),
            Self::Category(n) => CATEGORIES[n % CATEGORIES.len()],
        }
    }

    /// Every look there is, for the dash table of `draw`.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        [
            Self::Measured,
            Self::PredictedBefore,
            Self::PredictedAfter,
            Self::Reference,
            Self::Limit,
            Self::Muted,
        ]
        .into_iter()
        .chain((0..CATEGORIES.len()).map(Self::Category))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn colour_and_width_name_one_style() {
        let pairs: HashSet<_> = Style::all()
            .map(|style| {
                let Look { colour: RGBColor(r, g, b), width, .. } = style.look();
                (r, g, b, width)
            })
            .collect();
        assert_eq!(pairs.len(), Style::all().count());
    }

    #[test]
    fn roles_differ_without_colour() {
        let shapes: HashSet<_> = Style::all()
            .filter(|style| !matches!(style, Style::Category(_)))
            .map(|style| (style.look().width, style.look().dash))
            .collect();
        assert_eq!(shapes.len(), 6);
        let shapes: HashSet<_> = CATEGORIES.iter().map(|look| (look.width, look.dash)).collect();
        assert_eq!(shapes.len(), CATEGORIES.len());
    }
}
