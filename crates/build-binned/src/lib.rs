//! Binned SAH BVH builder (Wald 2007).
