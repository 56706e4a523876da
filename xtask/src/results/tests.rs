use super::*;

/// A build row whose times are `ms`, `ms / 2` and `2 ms`.
pub(crate) fn build(scene: &str, builder: &str, threads: usize, ms: f64) -> BuildRow {
    BuildRow {
        run: 0,
        scene: scene.into(),
        triangles: 1000,
        source: Source::Niwaki,
        builder: builder.into(),
        threads,
        repeats: 3,
        ms_median: ms,
        ms_min: ms / 2.0,
        ms_wide_median: Some(2.0 * ms),
        ms_commit_median: None,
        references: 1000,
        nodes: 999,
        bytes: 40_000,
        peak_bytes: Some(100_000),
        sah: Some(50.0),
        sah_constants: SahConstants::THESIS_IV.into(),
        epo: Some(1.0),
        epo_standard_error: Some(0.0),
        depth: 20,
    }
}

/// A trace row.
pub(crate) fn trace(scene: &str, builder: &str, threads: usize, mrays: f64) -> TraceRow {
    TraceRow {
        run: 0,
        scene: scene.into(),
        triangles: 1000,
        source: Source::Niwaki,
        builder: builder.into(),
        kernel: "avx2".into(),
        width: Some(8),
        rays_per_call: 1,
        rays: "camera".into(),
        query: "closest".into(),
        threads,
        ray_count: 1000,
        timed_rays: 1000,
        repeats: 3,
        batch: 0,
        mrays_per_s: mrays,
        bytes: None,
        hits: 900,
        boxes_per_ray: None,
        triangles_per_ray: None,
    }
}

#[test]
fn rows_carry_their_kind_and_survive_a_round_trip() {
    let results = Results {
        runs: vec![Run::default()],
        rows: vec![
            Row::Build(build("a", "sweep", 1, 1.0)),
            Row::Trace(trace("a", "sweep", 1, 3.0)),
        ],
        ..Results::default()
    };
    let json = serde_json::to_string(&results).unwrap();
    assert!(json.starts_with(r#"{"schema":1,"#), "{json}");
    assert!(json.contains(r#""kind":"build","#) && json.contains(r#""kind":"trace","#));
    assert!(json.contains(r#""source":"niwaki""#));
    assert_eq!(Results::parse(&json).unwrap(), results);
}

#[test]
fn files_of_another_kind_are_refused_with_the_reason() {
    for (text, reason) in [
        ("{", "not JSON"),
        ("{}", "no `schema`"),
        (r#"{"schema": 2}"#, "schema is 2"),
        (r#"{"schema": 1, "runs": [], "scenes": [], "rows": [7]}"#, "expected"),
    ] {
        let error = format!("{:#}", Results::parse(text).unwrap_err());
        assert!(error.contains(reason), "{error}");
    }
    let mut results = Results { runs: vec![Run::default()], ..Results::default() };
    results.rows.push(Row::Build(BuildRow { run: 1, ..build("a", "sweep", 1, 1.0) }));
    let json = serde_json::to_string(&results).unwrap();
    assert!(Results::parse(&json).unwrap_err().to_string().contains("run 1"));
}

#[test]
fn merged_rows_keep_their_run() {
    let part = |name: &str, date: &str| Results {
        runs: vec![Run { date: date.into(), ..Run::default() }],
        scenes: vec![SceneInfo { name: name.into(), ..SceneInfo::default() }],
        rows: vec![Row::Build(build(name, "sweep", 1, 1.0))],
        ..Results::default()
    };
    let mut second = part("b", "2");
    second.scenes[0].picture = Some("b.png".into());
    let whole = Results::merge([part("a", "1"), part("b", "1"), second]);
    assert_eq!(whole.rows.iter().map(Row::run).collect::<Vec<_>>(), [0, 1, 2]);
    assert_eq!(whole.scenes.len(), 2, "the same scene appears once");
    assert_eq!(whole.scenes[1].picture.as_deref(), Some(Path::new("b.png")));
}

#[test]
fn pictures_are_found_from_wherever_the_file_is_read() {
    let folder = std::env::temp_dir().join(format!("niwaki-results-{}", std::process::id()));
    let mut results = Results::default();
    results.add_scene(SceneInfo {
        picture: Some(folder.join("pictures/a.png")),
        ..SceneInfo::default()
    });
    let file = folder.join("results.json");
    results.write(&file).unwrap();
    assert!(std::fs::read_to_string(&file).unwrap().contains(r#""picture": "pictures/a.png""#));
    assert_eq!(Results::read(&file).unwrap(), results);
    std::fs::remove_dir_all(folder).unwrap();
}
