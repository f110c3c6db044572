// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C interface: plain arrays in, plain arrays and a status out. `include/bearslam.h` is made from it.
//!
//! Angles are radians. A pose is `x, y, heading`, a landmark `x, y`; arrays are row by row. A bearing that
//! is NaN has not been seen. Nothing allocates, nothing panics, and no call keeps a pointer. With any status
//! but [`BearslamStatus::Ok`] and [`BearslamStatus::NotConverged`] nothing has been written.
//!
//! # Safety
//! Holds for every function: a pointer that is not null has room for the numbers that its argument
//! names, and what a call writes overlaps nothing else that it is given. Null and misaligned pointers are
//! told by the status.
#![allow(unsafe_code, reason = "pointers of C")]

use crate::{
    Bearing, Error, FixedMap, Method, Pose, Real, RefineOptions, Triple, Workspace, pose, resect,
    three_view, triangulate,
};
use core::ffi::{CStr, c_char, c_int, c_void};
use core::slice;
use nalgebra::{Point2, UnitComplex};

/// Most landmarks of `bearslam_three_view`, whose rays are on the stack.
pub const BEARSLAM_MAX_TRIPLES: usize = 64;
/// Most rounds of reweighting of `bearslam_three_view`: a count that went wrong is not worked off.
pub const BEARSLAM_MAX_REWEIGHTS: usize = 100;
/// Most views of `bearslam_refine`.
pub const BEARSLAM_MAX_VIEWS: usize = 16;
/// Most landmarks of `bearslam_refine`.
pub const BEARSLAM_MAX_LANDMARKS: usize = 32;

/// Up to so many views and landmarks, `bearslam_refine` asks for less memory.
const FEW_VIEWS: usize = 8;
const FEW_LANDMARKS: usize = 16;

/// What became of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BearslamStatus {
    /// All is written.
    Ok = 0,
    /// A pointer is null.
    NullPointer,
    /// A pointer is not aligned for what it points at.
    Misaligned,
    /// Fewer views or landmarks than the call needs.
    TooFew,
    /// More views, landmarks or rounds than the call can take.
    TooLarge,
    /// A number is infinite, or NaN where that means nothing.
    NotFinite,
    /// The standard deviation is not positive, or the tolerance is negative.
    NotPositive,
    /// No such method.
    UnknownMethod,
    /// The memory is smaller than `bearslam_refine_size` says.
    MemoryTooSmall,
    /// The data do not determine the answer.
    Degenerate,
    /// The iterations ran out before the minimum; all is written.
    NotConverged,
    /// An error of the library that its calls from C should not meet.
    Unexpected,
}

/// How three views are solved.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BearslamMethod {
    /// The calibrated tensor, from five landmarks.
    Calibrated = 0,
    /// The method of Dellaert and Stroupe (ICRA 2002), from seven landmarks.
    Projective,
}

impl BearslamStatus {
    const ALL: [(Self, &CStr); 12] = [
        (Self::Ok, c"all is written"),
        (Self::NullPointer, c"a pointer is null"),
        (
            Self::Misaligned,
            c"a pointer is not aligned for what it points at",
        ),
        (
            Self::TooFew,
            c"fewer views or landmarks than the call needs",
        ),
        (
            Self::TooLarge,
            c"more views, landmarks or rounds than the call can take",
        ),
        (
            Self::NotFinite,
            c"a number is infinite, or NaN where that means nothing",
        ),
        (Self::NotPositive, c"the standard deviation is not positive, or the tolerance is negative"),
        (Self::UnknownMethod, c"no such method"),
        (
            Self::MemoryTooSmall,
            c"the memory is smaller than bearslam_refine_size says",
        ),
        (
            Self::Degenerate,
            c"the data do not determine the answer; add landmarks off their common line or circle, or views \
              from other places",
        ),
        (
            Self::NotConverged,
            c"the iterations ran out before the minimum; all is written",
        ),
        (
            Self::Unexpected,
            c"an error of the library that its calls from C should not meet",
        ),
    ];
}

impl From<Error> for BearslamStatus {
    fn from(error: Error) -> Self {
        match error {
            Error::TooFew { .. } => Self::TooFew,
            Error::TooLarge { .. } | Error::OutOfRange { .. } => Self::TooLarge,
            Error::NotFinite { .. } => Self::NotFinite,
            Error::NotPositive { .. } => Self::NotPositive,
            Error::Degenerate { .. } => Self::Degenerate,
            _ => Self::Unexpected,
        }
    }
}

