// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every kernel in `f32` and `f64`, without std, without a heap, without a panic.
//!
//! The panic handler calls a function that does not exist, so this program links only if the
//! optimiser has removed every path to a panic. There is no allocator, so nothing that needs one
//! links either. On bare metal that is all. On a host `probe` lists the kernels, `probe run` calls
//! each on every scene through [`bearslam_measured`], where callgrind counts, and `probe stack` prints the
//! stack that each has used.
#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
mod host;
mod kernels;
mod scene;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    unsafe extern "C" {
        fn bearslam_must_not_panic() -> !;
    }
    // SAFETY: there is no such function, so there is no program in which this is called.
    unsafe { bearslam_must_not_panic() }
}

/// The one place from which kernels are called.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn bearslam_measured(kernel: &kernels::Kernel, scenes: &scene::Scenes) {
    (kernel.call)(scenes);
}

/// The entry point on bare metal: references all kernels for the linker.
#[cfg(target_os = "none")]
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    let mut seed = 0;
    loop {
        seed += 1;
        let scenes = scene::Scenes::new(core::hint::black_box(seed));
        for kernel in core::hint::black_box(&kernels::KERNELS) {
            bearslam_measured(kernel, &scenes);
        }
    }
}
