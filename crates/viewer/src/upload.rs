//! Uploads: files that are dropped on the page, alone or several in one request.

use crate::dropped::Dropped;
use axum::body::Body;
use axum::http::{HeaderMap, StatusCode, header};
use http_body_util::BodyExt;
use std::time::Duration;
use tokio::time::timeout;

/// Maximum size of all files of a request in bytes. Larger ones are opened by name and read in
/// place.
pub const MAX_BYTES: usize = 256 << 20;
/// Time limit for the next piece of a file.
const PIECE_TIME: Duration = Duration::from_secs(20);
/// Time limit for a whole file.
const WHOLE_TIME: Duration = Duration::from_secs(10 * 60);

/// The refusal of an upload: a status, and a line for the user.
pub type Refusal = (StatusCode, String);

/// Receives the file in the body of a request. A file whose declared size is too large is refused
/// before any of it is read; a file that turns out to be too large is refused as soon as it does.
pub async fn receive(headers: &HeaderMap, body: Body) -> Result<Vec<u8>, Refusal> {
    let length = headers.get(header::CONTENT_LENGTH).and_then(|l| l.to_str().ok());
    if length.is_some_and(|l| l.parse::<usize>().is_ok_and(|l| l > MAX_BYTES)) {
        return Err(too_large());
    }
    let late = |_| (StatusCode::REQUEST_TIMEOUT, "the upload was too slow\n".to_string());
    timeout(WHOLE_TIME, pieces(body)).await.map_err(late)?
}

/// Maximum number of files in a request.
const MAX_FILES: usize = 10_000;
/// Maximum size of the list of files at the beginning of a request.
const MAX_LIST: usize = 4 << 20;

/// A file in the list at the beginning of a request.
#[derive(serde::Deserialize)]
struct Listed {
    name: String,
    bytes: usize,
}

/// The files of a body: one line of JSON with their names and sizes, `[{"name":…,"bytes":…},…]`,
/// and then their contents, one after the other.
pub fn files(body: &[u8]) -> Result<Vec<Dropped>, Refusal> {
    let refused = |problem: &str| (StatusCode::BAD_REQUEST, format!("{problem}\n"));
    let end = body.iter().take(MAX_LIST).position(|byte| *byte == b'\n');
    let (list, mut rest) =
        end.map(|end| body.split_at(end + 1)).ok_or_else(|| refused("no list"))?;
    let list: Vec<Listed> =
        serde_json::from_slice(list).map_err(|_| refused("this is no list of files"))?;
    if list.len() > MAX_FILES {
        return Err(refused(&format!("more than {MAX_FILES} files; drop only those of one scene")));
    }
    let mut files = Vec::with_capacity(list.len());
    for Listed { name, bytes } in list {
        let (own, others) =
            rest.split_at_checked(bytes).ok_or_else(|| refused("the upload was cut off"))?;
        files.push(Dropped { name, bytes: own.to_vec() });
        rest = others;
    }
    Ok(files)
}

async fn pieces(mut body: Body) -> Result<Vec<u8>, Refusal> {
    let mut bytes = Vec::new();
    loop {
        let piece = timeout(PIECE_TIME, body.frame()).await;
        let late = |_| (StatusCode::REQUEST_TIMEOUT, "the upload stalled\n".to_string());
        let Some(piece) = piece.map_err(late)? else { return Ok(bytes) };
        let broken = |e| (StatusCode::BAD_REQUEST, format!("the upload was interrupted: {e}\n"));
        let Ok(piece) = piece.map_err(broken)?.into_data() else { continue };
        if bytes.len() + piece.len() > MAX_BYTES {
            return Err(too_large());
        }
        let lacking =
            |_| (StatusCode::INSUFFICIENT_STORAGE, "not enough memory for the file\n".to_string());
        bytes.try_reserve(piece.len()).map_err(lacking)?;
        bytes.extend_from_slice(&piece);
    }
}

fn too_large() -> Refusal {
    let most = MAX_BYTES >> 20;
    let text = format!(
        "more than {most} MB: that is too much to send; start the viewer with the file, which is \
            then read where it is\n"
    );
    (StatusCode::PAYLOAD_TOO_LARGE, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_files_come_in_one_request() {
        let body = b"[{\"name\":\"a/b.obj\",\"bytes\":3},{\"name\":\"c\",\"bytes\":0}]\nv 0";
        let found = files(body).expect("two files");
        assert_eq!((&*found[0].name, &*found[0].bytes), ("a/b.obj", &b"v 0"[..]));
        assert_eq!((&*found[1].name, found.len()), ("c", 2));
        for wrong in [&b""[..], b"\n", b"[]", b"[{\"name\":\"a\",\"bytes\":9}]\nv 0", b"{}\n"] {
            assert!(files(wrong).is_err());
        }
    }
}
