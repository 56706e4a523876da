//! Truncated, mutated and random files: an error or a scene, never a panic.

mod common;

use common::{Folder, glb, load, square, square_json};
use niwaki_scene::{LoadError, LoadOptions};
use proptest::prelude::*;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

const OBJ: &str = "mtllib a.mtl\no x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\n\
                   usemtl m\nf 1/1/1 2/1/1 3//1\nf -1 -2 -3\nl 1 2\ng y\nf 1 2 3 1 2\n";
const MTL: &str = "newmtl m\nKd 1 0 0\nKe 0 0 0\nNs 10\nNi 1.5\nd 0.5\nTf 1 1 1\nillum 4\n";

fn sample_glb() -> Vec<u8> {
    let nodes = r#"{"children":[1,2]},{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,3,2,1,1]},
        {"camera":0,"rotation":[0,0,0,0],"extensions":{"KHR_lights_punctual":{"light":0}}}"#;
    let more = r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "textures":[{"source":0}],"images":[{"bufferView":0}],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point"}]}}"#;
    let json = square_json(nodes, more);
    let sparse = r#""count":4,"sparse":{"count":1,"indices":{"bufferView":1,"componentType":5123},
        "values":{"bufferView":0}}"#;
    glb(&json.replace("\"count\":4", sparse), &square())
}

/// Whatever comes back, it must be consistent.
fn survives(name: &str, bytes: &[u8]) {
    let folder = Folder::new();
    folder.file("a.mtl", MTL);
    if let Ok(scene) = load(&folder.file(name, bytes)) {
        assert_eq!(scene.material_ids.len(), scene.mesh.len());
        assert!(scene.material_ids.iter().all(|&id| (id as usize) < scene.materials.len()));
        assert!(!scene.cameras.is_empty());
        for n in [scene.normals.len(), scene.uvs.len()] {
            assert!(n == 0 || n == scene.mesh.positions().len());
        }
    }
}

fn mutated(
    mut bytes: Vec<u8>,
    edits: &[(prop::sample::Index, u8)],
    cut: Option<prop::sample::Index>,
) -> Vec<u8> {
    for (at, value) in edits {
        let at = at.index(bytes.len());
        bytes[at] = *value;
    }
    if let Some(cut) = cut {
        bytes.truncate(cut.index(bytes.len()));
    }
    bytes
}

fn edits() -> impl Strategy<Value = Vec<(prop::sample::Index, u8)>> {
    let byte = prop_oneof![any::<u8>(), Just(b'9'), Just(b'-'), Just(b'0'), Just(b'\n')];
    prop::collection::vec((any::<prop::sample::Index>(), byte), 0..6)
}

#[test]
fn the_samples_are_good() {
    let folder = Folder::new();
    folder.file("a.mtl", MTL);
    assert_eq!(load(&folder.file("a.obj", OBJ)).unwrap().mesh.len(), 5);
    assert_eq!(load(&folder.file("a.glb", sample_glb())).unwrap().mesh.len(), 2);
}

#[test]
fn every_truncation_is_survived() {
    for n in 0..OBJ.len() {
        survives("a.obj", &OBJ.as_bytes()[..n]);
    }
    let glb = sample_glb();
    for n in (0..glb.len()).step_by(7) {
        survives("a.glb", &glb[..n]);
    }
}

#[test]
fn packed_files_are_the_same_scene_and_broken_ones_an_error() {
    let folder = Folder::new();
    folder.file("a.mtl", MTL);
    let packed = compress_to_vec(OBJ.as_bytes(), CompressionLevel::Fastest);
    let plain = load(&folder.file("a.obj", OBJ)).unwrap();
    assert_eq!(load(&folder.file("a.obj.zst", &packed)).unwrap(), plain);
    let glb = compress_to_vec(&sample_glb()[..], CompressionLevel::Fastest);
    assert_eq!(load(&folder.file("a.glb.zst", glb)).unwrap().mesh.len(), 2);
    for n in 0..packed.len() {
        let error = load(&folder.file("cut.obj.zst", &packed[..n])).expect_err("it is cut");
        assert!(error.to_string().contains("zst"), "{error}");
    }
    assert!(load(&folder.file("a.ply", OBJ)).unwrap_err().to_string().contains(".glb"));
}

