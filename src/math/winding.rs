//! What closed loops in a plane wind round.

pub use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::core::solver::Solver;
use i_overlay::float::overlay::{FloatOverlay, OverlayOptions};

/// Outer loops, anticlockwise, each with its holes, of what the loops wind round; edges meet at their ends only.
pub fn shapes(loops: &[Vec<[f64; 2]>], rule: FillRule) -> Vec<Vec<Vec<[f64; 2]>>> {
    let mut options = OverlayOptions::default();
    // points are kept, or the outlines of neighbouring planes would differ more than the planes do
    options.preserve_input_collinear = true;
    options.preserve_output_collinear = true;
    options.clean_result = false;
    FloatOverlay::<[f64; 2], i64>::from_subj_custom(&loops, options, Solver::default())
        .overlay(OverlayRule::Subject, rule)
}
