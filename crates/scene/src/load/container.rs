//! The GLB container and the places where a glTF file keeps its bytes.

use super::{LoadOptions, read};
use crate::LoadError;
use std::{borrow::Cow, collections::HashMap, path::Path, sync::Arc};

const EXPORT: &str = "the file is cut off or damaged; copy or export it again";

fn fail(path: &Path, at: &str, reason: String, remedy: &'static str) -> LoadError {
    LoadError::Gltf { path: path.into(), at: at.into(), reason, remedy }
}

/// The JSON text and the binary chunk of a GLB file (glTF 2.0 §4.4).
pub(super) fn split_glb<'a>(
    path: &Path,
    bytes: &'a [u8],
) -> Result<(&'a [u8], Option<&'a [u8]>), LoadError> {
    let word = |at: usize| -> Option<u32> {
        let raw = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(raw.try_into().ok()?))
    };
    let header = "GLB header";
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(fail(path, header, format!("{} bytes are too few", bytes.len()), EXPORT));
    };
    if version != 2 {
        let reason = format!("version {version} is not 2");
        return Err(fail(path, header, reason, "export it as glTF 2.0"));
    }
    if (length as usize) > bytes.len() {
        let reason = format!("it says {length} bytes, the file has {}", bytes.len());
        return Err(fail(path, header, reason, EXPORT));
    }
    let mut json = None;
    let mut binary = None;
    let mut at = 12_usize;
    while at < length as usize {
        let chunk = format!("GLB chunk at byte {at}");
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(fail(path, &chunk, "it has no complete header".into(), EXPORT));
        };
        let Some(body) = (at + 8)
            .checked_add(size as usize)
            .filter(|&end| end <= length as usize)
            .and_then(|end| bytes.get(at + 8..end))
        else {
            let reason = format!("its {size} bytes go past the end of the file");
            return Err(fail(path, &chunk, reason, EXPORT));
        };
        match &kind.to_le_bytes() {
            b"JSON" if json.is_none() => json = Some(body),
            b"BIN\0" if binary.is_none() => binary = Some(body),
            // Unknown chunks are to be ignored (§4.4.3).
            _ => {}
        }
        at += 8 + size as usize;
    }
    let json = json.ok_or_else(|| fail(path, header, "there is no JSON chunk".into(), EXPORT))?;
    Ok((json, binary))
}

/// The bytes that a URI in `file` stands for: a `data:` URI or a file beside it.
pub(super) fn resolve(
    file: &Path,
    at: &str,
    uri: &str,
    options: &LoadOptions,
) -> Result<Vec<u8>, LoadError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((head, body)) = data.split_once(',') else {
            let reason = String::from("its data URI has no comma");
            return Err(fail(file, at, reason, "write data:TYPE;base64,BYTES"));
        };
        if !head.ends_with(";base64") {
            return Ok(percent_decode(body));
        }
        return base64(body.as_bytes()).ok_or_else(|| {
            let reason = String::from("its data URI is not base64");
            fail(file, at, reason, "write data:TYPE;base64,BYTES")
        });
    }
    if uri.contains("://") {
        let reason = format!("`{uri}` is not a file");
        return Err(fail(file, at, reason, "fetch it and refer to the copy by a relative path"));
    }
    let decoded = percent_decode(uri);
    read::beside(file, &String::from_utf8_lossy(&decoded), options)
}

/// All buffers of a document; each has at least the bytes it claims. A file that many of them are is
/// read once.
pub(super) fn buffers<'a>(
    path: &Path,
    root: &gltf::json::Root,
    binary: Option<&'a [u8]>,
    options: &LoadOptions,
) -> Result<Vec<Arc<Cow<'a, [u8]>>>, LoadError> {
    let mut out = Vec::with_capacity(root.buffers.len());
    let mut known: HashMap<&str, Arc<Cow<'a, [u8]>>> = HashMap::new();
    for (i, buffer) in root.buffers.iter().enumerate() {
        let at = format!("buffers[{i}]");
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => match known.get(uri.as_str()) {
                Some(bytes) => Arc::clone(bytes),
                None => {
                    let bytes = Arc::new(Cow::Owned(resolve(path, &at, uri, options)?));
                    known.insert(uri, Arc::clone(&bytes));
                    bytes
                }
            },
            (None, Some(binary)) if i == 0 => Arc::new(Cow::Borrowed(binary)),
            (None, _) => {
                let reason = String::from("it has no uri and there is no binary chunk for it");
                return Err(fail(path, &at, reason, "export it again with its buffers"));
            }
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let reason =
                format!("it should have {} bytes but has {}", buffer.byte_length.0, bytes.len());
            return Err(fail(path, &at, reason, EXPORT));
        }
        out.push(bytes);
    }
    Ok(out)
}

/// Replaces %XX by the byte it stands for (RFC 3986, §2.1); anything else stays.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |b: Option<&u8>| b.and_then(|&b| char::from(b).to_digit(16));
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let pair = (digit(bytes.get(i + 1)), digit(bytes.get(i + 2)));
        if let (b'%', (Some(high), Some(low))) = (bytes[i], pair) {
            out.push(u8::try_from(high * 16 + low).unwrap_or(u8::MAX));
            i += 3;
        } else {
            out.push(bytes[i]);
            i += 1;
        }
    }
    out
}

/// Decodes base64 (RFC 4648, §4); white space is skipped, padding may be missing.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for &c in text {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' | b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push(u8::try_from(bits >> count & 0xff).unwrap_or(0));
        }
    }
    (count < 6).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        // RFC 4648, §10.
        for (text, plain) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmFy", "foobar")]
        {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(plain.as_bytes()));
        }
        assert_eq!(base64(b"Zg"), Some(b"f".to_vec()));
        assert_eq!(base64(b"Z"), None);
        assert_eq!(base64(b"Zm9*"), None);
    }

    #[test]
    fn percent_escapes() {
        assert_eq!(percent_decode("a%20b%2fc%"), b"a b/c%");
        assert_eq!(percent_decode("%zz%4"), b"%zz%4");
    }
}
