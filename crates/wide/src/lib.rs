//! Wide BVH layouts collapsed from binary trees.
