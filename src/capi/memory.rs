// SPDX-License-Identifier: MIT OR Apache-2.0
//! The memory of the caller: pointers become slices, and raw bytes the storage of a refinement.
//!
//! All code that dereferences pointers from C is here; the calls only pass on the caller's promise about them.

use super::status::{BearslamStatus, Found};
use crate::fixed::{FixedMap, Workspace};
use crate::scalar::Real;
use core::ffi::c_void;
use core::marker::PhantomData;
use core::slice;

/// The promise of a caller from C about every pointer passed with its call, for the duration of the call.
#[derive(Clone, Copy)]
pub(super) struct Memory<'a> {
    promise: PhantomData<&'a mut [f64]>,
}

impl<'a> Memory<'a> {
    /// Accepts the promise.
    ///
    /// # Safety
    /// For the lifetime `'a`, every non-null pointer passed to this value has room for the numbers requested
    /// from it; nothing else writes what is read through it, and nothing else reads or writes what is written.
    /// Only numbers (`f32`, `f64`, `usize`) are requested.
    pub(super) unsafe fn promised() -> Self {
        let promise = PhantomData;
        Self { promise }
    }

    /// `count` rows of `width` numbers to read.
    pub(super) fn input<T>(self, pointer: *const T, count: usize, width: usize) -> Found<&'a [T]> {
        let length = check(pointer, count, width)?;
        // SAFETY: not null, aligned, no longer than memory can be; the rest is the promise.
        Ok(unsafe { slice::from_raw_parts(pointer, length) })
    }

    /// `count` rows of `width` numbers to write.
    pub(super) fn output<T>(
        self,
        pointer: *mut T,
        count: usize,
        width: usize,
    ) -> Found<&'a mut [T]> {
        let length = check(pointer, count, width)?;
        // SAFETY: not null, aligned, no longer than memory can be; the rest is the promise. Any bit pattern is
        // a valid number, so memory that C has never initialised is allowed.
        Ok(unsafe { slice::from_raw_parts_mut(pointer, length) })
    }

    /// Raw memory of `size` bytes, of which `needed` are required.
    pub(super) fn scratch(
        self,
        pointer: *mut c_void,
        size: usize,
        needed: usize,
    ) -> Found<Scratch<'a>> {
        if pointer.is_null() {
            return Err(BearslamStatus::NullPointer);
        }
        if size < needed {
            return Err(BearslamStatus::MemoryTooSmall);
        }
        let promise = self.promise;
        Ok(Scratch {
            pointer,
            size,
            promise,
        })
    }
}

/// Checks a pointer and returns the number of elements.
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

/// The storage of a refinement in the memory of the caller.
pub(super) struct Room<T: Real, const M: usize, const N: usize> {
    pub(super) map: FixedMap<T, M, N>,
    pub(super) workspace: Workspace<T, M, N>,
}

/// Raw memory of the caller that is not null.
pub(super) struct Scratch<'a> {
    pointer: *mut c_void,
    size: usize,
    promise: PhantomData<&'a mut [f64]>,
}

impl<'a> Scratch<'a> {
    /// Initialises empty storage in this memory.
    pub(super) fn room<T: Real, const M: usize, const N: usize>(
        self,
    ) -> Found<&'a mut Room<T, M, N>> {
        let room = self.pointer.cast::<Room<T, M, N>>();
        if !room.is_aligned() {
            return Err(BearslamStatus::Misaligned);
        }
        if self.size < size_of::<Room<T, M, N>>() {
            return Err(BearslamStatus::MemoryTooSmall);
        }
        // In place, because a value returned by `new` would pass through the stack. SAFETY: aligned and large enough.
        // It consists of numbers, for which zero bits are valid (`T` is f32 or f64), and options, which are written one
        // by one.
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
