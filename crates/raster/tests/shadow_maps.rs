//! Shadow maps and variance shadow maps against rays in double precision.

mod common;

use common::{SIZE, error, gpu, ground, scene, settings, square};
use niwaki_core::glam::Vec3;
use niwaki_raster::{
    Algorithm, Bias, Filter, Renderer, Settings, ShadowError, SpotLight, Variance, study,
};
use niwaki_scene::Camera;

/// Mean errors over two lights by side of the map.
fn errors(settings: Settings, sides: &[u32]) -> Option<Vec<ShadowError>> {
    let gpu = gpu()?;
    let study = study::tessellated(6_000, 1);
    let lights = study.shadow_lights(2);
    let mut renderer = Renderer::new(&gpu, study.scene.clone(), lights, settings.clone()).unwrap();
    let at = |&side: &u32| {
        renderer.set_settings(Settings { shadow_resolution: side, ..settings.clone() });
        error(&mut renderer, &study.path.at(0.1), SIZE).0
    };
    Some(sides.iter().map(at).collect())
}

const SIDES: [u32; 4] = [64, 192, 576, 1728];

#[test]
fn shadow_maps_converge_with_resolution() {
    for filter in [Filter::Nearest, Filter::Closer(1), Filter::Closer(3)] {
        let taps = if filter == Filter::Closer(3) { 2.0 } else { 1.0 };
        let bias = Bias { constant: 0.5 * taps, slope: taps, normal: 0.0 };
        let settings = Settings { filter, bias, ..settings(Algorithm::ShadowMaps) };
        let Some(errors) = errors(settings, &SIDES) else { return };
        let means: Vec<f64> = errors.iter().map(ShadowError::mean).collect();
        println!("{filter:?}: {means:.4?}");
        assert!(means.windows(2).all(|w| w[1] < 0.75 * w[0]), "{filter:?}: {means:?}");
        assert!(means[3] < 0.02, "{filter:?}: {means:?}");
    }
}

/// By the finest level alone, with the resolution of the map.
#[test]
fn variance_shadow_maps_converge_with_resolution() {
    let variance = Variance { most_filter: 1.0, ..Variance::default() };
    let settings = Settings { variance, ..settings(Algorithm::VarianceShadowMaps) };
    let Some(errors) = errors(settings, &SIDES) else { return };
    let means: Vec<f64> = errors.iter().map(ShadowError::mean).collect();
    println!("{means:.4?}");
    assert!(means.windows(2).all(|w| w[1] < 0.75 * w[0]), "{means:?}");
    assert!(means[3] < 0.015, "{means:?}");
}

/// With their levels, which filter as much as a pixel of the image covers, when the image grows
/// with the map; with the map alone they stay as soft as the image's pixels.
#[test]
fn filtered_variance_shadow_maps_converge_as_image_and_map_grow() {
    let Some(gpu) = gpu() else { return };
    let study = study::tessellated(6_000, 1);
    let lights = study.shadow_lights(2);
    let mut renderer =
        Renderer::new(&gpu, study.scene.clone(), lights, settings(Algorithm::VarianceShadowMaps))
            .unwrap();
    let means = [1, 2, 4].map(|n| {
        let size = [80 * n, 45 * n];
        renderer.set_settings(Settings {
            shadow_resolution: 256 * n,
            ..Settings::new(Algorithm::VarianceShadowMaps, size[0], size[1])
        });
        error(&mut renderer, &study.path.at(0.1), size).0.mean()
    });
    println!("{means:.4?}");
    assert!(means.windows(2).all(|w| w[1] < 0.75 * w[0]), "{means:?}");
}

/// Without bias a map's pixels shade the surfaces they were drawn from; the default ends that.
#[test]
fn bias_trades_acne_for_leaks() {
    let lost = |bias| {
        let settings =
            Settings { filter: Filter::Nearest, bias, ..settings(Algorithm::ShadowMaps) };
        errors(settings, &[256]).map(|e| (e[0].leaked_and_lost()[1], e[0].leaked))
    };
    let (Some(none), Some(default)) = (lost(Bias::NONE), lost(Bias::default())) else { return };
    let Some(much) = lost(Bias { constant: 30.0, ..Bias::default() }) else { return };
    println!("none {none:.4?}, default {default:.4?}, much {much:.4?}");
    assert!(none.0 > 0.2 && default.0 < 0.02, "{none:?} {default:?}");
    assert!(much.1 > 1.5 * default.1, "{much:?} {default:?}");
}

/// Light bleeds where two things that cast shadows lie far apart behind one another: the variance
/// of depth is large along the outline of the first, and Chebyshev's bound, which knows nothing but
/// mean and variance, lets light through to the second's shadow. Ordinary maps have none of it.
#[test]
fn variance_maps_bleed_behind_two_layers_and_the_setting_darkens_it() {
    let Some(gpu) = gpu() else { return };
    let (mut positions, mut indices) = ground();
    // A small square high up, and a large one just above the ground, in whose shadow all is.
    let high = Vec3::new(0.0, 3.0, 0.0);
    square(&mut positions, &mut indices, high, [Vec3::Z * 0.5, Vec3::X * 0.5]);
    let low = Vec3::new(0.0, 0.3, 0.0);
    square(&mut positions, &mut indices, low, [Vec3::Z * 4.0, Vec3::X * 4.0]);
    let light = SpotLight::aimed(Vec3::new(0.3, 5.0, 0.2), Vec3::ZERO, 0.9, 20.0, Vec3::ONE);
    // Between the large square and the ground.
    let camera = Camera::look_at(Vec3::new(0.0, 0.2, 5.5), Vec3::ZERO, Vec3::Y, 1.0);
    let scene = scene(positions, indices);
    let leaked = |algorithm, least_filter, bleeding| {
        let variance = Variance { least_filter, bleeding, ..Variance::default() };
        let settings = Settings { variance, shadow_resolution: 256, ..settings(algorithm) };
        let mut renderer = Renderer::new(&gpu, scene.clone(), vec![light], settings).unwrap();
        let (error, _) = error(&mut renderer, &camera, SIZE);
        assert!(error.facing() > 1_000, "{error:?}");
        error.leaked_and_lost()[0]
    };
    let plain = leaked(Algorithm::ShadowMaps, 1.0, 0.0);
    let bleeds = leaked(Algorithm::VarianceShadowMaps, 16.0, 0.0);
    let reduced = leaked(Algorithm::VarianceShadowMaps, 16.0, 0.3);
    println!("leaked: SM {plain:.4}, VSM {bleeds:.4}, reduced {reduced:.4}");
    assert!(bleeds > 4.0 * plain.max(1e-3), "SM {plain}, VSM {bleeds}");
    assert!(reduced < 0.6 * bleeds, "{reduced} of {bleeds}");
}
