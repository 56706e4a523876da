//! The published values: the CSV files of `assets/published`, built into the program.

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

/// A table or figure of papers IV and V.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) enum Item {
    #[serde(rename = "iv-figure-5")]
    IvFigure5,
    #[serde(rename = "iv-figure-6")]
    IvFigure6,
    #[serde(rename = "iv-figure-7")]
    IvFigure7,
    #[serde(rename = "iv-figure-8")]
    IvFigure8,
    #[serde(rename = "v-table-1")]
    VTable1,
    #[serde(rename = "v-table-2")]
    VTable2,
    #[serde(rename = "v-table-3")]
    VTable3,
    #[serde(rename = "v-table-4")]
    VTable4,
    #[serde(rename = "v-table-5")]
    VTable5,
    #[serde(rename = "v-figure-4")]
    VFigure4,
}

macro_rules! file {
    ($name:literal) => {
        include_str!(concat!("../../../assets/published/", $name, ".csv"))
    };
}

impl Item {
    /// All, in the order of the report.
    pub(crate) const ALL: [Self; 10] = [
        Self::IvFigure5,
        Self::IvFigure6,
        Self::IvFigure7,
        Self::IvFigure8,
        Self::VTable1,
        Self::VTable2,
        Self::VTable3,
        Self::VTable4,
        Self::VTable5,
        Self::VFigure4,
    ];

    /// The name in files.
    pub(crate) const fn id(self) -> &'static str {
        match self {
            Self::IvFigure5 => "iv-figure-5",
            Self::IvFigure6 => "iv-figure-6",
            Self::IvFigure7 => "iv-figure-7",
            Self::IvFigure8 => "iv-figure-8",
            Self::VTable1 => "v-table-1",
            Self::VTable2 => "v-table-2",
            Self::VTable3 => "v-table-3",
            Self::VTable4 => "v-table-4",
            Self::VTable5 => "v-table-5",
            Self::VFigure4 => "v-figure-4",
        }
    }

    /// The heading.
    pub(crate) const fn title(self) -> &'static str {
        match self {
            Self::IvFigure5 => "Paper IV, figure 5: build times and path tracing",
            Self::IvFigure6 => "Paper IV, figure 6: steps of Bonsai on San Miguel",
            Self::IvFigure7 => "Paper IV, figure 7: averages",
            Self::IvFigure8 => "Paper IV, figure 8: SAH cost (C_I = 2, C_L = 0, C_T = 1)",
            Self::VTable1 => "Paper V, table 1: build times and path tracing",
            Self::VTable2 => "Paper V, table 2: path tracing through binary trees",
            Self::VTable3 => "Paper V, table 3: references added by splitting",
            Self::VTable4 => "Paper V, table 4: time of split partitioning",
            Self::VTable5 => "Paper V, table 5: SAH cost (C_I = 1, C_L = 0, C_T = 1)",
            Self::VFigure4 => "Paper V, figure 4: scaling with threads on Power Plant",
        }
    }

    /// The paper.
    #[cfg(test)]
    pub(crate) const fn paper(self) -> &'static str {
        match self {
            Self::IvFigure5 | Self::IvFigure6 | Self::IvFigure7 | Self::IvFigure8 => "IV",
            _ => "V",
        }
    }

    /// The builder that others are relative to; none where values are shares by themselves.
    pub(crate) const fn baseline(self) -> Option<&'static str> {
        match self {
            Self::IvFigure5 | Self::IvFigure8 => Some("SweepSAH"),
            Self::VTable1 | Self::VTable2 | Self::VTable5 => Some("SWEEPSAH"),
            _ => None,
        }
    }

    const fn csv(self) -> &'static str {
        match self {
            Self::IvFigure5 => file!("iv-figure-5"),
            Self::IvFigure6 => file!("iv-figure-6"),
            Self::IvFigure7 => file!("iv-figure-7"),
            Self::IvFigure8 => file!("iv-figure-8"),
            Self::VTable1 => file!("v-table-1"),
            Self::VTable2 => file!("v-table-2"),
            Self::VTable3 => file!("v-table-3"),
            Self::VTable4 => file!("v-table-4"),
            Self::VTable5 => file!("v-table-5"),
            Self::VFigure4 => file!("v-figure-4"),
        }
    }
}

/// The scene's name of averages.
pub(crate) const AVERAGE: &str = "(average)";

/// One published value.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct Value {
    pub(crate) item: Item,
    pub(crate) scene: String,
    pub(crate) builder: String,
    pub(crate) quantity: String,
    pub(crate) unit: String,
    pub(crate) value: f64,
}

#[derive(Debug, Deserialize)]
struct Size {
    paper: String,
    scene: String,
    triangles: usize,
}

/// All published values.
#[derive(Debug)]
pub(crate) struct Published {
    values: Vec<Value>,
    sizes: Vec<Size>,
}

fn reader(text: &str) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes())
}

/// Each name once, in the order of appearance.
fn once<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

impl Published {
    /// Reads the files.
    pub(crate) fn read() -> Result<Self> {
        let mut values: Vec<Value> = Vec::new();
        for item in Item::ALL {
            for value in reader(item.csv()).deserialize() {
                let value: Value = value.with_context(|| format!("{}.csv", item.id()))?;
                if value.item != item {
                    bail!("{}.csv has a row of {}", item.id(), value.item.id());
                }
                values.push(value);
            }
        }
        let sizes = reader(file!("scenes")).deserialize().collect::<Result<_, _>>();
        Ok(Self { values, sizes: sizes.context("scenes.csv")? })
    }

    /// The values of an item, in the order of its file.
    pub(crate) fn of(&self, item: Item) -> impl Iterator<Item = &Value> {
        self.values.iter().filter(move |value| value.item == item)
    }

