//! The shelf: paints and blends as they were last read from the store, described once.

use std::sync::Arc;

use bytes::Bytes;

use super::app::App;
use super::http::{Answer, Keep, Kind, Problem};
use super::ids;
use super::resources::documents;
use super::work::{BlendOptions, Thing};
use crate::blend::Blend;
use crate::paint::PaintFile;
use crate::store::{BlendRecord, CachedResult, Hash, PaintRecord, Visibility};

/// A paint or a blend, read and described.
#[derive(Debug)]
pub struct Shelved {
    /// Its address.
    pub id: String,
    /// Itself.
    pub thing: Thing,
    /// Names of its paints, in the order of weights.
    pub names: Vec<String>,
    /// What is told about it, as JSON.
    pub document: CachedResult,
    /// Blob of its file.
    pub file: Hash,
    /// Hash of its physical content.
    pub content: Hash,
    /// Whether lists show it.
    pub visibility: Visibility,
    /// Blob of its measurement, where there was one.
    pub measurement: Option<Hash>,
}

impl Shelved {
    /// The answer that tells what is known about it.
    #[must_use]
    pub fn told(&self) -> Answer {
        Answer::result(
            "application/json",
            self.document.clone(),
            self.keep_changing(),
        )
    }

    /// How long files and pictures of it may be kept: what is private, by who asked for it.
    #[must_use]
    pub fn keep(&self) -> Keep {
        match self.visibility {
            Visibility::Published => Keep::ForEver,
            Visibility::Private => Keep::Own,
        }
    }

    /// How long may be kept what another version or another day tells otherwise.
    #[must_use]
    pub fn keep_changing(&self) -> Keep {
        self.keep().revalidated()
    }

    /// The paint, if it is one.
    #[must_use]
    pub fn file_of_paint(&self) -> Option<&PaintFile> {
        match &self.thing {
            Thing::Paint(file) => Some(file),
            Thing::Blend(_) => None,
        }
    }

    /// Bytes in memory, about.
    #[must_use]
    pub fn weight(&self) -> u32 {
        let (clusters, nodes) = match &self.thing {
            Thing::Paint(file) => {
                let flakes = file.paint.flakes.as_ref();
                (
                    flakes.map_or(0, crate::paint::Flakes::clusters),
                    file.paint.color_table.nodes().len(),
                )
            }
            Thing::Blend(blend) => (
                blend.report().clusters * blend.len(),
                blend.color_table_nodes(),
            ),
        };
        // A box is 24 bytes and a probability 8; a node of a color table is 24.
        let bytes = clusters * 32 + nodes * 24 + self.document.bytes.len() + (16 << 10);
        u32::try_from(bytes).unwrap_or(u32::MAX)
    }
}

impl App {
    /// The paint of this id.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownPaint`] when there is none.
    pub async fn paint(&self, id: &str) -> Result<Arc<Shelved>, Problem> {
        self.shelved(id, "p_", || self.read_paint(id))
            .await?
            .ok_or_else(|| unknown_paint(id))
    }

    /// The blend of this id.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownBlend`] when there is none.
    pub async fn blend(&self, id: &str) -> Result<Arc<Shelved>, Problem> {
        self.shelved(id, "b_", || self.read_blend(id))
            .await?
            .ok_or_else(|| unknown_blend(id))
    }

    /// From the shelf, or read once however many ask.
    async fn shelved<F>(
        &self,
        id: &str,
        prefix: &str,
        read: impl Fn() -> F,
    ) -> Result<Option<Arc<Shelved>>, Problem>
    where
        F: Future<Output = Result<Option<Shelved>, Problem>>,
    {
        if !ids::is(prefix, id) {
            return Ok(None);
        }
        if let Some(shelved) = self.shelf.get(id).await {
            return Ok(Some(shelved));
        }
        loop {
            let shelve = async { read().await.map_err(Some)?.map(Arc::new).ok_or(None) };
            let shelved = match self.shelf.try_get_with_by_ref(id, shelve).await {
                Ok(shelved) => shelved,
                Err(problem) => return (*problem).clone().map_or(Ok(None), Err),
            };
            // What was forgotten or changed while it was read does not stay on the shelf.
            let _reading = self.removal.read().await;
            let on_record = match &shelved.thing {
                Thing::Paint(_) => self.catalogue.paint(id).await?.map(|of| of.visibility),
                Thing::Blend(_) => match self.catalogue.blend(id).await? {
                    Some(record) => Some(self.visibility_of_blend(&record.paints).await?),
                    None => None,
                },
            };
            if on_record == Some(shelved.visibility) {
                return Ok(Some(shelved));
            }
            self.shelf.invalidate(id).await;
            if on_record.is_none() {
                return Ok(None);
            }
        }
    }

