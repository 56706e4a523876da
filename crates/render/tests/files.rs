//! Images survive being written.

use niwaki_core::glam::Vec3;
use niwaki_render::{Image, ImageError, ToneCurve};
use std::path::PathBuf;

fn gradient() -> Image {
    let pixels = (0..20 * 10)
        .map(|i| Vec3::new(i as f32 * 0.01, 1e-5 * i as f32, 1e4 / (i + 1) as f32))
        .collect();
    Image::from_pixels(20, 10, pixels).unwrap()
}

/// A folder of its own for each test, removed at the end.
struct Folder(PathBuf);
impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("niwaki-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}
impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn exr_keeps_every_bit() {
    let folder = Folder::new("exr");
    let path = folder.0.join("image.exr");
    gradient().save_exr(&path).unwrap();
    let read = exr::prelude::read_first_rgba_layer_from_file(
        &path,
        |size, _| vec![Vec3::ZERO; size.area()],
        |pixels, at, (r, g, b, _): (f32, f32, f32, f32)| {
            pixels[at.1 * 20 + at.0] = Vec3::new(r, g, b);
        },
    )
    .unwrap();
    assert_eq!(read.layer_data.channel_data.pixels, gradient().pixels());
}

#[test]
fn png_holds_what_the_tone_curve_says() {
    let folder = Folder::new("png");
    let path = folder.0.join("image.png");
    let tone = ToneCurve::automatic();
    gradient().save_png(&path, &tone).unwrap();
    let read = image::open(&path).unwrap().into_rgb8();
    assert_eq!(read.dimensions(), (20, 10));
    assert_eq!(read.into_raw(), tone.encode(&gradient()));
}

#[test]
fn what_cannot_be_written_is_named() {
    let folder = Folder::new("errors");
    let missing = folder.0.join("none").join("image.png");
    let error = gradient().save_png(&missing, &ToneCurve::default()).unwrap_err();
    assert!(matches!(&error, ImageError::Png { path, .. } if *path == missing));
    assert!(error.to_string().contains("image.png"));
    assert!(matches!(gradient().save_exr(&missing).unwrap_err(), ImageError::Exr { .. }));
    let empty = Image::black(0, 4);
    let path = folder.0.join("empty.png");
    assert!(matches!(empty.save_png(&path, &ToneCurve::default()), Err(ImageError::Empty { .. })));
    assert!(!path.exists());
}
