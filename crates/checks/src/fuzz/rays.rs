//! Ray files of any bytes.

use niwaki_core::Ray;
use niwaki_hard_cases::counting::peak;
use niwaki_ray_file::{RayFileError, read_binary, read_csv};

/// Bytes that reading may take at once, where they are counted (in `fuzz/`).
const fn most_bytes(len: usize) -> usize {
    (1 << 20) + 64 * len
}

/// The bytes as text and as records.
pub(crate) fn check(data: &[u8]) {
    let ((text, records), bytes) = peak(|| (read_csv(data), read_binary(data)));
    assert!(bytes <= most_bytes(data.len()), "{bytes} bytes at once for {}", data.len());
    match records {
        Ok(rays) => {
            let bytes: Vec<u8> = rays.iter().flat_map(fields).flat_map(f32::to_le_bytes).collect();
            assert_eq!(bytes, data);
        }
        Err(RayFileError::PartialRecord { bytes }) => {
            assert!(bytes == data.len() && !bytes.is_multiple_of(32));
        }
        Err(error) => panic!("bytes in memory can be read: {error}"),
    }
    match text {
        Ok(rays) => {
            // A header and a line for each.
            let ends = data.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count();
            assert!(rays.len() <= ends, "{} rays in {} lines", rays.len(), ends + 1);
            let again = read_csv(text_of(&rays).as_bytes()).expect("it was written here");
            assert_eq!(bits(&again), bits(&rays));
        }
        Err(error) => {
            let about = |text: String| text.contains("line") || text.contains("UTF-8");
            assert!(about(error.to_string()), "it names no line: {error}");
        }
    }
}

/// In the order of a record.
fn fields(ray: &Ray) -> [f32; 8] {
    let Ray { origin: o, t_min, direction: d, t_max } = *ray;
    [o.x, o.y, o.z, t_min, d.x, d.y, d.z, t_max]
}

/// Every NaN is alike in text.
fn bits(rays: &[Ray]) -> Vec<u32> {
    let of = |x: f32| if x.is_nan() { u32::MAX } else { x.to_bits() };
    rays.iter().flat_map(fields).map(of).collect()
}

fn text_of(rays: &[Ray]) -> String {
    let mut text = "tmax,ox,oy,oz,tmin,dx,dy,dz\n".to_owned();
    for ray in rays {
        let [ox, oy, oz, t_min, dx, dy, dz, t_max] = fields(ray);
        let row = [t_max, ox, oy, oz, t_min, dx, dy, dz];
        text += &(row.map(|x| format!("{x:?}")).join(",") + "\n");
    }
    text
}

/// Good files of both kinds.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let records = [1.0_f32, -2.0, 3.5, 0.0, 0.25, -1e-3, 1e30, f32::INFINITY];
    let records: Vec<u8> = records.iter().flat_map(|x| x.to_le_bytes()).collect();
    vec![
        Vec::new(),
        records.clone(),
        records.repeat(3),
        b"ox,oy,oz,dx,dy,dz\n1,2,3,4,5,6\n-1,.5,1e3,0,-0.0,1\n".to_vec(),
        b"# rays\r\n id, T_MIN ,origin_x,oy,origin_z,dx,direction_y,dz,tmax\r\n\r\n\"7\", 0 ,1,2,3,4,5,6,inf\r\n"
            .to_vec(),
        b"ox,oy,oz,dx,dy,dz\n\"1\"\"\",2,3,4,5,nan\n".to_vec(),
        b"dz,dy,dx,oz,oy,ox\n1,2,3,-inf,5,6\n1,2\n".to_vec(),
    ]
}
