//! Judges bounding volume hierarchies: SAH, EPO, LCV, statistics and structural validation.
