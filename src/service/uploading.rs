//! Uploads from their last byte until a record or a job names them, or nothing ever will: meanwhile nobody removes their
//! blobs.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::app::App;
use super::http::Problem;
use crate::store::{BlobWriter, Hash};

/// Uploads under way, by their blobs.
#[derive(Debug, Default)]
pub struct Uploading(Mutex<HashMap<Hash, UnderWay>>);

#[derive(Debug, Default)]
struct UnderWay {
    /// How many of the same bytes.
    uploads: usize,
    /// Whether somebody else let the blob go meanwhile.
    spared: bool,
}

impl Uploading {
    fn blobs(&self) -> MutexGuard<'_, HashMap<Hash, UnderWay>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn begin(&self, blob: Hash) {
        self.blobs().entry(blob).or_default().uploads += 1;
    }

    /// Whether somebody is uploading a blob, who then sees to it in place of whoever would remove it now.
    #[must_use]
    pub fn spares(&self, blob: Hash) -> bool {
        let mut blobs = self.blobs();
        let found = blobs.get_mut(&blob);
        found.map(|under_way| under_way.spared = true).is_some()
    }

    /// One upload less; whether it was the last of a blob that was spared.
    fn end(&self, blob: Hash) -> bool {
        let mut blobs = self.blobs();
        let Some(under_way) = blobs.get_mut(&blob) else {
            return false;
        };
        under_way.uploads -= 1;
        let (last, spared) = (under_way.uploads == 0, under_way.spared);
        if last {
            blobs.remove(&blob);
        }
        last && spared
    }
}

/// An upload that came whole. Its blob is there as long as this is.
#[derive(Debug)]
pub struct Uploaded {
    app: App,
    blob: Hash,
    settled: bool,
}

impl Uploaded {
    /// Its blob.
    #[must_use]
    pub const fn blob(&self) -> Hash {
        self.blob
    }

    /// Ends it with what came of it. A blob goes that nothing names: after a failure, or when it was let go meanwhile.
    ///
    /// # Errors
    ///
    /// What came of it, or [`Problem`] when the store fails.
    pub async fn settle<T>(self, came: Result<T, Problem>) -> Result<T, Problem> {
        self.end(came.is_ok()).await?;
        came
    }

    /// Ends it with nothing that would name it.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn forget(self) -> Result<(), Problem> {
        self.end(false).await
    }

    async fn end(mut self, is_named: bool) -> Result<(), Problem> {
        self.settled = true;
        let spared = self.app.uploading.end(self.blob);
        if spared || !is_named {
            self.app.forget_upload(self.blob).await?;
        }
        Ok(())
    }
}

impl Drop for Uploaded {
    /// Of an upload whose caller left before anything came of it the blob goes, unless something names it.
    fn drop(&mut self) {
        if self.settled {
            return;
        }
        self.app.uploading.end(self.blob);
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            let (app, blob) = (self.app.clone(), self.blob);
            runtime.spawn(async move {
                if let Err(problem) = app.forget_upload(blob).await {
                    tracing::error!(%blob, ?problem, "an upload that came to nothing stays until the next start");
                }
            });
        }
    }
}

impl App {
    /// Makes the blob of an upload appear.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn uploaded(&self, received: Box<dyn BlobWriter>) -> Result<Uploaded, Problem> {
        // Nobody removes it in the moment before it is counted.
        let _writing = self.removal.read().await;
        let blob = received.finish().await?.hash;
        self.uploading.begin(blob);
        Ok(Uploaded {
            app: self.clone(),
            blob,
            settled: false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blob_is_spared_until_the_last_upload_of_it_ends() {
        let uploading = Uploading::default();
        let (sky, sea) = (Hash::of(b"sky"), Hash::of(b"sea"));
        assert!(!uploading.spares(sky), "nobody uploads it");
        uploading.begin(sky);
        uploading.begin(sky);
        uploading.begin(sea);
        assert!(uploading.spares(sky));
        assert!(!uploading.end(sky), "another is under way");
        assert!(uploading.spares(sky));
        assert!(uploading.end(sky), "the last sees to it");
        assert!(!uploading.spares(sky));
        assert!(!uploading.end(sea), "nobody let that go");
    }
}
