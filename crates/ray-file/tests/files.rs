//! Rays from text and bytes, and the errors of both.

use niwaki_core::{Ray, glam::Vec3};
use niwaki_ray_file::{RayFileError, load, read_binary, read_csv};
use proptest::prelude::*;

fn ray(fields: [f32; 8]) -> Ray {
    let [ox, oy, oz, t_min, dx, dy, dz, t_max] = fields;
    Ray { origin: Vec3::new(ox, oy, oz), t_min, direction: Vec3::new(dx, dy, dz), t_max }
}

fn csv(text: &str) -> Result<Vec<Ray>, RayFileError> {
    read_csv(text.as_bytes())
}

fn error(text: &str) -> String {
    csv(text).unwrap_err().to_string()
}

#[test]
fn columns_come_in_any_order_and_may_be_left_out() {
    let all = "origin_x,origin_y,origin_z,t_min,direction_x,direction_y,direction_z,t_max\n\
               1,2,3,0.5,4,-5,6e-3,inf\n";
    let expected = ray([1.0, 2.0, 3.0, 0.5, 4.0, -5.0, 6e-3, f32::INFINITY]);
    assert_eq!(csv(all).unwrap(), [expected]);
    let short = "# a comment\nid, DX ,dy,dz,oz,oy,ox\n7, 4,-5,6e-3, 3,2,1\n\n8,4,-5,6e-3,3,2,1";
    assert_eq!(csv(short).unwrap(), [Ray { t_min: 0.0, ..expected }; 2]);
    assert_eq!(csv("ox,oy,oz,dx,dy,dz\n").unwrap(), []);
    assert!(csv("ox,oy,oz,dx,dy,dz\n1,2,3,nan,0,0").unwrap()[0].direction.x.is_nan());
}

#[test]
fn errors_name_line_and_column() {
    let header = "ox,oy,oz,dx,dy,dz\n";
    let bad = error(&format!("{header}1,2,3,4,5,6\n1,2,3,4,five,6\n"));
    assert!(bad.contains("line 3") && bad.contains("direction_y") && bad.contains("five"), "{bad}");
    let empty = error(&format!("{header}1,2,3,4,,6\n"));
    assert!(empty.contains("line 2") && empty.contains("direction_y"), "{empty}");
    let short = error(&format!("{header}1,2,3,4,5,6\n1,2,3\n"));
    assert!(short.contains("line: 3") || short.contains("line 3"), "{short}");
    let missing = error("ox,oy,dx,dy,dz\n1,2,3,4,5\n");
    assert!(missing.contains("origin_z is missing"), "{missing}");
    let no_header = error("1,2,3,4,5,6\n");
    assert!(no_header.contains("line 1 must name") && no_header.contains("1,2,3"), "{no_header}");
    assert!(error("ox,oy,oz,dx,dy,dz,origin_x\n").contains("origin_x is there twice"));
    assert!(error("").contains("line 1 must name"));
    let not_text = read_csv(&b"ox,oy,oz,dx,dy,dz\n1,2,3,\xff,5,6\n"[..]).unwrap_err();
    assert!(matches!(not_text, RayFileError::Csv(_)), "{not_text}");
}

#[test]
fn binary_records_are_little_endian_and_whole() {
    let fields = [1.0, 2.0, 3.0, 0.5, 4.0, -5.0, 6e-3, f32::INFINITY];
    let mut bytes: Vec<u8> = fields.iter().flat_map(|f: &f32| f.to_le_bytes()).collect();
    assert_eq!(&bytes[..4], [0, 0, 0x80, 0x3f]);
    bytes.extend(bytes.clone());
    assert_eq!(read_binary(&bytes[..]).unwrap(), [ray(fields); 2]);
    assert_eq!(read_binary(&[][..]).unwrap(), []);
    let error = read_binary(&bytes[..63]).unwrap_err();
    assert!(matches!(error, RayFileError::PartialRecord { bytes: 63 }));
    let text = error.to_string();
    assert!(text.contains("63 bytes") && text.contains("31 more"), "{text}");
}

#[test]
fn the_name_of_a_file_says_what_is_in_it() {
    let folder = std::env::temp_dir().join(format!("niwaki-ray-file-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let text = folder.join("rays.CSV");
    std::fs::write(&text, "ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6\n").unwrap();
    assert_eq!(load(&text).unwrap().len(), 1);
    let binary = folder.join("rays.bin");
    std::fs::write(&binary, [0; 64]).unwrap();
    assert_eq!(load(&binary).unwrap().len(), 2);
    assert!(matches!(load(&folder.join("none")), Err(RayFileError::Io(_))));
    std::fs::remove_dir_all(folder).unwrap();
}

proptest! {
    /// Text with the fewest digits that tell floats apart reads as the same bits.
    #[test]
    fn numbers_survive_text_and_bytes(rows in prop::collection::vec(prop::array::uniform8(any::<f32>()), 0..20)) {
        let line = |row: &[f32; 8]| row.map(|x| format!("{x:?}")).join(",");
        let lines: Vec<_> = rows.iter().map(line).collect();
        let found = csv(&format!("ox,oy,oz,tmin,dx,dy,dz,tmax\n{}", lines.join("\n"))).unwrap();
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let expected: Vec<Ray> = rows.into_iter().map(ray).collect();
        prop_assert_eq!(&found, &expected);
        prop_assert_eq!(read_binary(&bytes[..]).unwrap(), expected);
    }
}
