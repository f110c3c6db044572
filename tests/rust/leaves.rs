// SPDX-License-Identifier: MIT OR Apache-2.0
//! All numbers in options, each by its path.

use serde_json::Value;

/// The JSON pointers of all numbers in a value, and of all arrays of numbers: an option that is an array counts once.
pub fn leaves(value: &Value) -> Vec<String> {
    match value {
        Value::Object(fields) => fields
            .iter()
            .flat_map(|(name, field)| {
                let below = leaves(field).into_iter();
                below.map(move |path| format!("/{name}{path}"))
            })
            .collect(),
        Value::Number(_) | Value::Array(_) => vec![String::new()],
        _ => Vec::new(),
    }
}

/// A value with the numbers at one pointer changed.
pub fn with(value: &Value, path: &str, change: impl Fn(&Value) -> Value) -> Value {
    let mut value = value.clone();
    let leaf = value.pointer_mut(path).expect("a path of the value");
    let changed = match &*leaf {
        Value::Array(numbers) => numbers.iter().map(change).collect(),
        number => change(number),
    };
    *leaf = changed;
    value
}
