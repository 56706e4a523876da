//! Scenes from OBJ and glTF files and from seeded procedural generators.
