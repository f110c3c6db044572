// SPDX-License-Identifier: MIT OR Apache-2.0
//! Progress and Ctrl-C while the interpreter is released.

use super::errors;
use crate::Error;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::available_parallelism;
use std::time::Instant;

/// Time between checks for signals and calls of the progress function.
const INTERVAL: Duration = Duration::from_millis(50);

/// Checks for signals and reports progress at intervals.
///
/// The work looks here between its steps. One factorisation of the sparse normal equations is a single call of a library
/// and is not interrupted: it takes a second for 600 views that all see 600 landmarks, and four for 900.
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

    /// Runs work without the interpreter on a pool of threads of its own, all cores but at most `most`, while the
    /// calling thread looks at signals; `goes_on` tells the work when one has raised an exception, which is passed on.
    ///
    /// A pool that outlives the call would have no threads in a child after `fork`, and the work no end.
    pub fn run_on_pool(
        py: Python<'_>,
        most: usize,
        work: impl Send + FnOnce(&(dyn Fn() -> bool + Sync)),
    ) -> PyResult<()> {
        let cores = available_parallelism().map_or(1, usize::from);
        let mut builder = ThreadPoolBuilder::new();
        // Without this it is the number of cores, or what RAYON_NUM_THREADS says.
        if most < cores {
            builder = builder.num_threads(most.max(1));
        }
        let pool = builder
            .build()
            .map_err(|_| errors::error(py, Error::NoThreads))?;
        let stop = AtomicBool::new(false);
        py.detach(|| {
            let (sender, receiver) = channel::<()>();
            pool.in_place_scope(|scope| {
                let stop = &stop;
                scope.spawn(move |_| {
                    // Dropped at the end of the work, which ends the wait.
                    let _sender = sender;
                    work(&|| !stop.load(Ordering::Relaxed));
                });
                let mut raised = None;
                while receiver.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                    if raised.is_none() {
                        raised = Python::attach(|py| py.check_signals()).err();
                        stop.store(raised.is_some(), Ordering::Relaxed);
                    }
                }
                raised.map_or(Ok(()), Err)
            })
        })
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
