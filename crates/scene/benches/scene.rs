//! Generating scenes, and loading one from OBJ and glTF text in memory-backed files.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_scene::{LoadOptions, Scene, automatic_camera, generate, load};
use std::{fmt::Write, hint::black_box, path::PathBuf};

const TRIANGLES: usize = 100_000;

fn scene(name: &str) -> Scene {
    generate::generate(name, TRIANGLES, 1).expect("the name is in the list")
}

fn generators(c: &mut Criterion) {
    let mut group = c.benchmark_group("generate");
    group.throughput(Throughput::Elements(TRIANGLES as u64)).sample_size(20);
    for name in generate::NAMES {
        group.bench_function(*name, |b| b.iter(|| black_box(scene(name))));
    }
    group.finish();
}

fn file(name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = std::env::temp_dir().join(format!("niwaki-bench-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).expect("the temporary folder can be written");
    path
}

fn loaders(c: &mut Criterion) {
    let mesh = scene("atrium").mesh;
    let mut obj = String::new();
    for p in mesh.positions() {
        writeln!(obj, "v {} {} {}", p.x, p.y, p.z).expect("strings can be written");
    }
    for [i, j, k] in mesh.indices() {
        writeln!(obj, "f {} {} {}", i + 1, j + 1, k + 1).expect("strings can be written");
    }
    let mut binary: Vec<u8> =
        mesh.positions().iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
    let split = binary.len();
    binary.extend(mesh.indices().iter().flatten().flat_map(|i| i.to_le_bytes()));
    let buffer = file("atrium.bin", &binary);
    let uri = buffer.file_name().unwrap_or_default().to_string_lossy();
    let (all, corners) = (binary.len(), 3 * mesh.len());
    let (vertices, rest) = (mesh.positions().len(), all - split);
    let gltf = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{all},"uri":"{uri}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{split}}},
            {{"buffer":0,"byteOffset":{split},"byteLength":{rest}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3"}},
            {{"bufferView":1,"componentType":5125,"count":{corners},"type":"SCALAR"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}]}}"#
    );
    let files = [file("atrium.obj", obj), file("atrium.gltf", gltf)];
    let mut group = c.benchmark_group("load");
    group.throughput(Throughput::Elements(mesh.len() as u64)).sample_size(20);
    for path in &files {
        let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        group.bench_function(extension, |b| {
            b.iter(|| load(black_box(path), &LoadOptions::default()).expect("the file is good"));
        });
    }
    group.bench_function("automatic camera", |b| b.iter(|| automatic_camera(black_box(&mesh))));
    group.finish();
    for path in files.iter().chain([&buffer]) {
        let _ = std::fs::remove_file(path);
    }
}

criterion_group!(benches, generators, loaders);
criterion_main!(benches);
