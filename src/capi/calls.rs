// SPDX-License-Identifier: MIT OR Apache-2.0
//! The functions of the interface, in double and in single precision.
//!
//! Both are written out, because the header is generated from this source and cbindgen does not expand macros.

use super::generic::{refinement, resection, size, three_views, triangulation};
use super::memory::Memory;
use super::status::{BearslamStatus, status, text};
use crate::lm::RefineOptions;
use core::ffi::{c_char, c_int, c_void};

/// The explanation of a status, as a short text; never null.
#[unsafe(no_mangle)]
pub extern "C" fn bearslam_status_text(status: c_int) -> *const c_char {
    text(status).as_ptr()
}

/// Poses and landmarks of three views from bearings alone: both motions that explain them, the better first.
///
/// View 0 is at the origin with heading 0, view 1 at distance 1 from it. Both motions explain the bearings
/// modulo pi. The signs distinguish them nearly always, but not always: check `inconsistent` of both.
///
/// - `bearings`: 3 x `landmark_count`, by view. A landmark not seen by all three views is ignored.
/// - `landmark_count`: at most `BEARSLAM_MAX_TRIPLES`.
/// - `method`: a `BearslamMethod`; `reweights`: rounds of reweighting of the calibrated method (2 is good), at
///   most `BEARSLAM_MAX_REWEIGHTS`.
/// - `poses`: 2 x 3 x 3, by solution, then by view.
/// - `landmarks`: 2 x `landmark_count` x 2; NaN where the rays are parallel or one is missing.
/// - `inconsistent`: 2; how many sightings point away from their landmark.
/// - `solutions`: 1; the number of solutions: 2, or 1 where noise has merged them, and the second is then NaN.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_three_view(
    bearings: *const f64,
    landmark_count: usize,
    method: c_int,
    reweights: usize,
    poses: *mut f64,
    landmarks: *mut f64,
    inconsistent: *mut usize,
    solutions: *mut usize,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(three_views(
        call,
        bearings,
        landmark_count,
        (method, reweights),
        poses,
        landmarks,
        (inconsistent, solutions),
    ))
}

/// As `bearslam_three_view`, in single precision.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_three_view_f32(
    bearings: *const f32,
    landmark_count: usize,
    method: c_int,
    reweights: usize,
    poses: *mut f32,
    landmarks: *mut f32,
    inconsistent: *mut usize,
    solutions: *mut usize,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(three_views(
        call,
        bearings,
        landmark_count,
        (method, reweights),
        poses,
        landmarks,
        (inconsistent, solutions),
    ))
}

/// A landmark by triangulation from at least two bearings.
///
/// The status is `BEARSLAM_STATUS_BEHIND` when the lines of sight intersect behind a view, as with diverging rays;
/// noise can make the rays to a far landmark diverge.
///
/// - `poses`: `view_count` x 3; those of views that do not see the landmark are ignored.
/// - `bearings`: `view_count`.
/// - `point`: 2.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_triangulate(
    poses: *const f64,
    bearings: *const f64,
    view_count: usize,
    point: *mut f64,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(triangulation(call, poses, bearings, view_count, point))
}

/// As `bearslam_triangulate`, in single precision.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_triangulate_f32(
    poses: *const f32,
    bearings: *const f32,
    view_count: usize,
    point: *mut f32,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(triangulation(call, poses, bearings, view_count, point))
}

/// A pose by resection from bearings of at least three known landmarks.
///
/// - `landmarks`: `landmark_count` x 2; those that are not seen are ignored.
/// - `bearings`: `landmark_count`.
/// - `pose`: 3.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_resect(
    landmarks: *const f64,
    bearings: *const f64,
    landmark_count: usize,
    pose: *mut f64,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(resection(call, landmarks, bearings, landmark_count, pose))
}

/// As `bearslam_resect`, in single precision.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_resect_f32(
    landmarks: *const f32,
    bearings: *const f32,
    landmark_count: usize,
    pose: *mut f32,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(resection(call, landmarks, bearings, landmark_count, pose))
}

/// The number of bytes of memory that `bearslam_refine` needs; 0 for more views or landmarks than it can take.
#[unsafe(no_mangle)]
pub extern "C" fn bearslam_refine_size(view_count: usize, landmark_count: usize) -> usize {
    size::<f64>(view_count, landmark_count)
}

/// As `bearslam_refine_size`, for `bearslam_refine_f32`.
#[unsafe(no_mangle)]
pub extern "C" fn bearslam_refine_size_f32(view_count: usize, landmark_count: usize) -> usize {
    size::<f32>(view_count, landmark_count)
}

/// Refines poses and landmarks in place: minimises the sum of squared bearing residuals over sigma.
///
/// In the result the first determined view is at the origin with heading 0, the others at a root-mean-square
/// distance of 1 from it. Views that see fewer than three landmarks of the map and landmarks seen by fewer
/// than two of its views are not determined by the bearings and become NaN.
///
/// - `bearings`: `view_count` x `landmark_count`, by view.
/// - `sigma`: standard deviation of a bearing.
/// - `view_count`, `landmark_count`: at most `BEARSLAM_MAX_VIEWS` and `BEARSLAM_MAX_LANDMARKS`.
/// - `poses`: `view_count` x 3, `landmarks`: `landmark_count` x 2; one whose x is NaN is left out.
/// - `max_iterations`: maximum number of linear systems to solve, which bounds the time.
/// - `tolerance`: ends when a step lowers the cost by less than this fraction of it; 1e-10 (1e-7 in single
///   precision) is good, 0 continues until no step lowers it.
/// - `cost`: 1; half the sum of squares. `iterations`: 1; linear systems solved.
/// - `memory`: `memory_size` bytes, aligned as a `double`, at least `bearslam_refine_size` of them. Its
///   contents before and after the call do not matter.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_refine(
    bearings: *const f64,
    sigma: f64,
    view_count: usize,
    landmark_count: usize,
    poses: *mut f64,
    landmarks: *mut f64,
    max_iterations: usize,
    tolerance: f64,
    cost: *mut f64,
    iterations: *mut usize,
    memory: *mut c_void,
    memory_size: usize,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(refinement(
        call,
        (bearings, sigma),
        [view_count, landmark_count],
        (poses, landmarks),
        RefineOptions {
            max_iterations,
            tolerance,
            ..RefineOptions::default()
        },
        (cost, iterations),
        (memory, memory_size),
    ))
}

/// As `bearslam_refine`, in single precision.
///
/// # Safety
/// See the head of this file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bearslam_refine_f32(
    bearings: *const f32,
    sigma: f32,
    view_count: usize,
    landmark_count: usize,
    poses: *mut f32,
    landmarks: *mut f32,
    max_iterations: usize,
    tolerance: f32,
    cost: *mut f32,
    iterations: *mut usize,
    memory: *mut c_void,
    memory_size: usize,
) -> BearslamStatus {
    // SAFETY: as promised with the call.
    let call = unsafe { Memory::promised() };
    status(refinement(
        call,
        (bearings, sigma),
        [view_count, landmark_count],
        (poses, landmarks),
        RefineOptions {
            max_iterations,
            tolerance,
            ..RefineOptions::default()
        },
        (cost, iterations),
        (memory, memory_size),
    ))
}
