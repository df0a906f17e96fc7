//! Every assembled shader is parsed and validated, and shared structs lie as in Rust. No adapter is needed.

use std::mem::{offset_of, size_of};

use naga::valid::{Capabilities, ValidationFlags, Validator};
use voxclay::gpu::Coefficients;
use voxclay::gpu::layout::{
    Affine4, Fixed4, MapUniform, ObjectUniform, ResampleUniform, SplineHead, SplineLevelUniform, SplineViewUniform,
    StepRecord, WarpTet, WarpUniform,
};
use voxclay::gpu::shader::{self, SplinePaint, Texel, Variant};
use voxclay::render::Frame;

fn parsed(name: &str, source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(source)))
}

fn validate(name: &str, source: &str) {
    let module = parsed(name, source);
    if let Err(e) = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module) {
        panic!("{name}: {}", e.emit_to_string(source));
    }
}

#[test]
fn every_variant_of_slicing_is_valid() {
    let mut count = 0;
    for v in Variant::all() {
        let source = v.source();
        validate(&format!("{v:?}"), &source);
        assert!(source.contains(&format!("fn {}", v.mode.entry())));
        count += 1;
    }
    assert_eq!(count, 1152);
}

#[test]
fn the_other_passes_are_valid() {
    validate("resolve", &shader::resolve(false));
    validate("resolve of the maximum", &shader::resolve(true));
    validate("opaque", &shader::opaque());
    validate("resample", &shader::resample());
    validate("warp claim", &shader::warp_claim());
    for texel in Texel::ALL {
        validate(&format!("warp sample {texel:?}"), &shader::warp_sample(texel));
    }
    validate("spline scan", shader::spline_scan());
    validate("spline classify", &shader::spline_classify());
    validate("spline layer", &shader::spline_layer());
    for paint in SplinePaint::all() {
        validate("spline cap", &shader::spline_cap(paint));
        for coefficients in Coefficients::ALL {
            validate("spline draw", &shader::spline_draw(coefficients, paint, false));
        }
    }
    for coefficients in Coefficients::ALL {
        validate("spline emit", &shader::spline_emit(coefficients));
        let plain = SplinePaint::default();
        let early = parsed("spline draw, early", &shader::spline_draw(coefficients, plain, true));
        if let Err(e) = Validator::new(ValidationFlags::all(), Capabilities::EARLY_DEPTH_TEST).validate(&early) {
            panic!("spline draw, early: {e:?}");
        }
    }
}

/// Offsets of the members of a struct in a shader, and its size.
fn layout_of(source: &str, name: &str) -> (Vec<(String, usize)>, usize) {
    let module = parsed(name, source);
    let (_, ty) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name)).expect(name);
    let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
    (members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize)).collect(), *span as usize)
}

macro_rules! same_layout {
    ($source:expr, $name:literal, $type:ty: $($field:ident),* $(,)?) => {{
        let (members, size) = layout_of(&$source, $name);
        let rust = vec![$((stringify!($field).to_string(), offset_of!($type, $field))),*];
        // padding has a name of its own on each side
        let members: Vec<_> = members.into_iter().filter(|(n, _)| !n.starts_with("pad")).collect();
        assert_eq!(members, rust, $name);
        assert_eq!(size, size_of::<$type>(), "size of {}", $name);
    }};
}

#[test]
fn shared_structs_lie_as_in_rust() {
    let slicing = Variant::all().last().unwrap().source();
    same_layout!(slicing, "Frame", Frame:
        clip_from_local, eye, axis, light, dims, window, material, iso_color, background, size);
    same_layout!(slicing, "Object", ObjectUniform: texel, jacobian);
    same_layout!(slicing, "Map", MapUniform: target_from_local, count);
    same_layout!(slicing, "Step", StepRecord:
        kind, falloff, first, core, center, inverse_radius, vector, turns, axis_u, cells_u, axis_v, cells_v, axis_w, cells_w);
    same_layout!(shader::resample(), "Resample", ResampleUniform:
        input_from_output, local_from_output, input, output, chunk, value);
    for source in [shader::warp_claim(), shader::warp_sample(Texel::Float)] {
        same_layout!(source, "Fixed4", Fixed4: hi, lo);
        same_layout!(source, "Affine4", Affine4: x, y, z, at);
        same_layout!(source, "Tet", WarpTet: bary, rest, inner, lo, weight, size, base);
        same_layout!(source, "Warp", WarpUniform: brick, chunk, input, first, end, range, outside);
    }
    for source in [shader::spline_classify(), shader::spline_emit(Coefficients::Stored)] {
        same_layout!(source, "Level", SplineLevelUniform: dims, blocks, iso, room);
        same_layout!(source, "Head", SplineHead:
            over_blocks, blocks, over_chunks, numbers, wanted_blocks, wanted_tets, wanted_cubes,
            first, count, draws);
    }
    for source in [
        shader::spline_draw(Coefficients::OnTheFly, SplinePaint::default(), false),
        shader::spline_cap(SplinePaint::default()),
    ] {
        same_layout!(source, "View", SplineViewUniform:
            clip_from_voxel, world_from_voxel, covariant, origin, origin_low, across, across_low, down, down_low, eye,
            eye_low, dims, iso, planes, normals, tint, positive, negative, window, shell,
            peel, unit, caps);
    }
}
