//! The twin against the CPU builder, and every stage of the kernels against the twin.
