//! CPU ray traversal kernels over binary and wide BVHs.
