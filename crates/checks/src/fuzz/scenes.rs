//! Scene files of any bytes.

use super::files::Folder;
use niwaki_core::{Aabb, glam::Vec3};
use niwaki_hard_cases::{
    counting::peak,
    files::{glb, square, square_json as document},
};
use niwaki_scene::{Camera, LoadError, LoadOptions, Scene, load_instanced};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::{path::Path, sync::LazyLock};

/// How a zstd frame begins.
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// What a loader may take: a file that asks for more has to be refused before it gets it.
fn options() -> LoadOptions {
    LoadOptions { max_triangles: 1 << 14, max_bytes: 1 << 20, ..LoadOptions::default() }
}

/// Bytes that loading may take at once, where they are counted (in `fuzz/`): what the options allow,
/// and some for each byte of the file.
const fn most_bytes(len: usize) -> usize {
    (256 << 20) + 1024 * len
}

thread_local! {
    /// What files may refer to, and the place of the file itself.
    static FOLDER: LazyLock<Folder> = LazyLock::new(|| {
        let folder = Folder::new("fuzz-scenes");
        folder.write("a.mtl", MTL.as_bytes());
        folder.write("a.png", &png());
        folder.write("a.bin", &square());
        folder
    });
}

pub(crate) fn obj(data: &[u8]) {
    FOLDER.with(|folder| {
        if data.starts_with(ZSTD) {
            survives(&folder.write("a.obj.zst", data), data.len());
            return;
        }
        let mut parts = data.splitn(2, |&byte| byte == 0);
        let (obj, library) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        folder.write("b.mtl", library);
        survives(&folder.write("a.obj", obj), data.len());
    });
}

pub(crate) fn gltf(data: &[u8]) {
    let name = if data.starts_with(ZSTD) { "a.glb.zst" } else { "a.gltf" };
    FOLDER.with(|folder| survives(&folder.write(name, data), data.len()));
}

/// An error that says where, or a scene that is consistent; within memory either way.
fn survives(path: &Path, len: usize) {
    let (scene, bytes) = peak(|| {
        let mut scene = load_instanced(path, &options())?;
        // A view is chosen by looking around in a grid of the scene, which takes a hundred times as
        // long as all else: for some.
        if !len.is_multiple_of(32) && scene.cameras.is_empty() {
            scene.cameras.push(Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 0.7));
        }
        Ok::<_, LoadError>(scene.flatten(&options()))
    });
    assert!(bytes <= most_bytes(len), "{bytes} bytes at once for a file of {len}");
    match scene {
        Ok(Ok(scene)) => consistent(&scene),
        Ok(Err(error)) => assert!(!error.to_string().is_empty()),
        Err(error) => {
            let text = error.to_string();
            let folder = path.parent().and_then(Path::to_str).unwrap_or_default();
            assert!(text.contains(folder), "it names no file: {text}");
        }
    }
}

fn consistent(scene: &Scene) {
    let Scene { mesh, materials, textures, .. } = scene;
    assert!(mesh.len() as u64 <= options().max_triangles);
    assert_eq!(scene.material_ids.len(), mesh.len());
    assert!(scene.material_ids.iter().all(|&id| (id as usize) < materials.len()));
    for count in [scene.normals.len(), scene.uvs.len()] {
        assert!(count == 0 || count == mesh.positions().len());
    }
    assert!(scene.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3));
    assert!(scene.uvs.iter().all(|uv| uv.is_finite()));
    for m in materials {
        let indices = [m.base_color_texture, m.metallic_roughness_texture, m.emission_texture];
        assert!(indices.into_iter().flatten().all(|i| i < textures.len()), "{m:?}");
        assert!(m.base_color.is_finite() && m.emission.is_finite(), "{m:?}");
        assert!((0.0..=1.0).contains(&m.roughness) && (0.0..=1.0).contains(&m.metallic), "{m:?}");
        assert!((0.0..=1.0).contains(&m.transmission) && m.ior.is_finite(), "{m:?}");
    }
    assert!(!scene.cameras.is_empty());
    if scene.animation.is_some() {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        scene.animate(0.5, &mut positions, &mut normals);
        assert_eq!([positions.len(), normals.len()], [mesh.positions().len(), scene.normals.len()]);
        let pose = scene.pose(0.5);
        for (i, object) in scene.objects.iter().enumerate() {
            let _ = scene.bounds_in(&pose, i, object.bounds);
        }
    }
    // Whatever is used is in the range of f32, so that builders take it.
    let bounds = mesh.bounds();
    assert!(bounds == Aabb::EMPTY || bounds.is_finite());
    let _ = scene.dropped.to_string();
}

const OBJ: &str = "mtllib a.mtl b.mtl\no x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1.5 -1e-3 2 1\nvt 0 1\n\
                   vt 0.5\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3//1\nf -1 -2 -3 -4\nl 1 2\n\
                   usemtl n\ng y\nf 1 2 \\\n3 1 2\nv nan 0 1.#INF\nf 5 1 2\ns off\n# end\n";

const MTL: &str = "newmtl m\nKd 1 0 0\nKe 0 0 0\nNs 10\nNi 1.5\nd 0.5\nTf 1 1 1\nillum 4\n\
                   map_Kd -s 1 1 1 a.png\nmap_d a.png\n";

const OTHER_MTL: &str = "newmtl n\nKd 0.5\nKs 1 1 1\nKe 3 2 1\nillum 3\nTr 0.25\nPr 0.5\nPm 1\n\
                         map_Kd a.png\nnewmtl o\nd -halo 0.5\n";

