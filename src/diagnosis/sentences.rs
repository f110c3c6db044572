// SPDX-License-Identifier: MIT OR Apache-2.0
//! The texts of findings in one table: for each kind its name, what is wrong and what to add.

use super::finding::{Finding, Kind, Severity};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

/// The circumstances in which a kind is found, where they change its text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    /// All others.
    Usual,
    /// No sightings at all.
    Unseen,
    /// No three views to start a map from.
    NoStart,
    /// Out of reach of the largest part by the pattern of sightings.
    OutOfReach,
    /// The solver has failed.
    NoMap,
    /// Odometry or priors are part of the problem.
    WithPriors,
    /// It has bearings that determine it, but not in the map.
    LeftOut,
}

/// For each kind, in their order: its name, what is wrong, and what to add.
///
/// Words in braces stand for facts of the finding, see [`fact`], or for facts given with it. The numbers in the
/// advice follow from counting: a new landmark takes two sightings to place it and a new view three; each sighting
/// beyond these fixes one direction.
#[rustfmt::skip]
const TABLE: [(Kind, &str, &str, &str); 31] = [
    (Kind::TooFewSightings, "too_few_sightings",
        "{all} {have} too few sightings to be placed",
        "A view needs three landmarks that are placed, a landmark two views."),
    (Kind::Disconnected, "disconnected",
        "no sighting connects the {parts} parts of the problem: {first}, and separately {all}",
        "Each further part needs four sightings between it and the others, or three landmarks of the others that \
         one of its views sees."),
    (Kind::TwoViews, "two_views",
        "{few views} never determine a map, however many landmarks they see",
        "Add {missing} from another place, so that three views see the same five landmarks."),
    (Kind::TooFewLandmarks, "too_few_landmarks",
        "{few landmarks} never determine a map, however many views see them",
        "Add {missing}."),
    (Kind::Counting, "counting",
        "{seen} are fewer than the {unknowns} unknowns of {count views} views and {count landmarks} landmarks \
         (three per view, two per landmark, minus four)",
        "Add at least {sightings} between them; a further landmark counts for the sightings beyond two, a further \
         view for those beyond three."),
    (Kind::Unreached, "unreached",
        "{all} {are} not in the map",
        "A view needs three landmarks of the map that are not on one circle with it, a landmark two views of the \
         map that are not in line with it."),
    (Kind::EverythingOnOneLine, "everything_on_one_line",
        "{all} lie on one line, or within the noise of one: every point can slide along it",
        "Add at least two views and two landmarks off the line, so that every view sees every landmark."),
    (Kind::LinesOfViewsAndOfLandmarks, "lines_of_views_and_of_landmarks",
        "{views} lie on one line and {landmarks} on another",
        "Add {sightings of one} of a landmark off both lines, or a view off the line of views and three sightings \
         of a landmark off the line of landmarks."),
    (Kind::ViewsAndLandmarksOnOneCircle, "views_and_landmarks_on_one_circle",
        "{all} lie on one circle, where inscribed angles do not depend on the position of a view: each view can slide \
         along it",
        "Add three landmarks off the circle, seen by all views."),
    (Kind::ThreeViewsAndLandmarksOnOneCircle, "three_views_and_landmarks_on_one_circle",
        "{all} lie on one circle, where inscribed angles do not depend on the position of a view: each view can slide \
         along it",
        "Add three landmarks off the circle, seen by all views."),
    (Kind::CoincidentViews, "coincident_views",
        "{views} are in one place and differ only by rotation: they count as one view, and fewer than three places \
        are left",
        "Add views from other places until there are three, each seeing five of the landmarks."),
    (Kind::CollinearLandmarks, "collinear_landmarks",
        "{landmarks} lie on one line, such as a wall: a family of maps has the same bearings, however many views \
         there are",
        "Add {sightings of one} of a landmark off the line."),
    (Kind::FourLandmarksOnACircle, "four_landmarks_on_a_circle",
        "there are only four landmarks, and {landmarks} lie on one circle, such as a rectangle: one direction is \
         free, however many views there are",
        "Add {sightings of one} of a fifth landmark, anywhere."),
    (Kind::ThreeCollinearViews, "three_collinear_views",
        "{views} lie on one line: the map and its mirror image merge there, and errors grow with the root of the \
         noise",
        "Add a fourth view, anywhere, that sees four of the landmarks."),
    (Kind::LandmarksOnACubic, "landmarks_on_a_cubic",
        "{landmarks} lie on one cubic curve through {views}, such as a line together with the circle through the \
         views: three views cannot distinguish the maps",
        "Add a fourth view that sees {landmarks of one} of the landmarks, or a landmark elsewhere."),
    (Kind::ViewOnCircleOfLandmarks, "view_on_circle_of_landmarks",
        "{views} is on one circle with all landmarks that it sees ({landmarks}), and can slide along it",
        "Add a sighting from it of a landmark that is not on the circle."),
    (Kind::LandmarkOnLineOfViews, "landmark_on_line_of_views",
        "{landmarks} is on one line with all views that see it ({views}): its direction is determined, its range \
         is not",
        "Add a sighting of it from a view off the line."),
    (Kind::LandmarksAtInfinity, "landmarks_at_infinity",
        "the rays of {landmarks} are parallel within their noise: directions are known, ranges are not",
        "Their bearings still determine the headings. For their ranges, add sightings from farther apart."),
    (Kind::LoosePart, "loose_part",
        "{all} can move as a whole relative to the rest: too few sightings connect {them} to it",
        "Add {sightings} between this part and the rest."),
    (Kind::UnnamedDirection, "unnamed_direction",
        "{directions are} free and no shape of the map explains {it}; mostly {all} {move}",
        "Add {sightings} between these and others, from other places."),
    (Kind::WeaklyDetermined, "weakly_determined",
        "noise of {noise} degrees leaves {all} uncertain by up to {share} % of the size of the map",
        "Add sightings of {them}, from other places or of other landmarks."),
    (Kind::SecondSolution, "second_solution",
        "another map explains the bearings nearly as well, with residuals {margin} times as large",
        "Add a view that sees five of the landmarks: it decides between the two."),
    (Kind::UnexplainedBearings, "unexplained_bearings",
        "the map leaves residuals of {rms} degrees, too large for its shape to mean anything",
        "Look for wrong correspondences, or give a better map."),
    (Kind::WeakConsensus, "weak_consensus",
        "the {outliers} outliers leave few degrees of freedom, and with identities assigned anew the map explains only \
         {explained} % of the bearings: the others may agree by chance",
        "Look for wrong identities, check sigma, and add sightings."),
    (Kind::PoorFit, "poor_fit",
        "the residuals are {ratio} times as large as the stated standard deviations predict",
        "Look for wrong bearings (or solve robustly), mistaken landmarks, wrong odometry or priors, or state a larger \
         standard deviation."),
    (Kind::Blunder, "blunder",
        "the {observation} contradicts the others: its residual is {standardized} times what they let it be",
        "Check it, or leave it out."),
    (Kind::TurnedBearings, "turned_bearings",
        "all bearings from {views} seem to be turned by {angle} degrees: with this angle the fit is good, or far better",
        "Check how the sensor is mounted, and from where its bearings count; turn them back."),
    (Kind::MirroredBearings, "mirrored_bearings",
        "the bearings seem to be clockwise: the mirror image fits, or far better",
        "Bearings are counter-clockwise: change their signs."),
    (Kind::UnderstatedSigma, "understated_sigma",
        "the residuals are {ratio} times as large as the stated standard deviations predict",
        "State larger ones; covariances are too small by the square of this."),
    (Kind::OverstatedSigma, "overstated_sigma",
        "the residuals are only {ratio} times as large as the stated standard deviations predict",
        "State smaller ones; covariances are too large by the square of this."),
    (Kind::NotExamined, "not_examined",
        "only the sightings have been counted: {why}",
        ""),
];

