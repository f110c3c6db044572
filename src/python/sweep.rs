// SPDX-License-Identifier: MIT OR Apache-2.0
//! Monte-Carlo sweeps.

use super::simulate::layout;
use super::{convert, errors};
use crate::{Cell, Chunk, Start, Tally};
use alloc::string::String;
use alloc::vec::Vec;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::format;

/// Layout, views, landmarks, noise, first trial, and end of the trials (exclusive).
type RawChunk = (String, usize, usize, f64, u64, u64);

#[pyfunction]
pub fn sweep(
    py: Python<'_>,
    chunks: Vec<RawChunk>,
    starts: Vec<String>,
    seed: u64,
    threads: usize,
    done: Py<PyAny>,
) -> PyResult<()> {
    let chunks: Vec<Chunk> = chunks
        .into_iter()
        .map(|(layout, views, landmarks, noise, first, end)| {
            Ok(Chunk {
                cell: cell(py, &layout, views, landmarks, noise)?,
                trials: first..end,
            })
        })
        .collect::<PyResult<_>>()?;
    let starts: Vec<Start> = starts
        .iter()
        .map(|name| start(py, name))
        .collect::<PyResult<_>>()?;
    let mut raised = None;
    let result = py.detach(|| {
        crate::sweep(&chunks, &starts, seed, threads, &mut |finished| {
            let told = Python::attach(|py| {
                if let Some((index, tallies)) = finished {
                    let (counts, bins) = arrays(py, &tallies);
                    done.call1(py, (index, counts, bins))?;
                }
                py.check_signals()
            });
            raised = told.err();
            raised.is_none()
        })
    });
    match raised {
        Some(raised) => Err(raised),
        None => result.map_err(|error| errors::error(py, error)),
    }
}

/// The seed of `simulate` for a trial of a sweep.
#[pyfunction]
pub fn scene_seed(
    py: Python<'_>,
    layout: &str,
    views: usize,
    landmarks: usize,
    noise: f64,
    seed: u64,
    trial: u64,
) -> PyResult<u64> {
    Ok(cell(py, layout, views, landmarks, noise)?.scene_seed(seed, trial))
}

fn cell(
    py: Python<'_>,
    layout: &str,
    views: usize,
    landmarks: usize,
    noise: f64,
) -> PyResult<Cell> {
    Ok(Cell {
        layout: self::layout(py, layout)?,
        views,
        landmarks,
        noise,
    })
}

fn start(py: Python<'_>, name: &str) -> PyResult<Start> {
    Start::ALL
        .into_iter()
        .find(|start| start.name() == name)
        .ok_or_else(|| {
            let known = Start::ALL.map(Start::name).join("\", \"");
            errors::invalid(
                py,
                &format!("starts: expected any of \"{known}\", got {name:?}"),
            )
        })
}

/// Counts (starts, 6) and the non-empty bins (k, 4) of the histograms: start, quantity, bin, count.
fn arrays<'py>(
    py: Python<'py>,
    tallies: &[Tally],
) -> (Bound<'py, PyArray2<i64>>, Bound<'py, PyArray2<i64>>) {
    let signed = |count: u64| i64::try_from(count).unwrap_or(i64::MAX);
    let counts: Vec<i64> = tallies
        .iter()
        .flat_map(|tally| {
            [
                tally.trials,
                tally.failures,
                tally.without_map,
                tally.incomplete,
                tally.iterations,
                tally.nanoseconds,
            ]
        })
        .map(signed)
        .collect();
    let mut bins = Vec::new();
    for (start, tally) in (0..).zip(tallies) {
        for (quantity, histogram) in (0..).zip(&tally.histograms) {
            for (bin, count) in histogram.counts() {
                bins.extend([start, quantity, i64::from(bin), signed(count)]);
            }
        }
    }
    let rows = bins.len() / 4;
    (
        convert::array2(py, counts, [tallies.len(), 6]),
        convert::array2(py, bins, [rows, 4]),
    )
}
