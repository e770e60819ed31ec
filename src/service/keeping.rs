//! What is kept and what is removed: a record names blobs, and a blob that none names goes.

use std::sync::Arc;

use bytes::Bytes;

use super::app::App;
use super::environments::unknown_environment;
use super::http::Problem;
use super::shelf::{unknown_blend, unknown_paint};
use super::work::{Thing, colors};
use crate::paint::{NotFinite, PaintFile};
use crate::store::{
    BlendRecord, BlobBytes, EnvironmentRecord, Hash, LocalBlob, PaintRecord, StoreError, Visibility,
};

/// What is kept of a paint, worked out.
#[derive(Debug)]
pub struct WrittenOut {
    bytes: Bytes,
    content: Hash,
    name: String,
    source: String,
    /// Its colors as an instrument reads them, where they could be read.
    colors: Option<Vec<f64>>,
}

impl App {
    /// Whether a paint has this id.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn has_paint(&self, id: &str) -> Result<bool, Problem> {
        Ok(self.catalogue.paint(id).await?.is_some())
    }

    /// Removes blobs that nothing names: what was uploaded in the moment before a crash.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn sweep(&self) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        for blob in self.blobs.all().await? {
            self.forget_unnamed(blob).await?;
        }
        Ok(())
    }

    /// Makes of a paint what is kept of it.
    ///
    /// # Errors
    ///
    /// [`Problem`] for a paint that has no file, which is a bug.
    pub async fn written_out(&self, file: PaintFile) -> Result<WrittenOut, Problem> {
        let works = Arc::clone(&self.works);
        let worked_out = tokio::task::spawn_blocking(move || {
            let content = Hash::from(file.paint.content_hash());
            let (bytes, name, source) = (
                file.to_bytes()?,
                file.name.clone(),
                file.provenance.source.clone(),
            );
            let colors = colors::read(&*works, &Thing::Paint(Box::new(file))).ok();
            Ok::<_, NotFinite>(WrittenOut {
                bytes: bytes.into(),
                content,
                name,
                source,
                colors,
            })
        });
        let worked_out = worked_out.await.map_err(Problem::internal)?;
        worked_out.map_err(Problem::internal)
    }

    /// Keeps a paint under an id. Nothing happens where the id is taken.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the store fails; it may go well later.
    pub async fn keep_paint(
        &self,
        id: &str,
        written: &WrittenOut,
        measurement: Option<Hash>,
    ) -> Result<(), StoreError> {
        let _writing = self.removal.read().await;
        let paint = self.blobs.put(written.bytes.clone()).await?.hash;
        let record = PaintRecord {
            id: id.to_owned(),
            name: written.name.clone(),
            source: written.source.clone(),
            measurement,
            paint,
            content: written.content,
            visibility: Visibility::default(),
        };
        self.catalogue.add_paint(&record).await?;
        // What is not noted now is when somebody asks for it; the paint is kept all the same.
        if let Some(colors) = &written.colors {
            let _ = colors::note(self, paint, colors).await;
        }
        Ok(())
    }

    /// Keeps a blend of these paints under an id. Nothing happens where the id is taken.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the store fails; it may go well later.
    pub async fn keep_blend(
        &self,
        id: &str,
        paints: &[String],
        options: &str,
        file: Bytes,
    ) -> Result<(), StoreError> {
        let _writing = self.removal.read().await;
        let record = BlendRecord {
            id: id.to_owned(),
            paints: paints.to_vec(),
            options: options.to_owned(),
            blend: self.blobs.put(file).await?.hash,
        };
        self.catalogue.add_blend(&record).await?;
        Ok(())
    }

    /// An upload that is kept, as a file.
    ///
    /// # Errors
    ///
    /// [`Problem`] when it is gone, which its uploader or a record would have prevented.
    pub async fn upload_at_hand(&self, upload: Hash) -> Result<LocalBlob, Problem> {
        let local = self.blobs.local(upload).await?;
        local.ok_or_else(|| Problem::internal(format!("upload {upload} is not there")))
    }

    /// A blob that the record of a paint names, to be streamed.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the paint was deleted a moment ago.
    pub async fn stream_of(&self, id: &str, blob: Hash) -> Result<BlobBytes, Problem> {
        // An open blob can be read to its end, whatever becomes of its name.
        let _reading = self.removal.read().await;
        match self.blobs.stream(blob).await? {
            Some(bytes) => Ok(bytes),
            None if self.catalogue.paint(id).await?.is_none() => Err(unknown_paint(id)),
            None => Err(Problem::internal(format!("a blob of {id} is not there"))),
        }
    }

    /// Forgets a paint and every blob that nothing else names.
    ///
    /// # Errors
    ///
    /// [`Problem`] when there is none.
    pub async fn forget_paint(&self, id: &str) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        let gone = self
            .catalogue
            .remove_paint(id)
            .await?
            .ok_or_else(|| unknown_paint(id))?;
        // Its blends are private from now on.
        self.shelf.invalidate_all();
        for blob in gone.measurement.into_iter().chain([gone.paint]) {
            self.forget_unnamed(blob).await?;
        }
        Ok(())
    }

    /// Forgets a blend, and its file unless something else names it.
    ///
    /// # Errors
    ///
    /// [`Problem`] when there is none.
    pub async fn forget_blend(&self, id: &str) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        let gone = self.catalogue.remove_blend(id).await?;
        let gone = gone.ok_or_else(|| unknown_blend(id))?;
        self.shelf.invalidate(id).await;
        self.forget_unnamed(gone.blend).await
    }

    /// A blob that the record of an environment names, to be streamed.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the environment was deleted a moment ago.
    pub async fn stream_of_environment(
        &self,
        record: &EnvironmentRecord,
    ) -> Result<BlobBytes, Problem> {
        let (_reading, id) = (self.removal.read().await, &record.id);
        match self.blobs.stream(record.file).await? {
            Some(bytes) => Ok(bytes),
            None if self.catalogue.environment(id).await?.is_none() => Err(unknown_environment(id)),
            None => Err(Problem::internal(format!("the file of {id} is not there"))),
        }
    }

    /// Forgets an environment, and its file unless something else names it.
    ///
    /// # Errors
    ///
    /// [`Problem`] when there is none.
    pub async fn forget_environment(&self, id: &str) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        let gone = self.catalogue.remove_environment(id).await?;
        let gone = gone.ok_or_else(|| unknown_environment(id))?;
        self.environments.forget(id);
        self.forget_unnamed(gone.file).await
    }

    /// Publishes a paint or makes it private.
    ///
    /// # Errors
    ///
    /// [`Problem`] when there is none.
    pub async fn show_paint(&self, id: &str, visibility: Visibility) -> Result<(), Problem> {
        // Nobody reads the record before and shelves it after.
        let _changing = self.removal.write().await;
        if !self.catalogue.show_paint(id, visibility).await? {
            return Err(unknown_paint(id));
        }
        // Its blends are as private as it is.
        self.shelf.invalidate_all();
        Ok(())
    }

    /// Forgets an upload that came to nothing: its blob goes, unless something names it or it is just uploaded again.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn forget_upload(&self, upload: Hash) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        self.forget_unnamed(upload).await
    }

    async fn forget_unnamed(&self, blob: Hash) -> Result<(), Problem> {
        if !self.uploading.spares(blob) && !self.catalogue.names_blob(blob).await? {
            self.blobs.remove(blob).await?;
        }
        Ok(())
    }
}