type Found<T> = Result<T, BearslamStatus>;

/// The status of what was tried.
fn status(tried: Found<()>) -> BearslamStatus {
    tried.err().unwrap_or(BearslamStatus::Ok)
}

/// `count` rows of `width` numbers of C.
///
/// # Safety
/// See the module; nothing writes to them as long as the slice is in use.
unsafe fn input<'a, T>(pointer: *const T, count: usize, width: usize) -> Found<&'a [T]> {
    let length = check(pointer, count, width)?;
    // SAFETY: not null, aligned, no longer than memory can be; the rest is the caller's word.
    Ok(unsafe { slice::from_raw_parts(pointer, length) })
}

/// As [`input`], to be written.
///
/// # Safety
/// See the module; nothing else reads or writes them as long as the slice is in use.
unsafe fn output<'a, T>(pointer: *mut T, count: usize, width: usize) -> Found<&'a mut [T]> {
    let length = check(pointer, count, width)?;
    // SAFETY: not null, aligned, no longer than memory can be; the rest is the caller's word. Numbers are
    // plain bits: memory of C that was never written holds some.
    Ok(unsafe { slice::from_raw_parts_mut(pointer, length) })
}

/// The number of elements.
fn check<T>(pointer: *const T, count: usize, width: usize) -> Found<usize> {
    if pointer.is_null() {
        return Err(BearslamStatus::NullPointer);
    }
    if !pointer.is_aligned() {
        return Err(BearslamStatus::Misaligned);
    }
    let length = count.checked_mul(width);
    let bytes = length.and_then(|length| length.checked_mul(size_of::<T>()));
    match (length, bytes) {
        (Some(length), Some(bytes)) if isize::try_from(bytes).is_ok() => Ok(length),
        _ => Err(BearslamStatus::TooLarge),
    }
}

fn finite<T: Real>(number: T) -> Found<T> {
    if number.is_finite() {
        Ok(number)
    } else {
        Err(BearslamStatus::NotFinite)
    }
}

fn is_nan<T: Real>(number: T) -> bool {
    number.partial_cmp(&number).is_none()
}

/// The explanation of a status, in a word or a sentence; never null.
#[unsafe(no_mangle)]
pub extern "C" fn bearslam_status_text(status: c_int) -> *const c_char {
    let mut all = BearslamStatus::ALL.iter();
    let known = all.find(|(known, _)| *known as c_int == status);
    known.map_or(c"no such status", |(_, text)| text).as_ptr()
}

/// Poses and landmarks of three views from bearings alone: both motions that explain them, best first.
///
/// View 0 is at the origin with heading 0, view 1 at distance 1 from it. Both motions explain the bearings
/// modulo pi; the signs nearly always tell them apart, but not always: look at `inconsistent` of both.
///
/// - `bearings`: 3 x `landmark_count`, by view. A landmark that one of the views does not see takes no part.
/// - `landmark_count`: at most `BEARSLAM_MAX_TRIPLES`.
/// - `method`: a `BearslamMethod`; `reweights`: rounds of reweighting of the calibrated one (2 is good), at
///   most `BEARSLAM_MAX_REWEIGHTS`.
/// - `poses`: 2 x 3 x 3, by solution, then by view.
/// - `landmarks`: 2 x `landmark_count` x 2; NaN where rays are parallel or one is missing.
/// - `inconsistent`: 2; how many sightings point away from their landmark.
/// - `solutions`: how many there are: 2, or 1 where noise has made the two one. Then the second is NaN.
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
    // SAFETY: passed on.
    status(unsafe {
        three_views(
            bearings,
            landmark_count,
            (method, reweights),
            poses,
            landmarks,
            (inconsistent, solutions),
        )
    })
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
    // SAFETY: passed on.
    status(unsafe {
        three_views(
            bearings,
            landmark_count,
            (method, reweights),
            poses,
            landmarks,
            (inconsistent, solutions),
        )
    })
}

