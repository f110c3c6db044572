// SPDX-License-Identifier: MIT OR Apache-2.0
//! The probe as a program of the host, for measurements.

use crate::bearslam_measured;
use crate::kernels::{KERNELS, Kernel};
use crate::scene::Scenes;
use core::ffi::{CStr, c_char, c_int};
use core::hint::black_box;

#[link(name = "c")]
unsafe extern "C" {
    fn printf(format: *const c_char, ...) -> c_int;
}

const SCENES: u64 = 16;

#[unsafe(no_mangle)]
extern "C" fn main(count: c_int, arguments: *const *const c_char) -> c_int {
    let command = if count > 1 {
        // SAFETY: C promises `count` strings.
        unsafe { CStr::from_ptr(*arguments.add(1)) }
    } else {
        c"list"
    };
    if command == c"list" {
        KERNELS.iter().for_each(|kernel| print(kernel, SCENES));
    } else if command == c"run" {
        for kernel in &KERNELS {
            for seed in 0..SCENES {
                let scenes = Scenes::new(black_box(seed));
                bearslam_measured(kernel, &scenes);
            }
        }
    } else if command == c"stack" {
        for kernel in &KERNELS {
            let used = (0..SCENES).map(|seed| stack(kernel, &Scenes::new(black_box(seed))));
            print(kernel, used.max().unwrap_or(0));
        }
    } else {
        return 2;
    }
    0
}

fn print(kernel: &Kernel, number: u64) {
    // SAFETY: the format asks for two strings and a number of 64 bits.
    unsafe {
        printf(
            c"%s\t%s\t%lu\n".as_ptr(),
            kernel.scalar.as_ptr(),
            kernel.name.as_ptr(),
            number,
        );
    }
}

/// Bytes of stack that are looked at.
const DEPTH: usize = 1 << 16;
const PAINT: u8 = 0xa5;

/// The stack below this frame, as it was left.
#[inline(never)]
fn with_stack<R>(look: fn(&mut [core::mem::MaybeUninit<u8>; DEPTH]) -> R) -> R {
    let mut below = [const { core::mem::MaybeUninit::uninit() }; DEPTH];
    look(black_box(&mut below))
}

/// Bytes of stack that one call has written.
#[inline(never)]
fn stack(kernel: &Kernel, scenes: &Scenes) -> u64 {
    with_stack(|below| {
        below.iter_mut().for_each(|byte| {
            // SAFETY: a byte of our own.
            unsafe { byte.as_mut_ptr().write_volatile(PAINT) }
        })
    });
    bearslam_measured(kernel, scenes);
    with_stack(|below| {
        // SAFETY: not written by this function, but by the one that painted, on purpose.
        let painted =
            |byte: &core::mem::MaybeUninit<u8>| unsafe { byte.as_ptr().read_volatile() } == PAINT;
        (DEPTH - below.iter().take_while(|byte| painted(byte)).count()) as u64
    })
}
