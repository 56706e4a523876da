// Frames over binary trees.
//!import trace_binary
//!import tracer/frame