pub(crate) fn obj_seeds() -> Vec<Vec<u8>> {
    let whole = [OBJ.as_bytes(), b"\0", OTHER_MTL.as_bytes()].concat();
    vec![
        OBJ.as_bytes().to_vec(),
        compress_to_vec(OBJ.as_bytes(), CompressionLevel::Fastest),
        compress_to_vec(OBJ.as_bytes(), CompressionLevel::Uncompressed),
        whole,
        b"v 0 0 0\nv 1e30 0 0\nv 0 -1e-40 0\nf 1 2 3\n".to_vec(),
        b"mtllib b.mtl\nusemtl n\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n\0newmtl n\nillum 7\n"
            .to_vec(),
    ]
}

pub(crate) fn gltf_seeds() -> Vec<Vec<u8>> {
    let nodes = r#"{"children":[1,2]},{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,3,2,1,1]},
        {"camera":0,"rotation":[0,0,0,0],"extensions":{"KHR_lights_punctual":{"light":0}}}"#;
    let texture = r#"{"index":0,"texCoord":0,"extensions":{"KHR_texture_transform":
        {"offset":[0.5,0],"rotation":1.5,"scale":[2,2]}}}"#;
    let more = |image: &str| {
        format!(
            r#","cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1}}}}],
            "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{texture},
                "metallicRoughnessTexture":{{"index":0}},"roughnessFactor":0.5}},
                "emissiveFactor":[1,0.5,0],"alphaMode":"MASK","alphaCutoff":0.25,
                "extensions":{{"KHR_materials_ior":{{"ior":1.3}},
                    "KHR_materials_emissive_strength":{{"emissiveStrength":4}}}}}}],
            "samplers":[{{"wrapS":33071,"wrapT":33648}}],
            "textures":[{{"source":0,"sampler":0}}],"images":[{image}],
            "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"spot","intensity":2,
                "color":[1,1,0],"spot":{{"innerConeAngle":0.1,"outerConeAngle":0.5}}}}]}}}}"#
        )
    };
    let sparse = r#""count":4,"sparse":{"count":1,"indices":{"bufferView":1,"componentType":5123},
        "values":{"bufferView":0}}"#;
    let image = r#"{"uri":"a.png"}"#;
    let external = document(nodes, &more(image))
        .replace(r#"{"byteLength":60}"#, r#"{"byteLength":60,"uri":"a.bin"}"#);
    let inline = document(nodes, &more(r#"{"uri":"data:image/png;base64,iVBORw0KGgo="}"#)).replace(
        r#"{"byteLength":60}"#,
        &format!(r#"{{"byteLength":60,"uri":"data:;base64,{}"}}"#, base64(&square())),
    );
    let plain = document(r#"{"mesh":0}"#, "");
    let with_uvs = external.replace(
        r#""attributes":{"POSITION":0}"#,
        r#""attributes":{"POSITION":0,"NORMAL":0,"TEXCOORD_0":2},"material":0,"mode":5"#,
    );
    let with_uvs = with_uvs.replace(
        r#""count":6,"type":"SCALAR"}"#,
        r#""count":6,"type":"SCALAR"},
        {"bufferView":1,"componentType":5121,"count":4,"type":"VEC2","normalized":true}"#,
    );
    // Corners for differences, and two keys of one weight at the same time.
    let morph = r#","animations":[{"samplers":[{"input":2,"output":2}],
        "channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}]}]"#;
    let morph = document(r#"{"mesh":0,"weights":[0.5],"scale":[-1,1,2]}"#, morph)
        .replace(r#""indices":1}]"#, r#""indices":1,"targets":[{"POSITION":0}]}],"weights":[1]"#)
        .replace(
            r#""count":6,"type":"SCALAR"}"#,
            r#""count":6,"type":"SCALAR"},{"bufferView":0,"componentType":5126,"count":2,"type":"SCALAR"},
            {"componentType":5126,"count":4,"type":"VEC3","sparse":{"count":1,
                "indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":0}}}"#,
        );
    let sparse_morph = morph
        .replace(r#""attributes":{"POSITION":0}"#, r#""attributes":{"POSITION":0,"NORMAL":0}"#)
        .replace(r#""targets":[{"POSITION":0}]"#, r#""targets":[{"POSITION":3,"NORMAL":3}]"#);
    vec![
        glb(&plain, &square()),
        glb(&morph, &square()),
        glb(&sparse_morph, &square()),
        glb(&document(nodes, &more(image)).replace("\"count\":4", sparse), &square()),
        compress_to_vec(&glb(&plain, &square())[..], CompressionLevel::Fastest),
        external.into_bytes(),
        inline.into_bytes(),
        with_uvs.into_bytes(),
        document(r#"{"mesh":0,"translation":[1e30,0,0],"scale":[-1,1,2]},{"mesh":0}"#, "")
            .replace(r#"{"byteLength":60}"#, r#"{"byteLength":60,"uri":"a%2Ebin"}"#)
            .replace(r#""indices":1"#, r#""indices":1,"mode":6"#)
            .into_bytes(),
    ]
}

/// RFC 4648, §4, of a multiple of three bytes.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = |group: &[u8]| {
        let bits = group.iter().fold(0, |bits, &byte| bits << 8 | usize::from(byte));
        [18, 12, 6, 0].map(|shift| char::from(DIGITS[bits >> shift & 63]))
    };
    bytes.chunks(3).flat_map(digits).collect()
}

/// Two by two pixels.
fn png() -> Vec<u8> {
    let pixels = image::RgbaImage::from_fn(2, 2, |x, y| {
        image::Rgba([255, 0, 99, if x == y { 0 } else { 255 }])
    });
    let mut out = std::io::Cursor::new(Vec::new());
    pixels.write_to(&mut out, image::ImageFormat::Png).expect("memory can be written");
    out.into_inner()
}
