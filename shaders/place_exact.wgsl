// The place of a fragment by the backward map itself (slicing-exact): the reference for subdivided slices.

fn locate(in: Fragment, view: vec3f) -> Place {
    let front = backward_with_jacobian(in.local);
    let behind = in.local - view * (frame.axis.w / dot(view, frame.axis.xyz));
    return Place(front.at, to_target(behind - displaced_by(behind)), front.jacobian);
}