/// The texts in special cases.
#[rustfmt::skip]
const SPECIAL: [(Kind, Case, &str, &str); 7] = [
    (Kind::TooFewSightings, Case::Unseen,
        "{all} {have} no sightings at all",
        "A view needs three landmarks that are placed, a landmark two views."),
    (Kind::Unreached, Case::WithPriors,
        "{all} {are} not in the map, or too little holds {them} there",
        "A view needs three landmarks of the map or odometry from one of its views, a landmark two views of the map \
         that are not in line with it."),
    (Kind::Unreached, Case::NoStart,
        "no three of {views} see the same four landmarks, so there is nothing to start a map from",
        "Add sightings so that three views see the same five landmarks."),
    (Kind::Unreached, Case::OutOfReach,
        "{all} cannot be added to the largest part step by step: no view among them sees three of its landmarks",
        "Add sightings from one of these views of three landmarks that two views of the largest part see."),
    (Kind::Unreached, Case::NoMap,
        "no map could be made: {why}",
        "Add sightings, odometry or priors."),
    (Kind::PoorFit, Case::LeftOut,
        "{all} {are} left out of the map, because no place explains the bearings of {them}",
        "Look for wrong bearings and mistaken identities, or solve robustly."),
    (Kind::WeaklyDetermined, Case::WithPriors,
        "{all} {are} uncertain by up to {share} % of the size of the map",
        "Add sightings of {them}, from other places or of other landmarks."),
];

