// SPDX-License-Identifier: MIT OR Apache-2.0
//! The sentences of each kind of finding.

use super::finding::{Finding, Kind, Severity};
use super::words::{both, count, list, sentence};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// A finding about a configuration, with what to add.
///
/// A landmark costs two sightings for itself, a view three; what is left of its sightings holds
/// directions, one each.
pub fn configuration(
    kind: Kind,
    severity: Severity,
    views: Vec<usize>,
    landmarks: Vec<usize>,
    directions: usize,
) -> Finding {
    let (message, advice) = match kind {
        Kind::EverythingOnOneLine => (
            format!(
                "{} all lie on one line, or their bearings cannot be told from that: every point may \
                 slide along it",
                both(&views, &landmarks)
            ),
            "Only views off the line and landmarks off the line help: add at least two of each, all \
             seen by all."
                .into(),
        ),
        Kind::LinesOfViewsAndOfLandmarks => (
            format!(
                "{} lie on one line and {} on another",
                list("view", &views),
                list("landmark", &landmarks)
            ),
            format!(
                "Add {} of a landmark off both lines, or a view off the line of views and three \
                 sightings of a landmark off the line of landmarks.",
                count(2 + directions, "sighting")
            ),
        ),
        Kind::ViewsAndLandmarksOnOneCircle | Kind::ThreeViewsAndLandmarksOnOneCircle => (
            format!(
                "{} lie on one circle, where inscribed angles do not tell the place of a view: each view may \
                 slide along it",
                both(&views, &landmarks)
            ),
            // Two are enough by their number, but leave one direction free.
            "Add three landmarks off the circle, seen by all views.".into(),
        ),
        Kind::CoincidentViews => (
            format!(
                "{} stand in one place and only turn: they count as one view, and fewer than three places \
                 are left",
                list("view", &views)
            ),
            "Add views from other places until there are three, each seeing five of the landmarks."
                .into(),
        ),
        Kind::CollinearLandmarks => (
            format!(
                "{} lie on one line, such as a wall: a family of maps has the same bearings, however \
                 many views there are",
                list("landmark", &landmarks)
            ),
            format!(
                "Add {} of a landmark off the line.",
                count(2 + directions, "sighting")
            ),
        ),
        Kind::FourLandmarksOnACircle => (
            format!(
                "there are only four landmarks, and {} lie on one circle, such as a rectangle: one \
                 direction is free, however many views there are",
                list("landmark", &landmarks)
            ),
            format!(
                "Add {} of a fifth landmark, anywhere.",
                count(2 + directions, "sighting")
            ),
        ),
        Kind::ThreeCollinearViews => (
            format!(
                "{} lie on one line: the map and its mirror image merge there, and errors grow with the \
                 root of the noise",
                list("view", &views)
            ),
            "Add a fourth view, anywhere, that sees four of the landmarks.".into(),
        ),
        Kind::LandmarksOnACubic => (
            format!(
                "{} lie on one cubic curve through {}, such as a line together with the circle through \
                 the views: three views do not tell the maps apart",
                list("landmark", &landmarks),
                list("view", &views)
            ),
            format!(
                "Add a fourth view that sees {} of the landmarks, or a landmark elsewhere.",
                3 + directions
            ),
        ),
        Kind::ViewOnCircleOfLandmarks => (
            format!(
                "{} is on one circle with all landmarks that it sees ({}), and may slide along it",
                list("view", &views),
                list("landmark", &landmarks)
            ),
            "Let it see a landmark that is not on the circle.".into(),
        ),
        Kind::LandmarkOnLineOfViews => (
            format!(
                "{} is on one line with all views that see it ({}), which know its direction but not its \
                 range",
                list("landmark", &landmarks),
                list("view", &views)
            ),
            "Let a view off the line see it.".into(),
        ),
        Kind::LandmarksAtInfinity => (
            format!(
                "the rays of {} are parallel within their noise: directions are known, ranges are not",
                list("landmark", &landmarks)
            ),
            "Their bearings still hold the headings. For their ranges see them from farther apart."
                .into(),
        ),
        Kind::LoosePart => (
            format!(
                "{} can move against the rest as a whole: too few sightings tie {} to it",
                both(&views, &landmarks),
                if views.len() + landmarks.len() == 1 { "it" } else { "them" }
            ),
            format!(
                "Add {} between this part and the rest.",
                count(directions, "sighting")
            ),
        ),
        Kind::UnnamedDirection => (
            format!(
                "{} no shape of the map explains it; mostly {} move",
                if directions == 1 {
                    "one direction of the map is free and".into()
                } else {
                    format!("{directions} directions of the map are free and")
                },
                both(&views, &landmarks)
            ),
            format!(
                "Add {} between these and others, from other places.",
                count(directions, "sighting")
            ),
        ),
        _ => (String::new(), String::new()),
    };
    finding(
        kind, severity, views, landmarks, directions, &message, &advice,
    )
}

/// A finding from its parts.
pub fn finding(
    kind: Kind,
    severity: Severity,
    views: Vec<usize>,
    landmarks: Vec<usize>,
    directions: usize,
    message: &str,
    advice: &str,
) -> Finding {
    Finding {
        kind,
        severity,
        views,
        landmarks,
        directions,
        message: format!("{message}."),
        advice: sentence(advice),
    }
}
