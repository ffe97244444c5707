//! Treats denormal numbers as zero in Embree's calls, as its manual requires.

/// The bits "flush to zero" and "denormals are zero" of the control register.
#[cfg(target_arch = "x86_64")]
const FLUSH: u32 = 1 << 15 | 1 << 6;

/// Runs `calls` with denormals treated as zero. Besides calling Embree, `calls` may move numbers,
/// but must not compute with them.
#[inline]
pub fn with_flushed_denormals<T>(calls: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    {
        let before = control();
        set_control(before | FLUSH);
        let result = calls();
        set_control(before);
        result
    }
    #[cfg(not(target_arch = "x86_64"))]
    calls()
}

#[cfg(target_arch = "x86_64")]
fn control() -> u32 {
    let mut value = 0u32;
    // SAFETY: writes the register to a variable of its size.
    unsafe {
        std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags))
    };
    value
}

#[cfg(target_arch = "x86_64")]
fn set_control(value: u32) {
    // SAFETY: reads a variable of the register's size. Only the two bits about denormals change,
    // and until they change back only foreign code and moves run, which they do not affect.
    unsafe {
        std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags))
    };
}
