//! One path-traced picture a scene, and one of traversal cost.

use crate::report::slug;
use crate::results::{HeatMap, SceneInfo};
use anyhow::{Context, Result};
use niwaki_render::{PathSettings, PathTracer, ToneCurve, traversal_heat_map};
use niwaki_scene::Scene;
use niwaki_trace::AutoScene;
use std::path::Path;

/// Width and height.
const SIZE: (u32, u32) = (560, 315);

/// Renders both pictures into a folder and notes them in `info`.
pub(crate) fn render(
    scene: &Scene,
    wide: &AutoScene,
    builder: &str,
    samples: u32,
    folder: &Path,
    info: &mut SceneInfo,
) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let name = format!("{}-{}", slug(&info.name), info.triangles);
    let settings =
        PathSettings { width: SIZE.0, height: SIZE.1, samples, ..PathSettings::default() };
    let image = PathTracer::new(settings).render(scene, wide);
    let path = folder.join(format!("{name}.png"));
    image.save_png(&path, &ToneCurve::automatic())?;
    info.picture = Some(path);

    let Some(camera) = scene.cameras.first() else { return Ok(()) };
    let map = traversal_heat_map(camera, SIZE.0, SIZE.1, |ray| {
        let (_, counts) = wide.closest_hit_counted(ray);
        (counts.boxes + counts.triangles) as f32
    });
    // A few extreme rays would leave the rest dark.
    let mut costs = map.costs.clone();
    costs.sort_by(f32::total_cmp);
    let top = costs.get(costs.len() * 99 / 100).copied().unwrap_or(1.0).max(1.0);
    let path = folder.join(format!("{name}-cost.png"));
    map.colorize(top).save_png(&path, &ToneCurve::default())?;
    info.heat_map = Some(HeatMap {
        picture: path,
        builder: builder.to_owned(),
        mean: map.mean(),
        top: f64::from(top),
    });
    Ok(())
}
