//! Tables of devices: what is published, and what is wrong with a file.

use niwaki_gpu_model::{Device, DeviceError};

#[test]
fn the_tables_are_the_published_ones() {
    // Thesis, Paper I, Table 4: M_d, D_c, D_tw, C_i, max b_o, F, c_l, c_dc, c_du.
    let table_4: [(&str, [f64; 9]); 3] = [
        ("geforce-8800", [86.0, 16.0, 32.0, 4.0, 8.0, 1.35, 420.0, 4.0, 9.8]),
        ("geforce-580", [192.0, 16.0, 32.0, 2.0, 8.0, 1.54, 550.0, 0.08, 0.66]),
        ("radeon-5870", [153.0, 20.0, 64.0, 4.0, 24.0, 0.88, 500.0, 64.0, 1.0]),
    ];
    for (name, row) in table_4 {
        let d = Device::builtin(name).unwrap();
        assert_eq!(
            row,
            [
                d.bandwidth_gb_s,
                f64::from(d.cores),
                f64::from(d.warp_size),
                d.issue_cycles,
                f64::from(d.max_blocks_per_core),
                d.clock_ghz,
                d.memory_latency_cycles,
                d.departure_delay_coalesced_cycles,
                d.departure_delay_uncoalesced_cycles,
            ],
            "{name}"
        );
    }
    // Hong and Kim: clock, bandwidth, latency, departure delays, transactions, cores.
    for (name, row) in [
        ("gtx-280", [1.3, 141.7, 450.0, 4.0, 40.0, 5.7, 30.0]),
        ("quadro-fx-5600", [1.35, 76.8, 420.0, 4.0, 10.0, 32.0, 16.0]),
    ] {
        let d = Device::builtin(name).unwrap();
        assert_eq!(
            row,
            [
                d.clock_ghz,
                d.bandwidth_gb_s,
                d.memory_latency_cycles,
                d.departure_delay_coalesced_cycles,
                d.departure_delay_uncoalesced_cycles,
                d.transactions_per_uncoalesced_load,
                f64::from(d.cores),
            ],
            "{name}"
        );
    }
}

#[test]
fn every_builtin_table_names_its_source_and_comes_back_from_toml() {
    for name in Device::builtin_names() {
        let device = Device::builtin(name).unwrap();
        assert!(device.source.contains("20"), "{name}: a year");
        assert_eq!(Device::parse(&device.to_toml(), name).unwrap(), device);
        assert_eq!(Device::load(name).unwrap(), device);
    }
}

#[test]
fn a_file_comes_back() {
    let path = std::env::temp_dir().join(format!("niwaki-device-{}.toml", std::process::id()));
    let device = Device::builtin("gtx-280").unwrap();
    device.save(&path).unwrap();
    let read = Device::load(&path);
    std::fs::remove_file(&path).unwrap();
    assert_eq!(read.unwrap(), device);
}

#[test]
fn errors_name_file_key_and_remedy() {
    let text = Device::builtin("gtx-280").unwrap().to_toml();
    let message = |text: &str| Device::parse(text, "mine.toml").unwrap_err().to_string();
    let bad = text.replace("clock_ghz = 1.3", "clock_ghz = 0.0");
    assert_eq!(
        message(&bad),
        "mine.toml: clock_ghz is 0, which has to be between 1e-9 and 1e9; give the clock of the cores in GHz"
    );
    let error = message(&text.replace("clock_ghz = 1.3", "clock_ghz = nan"));
    assert!(error.starts_with("mine.toml: clock_ghz is NaN"), "{error}");
    let error = message(&text.replace("clock_ghz", "clock_mhz"));
    assert!(error.contains("mine.toml") && error.contains("clock_mhz"), "{error}");
    let error = message(&text.replace("cores = 30\n", ""));
    assert!(error.contains("mine.toml") && error.contains("cores"), "{error}");
    let error = message(&text.replace("cores = 30", "cores = -3"));
    assert!(error.contains("cores"), "{error}");
    let error = message(&text.replace("cores = 30", "cores = 0"));
    assert!(error.contains("cores is 0"), "{error}");
    let error = message(&text.replace("load = 5.7", "load = 0.5"));
    assert!(error.contains("transactions_per_uncoalesced_load is 0.5"), "{error}");
}

#[test]
fn unknown_names_list_what_there_is() {
    let error = Device::load("geforce").unwrap_err();
    assert!(matches!(&error, DeviceError::Unknown { .. }));
    assert!(error.to_string().contains("geforce-580"), "{error}");
    let error = Device::load("no/such/file.toml").unwrap_err();
    assert!(matches!(error, DeviceError::File { .. }), "{error}");
}

#[test]
fn a_device_that_cannot_be_is_not_saved() {
    let mut device = Device::builtin("gtx-280").unwrap();
    device.issue_cycles = f64::INFINITY;
    assert!(device.save(std::env::temp_dir().join("niwaki-never.toml")).is_err());
}

#[test]
fn blocks_a_core_by_both_limits() {
    let device = Device::builtin("geforce-580").unwrap();
    // 48 warps and 8 blocks.
    assert_eq!(device.blocks_per_core(32), 8);
    assert_eq!(device.blocks_per_core(256), 6);
    assert_eq!(device.blocks_per_core(1024), 1);
    assert_eq!(device.blocks_per_core(100_000), 1);
    assert_eq!(device.blocks_per_core(0), 8);
}
