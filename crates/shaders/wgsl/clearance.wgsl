// How far from a surface the rays that leave it begin.

// niwaki_render::offset::CLEARANCE, and what forming a point in f32 errs by.
const CLEARANCE: f32 = 1.9073523e-6;
const POINT_ERROR: f32 = 9.6e-7;