unsafe fn three_views<T: Real>(
    bearings: *const T,
    count: usize,
    (method, reweights): (c_int, usize),
    poses: *mut T,
    landmarks: *mut T,
    (inconsistent, solutions): (*mut usize, *mut usize),
) -> Found<()> {
    // SAFETY: passed on.
    let (bearings, poses, landmarks, inconsistent, solutions) = unsafe {
        (
            input(bearings, count, 3)?,
            output(poses, 6, 3)?,
            output(landmarks, count, 4)?,
            output(inconsistent, 2, 1)?,
            output(solutions, 1, 1)?,
        )
    };
    let method = if method == BearslamMethod::Calibrated as c_int {
        Method::Calibrated { reweights }
    } else if method == BearslamMethod::Projective as c_int {
        Method::Projective
    } else {
        return Err(BearslamStatus::UnknownMethod);
    };
    if count > BEARSLAM_MAX_TRIPLES || reweights > BEARSLAM_MAX_REWEIGHTS {
        return Err(BearslamStatus::TooLarge);
    }
    let (first, others) = bearings.split_at_checked(count).unwrap_or_default();
    let (second, third) = others.split_at_checked(count).unwrap_or_default();
    let seen = || {
        let all = first.iter().zip(second).zip(third);
        all.map(|((u, v), w)| [*u, *v, *w])
            .map(|triple| (!triple.iter().any(|angle| is_nan(*angle))).then_some(triple))
    };

    let mut room: [Triple<T>; BEARSLAM_MAX_TRIPLES] =
        [[UnitComplex::identity(); 3]; BEARSLAM_MAX_TRIPLES];
    let mut triples = 0;
    for (place, angles) in room.iter_mut().zip(seen().flatten()) {
        *place = angles.map(Bearing::new);
        triples += 1;
    }
    let triples = room.get(..triples).unwrap_or_default();
    let found = three_view(triples, method)?;

    let count_found = if found.flattened { 1 } else { 2 };
    solutions.fill(count_found);
    let nan = T::zero() / T::zero();
    poses.fill(nan);
    landmarks.fill(nan);
    inconsistent.fill(0);
    let mut poses = poses.as_chunks_mut().0.iter_mut();
    let mut landmarks = landmarks.as_chunks_mut().0.iter_mut();
    let motions = found.motions.iter().take(count_found);
    for (motion, inconsistent) in motions.zip(inconsistent) {
        *inconsistent = motion.inconsistent;
        for (pose, place) in motion.poses.iter().zip(&mut poses) {
            *place = triplet(pose);
        }
        let mut triples = triples.iter();
        for (seen, place) in seen().zip(&mut landmarks) {
            let triple = seen.and_then(|_| triples.next());
            if let Some(point) = triple.and_then(|triple| motion.landmark(triple)) {
                *place = [point.x, point.y];
            }
        }
    }
    Ok(())
}

/// The heading in (-pi, pi].
fn triplet<T: Real>(pose: &Pose<T>) -> [T; 3] {
    let angle = pose.rotation.angle();
    let heading = if angle == -T::pi() { T::pi() } else { angle };
    [pose.translation.x, pose.translation.y, heading]
}

/// A landmark from two bearings or more.
///
/// - `poses`: `view_count` x 3; those of views that do not see it are not looked at.
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
    // SAFETY: passed on.
    status(unsafe { triangulation(poses, bearings, view_count, point) })
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
    // SAFETY: passed on.
    status(unsafe { triangulation(poses, bearings, view_count, point) })
}

unsafe fn triangulation<T: Real>(
    poses: *const T,
    bearings: *const T,
    count: usize,
    point: *mut T,
) -> Found<()> {
    // SAFETY: passed on.
    let (poses, bearings, place) = unsafe {
        (
            input(poses, count, 3)?,
            input(bearings, count, 1)?,
            output(point, 2, 1)?,
        )
    };
    let seen = poses.as_chunks().0.iter().zip(bearings);
    let seen = seen.filter(|(_, bearing)| !is_nan(**bearing));
    let rays =
        seen.map(|([x, y, heading], bearing)| (pose(*x, *y, *heading), Bearing::new(*bearing)));
    let point = triangulate(rays)?.point;
    place.copy_from_slice(&[point.x, point.y]);
    Ok(())
}

/// A pose from bearings of three known landmarks or more.
///
/// - `landmarks`: `landmark_count` x 2; those that are not seen are not looked at.
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
    // SAFETY: passed on.
    status(unsafe { resection(landmarks, bearings, landmark_count, pose) })
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
    // SAFETY: passed on.
    status(unsafe { resection(landmarks, bearings, landmark_count, pose) })
}

