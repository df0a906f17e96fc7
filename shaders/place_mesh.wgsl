// The place of a fragment as interpolated over its triangle.

fn locate(in: Fragment, view: vec3f) -> Place {
    if AFFINE {
        return Place(in.front, in.back, object.jacobian);
    }
    return Place(in.front, in.back, mat3x3f(in.jacobian_x, in.jacobian_y, in.jacobian_z));
}