    /// The scenes of an item.
    pub(crate) fn scenes(&self, item: Item) -> Vec<&str> {
        once(self.of(item).map(|value| value.scene.as_str()))
    }

    /// The builders of an item.
    pub(crate) fn builders(&self, item: Item) -> Vec<&str> {
        once(self.of(item).map(|value| value.builder.as_str()))
    }

    /// A value, in its unit.
    pub(crate) fn get(
        &self,
        item: Item,
        scene: &str,
        builder: &str,
        quantity: &str,
    ) -> Option<f64> {
        self.of(item)
            .find(|v| v.scene == scene && v.builder == builder && v.quantity == quantity)
            .map(|v| v.value)
    }

    /// Triangles of a scene in a paper.
    pub(crate) fn triangles(&self, paper: &str, scene: &str) -> Option<usize> {
        self.sizes.iter().find(|s| s.paper == paper && s.scene == scene).map(|s| s.triangles)
    }

    /// The triangles of a scene in the papers that have it.
    pub(crate) fn sizes(&self, scene: &str) -> Vec<usize> {
        self.sizes.iter().filter(|s| s.scene == scene).map(|s| s.triangles).collect()
    }

    /// All scenes of both papers.
    pub(crate) fn all_scenes(&self) -> Vec<&str> {
        once(self.sizes.iter().map(|size| size.scene.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::names;

    fn mean(values: impl Iterator<Item = f64>) -> f64 {
        let values: Vec<_> = values.collect();
        values.iter().sum::<f64>() / values.len() as f64
    }

    #[test]
    fn every_file_is_complete_and_has_known_names() {
        let published = Published::read().unwrap();
        let counts = Item::ALL.map(|item| published.of(item).count());
        // Scenes × builders × quantities, but for the two figures that are drawn.
        let expected =
            [14 * 7 * 2, 3, 7 * 3, 14 * 7, 12 * 7 * 3, 6 * 2 * 2, 12 * 3, 12 * 2, 12 * 7, 4];
        assert_eq!(counts, expected);
        let mut keys = Vec::new();
        for value in &published.values {
            assert!(value.value > 0.0, "{value:?}");
            assert!(
                value.scene == AVERAGE || names::scene(&value.scene).is_some(),
                "unknown scene: {value:?}"
            );
            assert!(!names::candidates(&value.builder).is_empty(), "unknown builder: {value:?}");
            let unit = match value.quantity.as_str() {
                "build" | "frame" | "split time" if value.item != Item::IvFigure7 => "ms",
                "sah" if value.item != Item::IvFigure7 => "cost",
                "scaling" => "rank",
                _ => "percent",
            };
            assert_eq!(value.unit, unit, "{value:?}");
            keys.push((value.item, &value.scene, &value.builder, &value.quantity));
            if value.scene != AVERAGE {
                assert!(published.triangles(value.item.paper(), &value.scene).is_some());
            }
        }
        keys.sort();
        assert!(keys.windows(2).all(|k| k[0] != k[1]), "a value is given twice");
        assert_eq!(published.all_scenes().len(), 16);
    }

    #[test]
    fn averages_of_paper_iv_follow_from_its_rows() {
        let published = Published::read().unwrap();
        let scenes = published.scenes(Item::IvFigure5);
        for builder in published.builders(Item::IvFigure7) {
            let average = |q| published.get(Item::IvFigure7, AVERAGE, builder, q).unwrap();
            let ratios = |item, q| {
                let get = |scene: &&str, b| published.get(item, scene, b, q).unwrap();
                mean(scenes.iter().map(|s| get(s, builder) / get(s, "SweepSAH"))) * 100.0
            };
            // Printed without decimals; build times are rounded before.
            let build = ratios(Item::IvFigure5, "build");
            assert!((build - average("build")).abs() < 0.6, "{builder}: {build}");
            let sah = ratios(Item::IvFigure8, "sah");
            assert!((sah - average("sah")).abs() < 0.5, "{builder}: {sah}");
            // The kind of mean is not stated: harmonic, which is of times, fits all but AAC HQ and
            // P*, arithmetic fits AAC HQ.
            let speeds: Vec<_> = scenes
                .iter()
                .map(|s| published.get(Item::IvFigure5, s, builder, "performance").unwrap())
                .collect();
            let arithmetic = mean(speeds.iter().copied());
            let harmonic = 1.0 / mean(speeds.iter().map(|x| 1.0 / x));
            let printed = average("performance");
            assert!(
                (harmonic - 0.4..=arithmetic + 0.4).contains(&printed),
                "{builder}: {printed} is not between {harmonic} and {arithmetic}"
            );
        }
    }

    #[test]
    fn brackets_of_paper_v_follow_from_its_times() {
        let published = Published::read().unwrap();
        for item in [Item::VTable1, Item::VTable2] {
            for value in published.of(item).filter(|v| v.quantity == "frame relative") {
                let frame = |b| published.get(item, &value.scene, b, "frame").unwrap();
                let ratio = frame(&value.builder) / frame("SWEEPSAH") * 100.0;
                // Two brackets of table 1 are of frame times before rounding.
                assert!((ratio - value.value).abs() < 0.7, "{value:?}: {ratio}");
            }
        }
        for value in published.of(Item::VTable4).filter(|v| v.quantity == "split share") {
            let split =
                published.get(Item::VTable4, &value.scene, "BONSAIS", "split time").unwrap();
            let build = published.get(Item::VTable1, &value.scene, "BONSAIS", "build").unwrap();
            let share = split / build * 100.0;
            assert!((share - value.value).abs() <= 0.6, "{value:?}: {share}");
        }
    }
}