impl Kind {
    /// All of them.
    pub const ALL: [Self; TABLE.len()] = {
        let mut all = [Self::TooFewSightings; TABLE.len()];
        let mut k = 0;
        while k < all.len() {
            all[k] = TABLE[k].0;
            assert!(
                all[k] as usize == k,
                "the table is in the order of the kinds"
            );
            k += 1;
        }
        all
    };

    /// The name of the variant in lower case with underscores.
    pub fn name(self) -> &'static str {
        TABLE[self as usize].1
    }
}

/// A finding with the texts of the table.
pub fn finding(
    kind: Kind,
    severity: Severity,
    (views, landmarks): (Vec<usize>, Vec<usize>),
    directions: usize,
) -> Finding {
    finding_in(
        Case::Usual,
        kind,
        severity,
        (views, landmarks),
        directions,
        &[],
    )
}

/// A finding in a case, given the facts of its texts other than those of [`fact`]. A kind without texts for the
/// case uses its usual ones.
pub fn finding_in(
    case: Case,
    kind: Kind,
    severity: Severity,
    (views, landmarks): (Vec<usize>, Vec<usize>),
    directions: usize,
    given: &[(&str, String)],
) -> Finding {
    let mut finding = Finding {
        kind,
        severity,
        views,
        landmarks,
        directions,
        message: String::new(),
        advice: String::new(),
    };
    let special = SPECIAL.iter().find(|text| text.0 == kind && text.1 == case);
    let (_, _, message, advice) = TABLE[kind as usize];
    let (message, advice) = special.map_or((message, advice), |text| (text.2, text.3));
    finding.message = fill(message, &finding, given) + ".";
    finding.advice = fill(advice, &finding, given);
    finding
}

/// Fills the facts into a text.
fn fill(text: &str, finding: &Finding, given: &[(&str, String)]) -> String {
    let mut filled = String::new();
    // Every second piece is between braces.
    for (k, piece) in text.split(['{', '}']).enumerate() {
        let known = given.iter().find(|(name, _)| *name == piece);
        match known {
            _ if k % 2 == 0 => filled.push_str(piece),
            Some((_, value)) => filled.push_str(value),
            None => filled.push_str(&fact(piece, finding)),
        }
    }
    filled
}

/// What a word in braces stands for in every finding.
fn fact(name: &str, finding: &Finding) -> String {
    let (views, landmarks, directions) = (&finding.views, &finding.landmarks, finding.directions);
    let choose =
        |one: bool, singular: &str, plural: &str| if one { singular } else { plural }.into();
    let one = views.len() + landmarks.len() == 1;
    match name {
        "views" => list("view", views),
        "landmarks" => list("landmark", landmarks),
        "all" => both(views, landmarks),
        "have" => choose(one, "has", "have"),
        "are" => choose(one, "is", "are"),
        "move" => choose(one, "moves", "move"),
        "them" => choose(one, "it", "them"),
        "directions are" if directions == 1 => "one direction of the map is".into(),
        "directions are" => format!("{directions} directions of the map are"),
        "it" => choose(directions == 1, "it", "them"),
        "sightings" => count(directions, "sighting"),
        "sightings of one" => count(2 + directions, "sighting"),
        "landmarks of one" => (3 + directions).to_string(),
        _ => String::new(),
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            kind,
            severity,
            message,
            advice,
            ..
        } = self;
        write!(f, "{} ({}): {message}", severity.name(), kind.name())?;
        if !advice.is_empty() {
            write!(f, " {advice}")?;
        }
        Ok(())
    }
}

