//! Parsing, repair, filters and the whole analysis, per row of six currents.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use niwaki_power::generator::{Recording, RecordingOptions};
use niwaki_power::{
    AnalysisOptions, Butterworth, CleanOptions, CleanStream, PowerStream, ReadOptions, TraceFormat,
    TraceReader, TraceWriter, ZeroPhase, analyze, read_trace,
};
use std::io::Cursor;

fn benches(c: &mut Criterion) {
    let recording = Recording::new(&RecordingOptions::six_rails(1, 5.0)).expect("valid options");
    let file = |format| {
        let mut writer =
            TraceWriter::new(Vec::new(), format, recording.info()).expect("valid columns");
        let mut reader = recording.reader();
        while let Ok(Some(block)) = reader.next_block() {
            writer.write(&block).expect("memory takes it");
        }
        writer.finish().expect("memory takes it")
    };
    let mut group = c.benchmark_group("trace");
    group.sample_size(10).throughput(Throughput::Elements(recording.rows()));
    for (name, format) in [("csv", TraceFormat::Csv), ("binary", TraceFormat::Binary)] {
        let bytes = file(format);
        let open = || {
            let options = ReadOptions { threads: 1, ..ReadOptions::default() };
            read_trace(Box::new(Cursor::new(bytes.clone())), &options)
        };
        group.bench_function(format!("read {name}"), |b| {
            b.iter(|| {
                let mut reader = open().expect("a trace");
                let mut rows = 0;
                while let Ok(Some(block)) = reader.next_block() {
                    rows += block.len();
                }
                rows
            });
        });
        group.bench_function(format!("repair {name}"), |b| {
            b.iter(|| {
                let reader = open().expect("a trace");
                let mut stream =
                    CleanStream::new(reader, &recording.rails(), &CleanOptions::default())
                        .expect("rails");
                let mut rows = 0;
                while let Ok(Some(block)) = stream.next_power() {
                    rows += block.watts.len();
                }
                rows
            });
        });
        let options =
            AnalysisOptions { rails: Some(recording.rails()), ..AnalysisOptions::default() };
        group.bench_function(format!("analyse {name}"), |b| {
            b.iter(|| analyze(open, Some(&recording.log()), &options).expect("an analysis"));
        });
    }
    group.finish();

    let samples: Vec<f64> = (0..1 << 20).map(|i| f64::from(i % 977)).collect();
    let mut group = c.benchmark_group("filter");
    group.sample_size(10).throughput(Throughput::Elements(samples.len() as u64));
    let filter = Butterworth::low_pass(4, 2e3, 40e3).expect("a valid design");
    group.bench_function("both ways, whole", |b| b.iter(|| filter.filter_both_ways(&samples)));
    group.bench_function("both ways, stream", |b| {
        b.iter(|| {
            let mut stream = ZeroPhase::new(filter.clone(), 1e-6).expect("a valid tolerance");
            let mut out = Vec::new();
            samples.chunks(16_384).for_each(|part| stream.push(part, &mut out));
            stream.finish(&mut out);
            out
        });
    });
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);
