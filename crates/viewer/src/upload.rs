//! Uploads: files that are dropped on the page, alone or several in one request.

use crate::dropped::MAX_BYTES;
use axum::body::Body;
use axum::http::{HeaderMap, StatusCode, header};
use http_body_util::BodyExt;
use std::time::Duration;
use tokio::time::timeout;

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
