// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a static library needs besides the C interface of the crate: somebody who handles panics.
//!
//! It is a crate of its own because a program may have one panic handler only, and Rust programs that use
//! bearslam have theirs.
#![no_std]

pub use bearslam::capi::*;

/// There is none: the tests look for panics in the program that they link.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
