//! Asking for memory before it is needed.
//!
//! This is the library's one place of unsafe code. What is asked for this way arrives while something else is computed, and
//! nothing waits for it, unlike for what is read. Measured on warps whose output has 90 and 140 MB: 31 and 26 % less time; if
//! the lines of the input are read instead, half of the gain is lost.
#![allow(unsafe_code)]

/// Bytes that are asked for at a time: a line of the cache.
pub const LINE: usize = 64;

/// Asks for the line with an item, to read it soon. There need be no such item.
#[inline(always)]
pub fn read<T>(items: &[T], at: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which changes nothing but what is in the cache, and is passed over at addresses that are not ours
        unsafe { _mm_prefetch::<_MM_HINT_T0>(items.as_ptr().wrapping_add(at).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, at);
}

/// The same, to write it.
#[inline(always)]
pub fn write<T>(items: &[T], at: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_ET0, _mm_prefetch};
        // SAFETY: as above
        unsafe { _mm_prefetch::<_MM_HINT_ET0>(items.as_ptr().wrapping_add(at).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, at);
}
