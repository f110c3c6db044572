// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sentences: lists of indices in few words.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// Most ranges of a list that are spelt out.
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

/// Views and landmarks together, such as `views 0..2 and landmark 5`.
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

/// The sentence with a large first letter.
pub fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
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
}