unsafe fn resection<T: Real>(
    landmarks: *const T,
    bearings: *const T,
    count: usize,
    pose: *mut T,
) -> Found<()> {
    // SAFETY: passed on.
    let (landmarks, bearings, place) = unsafe {
        (
            input(landmarks, count, 2)?,
            input(bearings, count, 1)?,
            output(pose, 3, 1)?,
        )
    };
    let seen = landmarks.as_chunks().0.iter().zip(bearings);
    let seen = seen.filter(|(_, bearing)| !is_nan(**bearing));
    let sightings = seen.map(|([x, y], bearing)| (Point2::new(*x, *y), Bearing::new(*bearing)));
    place.copy_from_slice(&triplet(&resect(sightings)?.pose));
    Ok(())
}

/// How many bytes of memory `bearslam_refine` needs; 0 for more views or landmarks than it can take.
#[unsafe(no_mangle)]
pub extern "C" fn bearslam_refine_size(view_count: usize, landmark_count: usize) -> usize {
    size::<f64>(view_count, landmark_count)
}

/// As `bearslam_refine_size`, of `bearslam_refine_f32`.
#[unsafe(no_mangle)]
pub extern "C" fn bearslam_refine_size_f32(view_count: usize, landmark_count: usize) -> usize {
    size::<f32>(view_count, landmark_count)
}

fn size<T: Real>(views: usize, landmarks: usize) -> usize {
    if views <= FEW_VIEWS && landmarks <= FEW_LANDMARKS {
        size_of::<Room<T, FEW_VIEWS, FEW_LANDMARKS>>()
    } else if views <= BEARSLAM_MAX_VIEWS && landmarks <= BEARSLAM_MAX_LANDMARKS {
        size_of::<Room<T, BEARSLAM_MAX_VIEWS, BEARSLAM_MAX_LANDMARKS>>()
    } else {
        0
    }
}

/// What a refinement puts into the memory of the caller.
struct Room<T: Real, const M: usize, const N: usize> {
    map: FixedMap<T, M, N>,
    workspace: Workspace<T, M, N>,
}

/// Refines poses and landmarks in place: the least sum of squared bearing residuals over sigma.
///
/// The first view that takes part ends at the origin with heading 0, the others at a root-mean-square
/// distance of 1 from it. Views that see fewer than three landmarks of the map and landmarks seen by fewer
/// than two of its views are not held by the bearings and become NaN.
///
/// - `bearings`: `view_count` x `landmark_count`, by view.
/// - `sigma`: standard deviation of a bearing.
/// - `view_count`, `landmark_count`: at most `BEARSLAM_MAX_VIEWS` and `BEARSLAM_MAX_LANDMARKS`.
/// - `poses`: `view_count` x 3, `landmarks`: `landmark_count` x 2; one with x NaN takes no part.
/// - `max_iterations`: most linear systems to solve, which bounds the time.
/// - `tolerance`: ends when a step lowers the cost by less than this part of it; 1e-10 (1e-7 in single
///   precision) is good, 0 goes on until no step lowers it.
/// - `cost`: 1; half the sum of squares. `iterations`: 1; linear systems solved.
/// - `memory`: `memory_size` bytes, aligned as a `double`, at least `bearslam_refine_size` of them. What is
///   in it before and after means nothing.
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
    // SAFETY: passed on.
    status(unsafe {
        refinement(
            bearings,
            sigma,
            [view_count, landmark_count],
            (poses, landmarks),
            RefineOptions {
                max_iterations,
                tolerance,
                ..RefineOptions::default()
            },
            (cost, iterations),
            (memory, memory_size),
        )
    })
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
    // SAFETY: passed on.
    status(unsafe {
        refinement(
            bearings,
            sigma,
            [view_count, landmark_count],
            (poses, landmarks),
            RefineOptions {
                max_iterations,
                tolerance,
                ..RefineOptions::default()
            },
            (cost, iterations),
            (memory, memory_size),
        )
    })
}

unsafe fn refinement<T: Real>(
    bearings: *const T,
    sigma: T,
    [views, points]: [usize; 2],
    (poses, landmarks): (*mut T, *mut T),
    options: RefineOptions<T>,
    (cost, iterations): (*mut T, *mut usize),
    (memory, memory_size): (*mut c_void, usize),
) -> Found<()> {
    let needed = size::<T>(views, points);
    if needed == 0 {
        return Err(BearslamStatus::TooLarge);
    }
    if memory.is_null() {
        return Err(BearslamStatus::NullPointer);
    }
    if memory_size < needed {
        return Err(BearslamStatus::MemoryTooSmall);
    }
    // SAFETY: passed on.
    let task = unsafe {
        Refinement {
            bearings: input(bearings, views, points)?,
            sigma,
            poses: output(poses, views, 3)?,
            landmarks: output(landmarks, points, 2)?,
            options,
            cost: output(cost, 1, 1)?,
            iterations: output(iterations, 1, 1)?,
        }
    };
    // SAFETY: the memory is large enough for the room of this size, which `size` has chosen alike.
    unsafe {
        if views <= FEW_VIEWS && points <= FEW_LANDMARKS {
            task.run(room::<T, FEW_VIEWS, FEW_LANDMARKS>(memory)?)
        } else {
            task.run(room::<T, BEARSLAM_MAX_VIEWS, BEARSLAM_MAX_LANDMARKS>(
                memory,
            )?)
        }
    }
}

