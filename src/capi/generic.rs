// SPDX-License-Identifier: MIT OR Apache-2.0
//! The implementation of each call, generic over `f64` and `f32`, and its limits.

use super::memory::{Memory, Room, Scratch};
use super::status::{BearslamStatus, Found};
use crate::geometry::{Bearing, pose, xytheta};
use crate::kernels::{Method, Triple, resect, three_view, triangulate};
use crate::lm::RefineOptions;
use crate::scalar::Real;
use core::ffi::{c_int, c_void};
use nalgebra::{Point2, UnitComplex};

/// Maximum number of landmarks of `bearslam_three_view`, whose rays are on the stack.
pub const BEARSLAM_MAX_TRIPLES: usize = 64;
/// Maximum number of rounds of reweighting of `bearslam_three_view`, so that a wrong argument cannot stall it.
pub const BEARSLAM_MAX_REWEIGHTS: usize = 100;
/// Maximum number of views of `bearslam_refine`.
pub const BEARSLAM_MAX_VIEWS: usize = 16;
/// Maximum number of landmarks of `bearslam_refine`.
pub const BEARSLAM_MAX_LANDMARKS: usize = 32;

/// Method for three views.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BearslamMethod {
    /// The calibrated tensor, from five landmarks.
    Calibrated = 0,
    /// The method of Dellaert and Stroupe (ICRA 2002), from seven landmarks.
    Projective,
}

/// Up to this many views and landmarks, `bearslam_refine` needs less memory.
const FEW_VIEWS: usize = 8;
const FEW_LANDMARKS: usize = 16;

pub(super) fn three_views<T: Real>(
    memory: Memory<'_>,
    bearings: *const T,
    count: usize,
    (method, reweights): (c_int, usize),
    poses: *mut T,
    landmarks: *mut T,
    (inconsistent, solutions): (*mut usize, *mut usize),
) -> Found<()> {
    let bearings = memory.input(bearings, count, 3)?;
    let poses = memory.output(poses, 6, 3)?;
    let landmarks = memory.output(landmarks, count, 4)?;
    let inconsistent = memory.output(inconsistent, 2, 1)?;
    let solutions = memory.output(solutions, 1, 1)?;
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
            *place = xytheta(pose);
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

pub(super) fn triangulation<T: Real>(
    memory: Memory<'_>,
    poses: *const T,
    bearings: *const T,
    count: usize,
    point: *mut T,
) -> Found<()> {
    let poses = memory.input(poses, count, 3)?;
    let bearings = memory.input(bearings, count, 1)?;
    let place = memory.output(point, 2, 1)?;
    let seen = poses.as_chunks().0.iter().zip(bearings);
    let seen = seen.filter(|(_, bearing)| !is_nan(**bearing));
    let rays =
        seen.map(|([x, y, heading], bearing)| (pose(*x, *y, *heading), Bearing::new(*bearing)));
    let found = triangulate(rays)?;
    if found.behind > 0 {
        return Err(BearslamStatus::Behind);
    }
    let point = found.point;
    place.copy_from_slice(&[point.x, point.y]);
    Ok(())
}

pub(super) fn resection<T: Real>(
    memory: Memory<'_>,
    landmarks: *const T,
    bearings: *const T,
    count: usize,
    pose: *mut T,
) -> Found<()> {
    let landmarks = memory.input(landmarks, count, 2)?;
    let bearings = memory.input(bearings, count, 1)?;
    let place = memory.output(pose, 3, 1)?;
    let seen = landmarks.as_chunks().0.iter().zip(bearings);
    let seen = seen.filter(|(_, bearing)| !is_nan(**bearing));
    let sightings = seen.map(|([x, y], bearing)| (Point2::new(*x, *y), Bearing::new(*bearing)));
    place.copy_from_slice(&xytheta(&resect(sightings)?.pose));
    Ok(())
}

/// Bytes that a refinement of this many views and landmarks needs; 0 when there are too many.
pub(super) fn size<T: Real>(views: usize, landmarks: usize) -> usize {
    if are_few(views, landmarks) {
        size_of::<Room<T, FEW_VIEWS, FEW_LANDMARKS>>()
    } else if views <= BEARSLAM_MAX_VIEWS && landmarks <= BEARSLAM_MAX_LANDMARKS {
        size_of::<Room<T, BEARSLAM_MAX_VIEWS, BEARSLAM_MAX_LANDMARKS>>()
    } else {
        0
    }
}

fn are_few(views: usize, landmarks: usize) -> bool {
    views <= FEW_VIEWS && landmarks <= FEW_LANDMARKS
}

pub(super) fn refinement<T: Real>(
    memory: Memory<'_>,
    (bearings, sigma): (*const T, T),
    [views, points]: [usize; 2],
    (poses, landmarks): (*mut T, *mut T),
    options: RefineOptions<T>,
    (cost, iterations): (*mut T, *mut usize),
    (scratch, scratch_size): (*mut c_void, usize),
) -> Found<()> {
    let needed = size::<T>(views, points);
    if needed == 0 {
        return Err(BearslamStatus::TooLarge);
    }
    let scratch = memory.scratch(scratch, scratch_size, needed)?;
    let task = Refinement {
        bearings: memory.input(bearings, views, points)?,
        sigma,
        poses: memory.output(poses, views, 3)?,
        landmarks: memory.output(landmarks, points, 2)?,
        options,
        cost: memory.output(cost, 1, 1)?,
        iterations: memory.output(iterations, 1, 1)?,
    };
    if are_few(views, points) {
        task.run::<FEW_VIEWS, FEW_LANDMARKS>(scratch)
    } else {
        task.run::<BEARSLAM_MAX_VIEWS, BEARSLAM_MAX_LANDMARKS>(scratch)
    }
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
    fn run<const M: usize, const N: usize>(self, scratch: Scratch<'_>) -> Found<()> {
        let Room { map, workspace } = scratch.room::<T, M, N>()?;
        let (poses, landmarks) = (
            self.poses.as_chunks_mut().0,
            self.landmarks.as_chunks_mut().0,
        );
        // Checked here because a map without sightings would not check it.
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
            *place = pose.as_ref().map_or([nan; 3], xytheta);
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
