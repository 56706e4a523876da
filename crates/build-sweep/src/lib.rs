//! Full-sweep SAH BVH builder (MacDonald and Booth 1990; thesis IV section 4).
