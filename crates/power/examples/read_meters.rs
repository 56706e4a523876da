//! Lists the meters of this machine and reads them for a second.

use niwaki_power::{JoinedMeter, Recorder, RecorderOptions, TraceReader, find_meters};
use std::time::{Duration, Instant};

fn main() -> Result<(), niwaki_power::PowerError> {
    let (meters, missing) = find_meters();
    for error in missing {
        println!("not here: {error}");
    }
    if meters.is_empty() {
        return Ok(());
    }
    let mut recorder = Recorder::start(JoinedMeter(meters), &RecorderOptions::default())?;
    let info = recorder.info().clone();
    let end = Instant::now() + Duration::from_secs(1);
    let mut rows = 0;
    while let Some(block) = recorder.next_block()? {
        rows += block.len();
        for (column, values) in info.columns.iter().zip(&block.channels) {
            println!("{}: {:.3}", column.name, values[values.len() - 1]);
        }
        if Instant::now() > end {
            recorder.stop();
        }
    }
    println!("{}: {rows} readings, {} of them late", info.sensor.name, recorder.late());
    Ok(())
}
