// SPDX-License-Identifier: MIT OR Apache-2.0
//! Monte-Carlo sweeps: many random scenes, each solved from several starts and compared.

mod tally;
mod trial;

pub use tally::{BINS_PER_OCTAVE, Histogram, Quantity, Tally};
pub use trial::{Start, SweepTrial, TrialOutcome};

use crate::error::Error;
use crate::simulate::Layout;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use rayon::ThreadPoolBuilder;
use std::sync::mpsc::{RecvTimeoutError, channel};

/// A cell of the sweep: one kind of scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Where views and landmarks are.
    pub layout: Layout,
    /// Number of views.
    pub views: usize,
    /// Number of landmarks.
    pub landmarks: usize,
    /// Standard deviation of the bearings \[rad\].
    pub noise: f64,
}

/// Some trials of one cell, run as one unit of work.
#[derive(Clone, Debug, PartialEq)]
pub struct Chunk {
    /// The kind of scene.
    pub cell: Cell,
    /// Indices of the trials.
    pub trials: Range<u64>,
}

/// Runs chunks on `threads` threads (0: all cores) and reports the tallies of each chunk, one for every
/// start, as soon as it is done.
///
/// `watch` is called on the calling thread with the index of a finished chunk and its tallies, and with
/// `None` when none has finished for 50 ms; returning `false` stops the work. Chunks that are not finished
/// by then are lost. Tallies are counts, so the order in which chunks finish and are merged does not
/// matter: the same seed gives the same bits, whatever the number of threads and the division into chunks.
///
/// # Errors
/// Those of [`simulate`](crate::simulate); [`Error::Interrupted`] when `watch` says so;
/// [`Error::NoThreads`] when threads cannot be created.
///
/// # Example
/// ```
/// use bearslam::{Cell, Chunk, Layout, Start, sweep};
/// let cell = Cell { layout: Layout::Mixed, views: 4, landmarks: 9, noise: 0.01 };
/// let mut failures = [0, 0];
/// sweep(&[Chunk { cell, trials: 0..20 }], &[Start::Random, Start::Solve], 1, 0, &mut |done| {
///     if let Some((_, tallies)) = done {
///         failures = [tallies[0].failures, tallies[1].failures];
///     }
///     true
/// })?;
/// assert!(failures[0] > 0 && failures[1] == 0);
/// # Ok::<(), bearslam::Error>(())
/// ```
pub fn sweep(
    chunks: &[Chunk],
    starts: &[Start],
    seed: u64,
    threads: usize,
    watch: &mut dyn FnMut(Option<(usize, Vec<Tally>)>) -> bool,
) -> Result<(), Error> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|_| Error::NoThreads)?;
    let stop = AtomicBool::new(false);
    let (sender, receiver) = channel();
    pool.in_place_scope(|scope| {
        for (index, chunk) in chunks.iter().enumerate() {
            let (sender, stop) = (sender.clone(), &stop);
            scope.spawn(move |_| {
                if !stop.load(Ordering::Relaxed) {
                    // The receiver no longer exists after the work has been stopped.
                    let _ = sender.send((index, run(chunk, starts, seed, stop)));
                }
            });
        }
        drop(sender);
        let mut outcome = Ok(());
        loop {
            let go_on = match receiver.recv_timeout(LOOK) {
                Ok((index, Ok(tallies))) => watch(Some((index, tallies))),
                Ok((_, Err(error))) => {
                    outcome = outcome.and(Err(error));
                    false
                }
                Err(RecvTimeoutError::Timeout) => watch(None),
                Err(RecvTimeoutError::Disconnected) => return outcome,
            };
            if !go_on {
                stop.store(true, Ordering::Relaxed);
                return outcome.and(Err(Error::Interrupted));
            }
        }
    })
}

/// Longest time without a call of `watch`.
const LOOK: Duration = Duration::from_millis(50);

/// The trials of a chunk, one after the other.
fn run(chunk: &Chunk, starts: &[Start], seed: u64, stop: &AtomicBool) -> Result<Vec<Tally>, Error> {
    let mut tallies = vec![Tally::default(); starts.len()];
    for number in chunk.trials.clone() {
        let trial = SweepTrial::run(&chunk.cell, starts, seed, number, &mut |_, _, _| {
            !stop.load(Ordering::Relaxed)
        })?;
        for (tally, outcome) in tallies.iter_mut().zip(&trial.outcomes) {
            tally.add(outcome, trial.bound.as_ref());
        }
    }
    Ok(tallies)
}