/// The square in a file of its own, which a document names as it likes.
fn external(uri: &str) -> String {
    let buffer = format!(r#"{{"byteLength":60,"uri":"{uri}"}}"#);
    square_json(r#"{"mesh":0}"#, "").replace(r#"{"byteLength":60}"#, &buffer)
}

#[test]
fn files_outside_the_folder_are_read_only_if_the_caller_says_so() {
    let folder = Folder::new();
    let outer = folder.file("square.bin", square());
    let inner = outer.parent().unwrap().join("scene");
    std::fs::create_dir_all(&inner).unwrap();
    let trusting = LoadOptions { outside: true, ..LoadOptions::default() };
    let path = inner.join("a.gltf");
    let absolute = outer.to_str().unwrap().replace('\\', "/");
    for uri in ["../square.bin", "%2e%2e/square.bin", "./x/../../square.bin", &absolute] {
        std::fs::write(&path, external(uri)).unwrap();
        let error = load(&path).unwrap_err();
        assert!(matches!(error, LoadError::Outside { .. }), "{uri}: {error}");
        if !uri.contains("x/") {
            assert_eq!(niwaki_scene::load(&path, &trusting).unwrap().mesh.len(), 2, "{uri}");
        }
    }
    // An OBJ file goes without its library.
    std::fs::write(outer.with_file_name("a.mtl"), MTL).unwrap();
    let path = inner.join("a.obj");
    for library in ["../a.mtl", "..\\a.mtl"] {
        std::fs::write(&path, OBJ.replace("a.mtl", library)).unwrap();
        assert_eq!(load(&path).unwrap().dropped.materials, 2, "{library}");
        assert!(niwaki_scene::load(&path, &trusting).unwrap().dropped.materials == 0);
    }
}

#[cfg(unix)]
#[test]
fn devices_and_folders_are_no_files() {
    let folder = Folder::new();
    let trusting = LoadOptions { outside: true, ..LoadOptions::default() };
    // Reading the first would never end, opening the terminal could wait for one.
    for uri in ["/dev/zero", "/dev/tty", "."] {
        let path = folder.file("a.gltf", external(uri));
        let error = niwaki_scene::load(&path, &trusting).unwrap_err();
        assert!(error.to_string().contains("not a regular file"), "{uri}: {error}");
    }
}

#[test]
fn what_is_named_often_is_read_once() {
    let folder = Folder::new();
    // 20 GB if each was read.
    let mut square = square();
    square.resize(1 << 20, 0);
    folder.file("a.bin", &square);
    let one = r#"{"byteLength":60,"uri":"a.bin"}"#;
    let json = external("a.bin").replace(one, &[one; 20_000].join(","));
    assert_eq!(load(&folder.file("a.gltf", json)).unwrap().mesh.len(), 2);
    // A fault of the library counts once, and its million lines are looked at once.
    folder.file("a.mtl", format!("newmtl m\nKd\n{}", "illum 2\n".repeat(100_000)));
    let obj = OBJ.replace("a.mtl", &["a.mtl"; 2_000].join(" "));
    let obj = format!("{}{obj}", "mtllib a.mtl\n".repeat(2_000));
    assert_eq!(load(&folder.file("a.obj", obj)).unwrap().dropped.materials, 1);
    // A hundred textures share the pixels of one image.
    let image = image::RgbaImage::from_pixel(64, 64, image::Rgba([1, 2, 3, 255]));
    image.save(folder.file("a.png", "")).unwrap();
    let list =
        |n: usize, item: &dyn Fn(usize) -> String| (0..n).map(item).collect::<Vec<_>>().join(",");
    let material =
        |i| format!(r#"{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{i}}}}}}}"#);
    let more = format!(
        r#","materials":[{}],"textures":[{}],"images":[{{"uri":"a.png"}}]"#,
        list(100, &material),
        list(100, &|_| r#"{"source":0}"#.into()),
    );
    let scene = load(&folder.file("a.glb", glb(&square_json(r#"{"mesh":0}"#, &more), &square)));
    let scene = scene.unwrap();
    assert_eq!(scene.textures.len(), 100);
    assert!(scene.textures.iter().all(|t| std::ptr::eq(t.pixels(), scene.textures[0].pixels())));
    // The limit of bytes holds for pixels too: 16 KiB of them come out of some hundred bytes.
    let path = folder.file("b.glb", glb(&square_json(r#"{"mesh":0}"#, &more), &common::square()));
    let limit = |max_bytes| LoadOptions { max_bytes, ..LoadOptions::default() };
    let size = std::fs::metadata(&path).unwrap().len();
    assert!(size < 16 << 10);
    let scene = niwaki_scene::load(&path, &limit(size)).unwrap();
    assert_eq!((scene.textures.len(), scene.dropped.textures), (0, 100), "{}", scene.dropped);
}

#[test]
fn elements_from_nothing_are_few_all_together() {
    let folder = Folder::new();
    let primitive = r#"{"attributes":{"POSITION":0}}"#;
    let many = |count: u32, primitives: usize| {
        let json = square_json(r#"{"mesh":0}"#, "")
            .replace(
                r#"{"attributes":{"POSITION":0},"indices":1}"#,
                &[primitive; 1000][..primitives].join(","),
            )
            .replace(
                r#""bufferView":0,"componentType":5126,"count":4"#,
                &format!(r#""componentType":5126,"count":{count}"#),
            );
        load(&folder.file("a.glb", glb(&json, &square())))
    };
    assert_eq!(many(300, 10).unwrap().mesh.len(), 1000);
    for (count, primitives) in [(1 << 20, 1000), (u32::MAX, 1), (300_000, 100)] {
        let error = many(count, primitives).unwrap_err().to_string();
        assert!(error.contains("claims") && error.contains("POSITION"), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn mutated_obj(edits in edits(), cut in any::<Option<prop::sample::Index>>()) {
        survives("a.obj", &mutated(OBJ.as_bytes().to_vec(), &edits, cut));
    }

    #[test]
    fn mutated_glb(edits in edits()) {
        survives("a.glb", &mutated(sample_glb(), &edits, None));
    }

    #[test]
    fn mutated_mtl(edits in edits(), cut in any::<Option<prop::sample::Index>>()) {
        let folder = Folder::new();
        folder.file("a.mtl", mutated(MTL.as_bytes().to_vec(), &edits, cut));
        prop_assert_eq!(load(&folder.file("a.obj", OBJ)).unwrap().mesh.len(), 5);
    }

    #[test]
    fn mutated_zst(edits in edits()) {
        let packed = compress_to_vec(OBJ.as_bytes(), CompressionLevel::Fastest);
        survives("a.obj.zst", &mutated(packed, &edits, None));
    }

    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for name in ["a.obj", "a.gltf", "a.glb", "a.obj.zst"] {
            survives(name, &bytes);
        }
        let mut with_magic = b"glTF\x02\0\0\0".to_vec();
        with_magic.extend(&bytes);
        survives("a.glb", &with_magic);
    }
}