/// Maximum number of ranges of a list that are printed: about a line of text. No result depends on it.
const MAX_RANGES: usize = 8;

/// `landmarks 0..7`, `views 0, 2 and 5..8`, `view 3`: ranges with both ends in them.
pub fn list(noun: &str, indices: &[usize]) -> String {
    if indices.is_empty() {
        return format!("no {noun}s");
    }
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for &index in indices {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == index => *last = index,
            _ => ranges.push((index, index)),
        }
    }
    let mut words: Vec<String> = Vec::new();
    for &(first, last) in ranges.iter().take(MAX_RANGES) {
        match last - first {
            0 => words.push(format!("{first}")),
            1 => words.extend([format!("{first}"), format!("{last}")]),
            _ => words.push(format!("{first}..{last}")),
        }
    }
    if ranges.len() > MAX_RANGES {
        let rest: usize = ranges[MAX_RANGES..].iter().map(|(a, b)| b - a + 1).sum();
        words.push(format!("{rest} more"));
    }
    let plural = if indices.len() == 1 { "" } else { "s" };
    format!("{noun}{plural} {}", join(&words))
}

/// `a`, `a and b`, `a, b and c`.
fn join(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Views and landmarks together, for example `views 0..2 and landmark 5`.
pub fn both(views: &[usize], landmarks: &[usize]) -> String {
    match (views, landmarks) {
        (_, []) => list("view", views),
        ([], _) => list("landmark", landmarks),
        _ => format!(
            "{} and {}",
            list("view", views),
            list("landmark", landmarks)
        ),
    }
}

/// `one sighting`, `3 sightings`.
pub fn count(number: usize, noun: &str) -> String {
    match number {
        0 => format!("no {noun}s"),
        1 => format!("one {noun}"),
        2 => format!("two {noun}s"),
        3 => format!("three {noun}s"),
        _ => format!("{number} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_short() {
        assert_eq!(
            list("landmark", &[0, 1, 2, 3, 4, 5, 6, 7]),
            "landmarks 0..7"
        );
        assert_eq!(list("view", &[0, 2, 5, 6, 7, 8]), "views 0, 2 and 5..8");
        assert_eq!(list("view", &[3, 4]), "views 3 and 4");
        assert_eq!(list("view", &[3]), "view 3");
        let gaps: Vec<usize> = (0..20).map(|k| 2 * k).collect();
        assert_eq!(
            list("view", &gaps),
            "views 0, 2, 4, 6, 8, 10, 12, 14 and 12 more"
        );
        assert_eq!(both(&[0], &[1, 2, 3]), "view 0 and landmarks 1..3");
    }

    /// Every word in braces is a fact of all findings, or one of those that are given.
    #[test]
    fn texts_are_filled() {
        let given = "parts first missing seen unknowns why noise share margin rms ratio observation standardized \
                     outliers explained angle";
        let given = given.split(' ').chain([
            "few views",
            "few landmarks",
            "count views",
            "count landmarks",
        ]);
        let given: Vec<_> = given.map(|name| (name, String::from("?"))).collect();
        let usual = TABLE.map(|(kind, _, message, advice)| (kind, Case::Usual, message, advice));
        for (kind, case, message, advice) in usual.into_iter().chain(SPECIAL) {
            let subjects = (Vec::from([0, 1, 2]), Vec::from([4, 5]));
            let found = finding_in(case, kind, Severity::Error, subjects, 2, &given);
            assert!(found.to_string().contains(kind.name()));
            for word in [message, advice]
                .iter()
                .flat_map(|text| text.split(['{', '}']).skip(1).step_by(2))
            {
                let known = given.iter().any(|(name, _)| *name == word);
                assert!(known || !fact(word, &found).is_empty(), "{word}");
            }
        }
    }
}