/// An empty room in memory of the caller.
///
/// # Safety
/// The memory is large enough, and nothing else uses it as long as the room is in use.
unsafe fn room<'a, T: Real, const M: usize, const N: usize>(
    memory: *mut c_void,
) -> Found<&'a mut Room<T, M, N>> {
    let room = memory.cast::<Room<T, M, N>>();
    if !room.is_aligned() {
        return Err(BearslamStatus::Misaligned);
    }
    // In place: made by `new` it would pass over the stack. SAFETY: aligned and large enough. All is numbers, for
    // which zero bits are valid (`T` is f32 or f64), and options, which are written one by one.
    unsafe {
        room.write_bytes(0, 1);
        write_none(&raw mut (*room).map.poses);
        write_none(&raw mut (*room).map.landmarks);
        write_none_by_row(&raw mut (*room).map.sightings);
        write_none(&raw mut (*room).workspace.poses);
        write_none(&raw mut (*room).workspace.landmarks);
        Ok(&mut *room)
    }
}

/// # Safety
/// The array is aligned and may be written.
unsafe fn write_none<U, const K: usize>(array: *mut [Option<U>; K]) {
    let first = array.cast::<Option<U>>();
    // SAFETY: within the array.
    (0..K).for_each(|k| unsafe { first.add(k).write(None) });
}

/// # Safety
/// As [`write_none`].
unsafe fn write_none_by_row<U, const K: usize, const L: usize>(rows: *mut [[Option<U>; K]; L]) {
    let first = rows.cast::<[Option<U>; K]>();
    // SAFETY: within the rows.
    (0..L).for_each(|row| unsafe { write_none(first.add(row)) });
}

struct Refinement<'a, T: Real> {
    /// By view.
    bearings: &'a [T],
    sigma: T,
    poses: &'a mut [T],
    landmarks: &'a mut [T],
    options: RefineOptions<T>,
    cost: &'a mut [T],
    iterations: &'a mut [usize],
}

impl<T: Real> Refinement<'_, T> {
    fn run<const M: usize, const N: usize>(self, room: &mut Room<T, M, N>) -> Found<()> {
        let Room { map, workspace } = room;
        let (poses, landmarks) = (
            self.poses.as_chunks_mut().0,
            self.landmarks.as_chunks_mut().0,
        );
        // A map without sightings would not ask.
        if !(self.sigma > T::zero() && self.options.tolerance >= T::zero()) {
            return Err(BearslamStatus::NotPositive);
        }
        for (place, &[x, y, heading]) in map.poses.iter_mut().zip(poses.iter()) {
            if !is_nan(x) {
                *place = Some(pose(finite(x)?, finite(y)?, finite(heading)?));
            }
        }
        for (place, &[x, y]) in map.landmarks.iter_mut().zip(landmarks.iter()) {
            if !is_nan(x) {
                *place = Some(Point2::new(finite(x)?, finite(y)?));
            }
        }
        let mut angles = self.bearings.iter();
        for view in 0..poses.len() {
            for (landmark, angle) in (0..landmarks.len()).zip(&mut angles) {
                if !is_nan(*angle) {
                    map.see(view, landmark, Bearing::new(*angle), self.sigma)?;
                }
            }
        }
        let outcome = map.refine(workspace, &self.options)?;
        map.normalize();

        let nan = T::zero() / T::zero();
        for (place, pose) in poses.iter_mut().zip(&map.poses) {
            *place = pose.as_ref().map_or([nan; 3], triplet);
        }
        for (place, point) in landmarks.iter_mut().zip(&map.landmarks) {
            *place = point.map_or([nan; 2], |point| [point.x, point.y]);
        }
        self.cost.fill(outcome.cost);
        self.iterations.fill(outcome.iterations);
        if outcome.termination.was_successful() {
            Ok(())
        } else {
            Err(BearslamStatus::NotConverged)
        }
    }
}
