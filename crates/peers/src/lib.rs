//! Other BVH libraries behind Niwaki's traits: Embree, found at run time, and obvhs.
