//! (to be written)
pub mod slice;
