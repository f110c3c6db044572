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
        // SAFETY: C guarantees `count` strings.
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

/// Bytes of stack that are examined, and those next to the frame of [`stack`], which are not touched.
const DEPTH: usize = 1 << 16;
const MARGIN: usize = 256;
const PAINT: u8 = 0xa5;

/// Bytes of stack from the frame of this function down to the lowest that one call has written.
#[inline(never)]
fn stack(kernel: &Kernel, scenes: &Scenes) -> u64 {
    let here = 0_u8;
    let top = black_box(&raw const here).cast_mut();
    for depth in MARGIN..DEPTH {
        // SAFETY: the stack is far deeper than this, and nothing below this frame is alive.
        unsafe { top.wrapping_sub(depth).write_volatile(PAINT) }
    }
    bearslam_measured(kernel, scenes);
    let painted = |depth: &usize| {
        // SAFETY: written above, and maybe by the call.
        unsafe { top.wrapping_sub(*depth).read_volatile() == PAINT }
    };
    (DEPTH - (MARGIN..DEPTH).rev().take_while(painted).count()) as u64
}
