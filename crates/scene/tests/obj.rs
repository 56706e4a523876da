//! OBJ files: what is read, and how what is broken is named.

mod common;

use common::{Folder, load};
use niwaki_core::glam::{Vec2, Vec3};
use niwaki_scene::AlphaMode;

const QUAD: &str = "v 0 0 0\nv 1 0 0 1 1 1\nv 1 1 0 0\nv 0 1 0\n";

#[test]
fn polygons_groups_and_relative_indices() {
    let folder = Folder::new();
    let text = format!("{QUAD}o first\nf 1 2 3 4\ng second\nf -4 -3 -2\nf 1 1 1\n");
    let scene = load(&folder.file("a.obj", text)).unwrap();
    assert_eq!(scene.mesh.len(), 4);
    assert!(scene.dropped.is_empty(), "{}", scene.dropped);
    assert_eq!(scene.mesh.triangle(0).v2, Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(scene.mesh.triangle(2).v0, Vec3::ZERO);
    assert_eq!(scene.mesh.triangle(3).area(), 0.0);
    assert!(scene.normals.is_empty() && scene.uvs.is_empty());
}

#[test]
fn attributes_of_some_faces_only_stay_with_them() {
    let folder = Folder::new();
    let text = format!("{QUAD}vt 0.25 0.75\nvn 0 0 2\nf 1 2 3\nf 1/1/1 3/1/1 4/1/1\n");
    let scene = load(&folder.file("a.obj", text)).unwrap();
    assert_eq!(scene.mesh.len(), 2);
    assert_eq!(scene.uvs.len(), scene.mesh.positions().len());
    assert!(scene.normals.iter().all(|n| (*n - Vec3::Z).length() < 1e-6), "{:?}", scene.normals);
    let [a, _, _] = scene.mesh.indices()[1];
    assert_eq!(scene.uvs[a as usize], Vec2::new(0.25, 0.25));
}

#[test]
fn materials_come_from_the_library() {
    let folder = Folder::new();
    folder.file(
        "my lib.mtl",
        "newmtl glass\nKd 0.5\nNi 1.33\nillum 7\nnewmtl lamp\nKe 4 2 1\nKd x\n\
         newmtl mirror\nKd 0 0 0\nKs 0.9 0.8 0.7\nNs 2\nillum 3\nnewmtl leaf\nd 0.5\n\
         map_Kd missing.png\n",
    );
    let text = format!(
        "mtllib my lib.mtl\n{QUAD}usemtl glass\nf 1 2 3\nusemtl lamp\nf 1 2 3\nusemtl mirror\n\
         f 1 2 3\nusemtl leaf\nf 1 2 3\nusemtl nothing\nf 1 2 3\n"
    );
    let scene = load(&folder.file("a.obj", text)).unwrap();
    assert_eq!(scene.mesh.len(), 5);
    let glass = scene.material(0);
    assert_eq!((glass.transmission, glass.ior, glass.base_color), (1.0, 1.33, Vec3::splat(0.5)));
    assert_eq!(scene.material(1).emission, Vec3::new(4.0, 2.0, 1.0));
    let mirror = scene.material(2);
    assert_eq!((mirror.metallic, mirror.base_color), (1.0, Vec3::new(0.9, 0.8, 0.7)));
    // Ns 2 is α² = 1/2.
    assert!((mirror.roughness.powi(4) - 0.5).abs() < 1e-6);
    assert_eq!((scene.material(3).alpha, scene.material(3).alpha_mode), (0.5, AlphaMode::Blend));
    assert_eq!(scene.material(4).name, "default");
    // `Kd x` and the material that is not defined; the missing image.
    assert_eq!((scene.dropped.materials, scene.dropped.textures), (2, 1), "{}", scene.dropped);
}

#[test]
fn a_missing_library_is_reported_but_no_error() {
    let folder = Folder::new();
    let scene = load(&folder.file("a.obj", format!("mtllib no.mtl\n{QUAD}f 1 2 3\n"))).unwrap();
    assert_eq!((scene.mesh.len(), scene.dropped.materials), (1, 1));
    assert!(scene.dropped.to_string().contains("no.mtl"), "{}", scene.dropped);
}

#[test]
fn bad_faces_are_dropped_with_their_lines() {
    let folder = Folder::new();
    let text = format!(
        "{QUAD}v nan 0 0\nv 1.#INF 0 0\nf 1 2 3\nf 1 2 99\nf 1 2 5\nf 1 2\nl 1 2\nf 0 1 2\n"
    );
    let scene = load(&folder.file("a.obj", text)).unwrap();
    assert_eq!(scene.mesh.len(), 1);
    let d = &scene.dropped;
    assert_eq!(
        (d.index_out_of_range, d.non_finite_triangles, d.points_and_lines),
        (2, 1, 2),
        "{d}"
    );
    assert!(d.to_string().contains("line 8"), "{d}");
}

#[test]
fn errors_name_the_line() {
    let folder = Folder::new();
    let cases = [
        ("v 0 0 0\nv 1 x 0\n", ":2: `x` is not a number"),
        ("v 0 0 0\n\nv 1\n", ":3: `v` has 1 numbers, not 3"),
        ("v 0 0 0\nf 1 \\\n 1 q\n", ":2: `q` in `q` is no index"),
        ("v 0 0 0\nf 1/1/1/1 1 1\n", ":2: `1/1/1/1` is no corner"),
        ("\u{0}\u{1}binary\n", ":1: "),
    ];
    for (text, expected) in cases {
        let error = load(&folder.file("e.obj", text)).expect_err("the line is broken").to_string();
        assert!(error.contains("e.obj") && error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn windows_line_ends_comments_and_joined_lines() {
    let folder = Folder::new();
    let text = "# a comment\r\nv 0 0 0 # origin\r\nv 1 0 0\r\nv 0 \\\r\n 1 0\r\nf 1 2 3\r\n";
    let scene = load(&folder.file("w.obj", text)).unwrap();
    assert_eq!((scene.mesh.len(), scene.mesh.triangle(0).v2), (1, Vec3::Y));
}
