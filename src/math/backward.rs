use glam::{DMat3, DVec3};

use super::OrientedBox;

/// A deformation as the answer to "where in the undeformed world does the value at this point come from".
pub trait BackwardMap: Sync {
    /// The undeformed world point whose value is seen at `p`.
    fn backward(&self, p: DVec3) -> DVec3;

    /// The same with the derivative of the map at `p` (column c is the change along world axis c).
    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3);

    /// Boxes outside whose union the map is the identity. Empty: the identity everywhere.
    fn supports(&self) -> Vec<OrientedBox>;
}

/// Nothing is deformed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Identity;

impl BackwardMap for Identity {
    fn backward(&self, p: DVec3) -> DVec3 {
        p
    }

    fn backward_with_jacobian(&self, p: DVec3) -> (DVec3, DMat3) {
        (p, DMat3::IDENTITY)
    }

    fn supports(&self) -> Vec<OrientedBox> {
        Vec::new()
    }
}