    async fn read_paint(&self, id: &str) -> Result<Option<Shelved>, Problem> {
        let (record, bytes) = {
            // Held while the blob is fetched, not while a place to compute is waited for.
            let _reading = self.removal.read().await;
            let Some(record) = self.catalogue.paint(id).await? else {
                return Ok(None);
            };
            let bytes = self.stored(record.paint).await?;
            (record, bytes)
        };
        let (limits, works) = (self.config.limits, Arc::clone(&self.works));
        let shelve = move || -> Result<Shelved, Problem> {
            let file = PaintFile::from_bytes(&bytes, &limits).map_err(Problem::internal)?;
            let names = vec![file.name.clone()];
            let thing = Thing::Paint(Box::new(file));
            let links = documents::of_paint(&record);
            let document = documents::described(&record.id, works.describe(&thing), links);
            let PaintRecord {
                id,
                paint: file,
                measurement,
                content,
                visibility,
                ..
            } = record;
            Ok(Shelved {
                id,
                thing,
                names,
                document,
                file,
                content,
                visibility,
                measurement,
            })
        };
        self.bench.run(shelve).await?.map(Some)
    }

    async fn read_blend(&self, id: &str) -> Result<Option<Shelved>, Problem> {
        let (record, visibility, bytes) = {
            let _reading = self.removal.read().await;
            let Some(record) = self.catalogue.blend(id).await? else {
                return Ok(None);
            };
            let visibility = self.visibility_of_blend(&record.paints).await?;
            let bytes = self.stored(record.blend).await?;
            (record, visibility, bytes)
        };
        let BlendRecord {
            id,
            paints,
            options,
            blend: file,
        } = record;
        let options: BlendOptions = serde_json::from_str(&options).map_err(Problem::internal)?;
        let (limits, works) = (self.config.limits, Arc::clone(&self.works));
        let shelve = move || -> Result<Shelved, Problem> {
            let blend = Blend::from_bytes(&bytes, &limits)
                .map_err(Problem::internal)?
                .in_order(&options.places);
            let names = blend
                .ingredients()
                .map(|(name, _)| name.to_owned())
                .collect();
            let notes = works.notes(&blend, &options.profile);
            let thing = Thing::Blend(Box::new(blend));
            let links = documents::of_blend(&id, &paints, &options, &notes);
            let document = documents::described(&id, works.describe(&thing), links);
            Ok(Shelved {
                id,
                thing,
                names,
                document,
                file,
                content: file,
                visibility,
                measurement: None,
            })
        };
        self.bench.run(shelve).await?.map(Some)
    }

    /// A blend is as private as the most private of its paints, and private where one is gone: nobody says any more that it
    /// was not.
    async fn visibility_of_blend(&self, paints: &[String]) -> Result<Visibility, Problem> {
        for paint in paints {
            let record = self.catalogue.paint(paint).await?;
            if record.is_none_or(|paint| paint.visibility == Visibility::Private) {
                return Ok(Visibility::Private);
            }
        }
        Ok(Visibility::Published)
    }

    /// A blob that a record names.
    async fn stored(&self, blob: Hash) -> Result<Bytes, Problem> {
        let bytes = self.blobs.read(blob).await?;
        bytes.ok_or_else(|| Problem::internal(format!("blob {blob} is on record but not there")))
    }
}

/// The problem of an id that no blend has.
#[must_use]
pub fn unknown_blend(id: &str) -> Problem {
    Problem::new(Kind::UnknownBlend, format!("There is no blend {id:?}."))
        .accepting("the id of an answer to POST /v1/blends")
}

/// The problem of an id that no paint has.
#[must_use]
pub fn unknown_paint(id: &str) -> Problem {
    Problem::new(Kind::UnknownPaint, format!("There is no paint {id:?}."))
        .accepting("an id that GET /v1/paints lists")
}
