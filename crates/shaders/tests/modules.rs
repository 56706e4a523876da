//! Every module of the crate is valid, and translates with any value of its constants.

use niwaki_shaders::{Library, Options, names};

/// Files that are part of a module, and none by themselves.
const PARTS: [&str; 3] = ["drive", "driver/common", "tracer/frame"];

#[test]
fn every_module_is_valid() {
    let library = Library::embedded();
    for name in names().into_iter().filter(|name| !PARTS.contains(&name.as_str())) {
        library.validate(&name).unwrap_or_else(|error| panic!("{error}"));
        for entry in library.entry_points(&name).unwrap() {
            for exact in [true, false] {
                let options = Options { exact, ..Options::default() };
                let shader = library.compile(&name, &entry, &options);
                let shader = shader.unwrap_or_else(|error| panic!("{error}"));
                assert_eq!(shader.words[0], 0x0723_0203, "{}", shader.label);
            }
        }
    }
}
