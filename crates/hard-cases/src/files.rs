//! Small scene files made byte by byte, for tests of loaders.

use niwaki_core::to_u32;

/// A GLB file of a JSON and a binary chunk, each filled up to a multiple of four bytes.
#[must_use]
pub fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    let word = |out: &mut Vec<u8>, n: usize| out.extend(to_u32(n).to_le_bytes());
    word(&mut out, 2);
    word(&mut out, 12 + 16 + json.len() + binary.len());
    word(&mut out, json.len());
    out.extend(b"JSON");
    out.extend(json);
    word(&mut out, binary.len());
    out.extend(b"BIN\0");
    out.extend(binary);
    out
}

/// Four corners of a unit square and two triangles, as `f32` and `u16`: 60 bytes.
#[must_use]
pub fn square() -> Vec<u8> {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut out: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    out.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    out
}

/// A glTF document of one mesh, the [`square`], with these nodes and anything more: `more` is empty or
/// begins with a comma. Its buffer has no address, as in a GLB file.
#[must_use]
pub fn square_json(nodes: &str, more: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":60}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},
            {{"buffer":0,"byteOffset":48,"byteLength":12}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",
            "min":[0,0,0],"max":[1,1,0]}},
            {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "scenes":[{{"nodes":[0]}}],"nodes":[{nodes}]{more}}}"#
    )
}
