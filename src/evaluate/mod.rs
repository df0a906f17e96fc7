//! L4: from the document to what is derived from it, on the CPU or the GPU.

pub mod export;
