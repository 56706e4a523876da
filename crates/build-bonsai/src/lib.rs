//! Bonsai BVH builder: mini trees, pruning and a top tree (thesis IV).
