//! Imports and errors say where.

use niwaki_shaders::{BindingKind, Library, Options, ShaderError, compile};

fn library(files: &[(&'static str, &'static str)]) -> Library {
    let mut library = Library::default();
    for &(name, text) in files {
        library.insert(name, text);
    }
    library
}

#[test]
fn a_file_that_is_imported_twice_is_there_once_and_first() {
    let library = library(&[
        ("a", "//!import b\n//!import c\nfn a() -> f32 { return b() + c(); }"),
        ("b", "//!import c\nfn b() -> f32 { return c(); }"),
        ("c", "fn c() -> f32 { return 1.0; }"),
    ]);
    let composed = library.compose("a").unwrap();
    assert_eq!(composed.text.matches("fn c()").count(), 1);
    let at = |text| composed.text.find(text).unwrap();
    assert!(at("fn c()") < at("fn b()") && at("fn b()") < at("fn a()"));
    assert_eq!(composed.origin(1), Some(("c", 1)));
    assert_eq!(composed.origin(3), Some(("b", 2)));
    assert_eq!(composed.origin(6), Some(("a", 3)));
    assert_eq!((composed.origin(0), composed.origin(7)), (None, None));
    library.validate("a").unwrap();
}

#[test]
fn wrong_imports_are_named_with_their_line() {
    let library = library(&[
        ("a", "\n//!import b"),
        ("b", "//!import c"),
        ("c", "\n\n//!import a"),
        ("d", "// no import\n//!import nowhere"),
        ("e", "//!imported is a word of its own\nfn e() {}"),
    ]);
    let cycle = library.compose("a").unwrap_err();
    let chain = "a imports b imports c imports a".to_owned();
    assert_eq!(cycle, ShaderError::Cycle { file: "c".into(), line: 3, chain });
    let (file, import) = ("d".to_owned(), "nowhere".to_owned());
    let unknown = library.compose("d").unwrap_err();
    assert_eq!(unknown, ShaderError::UnknownImport { file, line: 2, import });
    assert!(matches!(library.compose("z"), Err(ShaderError::UnknownModule { .. })));
    assert!(library.validate("e").is_ok());
}

#[test]
fn a_long_chain_of_imports_needs_no_stack() {
    let mut library = Library::default();
    for i in 0..10_000 {
        library.insert(format!("f{i}"), format!("//!import f{}", i + 1));
    }
    library.insert("f10000", "");
    assert_eq!(library.compose("f0").unwrap().text.lines().count(), 10_000);
}

#[test]
fn errors_are_found_in_the_file_that_has_them() {
    let library = library(&[
        ("a", "//!import b\nfn a() -> f32 { return b(); }"),
        ("b", "// fine\nfn b() -> f32 { return c(); }"),
        ("d", "//!import e\nfn d() {}"),
        ("e", "fn e() -> u32 {\n    return 1.5;\n}"),
        ("f", "fn f( {"),
    ]);
    let place = |module| match library.validate(module).unwrap_err() {
        ShaderError::Invalid { file, line, .. } => (file, line),
        other => panic!("{other}"),
    };
    assert_eq!(place("a"), ("b".to_owned(), 2));
    assert_eq!(place("d").0, "e");
    assert_eq!(place("f"), ("f".to_owned(), 1));
}

#[test]
fn entry_points_and_constants_are_checked() {
    let options = Options { constants: &[("NO_SUCH", 1.0)], ..Options::default() };
    let unknown = compile("trace_binary", "main", &options);
    assert!(matches!(unknown, Err(ShaderError::Constant { .. })));
    let missing = compile("trace_binary", "no_such", &Options::default()).unwrap_err();
    assert!(missing.to_string().contains("persistent"), "{missing}");
    let size = Options { constants: &[("WORKGROUP", 32.0)], ..Options::default() };
    let shader = compile("trace_binary", "main", &size).unwrap();
    assert_eq!(shader.workgroup_size, [32, 1, 1]);
    assert_eq!(shader.immediate_bytes, 48);
    let named = |name: &str| shader.bindings.iter().find(|b| b.name == name).unwrap().kind;
    assert_eq!(named("rays"), BindingKind::Storage { writable: false });
    assert_eq!(named("hits"), BindingKind::Storage { writable: true });
}

#[test]
fn exact_arithmetic_is_marked() {
    let count = |exact| {
        let words =
            compile("probe", "main", &Options { exact, ..Options::default() }).unwrap().words;
        // OpDecorate x NoContraction.
        words.windows(3).filter(|w| w[0] == 3 << 16 | 71 && w[2] == 42).count()
    };
    // fma, a·b, + c, a / b, a·b.
    assert_eq!((count(true), count(false)), (5, 0));
}
