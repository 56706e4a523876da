//! CPU reference path tracer, image output and ray recording.
