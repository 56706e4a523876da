//! Object-median and spatial-median BVH builders.
