//!import hybrid/scene
// Depth in the faces of the cube map.

// tan(45.1 degrees).
const FACE_TANGENT = 1.0034968;
// No surface.
const NOWHERE = 3.0e38;

// Distance along the face's axis of a depth of its map.
fn linear_depth(z: f32) -> f32 {
    let n = frame.half_size;
    let f = frame.far;
    return n * f / (f - z * (f - n));
}

// That of a pixel, where 1 means that it shows nothing.
fn surface_depth(z: f32) -> f32 {
    return select(linear_depth(z), NOWHERE, z >= 1.0);
}

// What a pixel of a face covers at distance 1.
fn pixel_slope() -> f32 {
    return 2.0 * FACE_TANGENT / frame.face_resolution;
}

// A ray counts as behind a surface only if it is behind by more than so many pixels cover there.
const DOUBT = 4.0;

// The distance of a ray, less that.
fn less_doubt(w: f32) -> f32 {
    return w * (1.0 - DOUBT * pixel_slope());
}
