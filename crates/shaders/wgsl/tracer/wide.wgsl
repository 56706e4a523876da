// Frames over wide trees.
//!import trace_wide
//!import tracer/frame
