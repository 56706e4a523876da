//! Exact ray-triangle decisions: the oracle that settles disagreements between kernels.
