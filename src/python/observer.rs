// SPDX-License-Identifier: MIT OR Apache-2.0
//! Progress and Ctrl-C while the interpreter is released.

use super::errors;
use crate::Error;
use core::time::Duration;
use pyo3::prelude::*;
use std::time::Instant;

/// Time between checks for signals and calls of the progress function.
const INTERVAL: Duration = Duration::from_millis(50);

/// Checks for signals and reports progress at intervals.
pub struct InterpreterObserver {
    progress: Option<Py<PyAny>>,
    last: Instant,
    raised: Option<PyErr>,
}

impl InterpreterObserver {
    /// Runs work with the interpreter released. An exception raised meanwhile by a signal handler or the
    /// progress function ends the work and is passed on.
    pub fn run<R: Send>(
        py: Python<'_>,
        progress: Option<Py<PyAny>>,
        work: impl Send + FnOnce(&mut dyn FnMut(&'static str, usize, usize) -> bool) -> Result<R, Error>,
    ) -> PyResult<R> {
        let mut watcher = Self {
            progress,
            last: Instant::now(),
            raised: None,
        };
        let result = py.detach(|| work(&mut |stage, done, all| watcher.look(stage, done, all)));
        match (watcher.raised, result) {
            (Some(raised), _) => Err(raised),
            (None, result) => result.map_err(|error| errors::error(py, error)),
        }
    }

    fn look(&mut self, stage: &'static str, done: usize, all: usize) -> bool {
        if self.last.elapsed() < INTERVAL {
            return true;
        }
        let result = Python::attach(|py| {
            py.check_signals()?;
            if let Some(progress) = &self.progress {
                progress.call1(py, (stage, done, all))?;
            }
            Ok(())
        });
        self.last = Instant::now();
        self.raised = result.err();
        self.raised.is_none()
    }
}
