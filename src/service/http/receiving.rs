//! Uploads on their way in: a body as a stream of pieces, held to size and pace, into a blob.

use std::time::{Duration, Instant};

use axum::body::{Body, BodyDataStream};
use axum::http::{HeaderMap, header};
use futures::StreamExt;

use super::kind::Kind;
use super::problem::{Place, Problem};
use crate::paint::Limits;
use crate::service::app::App;
use crate::store::BlobWriter;

/// Longest silence in the middle of an upload.
const SILENCE: Duration = Duration::from_secs(30);

/// Least bytes a second of an upload, but for so much time as one silence.
const LEAST_RATE: u64 = 16 << 10;

/// Longest time that a refused upload is still taken in, and most bytes of it.
const PATIENCE: Duration = Duration::from_secs(5);
const MOST_DRAINED: usize = 64 << 20;

/// What a body is to be.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Whether it may be an archive, which is unpacked file by file; anything else is held in memory as a whole.
    pub archive: bool,
    /// The kind of problem that a body is which is nothing of it.
    pub unusable: Kind,
    /// What would be accepted.
    pub accepted: &'static str,
}

/// Refuses an upload by its headers, before a byte of it is taken in.
///
/// # Errors
///
/// [`Problem`] for a form, an encoding, or a length beyond the limit.
pub fn check_headers(app: &App, expected: &Expected, headers: &HeaderMap) -> Result<(), Problem> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    if text(header::CONTENT_TYPE).is_some_and(|kind| kind.starts_with("multipart/")) {
        let problem = Problem::new(
            Kind::UnsupportedMediaType,
            "The upload is wrapped in a multipart form.",
        );
        return Err(problem
            .accepting("the file's bytes as the body, as curl --data-binary @FILE sends them"));
    }
    if let Some(encoding) =
        text(header::CONTENT_ENCODING).filter(|encoding| *encoding != "identity")
    {
        let problem = Problem::new(
            Kind::UnsupportedMediaType,
            format!("The upload is encoded as {encoding:?}."),
        );
        return Err(problem.accepting("the file's bytes as they are"));
    }
    let announced: u64 = text(header::CONTENT_LENGTH)
        .and_then(|length| length.parse().ok())
        .unwrap_or(0);
    let most = expected.most(&app.config.limits);
    if announced > most {
        Err(too_large(most))
    } else {
        Ok(())
    }
}

impl Expected {
    /// Most bytes of one.
    fn most(&self, limits: &Limits) -> u64 {
        if self.archive {
            limits.bytes
        } else {
            limits.bytes.min(limits.table_bytes)
        }
    }
}

fn too_large(most: u64) -> Problem {
    Problem::new(Kind::TooLarge, "The upload is too large.")
        .accepting(format!("up to {most} bytes of such a file"))
}

/// Takes in what is refused, within reason: who still sends does not listen.
pub async fn drain(mut pieces: BodyDataStream) {
    let drained = async {
        let mut length = 0;
        while let Some(Ok(piece)) = pieces.next().await {
            length += piece.len();
            if length > MOST_DRAINED {
                return;
            }
        }
    };
    let _ = tokio::time::timeout(PATIENCE, drained).await;
}

/// Streams a body into a blob that is still to be finished.
///
/// # Errors
///
/// [`Problem`] for a body that is too large, too slow, empty or broken off.
pub async fn receive(
    app: &App,
    body: Body,
    expected: &Expected,
) -> Result<Box<dyn BlobWriter>, Problem> {
    let mut writer = app.blobs.begin().await?;
    let mut pieces = body.into_data_stream();
    let (mut length, begun) = (0, Instant::now());
    let mut most = expected.most(&app.config.limits);
    loop {
        let piece = match tokio::time::timeout(SILENCE, pieces.next()).await {
            Ok(None) => break,
            Ok(Some(Ok(piece))) => piece,
            Ok(Some(Err(_))) => {
                return Err(Problem::new(
                    Kind::MalformedRequest,
                    "The upload broke off before its end.",
                ));
            }
            Err(_) => {
                let detail = format!(
                    "Nothing came for {} seconds in the middle of the upload.",
                    SILENCE.as_secs()
                );
                return Err(Problem::new(Kind::RequestTimeout, detail));
            }
        };
        if length == 0 && !piece.is_empty() && !piece.starts_with(b"P") {
            most = most.min(app.config.limits.table_bytes);
        }
        length += piece.len() as u64;
        if length > most {
            drop(writer);
            drain(pieces).await;
            return Err(too_large(most));
        }
        if begun.elapsed() > SILENCE + Duration::from_secs(length / LEAST_RATE) {
            let detail = format!(
                "{length} bytes came in {} seconds.",
                begun.elapsed().as_secs()
            );
            return Err(
                Problem::new(Kind::RequestTimeout, detail).accepting(format!(
                    "at least {LEAST_RATE} bytes a second after the first {} seconds",
                    SILENCE.as_secs()
                )),
            );
        }
        writer.append(piece).await?;
    }
    if length == 0 {
        return Err(Problem::new(expected.unusable, "The body is empty.")
            .at(Place::Body, "")
            .accepting(expected.accepted));
    }
    Ok(writer)
}
