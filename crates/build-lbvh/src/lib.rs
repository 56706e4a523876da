//! Linear BVH builders over Morton codes (Lauterbach 2009, Karras 2012).
